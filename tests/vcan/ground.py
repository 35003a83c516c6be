"""Where the vcan tests run: natively in a network namespace of their own or, if the host's kernel has no vcan, in a
User Mode Linux kernel on the host's own files."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
PYTHON = os.path.realpath(sys.executable)
UML_MODULES = Path("/usr/lib/uml/modules")
MODULES = ("can", "can-raw", "can-dev", "can-j1939", "vcan", "sch_tbf")
# Tries the kernel features that the tests need, in a namespace that vanishes at once.
PROBE = "ip link add vgprobe0 type vcan && tc qdisc add dev vgprobe0 root tbf rate 100kbit burst 200 limit 400"

GUEST_INIT = """\
#!/bin/sh
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t tmpfs tmpfs /run
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/run
for module in {modules}; do insmod "$module" || echo "cannot load $module" >> {folder}/guest.txt; done
ip link set lo up
{python} {inside} {folder} /run >> {folder}/guest.txt 2>&1
echo $? > {folder}/guest.exit
# Not every system has halt(8).
exec {python} -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321FEDC)'
"""


def foremost():
    """Gives real-time tests priority over other work of the host, if permitted. A guest is many processes that wait for each
    other: at a common priority each would wait for the end of another's time slice."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except OSError:
        pass


class Native:
    name = "natively"

    def __init__(self, unshare):
        self.unshare = unshare

    def run(self, folder, seconds, inside=HERE / "inside.py"):
        done = subprocess.run([*self.unshare, PYTHON, str(inside), str(folder), str(folder)],
                              stdout=sys.stderr, timeout=seconds, check=False, preexec_fn=foremost)
        return done.returncode


class UserModeLinux:
    name = "inside User Mode Linux (host kernel has no vcan)"

    def __init__(self, kernel, modules):
        self.kernel = kernel
        self.modules = modules

    def run(self, folder, seconds, inside=HERE / "inside.py"):
        init = folder / "init"
        init.write_text(GUEST_INIT.format(
            modules=" ".join(shlex.quote(str(m)) for m in self.modules), python=shlex.quote(PYTHON),
            inside=shlex.quote(str(inside)), folder=shlex.quote(str(folder))))
        init.chmod(0o755)
        command = [self.kernel, "mem=512M", "rootfstype=hostfs", "rootflags=/", "rw", "quiet", f"init={init}",
                   "con=null", "con0=fd:0,fd:1"]
        with open(folder / "guest.console", "wb") as console:
            subprocess.run(command, stdin=subprocess.DEVNULL, stdout=console, stderr=console, timeout=seconds,
                           check=False, preexec_fn=foremost)
        code = folder / "guest.exit"
        return int(code.read_text()) if code.exists() else 1


def native():
    """The host's own kernel, or None with the reason."""
    unshare = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--net", "--map-root-user"]
    done = subprocess.run([*unshare, "sh", "-c", PROBE], capture_output=True, text=True, check=False)
    return (Native(unshare), "") if done.returncode == 0 else (None, done.stderr.strip())


def user_mode_linux():
    kernel = shutil.which("linux.uml") or shutil.which("linux")
    if kernel is None:
        return None, "no linux.uml (`apt install user-mode-linux`)"
    versions = sorted(UML_MODULES.iterdir()) if UML_MODULES.is_dir() else []
    for version in reversed(versions):
        found = {path.name.split(".ko")[0]: path for path in version.rglob("*.ko*")}
        if all(module in found for module in MODULES):
            return UserModeLinux(kernel, [found[module] for module in MODULES]), ""
    return None, f"no CAN modules under {UML_MODULES}"


def choose(wish):
    """`wish`: native, uml, or auto. Returns the ground, or exits with a text that says what is missing."""
    reasons = []
    for name, find in (("native", native), ("uml", user_mode_linux)):
        if wish not in ("auto", name):
            continue
        ground, reason = find()
        if ground is not None:
            return ground
        reasons.append(f"{name}: {reason}")
    sys.exit("vcan: nothing could run: " + "; ".join(reasons))
