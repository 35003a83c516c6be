#!/usr/bin/python3
"""Prints the paper's table as measured on the simulated twin: `vgyro replay` with `mutual` and with `mean`, over
several seeds."""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/twin"))
import command_line  # noqa: E402
import paper  # noqa: E402

QUANTITIES = (
    ("error of the mean rate, deg/h", lambda e, run: abs(e.mean_dps) * paper.DPH, "{:.3f}"),
    ("worst 10-s window, deg/h", lambda e, run: e.worst_window_dps * paper.DPH, "{:.2f}"),
    ("error of the angle, deg", lambda e, run: abs(e.angle_deg), "{:.4f}"),
)
PAPER = {
    ("rest", 0): ("46", "0.576"), ("rest", 1): ("", "below 1"), ("rest", 2): ("", "0.02"),
    ("turn", 0): ("87", "4.3"), ("turn", 1): ("", ""), ("turn", 2): ("", "0.0185"),
}
RUN_NAMES = {"rest": "rest, 120 s", "turn": "50 deg/s, 900 s"}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=command_line.whole(1, 10_000), default=10, help="seeds 1 … this (default %(default)s)")
    count = parser.parse_args().seeds

    print(f"Medians over seeds 1 … {count} (in brackets: the worst seed). 1 σ: expected error of `mutual` from the twin's noise.\n")
    print("| run | magnitude of | plain mean | virtual gyro, `mutual` | 1 σ | paper: mean | paper: virtual |")
    print("|---|---|---|---|---|---|---|")
    for run in paper.RUNS:
        measured = [paper.measure(run, seed) for seed in range(1, count + 1)]
        sigma_dps = paper.expect(run, "mutual").sigma_dps
        sigmas = (f"{sigma_dps * paper.DPH:.2f}", "", f"{sigma_dps * paper.RUNS[run]:.3f}")
        for q, (name, value, form) in enumerate(QUANTITIES):
            cells = []
            for method in ("mean", "mutual"):
                values = [value(m[method], run) for m in measured]
                cells.append(f"{form.format(np.median(values))} ({form.format(max(values))})")
            print(f"| {RUN_NAMES[run]} | {name} | {' | '.join(cells)} | {sigmas[q]} | {' | '.join(PAPER[run, q])} |")


if __name__ == "__main__":
    main()
