#!/usr/bin/env bash
# python-can 4.6.1 (PyPI): error frames in a candump log.
#
# Guess: `candump -l any,0:0,#FFFFFFFF` writes error frames with bit 29 of the identifier set; the reader
# of python-can knows that form, so each comes out as an error frame, with its class.
# Behaviour: only the one class 20000080 (bus error), which python-can itself writes, is an error frame.
# Every other one becomes an ordinary extended data frame whose identifier is the error class: bus-off is
# message 00000040 with eight bytes of data. A DBC decoder, a player or a statistic takes it for traffic;
# copied from log to log, the mark is gone for good.
# Seen: of three error frames two come back as data, and are written as data.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q python-can==4.6.1 >/dev/null 2>&1

cat >in.log <<'LOG'
(1700000000.100000) can0 20000080#0000000000000000
(1700000000.200000) can0 20000004#000C000000006000
(1700000000.300000) can0 20000040#0000000000000000
LOG
venv/bin/python - <<'PY' >seen.txt
import can
with can.Logger("out.log") as writer:
    for message in can.LogReader("in.log"):
        kind = "error" if message.is_error_frame else "data"
        print(f"{kind} {message.arbitration_id:08X} extended={message.is_extended_id} dlc={message.dlc}")
        writer.on_message_received(message)
PY
echo "python-can 4.6.1"
sed 's/^/in:   /' in.log
sed 's/^/read: /' seen.txt
sed 's/^/out:  /' out.log

sed -n 1p seen.txt | grep -q '^error ' || { echo "changed: 20000080 is no error frame"; exit 1; }
sed -n 2p seen.txt | grep -qx 'data 00000004 extended=True dlc=8' || { echo "changed: 20000004"; exit 1; }
sed -n 3p seen.txt | grep -qx 'data 00000040 extended=True dlc=8' || { echo "changed: 20000040"; exit 1; }
grep -q ' 00000040#0000000000000000' out.log || { echo "changed: what is written"; exit 1; }
echo "as described: error frames of other classes become extended data frames"
