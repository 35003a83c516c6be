#!/usr/bin/env bash
# cantools 45.1.0 (PyPI): the encoder that it is and the encoder that it generates.
#
# Guess: the C source of `cantools generate_c_source` puts a physical value into the same bits as
# cantools itself does from the same DBC file.
# Behaviour: cantools rounds to the nearest raw value, the generated C drops what is behind the point.
# A value that lies on the signal's own grid goes out a whole step too small wherever its quotient in
# binary is a hair below the integer, and all others are biased towards zero by half a step on average.
# Seen: 0.29 deg/s at 0.01 deg/s a bit is 29 from Python and 28 from C; 4.35 deg/s is 435 and 434.
#
# Needs python3 with venv, PyPI, a C compiler as cc. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q cantools==45.1.0 >/dev/null 2>&1

cat >rate.dbc <<'DBC'
VERSION ""
BU_: Gyro
BO_ 291 Yaw: 2 Gyro
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" Gyro
DBC
cat >main.c <<'C'
#include "rate.h"
#include <stdio.h>
int main(void) {
  const double rates_dps[] = {0.29, -0.29, 4.35, 5.0};
  for (int i = 0; i < 4; i++) printf("%g %d\n", rates_dps[i], rate_yaw_rate_encode(rates_dps[i]));
}
C
cat >encode.py <<'PY'
import cantools
message = cantools.database.load_file("rate.dbc").get_message_by_name("Yaw")
for rate_dps in (0.29, -0.29, 4.35, 5.0):
    print(f"{rate_dps:g}", int.from_bytes(message.encode({"Rate": rate_dps}), "little", signed=True))
PY
venv/bin/cantools generate_c_source rate.dbc >/dev/null
cc -o encode main.c rate.c
./encode >c.txt
venv/bin/python encode.py >python.txt
echo "cantools 45.1.0: deg/s, raw"
sed 's/^/Python: /' python.txt
sed 's/^/C:      /' c.txt

printf '0.29 29\n-0.29 -29\n4.35 435\n5 500\n' | cmp -s - python.txt || { echo "changed: Python's raw values"; exit 1; }
printf '0.29 28\n-0.29 -28\n4.35 434\n5 500\n' | cmp -s - c.txt || { echo "changed: the raw values of the generated C"; exit 1; }
echo "as described: the generated encoder cuts where cantools rounds"
