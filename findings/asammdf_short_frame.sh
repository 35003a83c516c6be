#!/usr/bin/env bash
# asammdf 8.8.28, python-can 4.6.1 and cantools 45.1.0 (PyPI): a frame that is shorter than its message.
#
# Guess: MF4 keeps the length of each frame. A signal whose bytes are not in a frame has no sample there,
# or an invalid one, when extract_bus_logging() decodes the log by a DBC file.
# Behaviour: the bytes that are missing are read as zeros, and the sample is valid like all others. An
# ECU that sends two bytes while it starts up has a temperature of -40 degC. cantools refuses the frame.
# Seen: a frame of two bytes yields a temperature, though none was sent.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 cantools==45.1.0 canmatrix==1.2 python-can==4.6.1 >/dev/null 2>&1

cat >gyro.dbc <<'DBC'
VERSION ""
BU_: Gyro
BO_ 291 Yaw: 4 Gyro
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" Gyro
 SG_ Temperature : 16|16@1- (0.1,-40) [-40|125] "degC" Gyro
DBC
venv/bin/python - <<'PY' >seen.txt 2>said.txt
import can, cantools
from asammdf import MDF
payloads = [bytes.fromhex("64006202"), bytes.fromhex("6400")]
with can.Logger("drive.mf4") as writer:
    for k, data in enumerate(payloads):
        writer.on_message_received(can.Message(timestamp=1_700_000_000.0 + k, arbitration_id=291, is_extended_id=False, data=data, channel=0))
log = MDF("drive.mf4")
print("lengths in the log:", *log.get("CAN_DataFrame.DataLength").samples)
signal = log.extract_bus_logging({"CAN": [("gyro.dbc", 0)]}).get("Temperature")
invalid = signal.invalidation_bits
print("asammdf:", *(f"{value:g}" for value in signal.samples), "invalid:", 0 if invalid is None else int(sum(invalid)))
message = cantools.database.load_file("gyro.dbc").get_message_by_name("Yaw")
try:
    print("cantools:", message.decode(payloads[1]))
except cantools.database.errors.DecodeError:
    print("cantools: refused")
PY
sed 's/^/seen: /' seen.txt

grep -qx 'lengths in the log: 4 2' seen.txt || { echo "changed: the log"; exit 1; }
grep -qx 'asammdf: 21 -40 invalid: 0' seen.txt || { echo "changed: asammdf"; exit 1; }
grep -qx 'cantools: refused' seen.txt || { echo "changed: cantools"; exit 1; }
echo "as described: a signal that was not sent has a valid sample"
