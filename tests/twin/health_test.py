#!/usr/bin/python3
"""Faulty gyros on the twin, through log and frames: the loss of heading, and the contents of VB_Health, VG_Quality
and the summary. The faults are put into the frames here; the truth is the twin's. Seeds are printed."""

import json
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402
import make_twin  # noqa: E402
import product  # noqa: E402

REST_S = 20.0
RUN_S = 120.0
RATE_HZ = 100.0
SEED = 7
SUSPECT = (4, 8)
MISSING = (1, 2)
METHODS = ("mutual", "optimal")
# σ of one sample of the worse gyro, and of its bias after the rest and a walk of two minutes.
SIGMA_DPS = 3e-4 * np.sqrt(RATE_HZ)
BIAS_SIGMA_DPS = float(np.hypot(3e-4 / np.sqrt(REST_S), 2e-6 * np.sqrt(RUN_S)))
HEADING_SIGMA_DEG = RUN_S * BIAS_SIGMA_DPS


def put_rate(stream, where, rate_dps):
    raw = np.broadcast_to(np.rint(np.asarray(rate_dps) / make_twin.RATE_STEP_DPS), where.sum()).astype(np.int64)
    order = ">" if stream.can_id == 0x102 else "<"
    stream.payloads[where, 0:4] = raw.astype(order + "i4").view(np.uint8).reshape(-1, 4)


class Played:
    def __init__(self, twin, method):
        with tempfile.TemporaryDirectory(prefix="vgyro-") as folder:
            folder = Path(folder)
            config = product.write_config(folder, REST_S, order=0)
            with open(folder / "in.log", "wb") as file:
                canlog.write(file, twin.streams)
            frames = canlog.read(product.replay(config, folder / "in.log", folder / "out.log", method,
                                                ("--json", str(folder / "s.json"))))
            self.summary = json.loads((folder / "s.json").read_text())
        rates = canlog.virtual_rate(frames)
        told = rates.valid & (rates.age_us < 7500)  # an age of 7.5 ms may be more
        self.t = (rates.stamps_us - rates.age_us)[told] * 1e-6 - make_twin.Options().start_s
        self.rate = rates.rate_dps[told]
        sigma_raw = canlog.intel(frames.with_id(canlog.RATE_ID).payloads, 40, 12)[told]
        self.sigma = np.where(sigma_raw == 0xFFF, np.nan, sigma_raw * 2e-5)
        bias = frames.with_id(canlog.BIAS_ID)
        self.bias_t = bias.stamps_us * 1e-6 - make_twin.Options().start_s
        self.health = canlog.intel(bias.payloads, 59, 5)

    def health_within(self, begin_s, end_s):
        """All bits that were set at any time between these."""
        return int(np.bitwise_or.reduce(self.health[(self.bias_t > begin_s) & (self.bias_t < end_s)], initial=0))

    def heading_error(self, options, begin_s, end_s):
        inside = (self.t >= begin_s) & (self.t < end_s)
        error = self.rate[inside] - make_twin.true_rate(self.t[inside], options)
        return float(np.sum(0.5 * (error[1:] + error[:-1]) * np.diff(self.t[inside])))

    def worst(self, options, begin_s, end_s):
        inside = (self.t >= begin_s) & (self.t < end_s)
        return float(np.abs(self.rate[inside] - make_twin.true_rate(self.t[inside], options)).max())


def rates_of(streams, method, later_us):
    """VG_Rate's stamps and payloads without the E2E header, for the recording shifted by later_us."""
    later = [canlog.Stream(s.bus, s.can_id, s.stamps_us + later_us, s.payloads) for s in streams]
    with tempfile.TemporaryDirectory(prefix="vgyro-") as folder:
        folder = Path(folder)
        config = product.write_config(folder, REST_S, order=0)
        with open(folder / "in.log", "wb") as file:
            canlog.write(file, later)
        frames = canlog.read(product.replay(config, folder / "in.log", folder / "out.log", method))
    rates = frames.with_id(canlog.RATE_ID)
    return rates.stamps_us, rates.payloads[:, 2:]


