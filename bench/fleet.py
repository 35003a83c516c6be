#!/usr/bin/python3
"""What a fleet costs: `vgyro gap` a drive, `vgyro fleet` over many drives and over many units, and `vgyro-fleet` with two
workers against one. With --before FOLDER the former `vgyro` in it merges the same evidence in turns with this one, and must
write the same merged bytes. Fleets are drawn from statistics as in tests/fleet/made_fleet.py. Prints Markdown."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import command_line

SOURCE = Path(__file__).resolve().parents[1]
TOOL = SOURCE / "cli" / "fleet" / "vgyro-fleet"
SEED = 20261130
# Name, drives, units of both types together, and whether --quick has it.
FLEETS = (("100 000 drives of 400 units", 100_000, 400, True),
          ("100 000 drives of 4000 units", 100_000, 4_000, True),
          ("100 000 drives of 40 000 units, 20 000 of a type", 100_000, 40_000, False),
          ("1 000 000 drives of 4000 units", 1_000_000, 4_000, False))
# The former program compares each unit with all others.
BEFORE_MOST_S = 900.0
TARGETS = "Targets: 100 000 drives within 10 s and 500 MB on two cores, two workers at least 1.8 times as fast as one on an idle machine."


def load():
    return "load " + ", ".join(f"{value:.1f}" for value in os.getloadavg())


class Cost:
    """Of a process: wall time, CPU, peak memory."""

    def __init__(self, command, folder, limit_s=None):
        # A process of its own counts the memory: that of a child of Python begins with Python's.
        with tempfile.NamedTemporaryFile("r", dir=folder) as told:
            done = subprocess.run(["/usr/bin/time", "-f", "%e %U %S %M", "-o", told.name, *map(str, command)], cwd=folder,
                                  stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=limit_s, check=False)
            if done.returncode != 0:
                raise RuntimeError(f"{command[0]} failed: {done.stderr.strip()}")
            wall, user, system, peak_kb = told.read().split()
        self.wall_s, self.cpu_s, self.peak_mb = float(wall), float(user) + float(system), float(peak_kb) / 1024.0


def least(costs):
    """The least disturbed of several runs."""
    return min(costs, key=lambda cost: cost.wall_s)


# --- drives --------------------------------------------------------------------------------------


def make_recordings(folder, count):
    """Of tests/cli/gap_test.py: 90 s at 50 Hz with a reference."""
    sys.path.insert(0, str(SOURCE / "tests" / "cli"))
    import gap_test
    (folder / "logs").mkdir()
    (folder / "bench.dbc").write_text(gap_test.DBC)
    (folder / "vgyro.toml").write_text(gap_test.GYROS + gap_test.REFERENCE)
    (folder / "model.toml").write_text(gap_test.MODEL)
    for number in range(count):
        gap_test.SEED = SEED + number
        (folder / "logs" / f"drive{number:04}.log").write_text(gap_test.recording())
    return sorted((folder / "logs").iterdir())


def gap_row(name, vgyro, folder, config, model, logs):
    costs, sizes = [], []
    for number, log in enumerate(logs):
        evidence, out = folder / f"{number}.json", folder / f"gap{number}"
        costs.append(Cost([vgyro, "gap", "-q", "--config", config, "--measured", log, "--out", out, "--evidence", evidence, *model], folder))
        sizes.append(evidence.stat().st_size)
        shutil.rmtree(out)
    cpu_s = sum(cost.cpu_s for cost in costs) / len(costs)
    print(f"| {name} | {cpu_s:.2f} | {3600.0 / cpu_s:,.0f} | {max(cost.peak_mb for cost in costs):.0f} | "
          f"{sum(sizes) / len(sizes) / 1000.0:.1f} |", flush=True)


def drives(vgyro, folder, logs):
    print(f"\n### A drive\n\n`vgyro gap --evidence`, {load()}:\n")
    print("| recording | CPU, s | drives a core-hour | peak memory, MB | evidence, kB |\n|---|---:|---:|---:|---:|")
    gap_row("90 s at 50 Hz with a reference", vgyro, folder, folder / "vgyro.toml", ["--model", folder / "model.toml"], logs[:8])
    gap_row("`examples/twin.log.xz`, 150 s at 500 Hz, no reference", vgyro, folder, SOURCE / "examples" / "twin.toml", [],
            3 * [SOURCE / "examples" / "twin.log.xz"])


def bare_loops(vgyro, folder, logs, loops):
    """Shells that run `vgyro gap` over the same drives: what this machine gives at best."""
    script = ('for log in "$@"; do "$VGYRO" gap -q --config vgyro.toml --model model.toml --measured "$log" --out "$OUT" '
              '--evidence "$OUT.json" || exit 1; rm -r "$OUT"; done')
    begin = time.monotonic()
    running = []
    for loop in range(loops):
        environment = {**os.environ, "VGYRO": str(vgyro), "OUT": str(folder / f"loop{loop}")}
        running.append(subprocess.Popen(["sh", "-c", script, "sh", *map(str, logs[loop::loops])], cwd=folder, env=environment,
                                        stdout=subprocess.DEVNULL))
    if any(one.wait() != 0 for one in running):
        raise RuntimeError("vgyro gap failed")
    return time.monotonic() - begin


def workers(vgyro, folder, logs, rounds):
    taken = {"`vgyro-fleet`": {1: [], 2: []}, "bare loops of a shell": {1: [], 2: []}}
    before = load()
    for _ in range(rounds):
        for count in (1, 2):
            cost = Cost([TOOL, "--vgyro", vgyro, "--config", "vgyro.toml", "--model", "model.toml", "--workers", count, "--out", "out",
                         "logs"], folder)
            shutil.rmtree(folder / "out")
            taken["`vgyro-fleet`"][count].append(cost.wall_s)
            taken["bare loops of a shell"][count].append(bare_loops(vgyro, folder, logs, count))
    print(f"\n### Two workers\n\n{len(logs)} drives of 90 s at 50 Hz, best of {rounds}, {before} before and {load()} after:\n")
    print("| by | one, s | two, s | times as fast |\n|---|---:|---:|---:|")
    for name, wall_s in taken.items():
        one, two = min(wall_s[1]), min(wall_s[2])
        print(f"| {name} | {one:.1f} | {two:.1f} | {one / two:.2f} |", flush=True)


# --- merging -------------------------------------------------------------------------------------


def made_evidence(drive_count, unit_count):
    """Cached: the same name always holds the same lines."""
    path = SOURCE / "build" / "bench" / f"fleet-{drive_count}-{unit_count}.json"
    if path.exists():
        return path
    print(f"making {path.name} …", file=sys.stderr)
    sys.path.insert(0, str(SOURCE / "tests" / "fleet"))
    import numpy
    from made_fleet import QuickDrives, Unit
    path.parent.mkdir(parents=True, exist_ok=True)
    rng = numpy.random.default_rng([SEED, drive_count, unit_count])
    pairs = [(Unit(rng, "alpha", f"a{i}", effects={"scale_factor": 4e-6}), Unit(rng, "beta", f"b{i}")) for i in range(unit_count // 2)]
    lines = QuickDrives(rng)
    part = path.with_suffix(".part")
    with part.open("w", encoding="ascii") as file:
        for number in range(drive_count):
            file.write(lines.line(number, pairs[number % len(pairs)]))
    part.replace(path)
    return path


def merge(vgyro, evidence, out, limit_s=None):
    return Cost([vgyro, "fleet", "-q", evidence, "--out", out], out.parent, limit_s)


def merge_row(name, evidence, drive_count, vgyro, before, folder, rounds):
    now, former, too_long = [], [], False
    for _ in range(rounds):
        now.append(merge(vgyro, evidence, folder / "now"))
        if before and not too_long:
            try:
                former.append(merge(before, evidence, folder / "before", BEFORE_MOST_S))
                same = (folder / "now" / "evidence.json").read_bytes() == (folder / "before" / "evidence.json").read_bytes()
                if not same:
                    raise RuntimeError(f"{name}: the former program merges to other bytes")
            except subprocess.TimeoutExpired:
                too_long = True
    merged = folder / "now" / "evidence.json"
    again = merge(vgyro, merged, folder / "again")
    best = least(now)
    cells = [name, f"{evidence.stat().st_size / drive_count / 1000.0:.1f}", f"{best.wall_s:.1f}", f"{best.cpu_s:.1f}", f"{best.peak_mb:.0f}",
             f"{merged.stat().st_size / 1e6:.1f}", f"{again.wall_s:.2f}"]
    if before:
        cells += [f"above {BEFORE_MOST_S:.0f}", "", ""] if too_long else [
            f"{least(former).wall_s:.1f}", f"{least(former).wall_s / best.wall_s:.1f}", f"{least(former).cpu_s / best.cpu_s:.1f}"]
    print("| " + " | ".join(cells) + " |", flush=True)
    for result in ("now", "before", "again"):
        shutil.rmtree(folder / result, ignore_errors=True)


def merges(options, vgyro, before, folder):
    print(f"\n### Merging\n\n`vgyro fleet`, best of {options.rounds}, reading, judging and writing counted, {load()}:\n")
    more = " former, wall, s | times as fast | CPU, former : this |" if before else ""
    print(f"| fleet | kB a drive | wall, s | CPU, s | peak memory, MB | merged file, MB | reading that, s |{more}")
    print("|---|---:|---:|---:|---:|---:|---:|" + ("---:|---:|---:|" if before else ""))
    for name, drive_count, unit_count, is_quick in FLEETS:
        if is_quick or not options.quick:
            merge_row(name, made_evidence(drive_count, unit_count), drive_count, vgyro, before, folder, options.rounds)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=command_line.file_name, default=SOURCE / "build" / "release", help="default: build/release")
    parser.add_argument("--before", type=command_line.file_name, metavar="FOLDER", help="build folder of the former program, with bin/vgyro")
    parser.add_argument("--rounds", type=command_line.whole(1, 100), default=3)
    parser.add_argument("--drives", type=command_line.whole(2, 10_000), default=60, help="recordings for the workers; default %(default)s")
    parser.add_argument("--quick", action="store_true", help="without 40 000 units and a million drives, which need 3 GB of disk")
    options = parser.parse_args()
    vgyro = options.build / "bin" / "vgyro"
    before = options.before / "bin" / "vgyro" if options.before else None
    for program in (vgyro, before):
        if program and not program.exists():
            parser.error(f"{program} is not there; build it first")
    os.environ.update(VGYRO_BIN=str(vgyro.parent), VGYRO_SOURCE=str(SOURCE))
    with tempfile.TemporaryDirectory(prefix="vgyro-fleet-") as scratch:
        folder = Path(scratch)
        logs = make_recordings(folder, options.drives)
        print(f"{os.cpu_count()} cores. {TARGETS}")
        drives(vgyro, folder, logs)
        workers(vgyro, folder, logs, options.rounds)
        merges(options, vgyro, before, folder)


if __name__ == "__main__":
    main()
