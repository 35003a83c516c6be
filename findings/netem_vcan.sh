#!/usr/bin/env bash
# Linux 6.1 (user-mode-linux 6.1um4+b13) and can-utils 2020.11.0-1 (Debian 12): netem on a virtual bus.
#
# Guess: `tc qdisc add dev vcan0 root netem loss 100%` makes vcan0 a bus on which nothing arrives, and
# `delay 500ms` one that is late, so that a gateway can be tested against both.
# Behaviour: every listener of the host gets every frame at once. vcan does not loop frames back itself by
# default; the CAN layer hands a copy to the listeners as it gives the frame to the queue. netem's own
# counters do say that it dropped the frames. On vxcan, where frames cross to the peer, netem acts for
# readers of the peer, and not for those of the interface it is sent on.
# Seen: three frames sent, netem dropped 3, candump has 3; frames without delay on vcan0, 0.5 s on vxcan.
#
# Needs apt-get, dpkg-deb, iproute2, python3. Fails if the behaviour changes.
set -euo pipefail
uml=6.1um4+b13 utils=2020.11.0-1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download "user-mode-linux=$uml" "can-utils=$utils" >/dev/null 2>&1
for package in ./*.deb; do dpkg-deb -x "$package" .; done
modules=$(for name in can can-raw can-dev vcan vxcan sch_netem; do find usr/lib/uml -name "$name.ko*"; done)

cat >init <<INIT
#!/bin/sh
cd $folder
mount -t proc proc /proc
mount -t sysfs sys /sys
export PATH=/usr/sbin:/usr/bin:/sbin:/bin:$folder/usr/bin
for module in $(echo $modules); do insmod \$module; done
ip link add vcan0 type vcan && ip link set vcan0 up
ip link add vx0 type vxcan peer name vx1 && ip link set vx0 up && ip link set vx1 up
tc qdisc add dev vcan0 root netem loss 100%
candump -L -n 3 -T 5000 vcan0 >loss.log 2>candump.err &
sleep 1
for frame in 100#01 100#02 100#03; do cansend vcan0 \$frame; done
wait
tc -s qdisc show dev vcan0 >counters.txt
tc qdisc replace dev vcan0 root netem delay 500ms
tc qdisc add dev vx0 root netem delay 500ms
candump -L -n 1 -T 5000 vcan0 >vcan0.log 2>candump.err &
candump -L -n 1 -T 5000 vx0 >vx0.log 2>candump.err &
candump -L -n 1 -T 5000 vx1 >vx1.log 2>candump.err &
sleep 1
date +'(%s.%6N) sent' >vcan0.sent
cansend vcan0 200#01
cansend vx0 200#02
wait
uname -r >kernel.txt
exec python3 -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321FEDC)'
INIT
chmod +x init
TMPDIR=$folder timeout 60 usr/bin/linux.uml mem=128M rootfstype=hostfs rootflags=/ rw quiet "init=$folder/init" \
  con=null con0=fd:0,fd:1 </dev/null >console.txt 2>&1 || true

[ -s kernel.txt ] || { cat console.txt; echo "the guest did not run"; exit 1; }
echo "Linux $(cat kernel.txt), can-utils $utils"
sed 's/^/loss 100%:   /' loss.log
grep -o 'dropped [0-9]*' counters.txt | sed 's/^/netem says:  /'
sed 's/^/delay 0.5 s: /' vcan0.sent vcan0.log vx0.log vx1.log
[ "$(grep -c ' vcan0 100#' loss.log)" = 3 ] || { echo "changed: netem takes frames from the listener on vcan"; exit 1; }
grep -q 'dropped 3' counters.txt || { echo "changed: netem did not drop"; exit 1; }
late() { awk -F'[()]' '{ t[NR] = $2 } END { exit !(NR == 2 && t[2] - t[1] >= '"$3"' && t[2] - t[1] < '"$4"') }' "$1" "$2"; }
late vx0.log vx1.log 0.3 5 || { echo "changed: on vxcan the peer's frame is not late"; exit 1; }
late vcan0.sent vcan0.log 0 0.4 || { echo "changed: on vcan the frame is late"; exit 1; }
echo "as described: netem on vcan is of no effect for listeners of the host"
