#!/usr/bin/python3
"""Runs the real vgyrod on a real vcan, and compares the frames that it sent with `vgyro replay` of those that it received.
Runs natively if the host's kernel has vcan, otherwise inside User Mode Linux. Never skips: exits with 1 if a case fails or
nothing could run. A case that fails while the machine stalled is void and run again; see timekeeping.py."""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import cases  # noqa: E402
import ground  # noqa: E402
import timekeeping  # noqa: E402
import verdicts  # noqa: E402

# Time for booting, and for the delays of a busy host in each case.
SECONDS_MOST = 600
# Most runs of a case that fails while the machine stalls, which proves nothing.
RUNS_MOST = 5


def parse_arguments():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--on", choices=["auto", "native", "uml"], default="auto", help="default: native if possible")
    p.add_argument("--keep", metavar="DIR", help="keep captures and logs in this folder")
    p.add_argument("case", nargs="*", help="names of cases; default: all")
    return p.parse_args()


def chosen_cases(names):
    recordings = os.environ.get("VGYRO_RECORDINGS")
    everything = cases.all_cases(Path(recordings) if recordings else None)
    unknown = set(names) - {case.name for case in everything}
    if unknown:
        sys.exit(f"vcan: no case {', '.join(sorted(unknown))}; one of: {', '.join(c.name for c in everything)}")
    return [case for case in everything if not names or case.name in names]


def check_programs():
    for program in ("ip", "tc", "candump", "canplayer"):
        if shutil.which(program, path=os.environ["PATH"] + ":/usr/sbin:/sbin") is None:
            sys.exit(f"vcan: nothing could run: no `{program}` (`apt install iproute2 can-utils`)")
    for program in ("vgyrod", "vgyro", "vcan_socket_probe", "vcan_bus_probe"):
        if not (cases.BIN / program).exists():
            sys.exit(f"vcan: nothing could run: {cases.BIN / program} is not built")


def run(folder, selected, where):
    """The cases that failed, and those that a stall made void."""
    folder.mkdir(parents=True, exist_ok=True)
    plan = []
    for case in selected:
        case_folder = folder / case.name
        case_folder.mkdir(parents=True)
        plan.append({"name": case.name, **case.prepare(case_folder)})
    (folder / "plan.json").write_text(json.dumps({"cases": plan}), encoding="utf-8")
    begin = time.monotonic()
    try:
        code = where.run(folder, SECONDS_MOST)
    except subprocess.TimeoutExpired:
        code = f"still running after {SECONDS_MOST} s"
    if code != 0:
        guest = folder / "guest.txt"
        print(f"vcan: the guest failed ({code})\n{guest.read_text() if guest.exists() else ''}")
    print(f"vcan: ran for {time.monotonic() - begin:.0f} s {where.name}")

    failed, void = [], []
    for case, orders in zip(selected, plan):
        passed, stall_us, text = cases.judge(case, folder / case.name, orders)
        spoilt = not passed and stall_us > timekeeping.STALL_MOST_US
        if not passed:
            (void if spoilt else failed).append(case)
        stood = f"\n        the machine stood still for up to {stall_us / 1000:.0f} ms" if stall_us > 0 else ""
        print(f"  {'pass' if passed else 'void' if spoilt else 'FAIL'}  {case.name}: {case.says}\n        {text}{stood}")
    return failed, void


def main():
    arguments = parse_arguments()
    check_programs()
    verdicts.check_own_vectors()
    selected = chosen_cases(arguments.case)
    where = ground.choose(arguments.on)
    if "car" not in {case.name for case in selected} and not arguments.case:
        print("vcan: no recordings of real cars (VGYRO_RECORDINGS is not set to a folder with car_rav4)")
    failed, void, voids = [], selected, 0
    with tempfile.TemporaryDirectory(prefix="vgyro-vcan-") as scratch:
        folder = Path(arguments.keep or scratch).resolve()
        for attempt in range(1, RUNS_MOST + 1):
            found, void = run(folder / f"run-{attempt}", void, where)
            failed += found
            voids += len(void)
            if not void:
                break
            print(f"vcan: void, for the machine stood still: {', '.join(case.name for case in void)}")
    note = f", beside {voids} void run{'s' * (voids > 1)} of a case while the machine stood still" if voids else ""
    if void:
        print(f"vcan: the machine never kept time in {RUNS_MOST} runs: {', '.join(case.name for case in void)}")
    if failed or void:
        print(f"vcan: {len(failed) + len(void)} of {len(selected)} cases FAILED {where.name}{note}")
        return 1
    print(f"vcan: {len(selected)} cases passed {where.name}{note}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
