#!/usr/bin/python3
"""Speed of reading logs of several forms, without use of their frames, compared with python-can's readers of the
same files; all in one run, pinned to one core. The log is throughput.py's. Prints Markdown. Needs Debian's package
python3-can."""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import can

import command_line
import throughput

ENDINGS = (".log", ".asc", ".blf")


def our_seconds(program, log, core):
    printed = subprocess.run(["taskset", "-c", str(core), program, log], capture_output=True, text=True, check=True).stdout
    frames, seconds = int(printed.split()[0]), float(printed.split()[-2])
    return frames, seconds


def python_can_seconds(log):
    begin = time.perf_counter()
    with can.LogReader(str(log)) as reader:
        frames = sum(1 for _ in reader)
    return frames, time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=command_line.file_name, default=throughput.SOURCE / "build/release/bin", help="where the programs are")
    parser.add_argument("--cache", type=command_line.file_name, default=throughput.SOURCE / "build/bench", help="where the logs are kept")
    parser.add_argument("--rounds", type=command_line.whole(1, 1000), default=5)
    a = parser.parse_args()
    core = sorted(os.sched_getaffinity(0))[-1]
    os.sched_setaffinity(0, {core})
    plain = throughput.make_log(a.cache / "short.log", throughput.FRAMES_SHORT)
    print(f"{throughput.FRAMES_SHORT / 1e6:g} million frames, best of {a.rounds}, pinned to one core, {throughput.cpu_name()}.\n")
    print("| form | MB | vgyro, million frames/s | python-can, million frames/s | times as fast |")
    print("|---|---:|---:|---:|---:|")
    for ending in ENDINGS:
        log = plain.with_suffix(ending)
        if log != plain:
            subprocess.run([a.bin / "vgyro", "convert", "-q", "-o", log, plain], check=True)
        ours = [our_seconds(a.bin / "vgyro_read_log", log, core) for _ in range(a.rounds)]
        theirs = [python_can_seconds(log) for _ in range(min(a.rounds, 2))]
        if {frames for frames, _ in ours + theirs} != {throughput.FRAMES_SHORT}:
            sys.exit(f"{log}: not all frames were read: {ours} {theirs}")
        speed, their_speed = (throughput.FRAMES_SHORT / min(seconds for _, seconds in runs) / 1e6 for runs in (ours, theirs))
        print(f"| `{ending}` | {log.stat().st_size / 1e6:.1f} | {speed:.3g} | {their_speed:.3g} | {speed / their_speed:.0f} |")


if __name__ == "__main__":
    main()
