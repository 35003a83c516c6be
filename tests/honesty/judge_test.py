#!/usr/bin/python3
"""Tests the random worlds and their judge on rates made from the truth and known noise, without the product."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import outside  # noqa: E402, F401
import candump  # noqa: E402
import judge  # noqa: E402
import worlds  # noqa: E402

SEED = 5525
SIGMA_DPS = 0.01


def quiet_world(seed=SEED):
    return worlds.Recording(worlds.draw(seed, ("drift", "faults", "scale", "wheels")))


def rates(recording, error_dps, sigma_dps=SIGMA_DPS, age=0):
    """The rates that a gateway would send with gyro 1's frames from the end of the calibration on."""
    t, _ = recording.samples[0]
    rate = recording.truth(t) + error_dps(t)
    stamps_us = np.rint(t * 1e6).astype(np.int64) + age * judge.AGE_STEP_US
    return judge.Rates(stamps_us, np.full(len(t), age), rate, np.full(len(t), sigma_dps), t > recording.world.calibration_s)


def white(t):
    return np.random.default_rng(1).standard_normal(len(t)) * SIGMA_DPS


class Worlds(unittest.TestCase):
    def test_a_seed_makes_the_same_bytes(self):
        with tempfile.TemporaryDirectory() as a, tempfile.TemporaryDirectory() as b:
            for folder in (a, b):
                worlds.Recording(worlds.draw(SEED)).write(Path(folder))
            for name in ("in.log", "vgyro.toml", "world.dbc"):
                self.assertEqual((Path(a) / name).read_bytes(), (Path(b) / name).read_bytes(), name)

    def test_a_gyro_without_drift_errs_by_its_noise_and_whitely_even_where_the_rate_changes_fast(self):
        recording = quiet_world(5404)
        for gyro, (t, raw) in zip(recording.world.gyros, recording.samples):
            gyro_error = raw * gyro.step_dps - gyro.bias_dps - recording.truth(t)
            expected = np.hypot(gyro.density * np.sqrt(gyro.rate_hz), gyro.step_dps / np.sqrt(12))
            fast = np.abs(np.gradient(recording.truth(t), t)) > 3
            self.assertGreater(fast.sum(), 300)
            step = np.diff(gyro_error)[fast[1:]] / np.sqrt(2)
            # A variance from 300 samples or more has a standard deviation of 8 %: four of these, and an allowance for
            # flicker and walk.
            self.assertLess(abs(np.mean(step**2) / expected**2 - 1), 0.35)

    def test_frames_come_back_as_they_were_written(self):
        rng = np.random.default_rng(3)
        stamps_us = np.sort(rng.integers(0, 2_000_000_000, 1000))
        payloads = rng.integers(0, 256, (1000, 8), dtype=np.uint8)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "x.log"
            candump.write(path, [(stamps_us, 0, 0x610, payloads), (stamps_us + 1, 1, 0x611, payloads)])
            read_us, read_payloads = candump.read(path, 0x610)
        self.assertTrue(np.array_equal(read_us, stamps_us) and np.array_equal(read_payloads, payloads))

    def test_drifting_pairs_stop_every_few_minutes(self):
        for seed in range(5000, 5060):
            world = worlds.draw(seed)
            longest = worlds.limits_of(world).longest_without_stop_s
            if all(g.drifts for g in world.gyros):
                self.assertLessEqual(longest, worlds.COMMON_LAG_S, seed)


class Judge(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.recording = quiet_world()
        cls.late_s = cls.recording.world.duration_s * 0.8

    def judged(self, error_dps, **more):
        found = judge.figures(rates(self.recording, error_dps, **more), self.recording)
        return found, judge.failures(found)

    def test_honest_noise_passes_with_a_ratio_of_one(self):
        found, failed = self.judged(white)
        self.assertEqual(failed, [])
        self.assertLess(abs(found["ratio_late"] - 1), 0.05)

    def test_an_age_is_taken_off_the_stamp(self):
        found, _ = self.judged(white, age=11)
        self.assertLess(abs(found["ratio_late"] - 1), 0.05)

    def test_sigma_too_small_by_half_is_told(self):
        self.assertEqual(self.judged(white, sigma_dps=SIGMA_DPS / 2)[1], ["ratio high"])

    def test_sigma_too_large_by_half_is_told(self):
        self.assertEqual(self.judged(white, sigma_dps=SIGMA_DPS * 2)[1], ["ratio low"])

    def test_three_seconds_at_seven_sigma_are_told(self):
        found, failed = self.judged(lambda t: white(t) + 7 * SIGMA_DPS * ((t > self.late_s) & (t < self.late_s + 3)))
        self.assertEqual(failed, ["beyond 6 sigma"])
        self.assertLess(abs(found["beyond_6_from_s"] - self.late_s), 1)

    def test_one_second_at_seven_sigma_passes(self):
        self.assertEqual(self.judged(lambda t: white(t) + 7 * SIGMA_DPS * ((t > self.late_s) & (t < self.late_s + 1)))[1], [])

    def test_half_a_minute_at_five_sigma_is_told(self):
        found, failed = self.judged(lambda t: white(t) + 5 * SIGMA_DPS * ((t > 200) & (t < 230)))
        self.assertIn("beyond 4 sigma", failed)
        self.assertGreater(found["heading_announced"], 2)

    def test_lone_outliers_are_no_run(self):
        found, failed = self.judged(lambda t: white(t) + 50 * SIGMA_DPS * (np.arange(len(t)) % 997 == 0))
        self.assertLess(found["beyond_6_s"], 0.2)
        self.assertNotIn("beyond 6 sigma", failed)

    def test_a_spike_without_sigma_does_not_choose_the_instant_that_is_meant(self):
        t, _ = self.recording.samples[0]
        slope = np.gradient(self.recording.truth(t), t)
        for sign in (-1, 1):
            made = rates(self.recording, lambda t: 0.02 * white(t), 0.02 * SIGMA_DPS, age=judge.AGE_OR_MORE)
            for begin_s in range(60, int(self.recording.world.duration_s), 10):
                steepest = np.argmax(np.where((t >= begin_s) & (t < begin_s + 10), np.abs(slope), -1))
                made.rate[steepest] += sign * 40 * np.sign(slope[steepest])
                made.sigma[steepest] = np.nan
            self.assertLess(abs(judge.figures(made, self.recording)["ratio_late"] - 1), 0.05)

    def test_a_rate_that_is_not_valid_for_a_tenth_of_the_time_is_told(self):
        made = rates(self.recording, white)
        made.valid[made.stamps_us % 10_000_000 < 1_000_000] = False
        found = judge.figures(made, self.recording)
        self.assertLess(abs(found["valid_sound"] - 0.9), 0.02)
        self.assertEqual(judge.failures(found), ["valid share"])

    def test_a_rate_without_sigma_is_counted_and_not_judged(self):
        made = rates(self.recording, white)
        made.sigma[::2] = np.nan
        self.assertLess(abs(judge.figures(made, self.recording)["without_sigma"] - 0.5), 0.01)


if __name__ == "__main__":
    unittest.main()
