#!/usr/bin/env bash
# canmatrix 1.2 and cantools 45.1.0 (PyPI): a float signal on its way from DBC to SYM.
#
# Guess: `canconvert` keeps what kind of number a signal is. SYM has a type `float`, and canmatrix reads
# SIG_VALTYPE_, so the float stays one; KCD and ARXML show that it can be done.
# Behaviour: in SYM it becomes a signed integer of the same bits, without a warning. Bits, scale and unit
# are right, so the files look alike, and each value is wrong.
# Seen: 1.5 deg/s is 1.5 by way of KCD, and 1069547520 by way of SYM.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q "canmatrix[kcd]==1.2" cantools==45.1.0 setuptools==65.5.0 >/dev/null 2>&1

cat >rate.dbc <<'DBC'
VERSION ""
BU_: Gyro
BO_ 291 Yaw: 4 Gyro
 SG_ Rate : 0|32@1- (1,0) [-300|300] "deg/s" Gyro

SIG_VALTYPE_ 291 Rate : 1;
DBC
for form in kcd sym; do
  venv/bin/canconvert rate.dbc "rate.$form" >"$form.txt" 2>&1
  venv/bin/canconvert "rate.$form" "$form.dbc" >>said.txt 2>&1
  [ -e "$form.dbc" ] || mv "${form}_"*.dbc "$form.dbc" # the name of a cluster is added
done
cat >decode.py <<'PY'
import sys, cantools
print(f"{cantools.database.load_file(sys.argv[1]).messages[0].decode(bytes.fromhex('0000C03F'))['Rate']:.10g}")
PY
for file in rate.dbc kcd.dbc sym.dbc; do echo "$file: $(venv/bin/python decode.py "$file") deg/s"; done | tee seen.txt
echo "in the SYM file: $(grep '^Var=' rate.sym)"

! grep -Eiq "float|value type" sym.txt || { echo "changed: something is said of the float"; exit 1; }

grep -qx 'rate.dbc: 1.5 deg/s' seen.txt && grep -qx 'kcd.dbc: 1.5 deg/s' seen.txt || { echo "changed: DBC or KCD"; exit 1; }
grep -qx 'sym.dbc: 1069547520 deg/s' seen.txt || { echo "changed: SYM"; exit 1; }
echo "as described: the float is an integer in SYM"
