#!/usr/bin/python3
"""`vgyro replay --method optimal` on short simulated drives: its errors in units of those that the injected noise
allows the best possible filter. bench/accuracy measures the same at length. Seeds are printed."""

import dataclasses
import functools
import math
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402
from judge import expectation, motion, rivals, score  # noqa: E402
from judge import pair as gyro_pair  # noqa: E402

SEEDS = (1, 2, 3)
# Mean square of this many standard normal numbers that chance exceeds once in a thousand.
LUCK = {3: 5.42, 6: 3.74, 24: 2.13}
# rms distance from the bound's heading, in its σ: an independent error of that size adds 5 % and 25 %; the margin
# allows for three seeds.
APART = {mode: math.sqrt((limit**2 - 1.0) * LUCK[len(SEEDS)]) for mode, limit in (("given", 1.05), ("estimated", 1.25))}
# At rest the bound's heading contains only what it has not learned in the last seconds, some thousandths of a degree;
# the product learns in steps of seconds and is that much behind.
BEHIND_AT_REST = 1.5
STEP_SIGMAS = 3.0
STEP_MEAN_S = 2.0

DROPOUT = dataclasses.replace(motion.SCENARIOS["dropout"], stops=False, gone_s=(((100.0, 160.0),), ((220.0, 280.0),)))


@functools.lru_cache(maxsize=1)
def recorded(pair, scenario, run_s, seed):
    recording = gyro_pair.simulate(pair, scenario, run_s, seed)
    return recording, recording.log()


def bias_sigma_dps(frames, t_s):
    model = frames.with_id(canlog.MODEL_ID)
    at_s = (model.stamps_us - gyro_pair.START_US) * 1e-6
    return np.interp(t_s, at_s, canlog.intel(model.payloads, 40, 12) * score.BIAS_SIGMA_STEP_DPS)


class Judge(unittest.TestCase):
    """Tests of the judge itself."""

    def test_the_bounds_heading_errors_are_as_large_as_its_covariance_says(self):
        for name, scenario, run_s in (("mems", motion.SCENARIOS["stops"], 600.0), ("fog_mems", DROPOUT, 300.0)):
            pair, squares = gyro_pair.PAIRS[name], []
            for seed in range(1, 25):
                recording = gyro_pair.simulate(pair, scenario, run_s, seed)
                judged = score.judge_rivals(recording, pair, horizons_s=(run_s,))
                sigma = expectation.heading_sigmas_deg(pair.gyros, recording.motion, (run_s,))[run_s]
                squares.append((judged["bound"]["heading_deg"][run_s] / sigma) ** 2)
            print(f"{name} {scenario.name}, seeds 1 … 24: (heading/σ)² {np.mean(squares):.2f}")
            self.assertLess(np.mean(squares), LUCK[24])
            self.assertGreater(np.mean(squares), 0.33)


