#!/usr/bin/env bash
# cantools 45.1.0 (PyPI): `cantools decode` and an identifier that exists in both lengths.
#
# Guess: a candump log says by its digits which frames are extended, the DBC file says by bit 31 which
# messages are; where both have 123, `cantools decode` takes each frame by its own message.
# Behaviour: it looks by the number alone, and the standard message wins. The extended frame is printed
# under the other message's name with values read from bits that mean something else, without a remark.
# Seen: a yaw rate of 1.5 deg/s in a float becomes a temperature of 123.2 degC.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q cantools==45.1.0 >/dev/null 2>&1

cat >both.dbc <<'DBC'
VERSION ""
BU_: Gyro
BO_ 291 Standard: 8 Gyro
 SG_ Temperature : 16|16@1- (0.01,-40) [0|0] "degC" Gyro

BO_ 2147483939 Extended: 8 Gyro
 SG_ YawRate : 0|32@1- (1,0) [0|0] "deg/s" Gyro

SIG_VALTYPE_ 2147483939 YawRate : 1;
DBC
printf '(1700000000.100000) can0 123#0000B80B00000000\n(1700000000.200000) can0 00000123#0000C03F00000000\n' >in.log
venv/bin/cantools decode --single-line both.dbc <in.log >out.txt
echo "cantools 45.1.0"
sed 's/^/seen: /' out.txt
venv/bin/python - <<'PY' >names.txt
import cantools
db = cantools.database.load_file("both.dbc")
print(*sorted((m.name, m.is_extended_frame) for m in db.messages))
print(db.get_message_by_name("Extended").decode(bytes.fromhex("0000C03F00000000")))
PY
sed 's/^/both messages are known: /' names.txt

grep -q "'YawRate': 1.5" names.txt || { echo "changed: the message itself"; exit 1; }
grep -q ' 00000123#.*Standard(Temperature: 12[0-9]' out.txt || { echo "changed: the extended frame is not taken for the standard one"; exit 1; }
! grep -q 'Extended' out.txt || { echo "changed: the extended message is found"; exit 1; }
echo "as described: the extended frame is decoded as the standard message"
