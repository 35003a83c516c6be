#!/usr/bin/python3
"""How fast `vgyro replay` goes through a log of 2.4 million frames, beside programs that do less with
it, all in one run, each pinned to one core; and how much memory each takes. Prints Markdown.
Needs Debian's packages time, can-utils, python3-can and python3-numpy."""

import argparse
import dataclasses
import math
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import command_line

SOURCE = Path(__file__).resolve().parents[1]
CONFIG = SOURCE / "examples/twin.toml"
FRAMES_LONG, FRAMES_SHORT = 2_400_000, 240_000
SECONDS_PER_FRAME = 1.0 / 1000.0  # two gyros at 500 Hz


@dataclasses.dataclass
class Row:
    name: str
    command: list
    log: Path
    frames: int
    from_pipe: bool = False
    prints_seconds: bool = False  # of its loop, which then count instead of the process's
    times_s: list = dataclasses.field(default_factory=list)
    cpu_s: float = math.inf
    rss_max_kb: int = 0

    @property
    def frames_per_s(self):
        return self.frames / min(self.times_s)


def make_log(path, frames):
    """Cached: the same name always holds the same frames."""
    if path.exists():
        return path
    print(f"making {path.name} …", file=sys.stderr)
    path.parent.mkdir(parents=True, exist_ok=True)
    run_s = frames * SECONDS_PER_FRAME - 60.0
    part = path.with_suffix(".part")
    subprocess.run(
        [sys.executable, SOURCE / "tests/twin/make_twin.py", "--scenario", "drive", "--rest", "60", "--run", str(run_s),
         "--turn", "20", "--seed", "1", "-o", part],
        check=True,
    )
    part.rename(path)
    return path


def measure(row, core, other_core, usage_file):
    """One run, wall time from start to exit; the feeding `cat` of a pipe runs on the other core. The
    kernel counts a process's memory from before its exec: /usr/bin/time is small, Python is not."""
    feeder = None
    stdin = subprocess.DEVNULL
    begin = time.perf_counter()
    if row.from_pipe:
        feeder = subprocess.Popen(["taskset", "-c", str(other_core), "cat", str(row.log)], stdout=subprocess.PIPE)
        stdin = feeder.stdout
    process = subprocess.Popen(
        ["taskset", "-c", str(core), "/usr/bin/time", "-q", "-f", "%M %U %S", "-o", str(usage_file), *map(str, row.command)],
        stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    if feeder:
        feeder.stdout.close()
    output, complaint = process.communicate()
    seconds = time.perf_counter() - begin
    if feeder:
        feeder.wait()
    if process.returncode != 0:
        raise RuntimeError(f"{row.command}: exit code {process.returncode}\n{complaint.decode(errors='replace')}")
    row.times_s.append(float(output.split()[1]) if row.prints_seconds else seconds)
    rss_kb, user_s, system_s = usage_file.read_text(encoding="ascii").split()
    row.rss_max_kb = max(row.rss_max_kb, int(rss_kb))
    row.cpu_s = min(row.cpu_s, float(user_s) + float(system_s))


def rows(bin_dir, long_log, short_log, out):
    vgyro = bin_dir / "vgyro"
    replay = [vgyro, "replay", "--config", CONFIG]
    python_loop = [sys.executable, SOURCE / "bench/python_can_loop.py", short_log]
    found = [
        Row("`wc -l`", ["wc", "-l", long_log], long_log, FRAMES_LONG),
        Row("bare parsing (`vgyro_parse_log`)", [bin_dir / "vgyro_parse_log", long_log], long_log, FRAMES_LONG),
        Row("`vgyro replay -o /dev/null`", [*replay, "-o", "/dev/null", long_log], long_log, FRAMES_LONG),
        Row("`vgyro replay -o FILE` on tmpfs", [*replay, "-o", out, long_log], long_log, FRAMES_LONG),
        Row("`cat LOG \\| vgyro replay -o /dev/null -`", [*replay, "-o", "/dev/null", "-"], long_log, FRAMES_LONG, from_pipe=True),
        Row("the same, a tenth of the log", [*replay, "-o", "/dev/null", "-"], short_log, FRAMES_SHORT, from_pipe=True),
        Row("python-can and struct, a loop¹", python_loop, short_log, FRAMES_SHORT, prints_seconds=True),
    ]
    if shutil.which("log2asc"):
        log2asc = ["log2asc", "-I", long_log, "-O", "/dev/null", "can0", "can1"]
        found.insert(1, Row("can-utils `log2asc`", log2asc, long_log, FRAMES_LONG))
    return found


def print_table(measured, rounds, core):
    reference = measured[0].frames_per_s
    print(f"{FRAMES_LONG / 1e6:g} million frames ({measured[0].log.stat().st_size / 1e6:.0f} MB), best of {rounds}, "
          f"pinned to core {core} of {os.cpu_count()}, {cpu_name()}, Linux {platform.release()}.\n")
    print("| program | million frames/s | seconds | of these, CPU | of `wc -l` | peak memory, MB |")
    print("|---|---:|---:|---:|---:|---:|")
    for row in measured:
        print(f"| {row.name} | {row.frames_per_s / 1e6:.3g} | {min(row.times_s):.3f} | {row.cpu_s:.2f} | "
              f"{row.frames_per_s / reference:.2g} | {row.rss_max_kb / 1024:.1f} |")
    print(f"\n¹ on {FRAMES_SHORT / 1e6:g} million frames, time of the loop alone.")


def cpu_name():
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=command_line.file_name, default=SOURCE / "build/release/bin", help="where the programs are")
    parser.add_argument("--cache", type=command_line.file_name, default=SOURCE / "build/bench", help="where the logs are kept")
    parser.add_argument("--rounds", type=command_line.whole(1, 1000), default=5)
    parser.add_argument("--core", type=command_line.whole(0, 4095), help="default: the last one")
    a = parser.parse_args()
    cores = sorted(os.sched_getaffinity(0))
    core = cores[-1] if a.core is None else a.core
    other_core = next((c for c in cores if c != core), core)

    long_log = make_log(a.cache / "long.log", FRAMES_LONG)
    short_log = make_log(a.cache / "short.log", FRAMES_SHORT)
    tmpfs = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="vgyro-", dir=tmpfs) as folder:
        measured = rows(a.bin, long_log, short_log, Path(folder) / "out.log")
        for log in (long_log, short_log):
            subprocess.run(["wc", "-l", log], check=True, stdout=subprocess.DEVNULL)  # into the page cache
        # Rounds over all rows, not rows one by one: a disturbance then spares somebody's best time.
        for number in range(a.rounds):
            for row in measured:
                print(f"round {number + 1} of {a.rounds}: {row.name}", file=sys.stderr)
                measure(row, core, other_core, Path(folder) / "usage")
    print_table(measured, a.rounds, core)


if __name__ == "__main__":
    main()
