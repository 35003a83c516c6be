"""Runs `vgyro gap` and `vgyro compare` on a case and reads their output files."""

import functools
import json
import os
import signal
import subprocess
import threading
import time
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
VGYRO = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")) / "vgyro"


class Failed(Exception):
    pass


def _run(command, limit_s=None):
    """Returns seconds and peak memory in MB; raises Failed with the last output if the run fails, or is ended
    after `limit_s`."""
    begun = time.monotonic()
    process = subprocess.Popen([str(c) for c in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    watch = threading.Timer(limit_s, process.kill) if limit_s else None
    if watch:
        watch.start()
    with process.stderr as pipe:
        words = pipe.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if watch:
        watch.cancel()
    if process.returncode == -signal.SIGKILL and limit_s and time.monotonic() - begun >= limit_s:
        raise Failed(f"ended after {limit_s} s")
    if process.returncode != 0:
        last = words.decode(errors="replace").strip().splitlines()[-3:]
        raise Failed(f"exit {process.returncode}: {' / '.join(last)}")
    return time.monotonic() - begun, usage.ru_maxrss / 1024.0


@functools.lru_cache
def _choice(vgyro):
    """For an ambiguous effect, model.toml must hold the likeliest explanation, or the result could not be
    compared with a fresh recording; an older build does this without the option."""
    told = subprocess.run([str(vgyro), "gap", "--help"], capture_output=True, text=True, check=True).stdout
    return ["--accept", "likeliest"] if "--accept" in told else []


def gap(folder, out, vgyro=VGYRO, limit_s=None):
    """(gap.json, seconds, MB) of the workflow on FOLDER's measured recording."""
    folder = Path(folder)
    model = folder / "model.toml"
    cost = _run(
        [vgyro, "gap", "--config", folder / "vgyro.toml", *(["--model", model] if model.exists() else [])]
        + ["--measured", folder / "measured.log.xz", "--out", out, *_choice(vgyro)],
        limit_s,
    )  # fmt: skip
    return json.loads((Path(out) / "gap.json").read_text()), *cost


def compare(folder, model, log, result, vgyro=VGYRO):
    """`compare --json` of a model on one of FOLDER's recordings."""
    folder = Path(folder)
    _run(
        [
            vgyro,
            "compare",
            "--config",
            folder / "vgyro.toml",
            "--model",
            model,
            "--measured",
            folder / log,
            "--json",
            result,
        ]
    )
    return json.loads(Path(result).read_text())
