#!/usr/bin/env bash
# can-utils 2020.11.0-1 (Debian 12): log2asc and the first stamp.
#
# Guess: log2asc writes the date of the first frame, and stamps since that date, so that date and stamp
# together are the frame's time, to the microsecond.
# Behaviour: the date has whole seconds; the stamps count from the first frame itself, which is 0.000000
# whatever its fraction was. The fraction is in the ASC log nowhere, and every absolute time that a
# reader makes of it is early by up to a second. Intervals are right.
# Seen: two logs of one drive, of which one went through log2asc, are 0.75 s apart.
#
# Needs apt-get and dpkg-deb. Fails if the behaviour changes.
set -euo pipefail
version=2020.11.0-1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download "can-utils=$version" >/dev/null 2>&1
dpkg-deb -x can-utils_*.deb .
PATH=$folder/usr/bin:$PATH
export LC_ALL=C TZ=UTC

printf '(1700000000.750000) can0 123#01\n(1700000001.500000) can0 123#02\n' >in.log
log2asc -I in.log -O out.asc can0
echo "can-utils $version"
echo "in:  $(tr '\n' ' ' <in.log)"
echo "asc:"
sed 's/^/     /' out.asc

grep -qx 'date Tue Nov 14 22:13:20 2023' out.asc || { echo "changed: the date"; exit 1; }
grep -Eq '^ +0\.000000 1 +123 ' out.asc || { echo "changed: the first stamp is not zero"; exit 1; }
grep -Eq '^ +0\.750000 1 +123 ' out.asc || { echo "changed: the interval is not 0.75 s"; exit 1; }
! grep -q '20\.750' out.asc || { echo "changed: the fraction is there"; exit 1; }
echo "as described: 0.75 s of the first stamp are lost"
