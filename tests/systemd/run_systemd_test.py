#!/usr/bin/python3
"""The package under a real systemd: a small Debian boots in User Mode Linux, installs the .deb, and goes through the life
of the service with recorded traffic on vcan interfaces. The unit's sandbox is on. Never skips: exits with 1 if a check
fails or nothing could run."""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = Path(os.environ.get("VGYRO_SOURCE", HERE.parents[1]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")).resolve()
sys.path[:0] = [str(HERE), str(HERE.parent / "vcan")]
import checks  # noqa: E402
import ground  # noqa: E402
import image  # noqa: E402
import verdicts  # noqa: E402

SECONDS_MOST = 420
SEED = 5

CONFIG = """\
[[gyro]]
name = "quiet"
bus = "vcan0"
dbc = "/usr/local/share/twin.dbc"
message = "GYRO_A"
rate = "Rate"
counter = "Counter"

[[gyro]]
name = "noisy"
bus = "vcan1"
dbc = "/usr/local/share/twin.dbc"
message = "GYRO_B"
rate = "Rate"
counter = "Counter"

[calibration]
rest_s = 3

[output]
bus = "vcan0"
"""
MODEL = "format = 1\n" + "".join(
    f"[[effect]]\ngyro = {gyro}\nkind = \"bias\"\nvalue_dps = {bias}\n"
    f"[[effect]]\ngyro = {gyro}\nkind = \"white_noise\"\ndensity_dps_rthz = {checks.NOISE_DPS_RTHZ}\n"
    for gyro, bias in enumerate(checks.BIASES_DPS, 1))


def output_of(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"systemd: nothing could run: {' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def another_version(deb, folder):
    """The same package with a higher version number."""
    tree = folder / "next"
    output_of("dpkg-deb", "--raw-extract", deb, tree)
    control = tree / "DEBIAN/control"
    text = control.read_text(encoding="utf-8")
    control.write_text(re.sub(r"^Version: (.*)$", r"Version: \1+next", text, flags=re.MULTILINE), encoding="utf-8")
    output_of("dpkg-deb", "--root-owner-group", "--build", tree, folder / "vgyro-next.deb")
    shutil.rmtree(tree)


def recordings(folder):
    """Simulates the gyros at rest with `vgyro simulate`: long enough to calibrate, and shorter."""
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    (folder / "profile.csv").write_text(f"t_s,rate_dps\n0,0\n{checks.PLAY_S},0\n", encoding="ascii")
    config = folder / "simulated.toml"
    config.write_text(CONFIG.replace("/usr/local/share/", ""), encoding="utf-8")
    output_of(BIN / "vgyro", "simulate", "--config", config, "--model", folder / "model.toml", "--profile",
              folder / "profile.csv", "--seed", str(SEED), "--quiet", "-o", folder / "calibration.log")
    lines = (folder / "calibration.log").read_text(encoding="ascii").splitlines(keepends=True)
    (folder / "rest.log").write_text("".join(lines[:int(2 * checks.RATE_HZ * checks.SHORT_S)]), encoding="ascii")


def prepare(folder):
    deb = output_of(SOURCE / "scripts/package", "--no-install").strip().splitlines()[-1]
    (folder / "out").mkdir()
    shutil.copy(deb, folder / "vgyro.deb")
    another_version(deb, folder)
    shutil.copytree(SOURCE / "systemd/examples", folder / "examples")
    shutil.copy(SOURCE / "examples/twin.dbc", folder)
    shutil.copy(HERE / "scenario.sh", folder)
    (folder / "vgyro.toml").write_text(CONFIG, encoding="utf-8")
    recordings(folder)
    depends = output_of("dpkg-deb", "--field", deb, "Depends")
    return [name for name in re.findall(r"(?:^|,) *([a-z0-9.+-]+)", depends) if name != "systemd"]


def boot(folder, disk):
    kernel = shutil.which("linux.uml")
    versions = sorted(Path("/usr/lib/uml/modules").glob("*/kernel"))
    if kernel is None or not versions:
        sys.exit("systemd: nothing could run: no linux.uml (`apt install user-mode-linux`)")
    (folder / "modules.path").write_text(f"{versions[-1].parent}\n", encoding="ascii")
    command = [kernel, "mem=512M", f"ubd0={folder}/changes,{disk}", "root=/dev/ubda", "rw", "quiet",
               "init=/lib/systemd/systemd", "systemd.show_status=false", "con=null", "con0=fd:0,fd:1", f"proof={folder}"]
    with open(folder / "console.txt", "wb") as console:
        subprocess.run(command, stdin=subprocess.DEVNULL, stdout=console, stderr=console, timeout=SECONDS_MOST, check=False,
                       preexec_fn=ground.foremost)


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--keep", metavar="DIR", help="keep what the guest left in this new folder")
    p.add_argument("--judge", metavar="DIR", help="judge a kept folder again, boot nothing")
    arguments = p.parse_args()
    if arguments.judge:
        return checks.judge(Path(arguments.judge) / "out")
    with tempfile.TemporaryDirectory(prefix="vgyro-systemd-") as scratch:
        folder = Path(arguments.keep or scratch).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        disk = image.image(SOURCE / "build/systemd", prepare(folder))
        begin = time.monotonic()
        try:
            boot(folder, disk)
        except subprocess.TimeoutExpired:
            print(f"systemd: the guest still ran after {SECONDS_MOST} s")
        print(f"systemd: the guest ran for {time.monotonic() - begin:.0f} s")
        failed = checks.judge(folder / "out")
        if failed:
            console = folder / "console.txt"
            print(console.read_text(errors="replace")[-2000:])
        return failed


if __name__ == "__main__":
    sys.exit(main())
