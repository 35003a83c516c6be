#!/usr/bin/python3
"""The paper's rows on the simulated twin: `mutual` and the plain mean, each compared with the errors expected from
the injected noise. Seeds are printed; the figures are not tuned."""

import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import paper  # noqa: E402

SEEDS = {"rest": (1, 2, 3, 4, 5), "turn": (1, 2)}
SIGMAS_MAX = 3.5


class PaperTable(unittest.TestCase):
    def check(self, run):
        errors = {"mean": [], "mutual": []}
        for seed in SEEDS[run]:
            for method, e in paper.measure(run, seed).items():
                expected = paper.expect(run, method)
                sigmas = (e.mean_dps - expected.mean_dps) / expected.sigma_dps
                print(
                    f"{run} seed {seed} {method}: mean error {e.mean_dps * paper.DPH:.3f} deg/h ({sigmas:+.2f} sigma), "
                    f"worst 10 s {e.worst_window_dps * paper.DPH:.2f} deg/h, angle {e.angle_deg:.4f} deg"
                )
                with self.subTest(seed=seed, method=method):
                    self.assertLessEqual(abs(sigmas), SIGMAS_MAX)
                errors[method].append(abs(e.mean_dps))
        return np.median(errors["mean"]) * paper.DPH, np.median(errors["mutual"]) * paper.DPH

    def test_at_rest_the_mean_is_46_deg_per_h_off_and_mutual_below_one(self):
        mean_dph, mutual_dph = self.check("rest")
        self.assertAlmostEqual(mean_dph, 46.08, delta=0.5)
        self.assertLess(mutual_dph, 1.0)

    def test_while_turning_mutual_is_as_good_as_its_calibration_extrapolated(self):
        mean_dph, mutual_dph = self.check("turn")
        self.assertAlmostEqual(mean_dph, 46.08, delta=1.0)
        self.assertLess(mutual_dph, 2.0 * paper.expect("turn", "mutual").sigma_dps * paper.DPH)


if __name__ == "__main__":
    unittest.main()
