#!/usr/bin/env bash
# can-utils 2020.11.0-1 (Debian 12), on Linux 6.1 (user-mode-linux 6.1um4+b13): candump and an
# interface that is renamed while it listens.
#
# Guess: `candump -L any` names each frame's interface as it is called when the frame comes; so where
# can0 and can1 swap their names, the log has them swapped from then on.
# Behaviour: candump asks for a name when it first hears of an index, and keeps it. After the swap each
# frame stands under the name that its interface had before; a log that is begun a moment later says
# the opposite. A socket is bound to an index, and a rename is no event for it.
# Seen: frame 222, sent to what is called vcan0 now, stands under vcan1.
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

cat >init <<INIT
#!/bin/sh
cd $folder
mount -t proc proc /proc
mount -t sysfs sys /sys
export PATH=/usr/sbin:/usr/bin:/sbin:/bin:$folder/usr/bin
for module in $(echo $modules); do insmod \$module; done
for name in vcan0 vcan1; do ip link add \$name type vcan && ip link set \$name up; done
candump -L -n 4 -T 5000 -D any >during.log 2>candump.err &
sleep 1
cansend vcan0 100#
cansend vcan1 111#
for name in vcan0 vcan1; do ip link set \$name down; done
ip link set vcan0 name other && ip link set vcan1 name vcan0 && ip link set other name vcan1
for name in vcan0 vcan1; do ip link set \$name up; done
candump -L -n 2 -T 5000 any >after.log 2>candump.err &
sleep 1
cansend vcan0 222#
cansend vcan1 211#
wait
uname -r >kernel.txt
exec python3 -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321FEDC)'
INIT
chmod +x init
TMPDIR=$folder timeout 60 usr/bin/linux.uml mem=128M rootfstype=hostfs rootflags=/ rw quiet "init=$folder/init" \
  con=null con0=fd:0,fd:1 </dev/null >console.txt 2>&1 || true

[ -s kernel.txt ] || { cat console.txt; echo "the guest did not run"; exit 1; }
echo "Linux $(cat kernel.txt), can-utils $utils"
sed 's/^/listened since before: /' during.log
sed 's/^/begun afterwards:      /' after.log
grep -q ' vcan0 100#' during.log && grep -q ' vcan0 222#' after.log || { echo "the frames are not there"; exit 1; }
grep -q ' vcan1 222#' during.log || { echo "changed: candump follows the rename"; exit 1; }
echo "as described: the name at which candump first heard of the interface stays"
