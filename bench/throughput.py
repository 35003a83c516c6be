#!/usr/bin/python3
"""Speed and memory of `vgyro replay` on a log of 2.4 million frames, compared with programs that do less with it,
all in one run, each pinned to one core; and on a car's log, in which one frame in twenty is a gyro's. With --former,
compared with another build in the same run. Prints Markdown. Needs Debian's packages time, can-utils, python3-can
and python3-numpy."""

import argparse
import dataclasses
import math
import os
import platform
import random
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
FOREIGN_PER_GYRO_FRAME = 19
FOREIGN_IDENTIFIERS = 60
CAR_SEED = 3


@dataclasses.dataclass
class Row:
    name: str
    command: list
    log: Path
    frames: int
    from_pipe: bool = False
    prints_seconds: bool = False  # prints its loop's seconds, which count instead of the process's
    former: "Row | None" = None  # the same row with the former build
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


def make_car_log(path, gyro_log):
    """The gyros' frames of the long log's beginning, each followed by 19 other frames: 60 identifiers on both buses,
    most with 8 bytes. FRAMES_LONG in all. Cached: the same name always holds the same frames."""
    if path.exists():
        return path
    print(f"making {path.name} …", file=sys.stderr)
    draw = random.Random(CAR_SEED)
    foreign = [(draw.choice(("can0", "can1")), identifier, draw.choice((2, 4, 7, 8, 8, 8, 8, 8)))
               for identifier in draw.sample([i for i in range(0x110, 0x600)], FOREIGN_IDENTIFIERS)]
    part = path.with_suffix(".part")
    step_us = round(SECONDS_PER_FRAME / (1 + FOREIGN_PER_GYRO_FRAME) * 1e6)
    with gyro_log.open(encoding="ascii") as gyro_lines, part.open("w", encoding="ascii") as to:
        for _, line in zip(range(FRAMES_LONG // (1 + FOREIGN_PER_GYRO_FRAME)), gyro_lines):
            to.write(line)
            seconds, fraction = line[1 : line.index(")")].split(".")
            stamp_us = int(seconds) * 1_000_000 + int(fraction)
            for place, (bus, identifier, length) in enumerate(draw.choices(foreign, k=FOREIGN_PER_GYRO_FRAME)):
                # All of them come before gyro 2's frame, which is 300 us after gyro 1's.
                at_us = stamp_us + (place + 1) * step_us // 4
                to.write(f"({at_us // 1_000_000}.{at_us % 1_000_000:06}) {bus} {identifier:03X}#"
                         f"{draw.randbytes(length).hex().upper()}\n")
    part.rename(path)
    return path


def measure(row, core, other_core, usage_file):
    """One run; wall time is from start to exit, and the `cat` that feeds a pipe runs on the other core. The kernel
    counts a process's memory from before its exec: /usr/bin/time is small, Python is not."""
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


def replay_rows(vgyro, long_log, short_log, car_log, out):
    replay = [vgyro, "replay", "--config", CONFIG]
    silent = [*replay, "-o", "/dev/null"]
    return [
        Row("`vgyro replay -o /dev/null`", [*silent, long_log], long_log, FRAMES_LONG),
        Row("the same, `--method mutual`", [*silent, "--method", "mutual", long_log], long_log, FRAMES_LONG),
        Row("`vgyro replay -o FILE` on tmpfs", [*replay, "-o", out, long_log], long_log, FRAMES_LONG),
        Row("a car's log, `-o /dev/null`", [*silent, car_log], car_log, FRAMES_LONG),
        Row("`cat LOG \\| vgyro replay -o /dev/null -`", [*silent, "-"], long_log, FRAMES_LONG, from_pipe=True),
        Row("the same, a tenth of the log", [*silent, "-"], short_log, FRAMES_SHORT, from_pipe=True),
    ]


def rows(bin_dir, former, long_log, short_log, car_log, out):
    ours = replay_rows(bin_dir / "vgyro", long_log, short_log, car_log, out)
    if former:
        for row, other in zip(ours, replay_rows(former, long_log, short_log, car_log, out), strict=True):
            row.former = other
    python_loop = [sys.executable, SOURCE / "bench/python_can_loop.py", short_log]
    found = [
        Row("`wc -l`", ["wc", "-l", long_log], long_log, FRAMES_LONG),
        Row("bare parsing (`vgyro_parse_log`)", [bin_dir / "vgyro_parse_log", long_log], long_log, FRAMES_LONG),
        *ours,
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
    print("| program | million frames/s | seconds | of these, CPU | of `wc -l` | peak memory, MB | former build : this one |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for row in measured:
        print(f"| {row.name} | {row.frames_per_s / 1e6:.3g} | {min(row.times_s):.3f} | {row.cpu_s:.2f} | "
              f"{row.frames_per_s / reference:.2g} | {row.rss_max_kb / 1024:.1f} | {gain(row)} |")
    print(f"\n¹ on {FRAMES_SHORT / 1e6:g} million frames, time of the loop alone.")


def gain(row):
    """Gain by the best times, wall and CPU."""
    if row.former is None:
        return ""
    return f"{min(row.former.times_s) / min(row.times_s):.2f} (CPU {row.former.cpu_s / max(row.cpu_s, 0.01):.2f})"


def cpu_name():
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=command_line.file_name, default=SOURCE / "build/release/bin", help="where the programs are")
    parser.add_argument("--former", type=command_line.file_name, help="another build's vgyro, to be measured beside this one")
    parser.add_argument("--cache", type=command_line.file_name, default=SOURCE / "build/bench", help="where the logs are kept")
    parser.add_argument("--rounds", type=command_line.whole(1, 1000), default=5)
    parser.add_argument("--core", type=command_line.whole(0, 4095), help="default: the last one")
    a = parser.parse_args()
    cores = sorted(os.sched_getaffinity(0))
    core = cores[-1] if a.core is None else a.core
    other_core = next((c for c in cores if c != core), core)

    long_log = make_log(a.cache / "long.log", FRAMES_LONG)
    short_log = make_log(a.cache / "short.log", FRAMES_SHORT)
    car_log = make_car_log(a.cache / "car.log", long_log)
    tmpfs = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="vgyro-", dir=tmpfs) as folder:
        measured = rows(a.bin, a.former, long_log, short_log, car_log, Path(folder) / "out.log")
        for log in (long_log, short_log, car_log):
            subprocess.run(["wc", "-l", log], check=True, stdout=subprocess.DEVNULL)  # into the page cache
        # Rounds over all rows, not row by row: a disturbance then leaves each row some undisturbed times.
        for number in range(a.rounds):
            for row in measured:
                print(f"round {number + 1} of {a.rounds}: {row.name}", file=sys.stderr)
                for one in filter(None, (row, row.former)):
                    measure(one, core, other_core, Path(folder) / "usage")
    print_table(measured, a.rounds, core)


if __name__ == "__main__":
    main()
