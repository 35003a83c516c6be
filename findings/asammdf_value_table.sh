#!/usr/bin/env bash
# asammdf 8.8.28 and cantools 45.1.0 (PyPI): a named value of a signal that has a scale.
#
# Guess: extract_bus_logging() with ignore_value2text_conversion=True, which is the default, gives
# numbers whatever VAL_ says: where the DBC file names the value 0 of a rate "standing", 0 deg/s comes out.
# Behaviour: each raw value that has a name becomes NaN; its neighbours are scaled. A rate whose zero is
# named has gaps just where the vehicle stands, which is where a gyro's bias is taken from.
# cantools gives the number with decode_choices=False.
# Seen: raw 1 0 -1 are 0.01 nan -0.01 deg/s from asammdf, 0.01 0 -0.01 from cantools.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 cantools==45.1.0 canmatrix==1.2 python-can==4.6.1 >/dev/null 2>&1

cat >rate.dbc <<'DBC'
VERSION ""
BU_: Gyro
BO_ 291 Yaw: 2 Gyro
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" Gyro

VAL_ 291 Rate 0 "standing" ;
DBC
venv/bin/python - <<'PY' >seen.txt 2>said.txt
import can, cantools
from asammdf import MDF
payloads = [raw.to_bytes(2, "little", signed=True) for raw in (1, 0, -1)]
with can.Logger("drive.mf4") as writer:
    for k, data in enumerate(payloads):
        writer.on_message_received(can.Message(timestamp=1_700_000_000.0 + k, arbitration_id=291, is_extended_id=False, data=data, channel=0))
for ignore in (True, False):
    rates = MDF("drive.mf4").extract_bus_logging({"CAN": [("rate.dbc", 0)]}, ignore_value2text_conversion=ignore)
    print(f"asammdf, ignore_value2text_conversion={ignore}:", *(f"{rate:g}" for rate in rates.get("Rate").samples))
message = cantools.database.load_file("rate.dbc").get_message_by_name("Yaw")
print("cantools:", *(f"{message.decode(data, decode_choices=False)['Rate']:g}" for data in payloads))
PY
sed 's/^/seen: /' seen.txt

grep -qx 'cantools: 0.01 0 -0.01' seen.txt || { echo "changed: cantools"; exit 1; }
grep -qx 'asammdf, ignore_value2text_conversion=True: 0.01 nan -0.01' seen.txt || { echo "changed: asammdf"; exit 1; }
echo "as described: the value that has a name is no number"
