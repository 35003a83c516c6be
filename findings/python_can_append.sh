#!/usr/bin/env bash
# python-can 4.6.1 (PyPI): logging with append=True.
#
# Guess: can.Logger(NAME, append=True) begins the file where there is none and adds to it where there is
# one, for each form that does not refuse; two runs of two frames leave four frames.
# Behaviour: candump log and BLF do so. CSV begun this way gets no head line, and its reader takes the
# first frame for one: that frame is lost. TRC opens the file anew: the whole run before is lost.
# Neither says a word, and both are found on the way back only.
# Seen: 4 frames from .log and .blf, 3 from .csv, 2 from .trc.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q python-can==4.6.1 >/dev/null 2>&1

export TZ=UTC
venv/bin/python - <<'PY' >seen.txt
import can
for form in ("log", "blf", "csv", "trc"):
    name = "drive." + form
    for run in range(2):
        with can.Logger(name, append=True) as writer:
            for k in range(2):
                stamp = 1_700_000_000.0 + 3600 * run + k
                writer.on_message_received(can.Message(timestamp=stamp, arbitration_id=16 * run + k, is_extended_id=False, data=b"\1"))
    print(form, *(f"{m.arbitration_id:02X}" for m in can.LogReader(name)))
PY
echo "python-can 4.6.1: written in two runs are 00 01 and 10 11"
sed 's/^/read: /' seen.txt

grep -qx 'log 00 01 10 11' seen.txt && grep -qx 'blf 00 01 10 11' seen.txt || { echo "changed: candump log or BLF"; exit 1; }
grep -qx 'csv 01 10 11' seen.txt || { echo "changed: CSV"; exit 1; }
grep -qx 'trc 10 11' seen.txt || { echo "changed: TRC"; exit 1; }
echo "as described: CSV loses the first frame, TRC the first run"
