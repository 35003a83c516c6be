#!/usr/bin/env bash
# systemd 252 (Debian 12) and dbus-fast 5.2.0 (PyPI): busctl and a number with a point.
#
# Guess: `busctl get-property` prints a double with the digits that tell it from its neighbours, and
# --json=short the same value.
# Behaviour: the plain form has six significant digits, also in `busctl introspect` and `busctl call`: a
# time in seconds moves in steps of 10000 s. JSON has all digits, but null for both NaN and
# infinity, which the plain form tells apart. So no one form shows every value.
# Seen: 1700000000.25 is printed as 1.7e+09, infinity as null.
#
# Needs apt-get, dpkg-deb, python3 with venv, PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download systemd libsystemd-shared libsystemd0 dbus-daemon dbus-bin libdbus-1-3 libapparmor1 libaudit1 libcap-ng0 libexpat1 >/dev/null 2>&1
version=$(dpkg-deb -f systemd_*.deb Version)
case $version in 252.*) ;; *) echo "not the version of this finding: $version"; exit 1 ;; esac
for package in ./*.deb; do dpkg-deb -x "$package" .; done
python3 -m venv venv
venv/bin/pip install -q dbus-fast==5.2.0 >/dev/null 2>&1
libraries=$folder/usr/lib/$(uname -m)-linux-gnu
libraries=$libraries:$libraries/systemd:$folder/lib/$(uname -m)-linux-gnu

cat >bus.conf <<'XML'
<busconfig>
  <type>session</type>
  <listen>unix:tmpdir=/tmp</listen>
  <policy context="default"><allow send_destination="*" eavesdrop="true"/><allow eavesdrop="true"/><allow own="*"/></policy>
</busconfig>
XML
cat >service.py <<'PY'
import asyncio
from dbus_fast import PropertyAccess
from dbus_fast.aio import MessageBus
from dbus_fast.service import ServiceInterface, dbus_property

VALUES = {"Rate": 123.456789, "Time": 1_700_000_000.25, "Lost": float("nan"), "Endless": float("inf")}

class Gyro(ServiceInterface):
    def __init__(self):
        super().__init__("example.Gyro")
    @dbus_property(access=PropertyAccess.READ)
    def Rate(self) -> "d":
        return VALUES["Rate"]
    @dbus_property(access=PropertyAccess.READ)
    def Time(self) -> "d":
        return VALUES["Time"]
    @dbus_property(access=PropertyAccess.READ)
    def Lost(self) -> "d":
        return VALUES["Lost"]
    @dbus_property(access=PropertyAccess.READ)
    def Endless(self) -> "d":
        return VALUES["Endless"]

async def ask(*options):
    process = await asyncio.create_subprocess_exec("usr/bin/busctl", "--user", *options, stdout=asyncio.subprocess.PIPE)
    return (await process.communicate())[0].decode().strip()

async def main():
    bus = await MessageBus().connect()
    bus.export("/gyro", Gyro())
    await bus.request_name("example.Gyro")
    for name, value in VALUES.items():
        what = ("get-property", "example.Gyro", "/gyro", "example.Gyro", name)
        print(f"{value!r}: {await ask(*what)}: {await ask('--json=short', *what)}")

asyncio.run(main())
PY
LD_LIBRARY_PATH=$libraries usr/bin/dbus-run-session --config-file=bus.conf --dbus-daemon="$folder/usr/bin/dbus-daemon" -- \
  venv/bin/python service.py >seen.txt 2>said.txt || { cat said.txt; exit 1; }
echo "systemd $version: the value, busctl, busctl --json=short"
sed 's/^/seen: /' seen.txt

grep -q '^123.456789: d 123.457: ' seen.txt || { echo "changed: the rate"; exit 1; }
grep -q '^1700000000.25: d 1.7e+09: .*1.70000000025' seen.txt || { echo "changed: the time"; exit 1; }
grep -q '^nan: d nan: .*null' seen.txt && grep -q '^inf: d inf: .*null' seen.txt || { echo "changed: NaN or infinity"; exit 1; }
echo "as described: six digits, or null"
