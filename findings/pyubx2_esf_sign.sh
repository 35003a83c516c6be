#!/usr/bin/env bash
# pyubx2 1.4.0 (PyPI): the gyro of a u-blox receiver in UBX-ESF-MEAS, turning the other way.
#
# Guess: the message's gyro data are signed, 24 bits, 2^-12 deg/s a step; pyubx2 scales other messages'
# fields (navigation angles are in degrees), so a z gyro at -1 deg/s reads -1, or -4096 unscaled.
# Behaviour: the data are a bit field without sign or scale: 2^24 is added to every negative rate. A
# mean over rest then is near the top of the range, and a turn to one side 4095 deg/s.
# Seen: 4096 for +1 deg/s, 16773120 for -1 deg/s.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pyubx2==1.4.0 >/dev/null 2>&1

venv/bin/python - <<'PY' >seen.txt
import struct
from pyubx2 import GET, UBXMessage, UBXReader
GYRO_Z, STEPS_PER_DPS, ONE_MEASUREMENT = 5, 4096, 1 << 11
for rate_dps in (1, -1):
    data = GYRO_Z << 24 | (rate_dps * STEPS_PER_DPS) & 0xFFFFFF
    payload = struct.pack("<IHHI", 1000, ONE_MEASUREMENT, 0, data)
    sent = UBXMessage(b"\x10", b"\x02", GET, payload=payload).serialize()
    read = UBXReader.parse(sent)
    print(f"{rate_dps:+d} deg/s: type {read.dataType_01}, data {read.dataField_01}")
PY
echo "pyubx2 1.4.0"
sed 's/^/seen: /' seen.txt

grep -qx '+1 deg/s: type 5, data 4096' seen.txt || { echo "changed: a positive rate"; exit 1; }
grep -qx -- '-1 deg/s: type 5, data 16773120' seen.txt || { echo "changed: a negative rate"; exit 1; }
echo "as described: a negative rate has no sign"
