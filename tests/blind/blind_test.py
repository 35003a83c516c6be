#!/usr/bin/python3
"""A small blind set: the gap workflow names the effects that the injector hid, and nothing else.
bench/blind runs the whole protocol."""

import multiprocessing
import os
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import injector  # noqa: E402
import judge  # noqa: E402
import runner  # noqa: E402
from cases import Case  # noqa: E402

SIGMAS_MAX = 4.0

CASES = [
    Case("clean", 301, short=True),
    Case("clean", 302, reference=False, short=True),
    Case("single", 303, "scale_factor", short=True),
    Case("single", 304, "temperature_bias", short=True),
    Case("single", 305, "bias_step", 20.0, short=True),
    Case("single", 306, "angle_harmonic", 20.0, short=True),
    Case("single", 307, "line", short=True),
    Case("single", 308, "delay", short=True),
    Case("single", 309, "dropped_frames", short=True),
    Case("single", 310, "scale_factor", reference=False, short=True),
    Case("single", 316, "supply_voltage_bias", short=True),
    Case("single", 317, "run_in", short=True),
    Case("single", 318, "temperature_hysteresis", short=True),
    Case("single", 319, "cross_axis", short=True),
    Case("single", 320, "bias_instability", 20.0, short=True),
    Case("pair", 315, short=True),
    Case("outside", 312, "loud_minute", short=True),
]
# Drives of four minutes each. DRIVES_REACHED is true if the workflow solves them.
DRIVES_REACHED = True
DRIVES = [
    Case("clean", 334, reference=False, short=True, world="drive"),
    Case("single", 328, "temperature_bias", 20.0, reference=False, short=True, world="drive"),
    Case("single", 329, "scale_factor", 20.0, short=True, world="drive"),
]


def examine(case):
    with tempfile.TemporaryDirectory(prefix="vgyro-blind-") as scratch:
        folder, out = Path(scratch) / "case", Path(scratch) / "out"
        answer = injector.make(case, folder, None)
        try:
            gap, _, _ = runner.gap(folder, out)
            fresh = runner.compare(folder, out / "model.toml", "fresh.log.xz", Path(scratch) / "fresh.json")
        except runner.Failed as trouble:
            return case, answer, None, str(trouble)
        return case, answer, judge.judge(answer, gap, fresh), None


class Judged:
    """The requirements on a set of cases, which are run once."""

    cases = []

    @classmethod
    def setUpClass(cls):
        with multiprocessing.Pool(min(2, os.cpu_count())) as pool:
            cls.results = pool.map(examine, cls.cases, chunksize=1)

    def each(self, check):
        """Calls check(answer, judged) for every case; a failure does not hide the others."""
        for case, answer, judged, trouble in self.results:
            with self.subTest(case.name):
                self.assertIsNotNone(judged, trouble)
                check(answer, judged)

    def test_names_what_hides_and_nothing_else(self):
        def check(answer, judged):
            self.assertEqual(judged["wrong"], [])
            self.assertEqual(judged["surplus"], 0)
            self.assertTrue(all(judged["found"]), f"hidden {judged['truth']}, named {judged['named']}")
            if answer["group"] == "clean":
                self.assertEqual(judged["verdict"], "no_gap")
            if answer["group"] == "outside":
                self.assertEqual(judged["verdict"], "unexplained")

        self.each(check)

    def test_parameters_lie_within_their_error(self):
        def check(_, judged):
            for kind, name, error, sigma in judged["errors"]:
                self.assertLess(abs(error), SIGMAS_MAX * sigma, f"{kind}.{name}")

        self.each(check)

    def test_the_gap_closes_on_a_recording_never_seen(self):
        def check(answer, judged):
            if answer["group"] != "outside" and not judged["unapplied"]:
                self.assertTrue(judged["closed"], f"{judged['fresh_gap']} outside {judged['fresh_band']}")

        self.each(check)


class Blind(Judged, unittest.TestCase):
    cases = CASES


@unittest.skipUnless(DRIVES_REACHED, "drives: switched off by DRIVES_REACHED")
class Drives(Judged, unittest.TestCase):
    cases = DRIVES


if __name__ == "__main__":
    print(f"seeds {min(c.seed for c in CASES)} to {max(c.seed for c in CASES)}")
    unittest.main()
