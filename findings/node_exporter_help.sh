#!/usr/bin/env bash
# prometheus-node-exporter 1.5.0 (Debian 12): a metric that two textfiles share.
#
# Guess: two gateways write one textfile each, with the same metric under different labels. Whether one
# of them describes it by a HELP line and the other does not is a matter of comments: both are exported,
# or node_textfile_scrape_error says that one is not.
# Behaviour: the samples without that HELP line are dropped from the answer, which is 200 OK.
# node_textfile_scrape_error stays 0, and node_textfile_mtime_seconds calls both files successfully read.
# The exporter makes up a HELP for a file that has none, and then finds it different from the other's.
# Seen: the rate of gyro b is missing, another metric of the same file is there.
#
# Needs apt-get, dpkg-deb, python3. Fails if the behaviour changes.
set -euo pipefail
package=prometheus-node-exporter
folder=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null; rm -rf "$folder"' EXIT
cd "$folder"
apt-get download "$package" >/dev/null 2>&1
version=$(dpkg-deb -f "$package"_*.deb Version)
case $version in 1.5.0-*) ;; *) echo "not the version of this finding: $version"; exit 1 ;; esac
dpkg-deb -x "$package"_*.deb .

mkdir files
printf '# HELP gyro_rate_dps Rate of a gyro.\n# TYPE gyro_rate_dps gauge\ngyro_rate_dps{gyro="a"} 1.5\n' >files/a.prom
printf '# TYPE gyro_rate_dps gauge\ngyro_rate_dps{gyro="b"} 2.5\n# TYPE gyro_b_frames gauge\ngyro_b_frames 7\n' >files/b.prom
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
usr/bin/prometheus-node-exporter --collector.disable-defaults --collector.textfile --collector.textfile.directory=files \
  "--web.listen-address=127.0.0.1:$port" 2>said.txt &
server=$!
python3 - "$port" >answer.txt <<'PY'
import sys, time, urllib.request
for attempt in range(50):
    try:
        answer = urllib.request.urlopen(f"http://127.0.0.1:{sys.argv[1]}/metrics")
        print("status", answer.status)
        print(answer.read().decode())
        break
    except OSError:
        time.sleep(0.1)
PY
echo "$package $version"
grep -E '^status|^gyro|^node_textfile' answer.txt | sed 's/^/seen: /'

grep -qx 'status 200' answer.txt || { echo "changed: the answer is not 200"; exit 1; }
grep -q '^gyro_rate_dps{gyro="a"} 1.5' answer.txt && grep -q '^gyro_b_frames 7' answer.txt || { echo "changed: what is exported besides"; exit 1; }
! grep -q 'gyro="b"' answer.txt || { echo "changed: the rate of gyro b is there"; exit 1; }
grep -qx 'node_textfile_scrape_error 0' answer.txt || { echo "changed: an error is told"; exit 1; }
grep -q '^node_textfile_mtime_seconds{file="files/b.prom"}' answer.txt || { echo "changed: b.prom is not called read"; exit 1; }
echo "as described: samples are dropped, and no metric says so"