class SickGyros(unittest.TestCase):
    def twin(self, turn_dps=40.0):
        print(f"seed {SEED}")
        options = make_twin.Options(scenario="drive", rest_s=REST_S, run_s=RUN_S, rate_hz=RATE_HZ, turn_dps=turn_dps, seed=SEED)
        return options, make_twin.simulate(options)

    def check(self, spoil, gyro, fault, begin_s, end_s, bit, turn_dps=40.0, late_s=0.6):
        """Between begin and end this gyro is faulty: this is reported, and the heading does not suffer."""
        options, twin = self.twin(turn_dps)
        lost_deg = spoil(options, twin)
        for method in METHODS:
            with self.subTest(method=method):
                played = Played(twin, method)
                error_deg = played.heading_error(options, REST_S, REST_S + RUN_S)
                print(f"{fault} {method}: heading error {error_deg:+.4f} deg, in the plain mean {lost_deg:+.1f} deg")
                self.assertLess(abs(error_deg), max(6.0 * HEADING_SIGMA_DEG, 0.01 * abs(lost_deg)))
                self.assertEqual(played.health_within(begin_s + late_s, end_s), bit)
                self.assertEqual(played.health_within(REST_S, begin_s), 0)
                self.assertEqual(played.health_within(end_s + 2.0, REST_S + RUN_S), 0)
                self.assertGreaterEqual(played.summary["gyros"][gyro]["faults"][fault]["times"], 1)
                self.assertEqual(played.summary["gyros"][1 - gyro]["faults"], {})
                self.assertTrue((np.diff(played.t) > 0).all())
                self.assertLess(played.worst(options, end_s, end_s + 3.0), 6.0 * (SIGMA_DPS + BIAS_SIGMA_DPS))
                self.check_step(played, options, end_s)

    def check_step(self, played, options, at_s):
        """Over the two seconds in which the gyro returns, the rate does not step by more than its own σ allows."""
        before = (played.t > at_s - 2.0) & (played.t < at_s)
        after = (played.t > at_s + 0.1) & (played.t < at_s + 2.1)
        sigma_dps = played.sigma[before | after]
        if np.isnan(sigma_dps).all():
            return  # the method gives no σ
        error = played.rate - make_twin.true_rate(played.t, options)
        step_dps = error[after].mean() - error[before].mean()
        print(f"  step at the return {step_dps:+.5f} deg/s, sigma {np.nanmax(sigma_dps):.5f} deg/s")
        self.assertFalse(np.isnan(sigma_dps).any())
        self.assertLess(abs(step_dps), 3.0 * np.nanmax(sigma_dps))

    def test_stuck_in_a_turn(self):
        begin_s, end_s = REST_S + 24.0, REST_S + 34.0

        def spoil(options, twin):
            where = (twin.t_s[1] >= begin_s) & (twin.t_s[1] < end_s)
            stuck_at = twin.reading_dps[1][where][0]
            put_rate(twin.streams[1], where, stuck_at)
            return 0.5 * np.sum(stuck_at - twin.reading_dps[1][where]) / RATE_HZ

        self.check(spoil, 1, "stuck", begin_s, end_s, SUSPECT[1])

    def test_clipped_in_a_fast_turn(self):
        clip_dps = 150.0

        def spoil(options, twin):
            over = np.abs(twin.reading_dps[0]) > clip_dps
            put_rate(twin.streams[0], over, np.sign(twin.reading_dps[0][over]) * clip_dps)
            left = over & (twin.reading_dps[0] > 0)
            return 0.5 * np.sum(clip_dps - twin.reading_dps[0][left]) / RATE_HZ

        options, twin = self.twin(300.0)
        lost_deg = spoil(options, twin)
        for method in METHODS:
            with self.subTest(method=method):
                played = Played(twin, method)
                # The first turn, in which the eight samples that revealed the clip were used.
                error_deg = played.heading_error(options, REST_S, REST_S + 20.5)
                print(f"clipped {method}: heading error {error_deg:+.4f} deg, in the plain mean {lost_deg / 2:+.1f} deg")
                self.assertLess(abs(error_deg), 0.02 * abs(lost_deg / 2))
                self.assertEqual(played.health_within(REST_S + 6.5, REST_S + 13.0), SUSPECT[0])
                self.assertEqual(played.health_within(REST_S + 16.0, REST_S + 22.0), 0)
                self.assertIn("saturated", played.summary["gyros"][0]["faults"])
                self.assertNotIn("stuck", played.summary["gyros"][0]["faults"])

    def test_what_time_it_is_changes_no_rate(self):
        options, twin = self.twin()
        # A coarse gyro, whose fault only the other one's movement reveals.
        put_rate(twin.streams[0], np.full(len(twin.t_s[0]), True), np.rint(twin.reading_dps[0] / 0.25) * 0.25)
        spells = ((0, 30.0, 40.0, 0.0), (1, 50.0, 50.2, None), (1, 60.0, 70.0, None))
        for gyro, begin_s, end_s, value in spells:
            where = (twin.t_s[gyro] >= begin_s) & (twin.t_s[gyro] < end_s)
            put_rate(twin.streams[gyro], where, twin.reading_dps[gyro][where][0] if value is None else value)
        stays = (twin.t_s[0] < 80.0) | (twin.t_s[0] >= 95.0)
        gyro = twin.streams[0]
        twin.streams[0] = canlog.Stream(gyro.bus, gyro.can_id, gyro.stamps_us[stays], gyro.payloads[stays])
        for method in METHODS:
            with self.subTest(method=method):
                expected = rates_of(twin.streams, method, 0)
                self.assertGreater(len(expected[0]), 5000)
                for later_us in (37_000, 12_345_678_000):
                    stamps, payloads = rates_of(twin.streams, method, later_us)
                    np.testing.assert_array_equal(stamps - later_us, expected[0])
                    np.testing.assert_array_equal(payloads, expected[1])

    def test_gone_for_a_minute(self):
        begin_s, end_s = REST_S + 10.0, REST_S + 70.0

        def spoil(options, twin):
            stays = (twin.t_s[0] < begin_s) | (twin.t_s[0] >= end_s)
            gyro = twin.streams[0]
            twin.streams[0] = canlog.Stream(gyro.bus, gyro.can_id, gyro.stamps_us[stays], gyro.payloads[stays])
            return 0.0

        self.check(spoil, 0, "silent", begin_s, end_s, MISSING[0], late_s=0.2)


if __name__ == "__main__":
    unittest.main()
