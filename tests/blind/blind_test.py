#!/usr/bin/python3
"""A small blind set: the gap workflow names what the injector hid, and nothing else. bench/blind runs the
whole protocol."""

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
    Case("single", 309, "saturation", short=True),
    Case("single", 310, "scale_factor", reference=False, short=True),
    Case("pair", 311, short=True),
    Case("outside", 312, "chirp", short=True),
]


def examine(case):
    with tempfile.TemporaryDirectory(prefix="vgyro-blind-") as scratch:
        folder, out = Path(scratch) / "case", Path(scratch) / "out"
        answer = injector.make(case, folder, None)
        try:
            gap, seconds, _ = runner.gap(folder, out)
            fresh = runner.compare(folder, out / "model.toml", "fresh.log.xz", Path(scratch) / "fresh.json")
        except runner.Failed as trouble:
            return case, answer, None, str(trouble), 0.0
        return case, answer, judge.judge(answer, gap, fresh), gap, seconds


class Blind(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with multiprocessing.Pool(min(2, os.cpu_count())) as pool:
            cls.results = pool.map(examine, CASES, chunksize=1)

    def each(self):
        for case, answer, judged, gap, seconds in self.results:
            with self.subTest(case.name):
                if judged is None:
                    self.fail(gap)
                print(
                    f"{case.name}: {seconds:.1f} s, {[n[:2] for n in judged['named']]}, hidden {judged['truth']}"
                )
                yield case, answer, judged, gap

    def test_names_what_hides_and_nothing_else(self):
        for _, answer, judged, _ in self.each():
            self.assertEqual(judged["wrong"], [])
            self.assertEqual(judged["surplus"], 0)
            self.assertTrue(all(judged["found"]), f"hidden {judged['truth']}, named {judged['named']}")
            if answer["group"] == "clean":
                self.assertEqual(judged["verdict"], "no_gap")
            if answer["group"] == "outside":
                self.assertEqual(judged["verdict"], "unexplained")

    def test_parameters_lie_within_their_error(self):
        for _, _, judged, _ in self.each():
            for kind, name, error, sigma in judged["errors"]:
                self.assertLess(abs(error), SIGMAS_MAX * sigma, f"{kind}.{name}")

    def test_the_gap_closes_on_a_recording_never_seen(self):
        for _, answer, judged, _ in self.each():
            if answer["group"] in ("clean", "single", "pair"):
                self.assertTrue(judged["closed"], f"{judged['fresh_gap']} outside {judged['fresh_band']}")


if __name__ == "__main__":
    print(f"seeds {min(c.seed for c in CASES)} to {max(c.seed for c in CASES)}")
    unittest.main()
