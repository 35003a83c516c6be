#!/usr/bin/env bash
# AHRS 0.4.0 (PyPI): the angular rate between two quaternions.
#
# Guess: QuaternionArray.angular_velocities(dt) gives the rate that turns each quaternion into the next
# one within dt, exactly so for a rotation about a fixed axis, because two quaternions say it in full.
# Behaviour: it takes the chord for the arc, 2 sin(angle / 2) for the angle. The rate is always low, and
# the more so the faster the turn and the slower the samples, like a scale factor that depends on rate.
# Seen: 300 deg/s sampled at 10 Hz reads 296.58 deg/s; 100 Hz would hide it (299.97).
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q AHRS==0.4.0 >/dev/null 2>&1

venv/bin/python - <<'PY' >seen.txt
import numpy as np
from ahrs import QuaternionArray
RATE_DPS = 300.0
for sample_hz in (10.0, 100.0):
    half = np.radians(RATE_DPS * np.arange(4) / sample_hz) / 2
    turned = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    rates_dps = np.degrees(QuaternionArray(turned).angular_velocities(1 / sample_hz))
    print(f"{sample_hz:.0f} Hz: {rates_dps[0, 2]:.2f} deg/s")
PY
echo "AHRS 0.4.0: true rate 300 deg/s"
sed 's/^/seen: /' seen.txt

grep -qx '10 Hz: 296.58 deg/s' seen.txt || { echo "changed: at 10 Hz"; exit 1; }
grep -qx '100 Hz: 299.97 deg/s' seen.txt || { echo "changed: at 100 Hz"; exit 1; }
echo "as described: the rate is that of the chord"
