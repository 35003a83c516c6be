"""Runs the built `vgyro replay` on recordings that a test has made."""

import os
import shutil
import subprocess
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
VGYRO = BIN / "vgyro"
TWIN_DBC = SOURCE / "examples/twin.dbc"

CONFIG = """\
[[gyro]]
name = "a"
bus = "can0"
dbc = "twin.dbc"
message = "GYRO_A"
rate = "Rate"
temperature = "Temperature"
counter = "Counter"

[[gyro]]
name = "b"
bus = "can1"
dbc = "twin.dbc"
message = "GYRO_B"
rate = "Rate"
temperature = "Temperature"
counter = "Counter"

[calibration]
rest_s = {rest_s!r}
rate_dps = {rate_dps!r}

[corrector]
method = "mutual"
window_s = {window_s!r}
order = {order}

[output]
bus = "can0"
"""


def write_config(folder, rest_s, window_s=10.0, order=1, rate_dps=0.0032):
    """vgyro.toml and the twin's DBC file beside it; returns the config's path."""
    folder = Path(folder)
    shutil.copy(TWIN_DBC, folder / "twin.dbc")
    path = folder / "vgyro.toml"
    path.write_text(
        CONFIG.format(rest_s=float(rest_s), window_s=float(window_s), order=order, rate_dps=float(rate_dps))
    )
    return path


def replay_command(config, log, out, method=None, extra=()):
    method_arguments = ["--method", method] if method else []
    return [str(VGYRO), "replay", "--config", str(config), *method_arguments, "-o", str(out), *extra, str(log)]


def replay(config, log, out, method=None, extra=()):
    """Runs to the end and returns the output log's bytes; raises with the program's messages."""
    done = subprocess.run(replay_command(config, log, out, method, extra), capture_output=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{done.args}: exit code {done.returncode}\n{done.stderr.decode(errors='replace')}")
    return Path(out).read_bytes()
