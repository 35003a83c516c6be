#!/usr/bin/env bash
# Linux 6.1 (user-mode-linux 6.1um4+b13) and can-utils 2020.11.0-1 (Debian 12): the stamp of a frame
# whose sender has asked for a launch time.
#
# Guess: candump stamps a frame with the time at which it arrived. SO_TXTIME of the sender is a matter
# between it and its queueing discipline; vcan has none, so the launch time is of no effect.
# Behaviour: the launch time is the frame's stamp, for every reader on the host and whatever kind of
# stamp it asks for, because the kernel stamps only frames that carry no time yet. It is not even on
# the readers' clock: CLOCK_MONOTONIC of the sender becomes a date in 1970.
# Seen: of two frames sent within milliseconds candump dates the second decades before the first.
#
# Needs apt-get, dpkg-deb, iproute2, python3. Fails if the behaviour changes.
set -euo pipefail
uml=6.1um4+b13 utils=2020.11.0-1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download "user-mode-linux=$uml" "can-utils=$utils" >/dev/null 2>&1
for package in ./*.deb; do dpkg-deb -x "$package" .; done
modules=$(for name in can can-raw can-dev vcan; do find usr/lib/uml -name "$name.ko*"; done)

cat >send.py <<'PYTHON'
import socket, struct, time
SO_TXTIME = SCM_TXTIME = 61
bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind(("vcan0",))
frame = struct.pack("=IB3x8s", 0x123, 1, b"\x01")
bus.send(frame)
bus.setsockopt(socket.SOL_SOCKET, SO_TXTIME, struct.pack("=iI", time.CLOCK_MONOTONIC, 0))
launch = struct.pack("=Q", time.monotonic_ns())
bus.sendmsg([frame], [(socket.SOL_SOCKET, SCM_TXTIME, launch)])
PYTHON

cat >init <<INIT
#!/bin/sh
cd $folder
mount -t proc proc /proc
mount -t sysfs sys /sys
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
for module in $(echo $modules); do insmod \$module; done
ip link add vcan0 type vcan && ip link set vcan0 up
usr/bin/candump -L -n 2 -T 5000 vcan0 >out.log 2>candump.err &
sleep 1
python3 send.py
wait
uname -r >kernel.txt
exec python3 -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321FEDC)'
INIT
chmod +x init
TMPDIR=$folder timeout 60 usr/bin/linux.uml mem=128M rootfstype=hostfs rootflags=/ rw quiet "init=$folder/init" \
  con=null con0=fd:0,fd:1 </dev/null >console.txt 2>&1 || true

[ -s kernel.txt ] || { cat console.txt; echo "the guest did not run"; exit 1; }
echo "Linux $(cat kernel.txt), can-utils $utils"
sed 's/^/out: /' out.log
mapfile -t stamps < <(sed -nE 's/^\(([0-9]+)\..*/\1/p' out.log)
[ ${#stamps[@]} = 2 ] || { echo "not two frames"; exit 1; }
[ "${stamps[0]}" -gt 1600000000 ] || { echo "changed: the frame without a launch time is not dated by the wall clock"; exit 1; }
[ "${stamps[1]}" -lt 100000 ] || { echo "changed: the launch time is not the stamp"; exit 1; }
echo "as described: the launch time of the sender is the reader's stamp"