class Accuracy(unittest.TestCase):
    def judged(self, pair_name, scenario, run_s, mode, seed):
        pair = gyro_pair.PAIRS[pair_name]
        recording, log = recorded(pair, scenario, run_s, seed)
        frames = score.replay(recording, log, pair, "optimal", mode)
        return pair, recording, frames

    def check_heading_and_sigma(self, pair_name, scenario_name, run_s):
        apart, error2 = {mode: [] for mode in score.MODES}, {mode: [] for mode in score.MODES}
        for seed in SEEDS:
            for mode in score.MODES:
                pair, recording, frames = self.judged(pair_name, motion.SCENARIOS[scenario_name], run_s, mode, seed)
                own = score.judge_product(recording, pair, frames, horizons_s=(run_s,))
                bound = score.judge_rivals(recording, pair, horizons_s=(run_s,))["bound"]
                sigma = expectation.heading_sigmas_deg(pair.gyros, recording.motion, (run_s,))[run_s]
                headings = own["heading_deg"][run_s], bound["heading_deg"][run_s]
                apart[mode].append((headings[0] - headings[1]) / sigma)
                error2[mode].append(own["error2"])
                print(f"{pair_name} {scenario_name} seed {seed} {mode}: heading {headings[0]:+.4f} deg, bound "
                      f"{headings[1]:+.4f}, its σ {sigma:.4f}; error² {own['error2']:.2f}")
        for mode in score.MODES:
            with self.subTest(pair=pair_name, scenario=scenario_name, mode=mode):
                allowed = APART[mode] * (BEHIND_AT_REST if scenario_name == "rest" else 1.0)
                self.assertLess(math.sqrt(np.mean(np.square(apart[mode]))), allowed)
                self.assertGreater(np.mean(error2[mode]), 0.8)
                self.assertLess(np.mean(error2[mode]), 1.2)

    def test_at_rest_the_heading_follows_the_bound(self):
        self.check_heading_and_sigma("k10", "rest", 300.0)

    def test_with_stops_the_heading_follows_the_bound(self):
        self.check_heading_and_sigma("fog_mems", "stops", 900.0)
        self.check_heading_and_sigma("mems", "stops", 600.0)

    def test_a_gyro_goes_and_returns_without_a_step(self):
        for seed in SEEDS:
            for mode in score.MODES:
                pair, recording, frames = self.judged("mems", DROPOUT, 320.0, mode, seed)
                with self.subTest(seed=seed, mode=mode):
                    self.check_steps(pair, recording, frames, f"seed {seed} {mode}")

    def check_steps(self, pair, recording, frames, name):
        """Means of the rate's error just before and just after, against white noise and the bias's σ."""
        rate = canlog.virtual_rate(frames)
        t = score.instants_s(rate, recording)
        error = rate.rate_dps - recording.motion.rate(t)
        density2 = max(g.white_dps_rthz for g in pair.gyros) ** 2
        for gone in recording.motion.scenario.gone_s:
            for at_s in gone[0]:
                edge = motion.BEGIN_S + at_s
                before = (t >= edge - STEP_MEAN_S) & (t < edge - 0.2)
                after = (t >= edge + 0.2) & (t < edge + STEP_MEAN_S)
                step = np.nanmean(error[after]) - np.nanmean(error[before])
                white2 = 2.0 * density2 / (STEP_MEAN_S - 0.2)
                bias2 = np.max(bias_sigma_dps(frames, np.array([edge - 1.0, edge + 1.0]))) ** 2
                sigma = math.sqrt(white2 + bias2)
                print(f"dropout {name}: step at {at_s:g} s {step / sigma:+.2f} σ")
                self.assertTrue(np.isfinite(error[after]).all() and np.isfinite(error[before]).all())
                self.assertLess(abs(step), STEP_SIGMAS * sigma)

    def test_the_sigma_of_one_gyro_alone_is_true(self):
        error2 = {mode: [] for mode in score.MODES}
        for seed in SEEDS:
            for mode in score.MODES:
                pair, recording, frames = self.judged("mems", DROPOUT, 320.0, mode, seed)
                error2[mode].append(score.judge_product(recording, pair, frames)["error2_alone"])
        print(f"dropout, seeds {SEEDS}: error² of one gyro alone {error2}")
        for mode in score.MODES:
            self.assertGreater(np.mean(error2[mode]), 0.8)
            self.assertLess(np.mean(error2[mode]), 1.2)

    def test_a_turning_ferry_is_not_learned_as_drift(self):
        run_s = 1200.0
        for name in ("fog_mems", "mems"):
            for seed in SEEDS[:2]:
                for mode in score.MODES:
                    pair, recording, frames = self.judged(name, motion.SCENARIOS["ferry"], run_s, mode, seed)
                    with self.subTest(pair=name, seed=seed, mode=mode):
                        self.check_ferry(pair, recording, frames, f"{name} seed {seed} {mode}")

    def check_ferry(self, pair, recording, frames, name):
        """At the end of each ferry the bias is known as well as before it, within the bound's σ."""
        stamps, bias = canlog.virtual_bias(frames)
        t = (stamps - gyro_pair.START_US) * 1e-6
        paired = rivals.pair_up(recording)
        _, covariance = rivals.bound_drifts(pair.gyros, paired)
        weights = rivals.weights_of(pair.gyros, np.ones((2, 1)))[:, 0]
        products = np.array([weights[0] ** 2, 2.0 * weights[0] * weights[1], weights[1] ** 2])
        for end_s, ferry_dps, _ in motion.leg_ends(recording.motion.scenario, recording.motion.run_s):
            if ferry_dps == 0.0:
                continue
            edge = motion.BEGIN_S + end_s
            at = np.searchsorted(t, edge) - 1
            off = weights @ (bias[at] - score.true_drifts(recording, t[at]))
            sigma = math.sqrt(products @ covariance[np.searchsorted(paired.t_s, edge) - 1])
            print(f"ferry {name}: after {ferry_dps:g} deg/s the bias is off by {off / sigma:+.2f} σ")
            self.assertLess(abs(off), 4.0 * 1.25 * sigma)
            self.assertLess(5.0 * sigma, abs(ferry_dps))


if __name__ == "__main__":
    unittest.main()
