"""A small Debian with systemd as the first process, as an ext2 image that a User Mode Linux kernel boots. Made once
and kept in build/, for it takes a minute and the network."""

import hashlib
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SUITE = "bookworm"
# bash for the scenario is essential anyway; libraries are what the package depends on.
PROGRAMS = ("systemd-sysv", "udev", "dbus", "libnss-systemd", "can-utils", "iproute2", "kmod")
# Nobody logs in, nothing is mounted but the root, no device waits to be found, and time does not pass for cleaning up.
MASKED_UNITS = ("getty.target", "systemd-tmpfiles-clean.timer", "apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer",
                "e2scrub_all.timer", "e2scrub_reap.service", "fstrim.timer", "systemd-logind.service", "systemd-udev-trigger.service",
                "systemd-update-utmp.service", "systemd-random-seed.service", "modprobe@.service")
# For the journal, the package and its state.
SPARE_BYTES = 96 << 20


def command(packages, image):
    unit = HERE / "proof.service"
    wants = '"$1/etc/systemd/system/multi-user.target.wants"'
    return ["mmdebstrap", "--quiet", "--variant=minbase", f"--include={','.join(packages)}",
            f"--customize-hook=upload {unit} /etc/systemd/system/proof.service",
            f"--customize-hook=mkdir -p {wants} && ln -s ../proof.service {wants}/",
            f"--customize-hook=for unit in {' '.join(MASKED_UNITS)}; do ln -sf /dev/null \"$1/etc/systemd/system/$unit\"; done",
            # None of them makes a unit here, and each reload of systemd would start them all: five seconds in the guest.
            "--customize-hook=mkdir -p \"$1/etc/systemd/system-generators\" && for generator in \"$1\"/lib/systemd/system-generators/*;"
            " do ln -s /dev/null \"$1/etc/systemd/system-generators/${generator##*/}\"; done",
            # The host's sources, where it has some: a mirror of its own, perhaps.
            SUITE, str(image), *sources()]


def sources():
    found = [Path("/etc/apt/sources.list"), *sorted(Path("/etc/apt/sources.list.d").glob("*"))]
    return [str(path) for path in found if path.suffix in (".list", ".sources") and path.is_file()
            and SUITE in path.read_text(encoding="utf-8", errors="replace")]


def image(folder, libraries):
    """Its path; made when there is none of this kind."""
    packages = sorted({*PROGRAMS, *libraries})
    kind = hashlib.sha256("\n".join([SUITE, *packages, (HERE / "proof.service").read_text(),
                                     Path(__file__).read_text()]).encode()).hexdigest()[:12]
    path = folder / f"debian-{kind}.ext2"
    if path.exists():
        return path
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("debian-*.ext2*"):
        old.unlink()
    print("systemd: making a Debian image, once", file=sys.stderr, flush=True)
    made = path.with_suffix(".ext2.new")
    done = subprocess.run([*command(packages, made), "--format=ext2"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"systemd: nothing could run: no Debian image (mmdebstrap: exit {done.returncode})\n{done.stderr[-3000:]}")
    with open(made, "r+b") as file:
        file.truncate(made.stat().st_size + SPARE_BYTES)
    for program in (["e2fsck", "-fy", str(made)], ["resize2fs", str(made)]):
        subprocess.run(program, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    made.rename(path)
    return path
