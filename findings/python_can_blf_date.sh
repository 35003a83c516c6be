#!/usr/bin/env bash
# python-can 4.1.0 and 4.6.1 (PyPI): the date in the head of a BLF file.
#
# Guess: a BLF file that one release of python-can wrote is read by a later one with the same times;
# the date in its head has no zone, so both take it for local time, as CANoe, Wireshark and ASC have it.
# Behaviour: 4.1.0 writes and reads local time, 4.6.1 writes and reads UTC. Between the two, and between
# 4.6.1 and CANoe's own files, every stamp is off by the zone's difference to UTC. Nothing says so.
# Seen: two logs of one drive, of which one was CANoe's, are nine hours apart in Tokyo, and right in UTC.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for version in 4.1.0 4.6.1; do
  python3 -m venv "$version"
  "$version/bin/pip" install -q "python-can==$version" setuptools >/dev/null 2>&1
done

cat >write.py <<'PY'
import sys
import can
from can.io.blf import BLFWriter
writer = BLFWriter(sys.argv[1])
writer.on_message_received(can.Message(timestamp=1_700_000_000.0, arbitration_id=0x123, is_extended_id=False, data=b"\1"))
writer.stop()
PY
cat >read.py <<'PY'
import sys
from can.io.blf import BLFReader
print(round(next(iter(BLFReader(sys.argv[1]))).timestamp))
PY

export TZ=Asia/Tokyo
for writer in 4.1.0 4.6.1; do
  "$writer/bin/python" write.py "$writer.blf"
  for reader in 4.1.0 4.6.1; do
    seconds=$("$reader/bin/python" read.py "$writer.blf")
    echo "written by $writer, read by $reader: $seconds, off by $(((seconds - 1700000000) / 3600)) h"
    expected=1700000000
    [ "$writer,$reader" != 4.1.0,4.6.1 ] || expected=$((1700000000 + 9 * 3600))
    [ "$writer,$reader" != 4.6.1,4.1.0 ] || expected=$((1700000000 - 9 * 3600))
    [ "$seconds" = "$expected" ] || { echo "changed: $expected was expected"; exit 1; }
  done
done
echo "as described: the releases disagree by Tokyo's nine hours"
