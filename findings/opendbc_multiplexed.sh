#!/usr/bin/env bash
# opendbc 0.3.1 (PyPI): a gyro that sends rate and temperature in turn under one identifier.
#
# Guess: CANParser reads SG_ lines with M and m0, m1 and has both signals, so each is updated only by
# frames whose multiplexor selects it; the other keeps its last value.
# Behaviour: the multiplexor is parsed and then ignored. Every frame updates every signal, so the
# temperature's bits become a rate, at the pace of the frames and without an error.
# Seen: after a rate of 12.34 deg/s, a frame with 25.5 degC gives a rate of 2.55 deg/s.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q opendbc==0.3.1 >/dev/null 2>&1

cat >gyro.dbc <<'DBC'
VERSION ""

BU_: UNIT

BO_ 257 GYRO: 8 UNIT
 SG_ Page M : 0|8@1+ (1,0) [0|1] "" UNIT
 SG_ Rate m0 : 8|16@1- (0.01,0) [-320|320] "deg/s" UNIT
 SG_ Temperature m1 : 8|16@1- (0.1,0) [-40|125] "degC" UNIT
DBC
venv/bin/python - <<'PY' >seen.txt
import struct
from opendbc.can import CANParser
parser = CANParser("gyro.dbc", [("GYRO", 100)], 0)
for nanos, page, raw in ((10_000_000, 0, 1234), (20_000_000, 1, 255)):
    parser.update([(nanos, [(257, struct.pack("<Bh5x", page, raw), 0)])])
    values = parser.vl["GYRO"]
    print(f"page {page}: rate {values['Rate']:.2f}, temperature {values['Temperature']:.1f}")
PY
echo "opendbc 0.3.1"
sed 's/^/seen: /' seen.txt

grep -qx 'page 0: rate 12.34, temperature 123.4' seen.txt || { echo "changed: a frame with the rate"; exit 1; }
grep -qx 'page 1: rate 2.55, temperature 25.5' seen.txt || { echo "changed: a frame with the temperature"; exit 1; }
echo "as described: each frame updates the signals of every page"
