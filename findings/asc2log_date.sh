#!/usr/bin/env bash
# can-utils 2020.11.0-1 (Debian 12): asc2log and the date of an ASC log.
#
# Guess: `log2asc | asc2log` gives the stamps back, for log2asc writes the date of the first frame in
# the head of the ASC log, and asc2log reads it.
# Behaviour: log2asc writes the date with English names in the C locale. asc2log reads dates with the
# locales en_US and de_DE only; where neither is installed, as on a minimal system or in a container,
# it takes the present time for the date of the first frame, says so on stderr, and exits with 0.
# Intervals stay right; absolute times are those of the conversion, and differ from run to run.
# Seen: two frames of 2023 come back with stamps of today.
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
export LC_ALL=C LOCPATH=$folder # no locale but C

printf '(1700000000.250000) can0 123#01\n(1700000001.750000) can0 123#02\n' >in.log
log2asc -I in.log -O mid.asc can0
before=$(date +%s)
asc2log -I mid.asc -O out.log 2>said.txt
echo "can-utils $version"
echo "in:   $(tr '\n' ' ' <in.log)"
echo "asc:  $(head -n 1 mid.asc)"
echo "out:  $(tr '\n' ' ' <out.log)"
echo "said: $(tr '\n' ' ' <said.txt)"

first=$(sed -nE '1s/^\(([0-9]+)\..*/\1/p' out.log)
[ "$first" -ge "$before" ] && [ "$first" -le $(($(date +%s) + 1)) ] || { echo "changed: the first stamp is $first"; exit 1; }
grep -q 'date' said.txt || { echo "changed: nothing is said of the date"; exit 1; }
awk -F'[()]' '{ t[NR] = $2 } END { d = t[2] - t[1]; exit !(d > 1.4999 && d < 1.5001) }' out.log || { echo "changed: the interval is not 1.5 s"; exit 1; }
echo "as described: the date of the log is lost, the interval is kept"
