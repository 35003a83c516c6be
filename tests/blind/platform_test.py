#!/usr/bin/python3
"""Blind recordings of two whole units: the gap workflow names the effect hidden in one axis of one unit, in that
unit's own axis, and nothing about the others. `bench/blind_units` runs more of them."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import platform_world as world  # noqa: E402
import runner  # noqa: E402
from platform_world import AXES, Case  # noqa: E402

SIGMAS_MAX = 4.0
CASES = [
    Case(401),
    Case(402, "cross_axis"),
    Case(403, "cross_axis", reference=False),
    Case(404, "scale_factor"),
    Case(405, "delay"),
]


class Blind(unittest.TestCase):
    def test_what_hides_is_named_about_its_axis_and_nothing_else_is(self):
        for case in CASES:
            with self.subTest(case=case.name), tempfile.TemporaryDirectory(prefix="vgyro-units-") as scratch:
                print(case.name)
                truths = world.make(case, Path(scratch) / "case")
                gap, _, _ = runner.gap(Path(scratch) / "case", Path(scratch) / "out")
                judged = world.judge(truths, gap)
                self.assertTrue(world.as_wished(judged), judged)
                if not case.kind:
                    self.assertEqual(set(judged["verdicts"].values()), {"no_gap"})
                for error in judged["errors"]:
                    self.assertLess(abs(error), SIGMAS_MAX, judged)
                # A reference shows which of the two has it: then it is certain, and its error has been judged.
                if case.kind and case.reference:
                    self.assertEqual(len(judged["applied"]), 1)
                    self.assertEqual(len(judged["errors"]), 1)


class World(unittest.TestCase):
    """Tests the world by other means than those that make it."""

    def test_an_effect_is_as_strong_as_the_case_wants_it(self):
        case = Case(410, "cross_axis", strength=12.0)
        for seed in range(410, 414):
            rng = np.random.default_rng([seed, 3])
            motion = world.Motion(case.seconds, rng)
            densities = [[4e-3, 5e-3, 6e-3], [3e-3, 7e-3, 2e-3]]
            [effect] = world.hidden(case, motion, densities, rng)
            t = np.arange(0.0, case.seconds, 1.0 / world.RATE_HZ)
            place, source = AXES.index(effect["axis"]), AXES.index(effect["parameters"]["from"])
            # A thousand fits by least squares to noise alone: their scatter is the sigma of the coefficient.
            shape = np.stack([np.ones(len(t)), motion.rate(t)[:, source]], axis=1)
            noise = rng.standard_normal((len(t), 400)) * densities[effect["gyro"] - 1][place] * np.sqrt(world.RATE_HZ)
            scatter = np.std(np.linalg.lstsq(shape, noise, rcond=None)[0][1])
            self.assertAlmostEqual(abs(effect["parameters"]["coefficient"]) / scatter, 12.0, delta=1.5)

    def test_the_units_rest_in_the_beginning_and_turn_about_every_axis_later(self):
        motion = world.Motion(340.0, np.random.default_rng(1))
        t = np.arange(0.0, 340.0, 0.02)
        rate = motion.rate(t)
        self.assertEqual(np.abs(rate[t < 60.0]).max(), 0.0)
        self.assertTrue((rate[t > 70.0].std(axis=0) > 1.0).all())

    def test_a_name_about_another_axis_is_wrong(self):
        truth = {"kind": "scale_factor", "gyro": 2, "axis": "y", "parameters": {"error": 1e-3}}
        named = {**truth, "sigma": {"error": 1e-4}, "ambiguous_with": [], "applied": True}
        axes = [{"axis": "y", "verdict": "explained"}]
        self.assertTrue(world.as_wished(world.judge([truth], {"effects": [named], "axes": axes})))
        for change in ({"axis": "x"}, {"gyro": 1}, {"kind": "delay"}):
            judged = world.judge([truth], {"effects": [{**named, **change}], "axes": axes})
            self.assertFalse(world.as_wished(judged), change)
        self.assertFalse(world.as_wished(world.judge([truth], {"effects": [], "axes": axes})))
        self.assertFalse(world.as_wished(world.judge([], {"effects": [named], "axes": axes})))


if __name__ == "__main__":
    unittest.main()
