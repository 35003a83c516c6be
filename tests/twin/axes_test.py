#!/usr/bin/python3
"""Two whole units on short simulated drives, tilted against each other: the errors of the angles about all axes in
units of those that the injected noise allows a filter that knows the tilt. bench/accuracy_axes measures the same at
length. Seeds are printed."""

import functools
import math
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from judge import axes, expectation, motion, rivals  # noqa: E402
from judge.pair import PAIRS  # noqa: E402

SEEDS = (1, 2, 3)
RUN_S = 600.0
# Mean square of nine standard normal numbers (axes and seeds) that chance exceeds once in a thousand.
LUCK = 3.1
# rms distance from the bound's angle, in its sigma: an independent error of that size adds a quarter.
APART = math.sqrt((1.25**2 - 1.0) * LUCK)


class OneAxis:
    """One axis of a motion about three, in the form that the expectation of one axis needs."""

    def __init__(self, true, axis):
        self.true, self.axis, self.standing = true, axis, true.standing

    def there(self, unit, t_s):
        return self.true.there(unit, self.axis, t_s)


@functools.cache
def judged(pair, scenario, seed):
    return axes.judge(PAIRS[pair], axes.SCENARIOS[scenario], RUN_S, seed, ("estimated",))


class Judge(unittest.TestCase):
    """Tests of the judge itself."""

    def test_the_bounds_angles_are_as_large_as_its_covariance_says(self):
        pair = PAIRS["mems"]
        squares = []
        for seed in range(30, 38):
            print(f"seed {seed}")
            scenario = axes.SCENARIOS["dropout"]
            recording = axes.simulate(pair, scenario, RUN_S, seed)
            for axis, one in enumerate(recording.axes):
                paired = rivals.pair_up(one)
                first, _ = axes.angle_errors(paired.t_s, rivals.rate_errors(pair, paired)[0]["bound"], RUN_S)
                sigma = expectation.heading_sigmas_deg(pair.gyros, OneAxis(recording.motion, axis), [RUN_S / 2])[RUN_S / 2]
                squares.append((first / sigma) ** 2)
        # 24 numbers: chance exceeds this limit once in a thousand.
        self.assertLess(np.mean(squares), 2.13)
        self.assertGreater(np.mean(squares), 0.35)

    def test_a_banked_turn_turns_the_vehicle_about_the_vertical(self):
        """Body rates are combined as rotations: after a leg that ends on its first heading the vehicle stands as it
        began."""
        true = axes.Motion(axes.SCENARIOS["banked"], RUN_S, np.random.default_rng(5))
        t = np.arange(motion.BEGIN_S, motion.BEGIN_S + 299.0, 0.005)
        sway = true.rate(t)
        attitude, dt = np.eye(3), 0.005
        bank = np.radians(axes.BANK_S * (true.drive.rate(t) - motion.EARTH_DPS))
        yaw = true.drive.rate(t) - motion.EARTH_DPS
        body = np.stack([np.degrees(np.gradient(bank, t)), yaw * np.sin(bank), yaw * np.cos(bank)])
        for rate in body.T:
            attitude = attitude @ axes.rotation(np.radians(rate) * dt)
        heading = np.degrees(np.arctan2(attitude[1, 0], attitude[0, 0]))
        self.assertAlmostEqual(heading, np.sum(yaw) * dt, delta=0.5)
        self.assertLess(np.degrees(np.arccos(np.clip(attitude[2, 2], -1, 1))), 0.5)
        # The motion's rates are these, with sway on x and y.
        np.testing.assert_allclose(sway[2] - motion.EARTH_DPS, body[2], atol=0.05)
        self.assertLess(np.std(sway[0] - body[0]), 1.0)

    def test_the_tilt_shows_in_the_readings(self):
        recording = axes.simulate(PAIRS["twin"], axes.SCENARIOS["tilted"], RUN_S, 3)
        t = recording.axes[0].gyros[1].t_s
        rates = recording.motion.rate(t)
        off = np.stack([one.gyros[1].error_dps for one in recording.axes])
        cross = np.cross(rates.T, np.radians(axes.TILT_DEG)).T  # for a small rotation by -theta
        moving = ~recording.motion.standing(t)
        left = (off - cross)[:, moving]
        self.assertLess(np.max(np.abs(left - left.mean(axis=1)[:, None])), 0.02)


class Product(unittest.TestCase):
    def test_angles_about_all_axes_are_near_the_bounds(self):
        for pair in ("fog_mems", "mems"):
            distances = []
            for seed in SEEDS:
                print(f"{pair}, seed {seed}")
                found = judged(pair, "tilted", seed)
                true = axes.Motion(axes.SCENARIOS["tilted"], RUN_S, np.random.default_rng(0))
                for axis in range(3):
                    sigma = expectation.heading_sigmas_deg(PAIRS[pair].gyros, OneAxis(true, axis), [RUN_S / 2])[RUN_S / 2]
                    distances.append((found["estimated"][axis]["angle_deg"][0] - found["bound"][axis]["angle_deg"][0]) / sigma)
            with self.subTest(pair=pair):
                self.assertLess(np.sqrt(np.mean(np.square(distances))), APART, distances)

    def test_on_the_second_drive_the_tilt_is_known(self):
        """The mean of both units always has an error of half the tilt; once the tilt is learned, the rate is near
        the bound."""
        for seed in SEEDS:
            found = judged("fog_mems", "tilted", seed)
            with self.subTest(seed=seed):
                for axis in range(3):
                    self.assertLess(found["estimated"][axis]["error2"], 1.3)
                    second = found["estimated"][axis]["angle_deg"][1]
                    self.assertLess(abs(second - found["bound"][axis]["angle_deg"][1]), 0.03)

    def test_an_axis_that_is_gone_is_carried_by_the_other_unit(self):
        found = axes.judge(PAIRS["mems"], axes.SCENARIOS["dropout"], RUN_S, 4, ("estimated",))
        for axis in range(3):
            self.assertLess(found["estimated"][axis]["error2"], 1.3, axis)
            self.assertLess(abs(found["estimated"][axis]["angle_deg"][1] - found["bound"][axis]["angle_deg"][1]), 1.5, axis)


if __name__ == "__main__":
    unittest.main()
