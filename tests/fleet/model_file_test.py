#!/usr/bin/python3
"""Uses each model file that `vgyro fleet` writes: `vgyro check` accepts it, and with it the heading of `vgyro replay` over a
simulated drive is nearer to the truth than without it. The simulation shares no code with the product."""

import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

import made_fleet
from made_fleet import Unit

ROOT = Path(os.environ["VGYRO_SOURCE"])
sys.path.insert(0, str(ROOT / "tests" / "cli"))
import gap_test  # noqa: E402  its DBC file and its gyros
from bench import stamp  # noqa: E402

VGYRO = Path(os.environ["VGYRO_BIN"]).resolve() / "vgyro"
SEED = 20261201
HZ, SECONDS, REST_S = 50.0, 240.0, 60.0
TURN_DPS = 30.0
WHITE_DPS_RTHZ = (2e-4, 4e-4)
BEGIN_US = 1_700_000_000_000_000
# Scale factors of the simulated types, and of the unit that is not as its type.
ALPHA, ODD, BETA = 4e-3, 7e-3, -3e-3


def turned_deg(t):
    """After the rest, the rate pulses in one direction, so that scale factors show in the heading."""
    since = np.maximum(t - REST_S, 0.0)
    pulse_s = 30.0
    return TURN_DPS * 0.5 * (since - pulse_s / (2 * np.pi) * np.sin(2 * np.pi * since / pulse_s))


def rate_dps(t):
    since = np.maximum(t - REST_S, 0.0)
    return TURN_DPS * 0.5 * (1.0 - np.cos(2 * np.pi * since / 30.0))


def recording(scale_errors, rng):
    t = np.arange(round(SECONDS * HZ)) / HZ
    frames = []
    for number, (error, density) in enumerate(zip(scale_errors, WHITE_DPS_RTHZ)):
        offset_us = 3100 * number
        rate = 0.02 + (1.0 + error) * rate_dps(t + offset_us * 1e-6) + density * np.sqrt(HZ) * rng.standard_normal(t.size)
        frames += [(BEGIN_US + round(s * 1e6) + offset_us, f"can{number}", 0x101 + number, struct.pack("<ihBB", round(r * 1e6), 0, i % 256, 0))
                   for i, (s, r) in enumerate(zip(t, rate))]
    frames.sort(key=lambda frame: frame[0])
    return "".join(f"{stamp(us)} {bus} {can_id:03X}#{data.hex().upper()}\n" for us, bus, can_id, data in frames)


class ModelFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.scratch.cleanup)
        cls.folder = Path(cls.scratch.name)
        (cls.folder / "bench.dbc").write_text(gap_test.DBC)
        (cls.folder / "vgyro.toml").write_text(gap_test.GYROS.replace("0.0032", "0.0"))
        rng = np.random.default_rng(SEED)
        pairs = [(Unit(rng, "alpha", f"a{i}", effects={"scale_factor": ALPHA}), Unit(rng, "beta", f"b{i}", effects={"scale_factor": BETA}))
                 for i in range(12)]
        pairs[5] = (Unit(rng, "alpha", "odd", effects={"scale_factor": ODD}), pairs[5][1])
        (cls.folder / "drives.json").write_text("".join(made_fleet.lines(rng, pairs, 240)))
        cls.run_vgyro("fleet", "drives.json", "--out", "fleet", "-q")
        cls.fleet = json.loads((cls.folder / "fleet" / "fleet.json").read_text())

    @classmethod
    def run_vgyro(cls, *words):
        done = subprocess.run([VGYRO, *words], cwd=cls.folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise AssertionError(f"{words}: {done.stderr}")
        return done.stdout

    def heading_error_deg(self, log, model=None):
        """Heading error at the end of the drive, from the integral of the sent rates."""
        options = ["--model", f"fleet/models/{model}.toml"] if model else []
        self.run_vgyro("check", "vgyro.toml", *options)
        self.run_vgyro("replay", "-q", "--config", "vgyro.toml", *options, "-o", "sent.log", "--csv", "rates.csv", log)
        table = np.genfromtxt(self.folder / "rates.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
        t = table["t_s"] - BEGIN_US * 1e-6
        rate = table["rate_dps"]
        since = (t > REST_S - 1.0) & np.isfinite(rate)
        told = np.sum(0.5 * (rate[since][1:] + rate[since][:-1]) * np.diff(t[since]))
        true = turned_deg(t[since][-1]) - turned_deg(t[since][0])
        return abs(told - true)

    def test_are_those_of_the_types_the_pair_and_the_odd_unit(self):
        self.assertEqual(sorted(path.name for path in (self.folder / "fleet" / "models").iterdir()),
                         ["alpha+beta.toml", "alpha-odd.toml", "alpha.toml", "beta.toml"])
        self.assertEqual([unit["unit"] for unit in self.fleet["units"] if unit["why"]], ["odd"])

    def test_make_the_heading_better_in_the_vehicles_that_they_are_for(self):
        rng = np.random.default_rng(SEED + 1)
        turned = turned_deg(SECONDS)
        # Errors of the vehicle's gyros, the model file, and the greatest share of the heading error that it may leave:
        # sizes have a σ of some parts in a thousand.
        for errors, model, most in (((ALPHA, BETA), "alpha+beta", 0.02), ((ALPHA, 0.0), "alpha", 0.02), ((0.0, BETA), "beta", 0.02),
                                    ((ODD, 0.0), "alpha-odd", 0.02)):
            (self.folder / "drive.log").write_text(recording(errors, rng))
            without = self.heading_error_deg("drive.log")
            with_it = self.heading_error_deg("drive.log", model)
            print(f"{model}: heading off by {without:.3f} deg of {turned:.0f} without the file, {with_it:.3f} deg with it")
            self.assertLess(with_it, most * without, model)

    def test_of_the_type_are_worse_for_the_odd_unit_than_its_own(self):
        rng = np.random.default_rng(SEED + 2)
        (self.folder / "drive.log").write_text(recording((ODD, 0.0), rng))
        self.assertLess(self.heading_error_deg("drive.log", "alpha-odd"), 0.2 * self.heading_error_deg("drive.log", "alpha"))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
