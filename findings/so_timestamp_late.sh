#!/usr/bin/env bash
# Linux 6.1 (user-mode-linux 6.1um4+b13, Debian 12): stamps of frames that wait in a CAN socket.
#
# Guess: a frame has the kernel's stamp of its arrival; whoever sets SO_TIMESTAMP after bind() gets it for
# the frames already in the queue too, or no stamp for these.
# Behaviour: nobody on the host wanted stamps when they came, so they have none. On reading the kernel
# fills in the present time, as an ordinary stamp: a program that is slow between bind() and setsockopt()
# begins with a heap of frames that arrived at one instant. Set the option before bind().
# Seen: a frame read 1 s after it was sent is stamped 1.00 s late; with the option set first, 0.00 s.
#
# Needs apt-get, dpkg-deb, iproute2, python3. Fails if the behaviour changes.
set -euo pipefail
uml=6.1um4+b13
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download "user-mode-linux=$uml" >/dev/null 2>&1
dpkg-deb -x ./user-mode-linux*.deb .
modules=$(for name in can can-raw can-dev vcan; do find usr/lib/uml -name "$name.ko*"; done)

cat >wait.py <<'PY'
import socket, struct, time
SO_TIMESTAMP = 29
def opened(): return socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
def stamps(reader): reader.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMP, 1)
sender = opened()
sender.bind(("vcan0",))
for when in ("after", "before"):
    reader = opened()
    if when == "before": stamps(reader)
    reader.bind(("vcan0",))
    sent_s = time.time()
    sender.send(struct.pack("<IB3x8s", 0x100, 0, b""))
    time.sleep(1)
    if when == "after": stamps(reader)
    _, beside, _, _ = reader.recvmsg(72, 200)
    whole_s, micro_s = struct.unpack("qq", beside[0][2])
    print(f"SO_TIMESTAMP {when} the frame: stamped {whole_s + micro_s * 1e-6 - sent_s:.2f} s after sending")
    reader.close()
PY
cat >init <<INIT
#!/bin/sh
cd $folder
mount -t proc proc /proc
mount -t sysfs sys /sys
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
for module in $(echo $modules); do insmod \$module; done
ip link add vcan0 type vcan && ip link set vcan0 up
python3 wait.py >seen.txt 2>&1
uname -r >kernel.txt
exec python3 -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321FEDC)'
INIT
chmod +x init
TMPDIR=$folder timeout 60 usr/bin/linux.uml mem=128M rootfstype=hostfs rootflags=/ rw quiet "init=$folder/init" \
  con=null con0=fd:0,fd:1 </dev/null >console.txt 2>&1 || true

[ -s kernel.txt ] || { cat console.txt; echo "the guest did not run"; exit 1; }
echo "Linux $(cat kernel.txt)"
sed 's/^/seen: /' seen.txt
grep -qE 'after the frame: stamped (1\.[0-9]|[2-9])' seen.txt || { echo "changed: stamps asked for late"; exit 1; }
grep -qE 'before the frame: stamped 0\.[0-4]' seen.txt || { echo "changed: stamps asked for first"; exit 1; }
echo "as described: a frame that waited is stamped when it is read"
