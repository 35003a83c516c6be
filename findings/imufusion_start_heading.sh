#!/usr/bin/env bash
# imufusion 1.3.3 with numpy 2.2.6 (PyPI): the heading in the first seconds.
#
# Guess: Ahrs.update_no_magnetometer() integrates the yaw rate from the first sample on; while it starts
# up it trusts the accelerometer more, which does not depend on yaw. 10 s at 10 deg/s are 100 deg.
# Behaviour: during the 3 s of start-up the heading is set to zero at each sample. What is turned in that
# time is lost for good; a recording of a turn is short by up to three seconds of it.
# Seen: 70 deg instead of 100, and 100 when the sensor stands still for the first three seconds.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q imufusion==1.3.3 numpy==2.2.6 >/dev/null 2>&1

venv/bin/python - <<'PY' >seen.txt
import imufusion
import numpy as np
PERIOD_S, TURN_DPS, TURN_S = 0.01, 10.0, 10.0
for stand_s in (0.0, 4.0):
    ahrs = imufusion.Ahrs()
    ahrs.set_sample_period(PERIOD_S)
    rates_dps = [0.0] * round(stand_s / PERIOD_S) + [TURN_DPS] * round(TURN_S / PERIOD_S)
    for rate_dps in rates_dps:
        ahrs.update_no_magnetometer(np.array([0.0, 0.0, rate_dps]), np.array([0.0, 0.0, 1.0]))
    yaw_deg = imufusion.quaternion_to_euler(ahrs.get_quaternion())[2]
    print(f"{stand_s:.0f} s of standing, then 100 deg of turning: {yaw_deg:.0f} deg")
PY
echo "imufusion 1.3.3"
sed 's/^/seen: /' seen.txt

grep -qx '4 s of standing, then 100 deg of turning: 100 deg' seen.txt || { echo "changed: the turn after start-up"; exit 1; }
grep -qx '0 s of standing, then 100 deg of turning: 70 deg' seen.txt || { echo "changed: the turn from the start"; exit 1; }
echo "as described: what is turned in the first three seconds is lost"
