#!/usr/bin/python3
"""Tests the regression that judges names on real recordings, with known truth: it agrees with hidden effects,
contradicts absent ones, and reports when it cannot tell."""

import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "bench")]
import injector  # noqa: E402
import real_regression  # noqa: E402
from cases import Case  # noqa: E402


class Judged(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="vgyro-regression-")
        cls.made = {}
        for kind in ("scale_factor", "temperature_bias", "delay", "quantization"):
            for reference in (True, False):
                folder = Path(cls.scratch.name) / f"{kind}-{reference}"
                case = Case("single", 601, kind, reference=reference, short=True)
                answer = injector.make(case, folder, None, ("measured",))
                recording = real_regression.Recording(folder)
                cells = {gyro: real_regression.Cells(recording, gyro) for gyro in (1, 2)}
                cls.made[kind, reference] = answer["effects"][0], recording, cells

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def judge(self, effect, of):
        _, recording, cells = self.made[of]
        return real_regression.judge({"sigma": {}, **effect}, recording, cells)

    def test_agrees_with_what_is_there(self):
        words = {of: self.judge(hidden, of) for of, (hidden, _, _) in self.made.items()}
        self.assertNotIn("contradicts", [word for word, _ in words.values()], words)
        # With the drift of both gyros, four minutes are short for a regression that does not model drift.
        self.assertGreaterEqual([word for word, _ in words.values()].count("agrees"), len(words) - 1, words)

    def test_sizes_are_the_true_ones(self):
        for kind, name, delta in (("scale_factor", "error", 3e-4), ("delay", "seconds", 3e-4)):
            for reference in (True, False):
                hidden, _, cells = self.made[kind, reference]
                size = real_regression.looked_at(kind, hidden["parameters"], cells[hidden["gyro"]])[0]
                self.assertAlmostEqual(size, hidden["parameters"][name], delta=delta, msg=f"{kind} {reference}")

    def test_contradicts_what_is_not_there(self):
        for of, (hidden, _, _) in self.made.items():
            for kind, parameters in (
                ("scale_factor", {"error": 0.02}),
                ("temperature_bias", {"coefficient_dps_k": -0.02, "reference_c": 25.0}),
                ("delay", {"seconds": -0.03}),
            ):
                if kind != hidden["kind"]:
                    wrong = {"kind": kind, "gyro": hidden["gyro"], "parameters": parameters}
                    self.assertEqual(self.judge(wrong, of)[0], "contradicts", (of, kind, self.judge(wrong, of)))

    def test_cannot_tell_what_is_smaller_than_its_errors(self):
        small = {"kind": "scale_factor_cubic", "gyro": 1, "parameters": {"coefficient_per_dps2": 1e-13}}
        self.assertEqual(self.judge(small, ("temperature_bias", True))[0], "cannot tell")

    def test_the_value_of_a_frame_is_the_one_that_was_sent(self):
        hidden, recording, _ = self.made["quantization", True]
        step, share = real_regression.steps_between(recording.gyros[hidden["gyro"] - 1][1])
        self.assertAlmostEqual(step, hidden["parameters"]["step_dps"], delta=1e-6)
        self.assertGreater(share, 0.99)


if __name__ == "__main__":
    unittest.main()
