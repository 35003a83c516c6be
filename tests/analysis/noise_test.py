#!/usr/bin/python3
"""Tests `vgyro allan` on recordings with known noise, made with NumPy: every estimate in units of its own stated
error, over many seeds, through a candump log."""

import json
import lzma
import math
import os
import subprocess
import tempfile
import tomllib
import unittest
from pathlib import Path

import noise_records as records
import numpy as np
from noise_records import Noise

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
VGYRO = str(Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")) / "vgyro")

SIGMAS = 3.5
TRUE = {"white_noise_dps_rthz": "n", "rate_random_walk_dps_rts": "k", "bias_instability_dps": "b", "quantisation_deg": "q"}


class Allan(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-allan-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        (self.folder / "noise.dbc").write_text(records.DBC)
        (self.folder / "vgyro.toml").write_text(records.CONFIG)
        self.log = self.folder / "rest.log"

    def call(self, *arguments, stdin=b""):
        return subprocess.run([VGYRO, "allan", "--config", "vgyro.toml", *map(str, arguments)], input=stdin,
                              capture_output=True, check=False, cwd=self.folder, timeout=60)

    def judge(self, *arguments, stdin=b""):
        done = self.call("--json", "-", *arguments, stdin=stdin)
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        result = json.loads(done.stdout)
        self.assertEqual(result["format"], 1)
        return result

    def bad(self, *arguments, stdin=b""):
        done = self.call(*arguments, stdin=stdin)
        self.assertEqual(done.returncode, 1, done.stderr.decode())
        return done.stderr.decode()

    def record(self, seed, noises, count, interval_s, motion=0.0, common=0.0, **options):
        """Writes the log; returns the rates of both gyros."""
        rng = np.random.default_rng(seed)
        shared = common * rng.normal(size=count) / math.sqrt(interval_s)
        rates = [records.rates(rng, noise, count, interval_s) + motion + shared for noise in noises]
        records.write_pair(self.log, rates, interval_s, **options)
        return rates

    def assert_normal(self, errors, what):
        """Mean 0 and standard deviation 1, within the statistics of so many errors."""
        errors = np.array(errors)
        self.assertLess(abs(errors.mean()), SIGMAS / math.sqrt(len(errors)), f"{what}: {errors}")
        self.assertLess(errors.std(), 1 + SIGMAS / math.sqrt(2 * len(errors)), f"{what}: {errors}")
        self.assertGreater(errors.std(), 1 - SIGMAS / math.sqrt(2 * len(errors)), f"{what}: {errors}")

    def collect(self, noises, seeds, count=20_000, interval_s=0.1):
        """Errors of each resolved estimate in its σ; those not resolved, as (bound, truth)."""
        resolved, unresolved = {}, {}
        for seed in seeds:
            self.record(seed, noises, count, interval_s)
            result = self.judge(self.log)
            self.assertTrue(result["at_rest"], f"seed {seed}")
            for gyro, noise in zip(result["gyros"], noises):
                for name, letter in TRUE.items():
                    estimate, truth = gyro["noise"][name], getattr(noise, letter)
                    if not estimate["resolved"]:
                        unresolved.setdefault(letter, []).append((estimate["below"], truth))
                    else:
                        # The likelihood is most nearly normal in the logarithm.
                        error = math.log(estimate["value"] / truth) if truth > 0 else math.inf
                        resolved.setdefault(letter, []).append(error * estimate["value"] / estimate["sigma"])
                ramp = gyro["noise"]["ramp_dps_s"]
                resolved.setdefault("ramp", []).append((ramp["value"] - noise.ramp) / ramp["sigma"])
        return resolved, unresolved


class Estimates(Allan):
    def test_white_noise_walk_and_ramp_are_found_within_their_errors(self):
        noises = (Noise(n=2e-3, k=2e-4), Noise(n=6e-3, k=6e-4, ramp=2e-5, bias=-0.3))
        resolved, unresolved = self.collect(noises, range(100, 120))
        for letter in ("n", "k", "ramp"):
            self.assertEqual(len(resolved[letter]), 40)
            self.assert_normal(resolved[letter], letter)
        self.assertGreaterEqual(len(unresolved["b"]), 39)
        self.assertGreaterEqual(len(unresolved["q"]), 39)

    def test_bias_instability_and_quantisation_are_found_within_their_errors(self):
        noises = (Noise(n=2e-3, b=2e-3), Noise(n=2e-3, q=4e-4))
        resolved, unresolved = self.collect(noises, range(200, 220))
        for letter, count in (("n", 40), ("b", 20), ("q", 20)):
            self.assertEqual(len(resolved[letter]), count)
            self.assert_normal(resolved[letter], letter)
        self.assertGreaterEqual(len(unresolved["k"]), 39)

    def test_absent_walk_is_not_resolved_and_a_weak_one_lies_below_its_bound(self):
        noises = (Noise(n=2e-3), Noise(n=2e-3, k=1e-6))
        resolved, unresolved = self.collect(noises, range(300, 320))
        # The criterion accepts a false term in a few records of a thousand.
        self.assertLessEqual(len(resolved.get("k", [])), 1)
        held = sum(below > truth for below, truth in unresolved["k"])
        self.assertGreaterEqual(held, len(unresolved["k"]) - 1)
        self.assertLess(max(below for below, _ in unresolved["k"]), 5e-5)

    def test_drift_that_forgets_itself_is_no_random_walk(self):
        noises = (Noise(n=3e-3, markov=(0.02, 60.0)), Noise(n=5e-3, markov=(0.01, 30.0)))
        for seed in range(340, 346):
            self.record(seed, noises, 36_000, 0.1)
            result = self.judge(self.log)
            self.assertTrue(result["at_rest"], f"seed {seed}")
            for gyro, noise in zip(result["gyros"], noises):
                self.assertFalse(gyro["noise"]["rate_random_walk_dps_rts"]["resolved"], f"seed {seed}")
                sigma, tau_s = noise.markov
                found = gyro["noise"]["gauss_markov"]
                self.assertAlmostEqual(math.log(found["sigma_dps"] / sigma), 0.0, delta=0.5)
                self.assertAlmostEqual(math.log(found["tau_s"] / tau_s), 0.0, delta=1.0)
            kinds = [effect["kind"] for effect in tomllib.loads(result["model_toml"])["effect"]]
            self.assertEqual(kinds, ["white_noise", "gauss_markov"] * 2)

    def test_no_bound_is_far_below_what_the_record_shows(self):
        # A weak term that the criterion rejects may still be likelier than none.
        for seed in range(350, 390):
            self.record(seed, (Noise(n=2e-3, b=3e-4), Noise(n=2e-3, k=2e-5)), 6_000, 0.1)
            for gyro in self.judge(self.log)["gyros"]:
                for name in ("bias_instability_dps", "rate_random_walk_dps_rts"):
                    estimate = gyro["noise"][name]
                    if not estimate["resolved"]:
                        self.assertGreater(estimate["below"], 1e-6, f"seed {seed}, {name}")

    def test_difference_has_the_noise_of_both(self):
        noises = (Noise(n=2e-3, k=2e-4), Noise(n=6e-3, k=6e-4))
        # Half an interval apart, so that one of them is interpolated; and with lost frames.
        for offset_us, lost in ((0, 0.0), (50_000, 0.0), (30_000, 0.01)):
            errors = []
            for seed in range(400, 412):
                rng = np.random.default_rng(seed + 1000)
                kept = [rng.random(20_000) >= lost for _ in range(2)]
                self.record(seed, noises, 20_000, 0.1, offset_us=(0, offset_us), kept=kept)
                white = self.judge(self.log)["difference"]["noise"]["white_noise_dps_rthz"]
                errors.append((white["value"] - math.hypot(2e-3, 6e-3)) / white["sigma"])
            self.assert_normal(errors, f"{offset_us} us apart, {lost} lost")

    def test_correlation_of_the_white_noises_is_found_within_its_error(self):
        for offset_us in (0, 20_000):
            errors = []
            for seed in range(500, 512):
                # Common noise of half the power, in the same samples of both gyros.
                self.record(seed, (Noise(n=2e-3), Noise(n=2e-3, k=1e-4)), 20_000, 0.1, common=2e-3, offset_us=(0, offset_us))
                rho = self.judge(self.log)["rho"]
                # A shift by a fifth of a sample costs next to nothing at a tenth of the rate.
                errors.append((rho["value"] - 0.5) / rho["sigma"])
            self.assertLess(abs(np.mean(errors)), SIGMAS / math.sqrt(len(errors)) + (0.5 if offset_us else 0.0), errors)
            self.assertLess(np.std(errors), 1 + SIGMAS / math.sqrt(2 * len(errors)), errors)

    def test_jitter_and_lost_frames_do_not_spoil_white_noise(self):
        errors = []
        for seed in range(600, 612):
            rng = np.random.default_rng(seed + 1000)
            jitter = [np.round(rng.normal(size=20_000) * 3000) for _ in range(2)]
            kept = [rng.random(20_000) >= 0.01 for _ in range(2)]
            self.record(seed, (Noise(n=2e-3), Noise(n=6e-3)), 20_000, 0.1, jitter_us=jitter, kept=kept)
            for gyro, truth in zip(self.judge(self.log)["gyros"], (2e-3, 6e-3)):
                self.assertAlmostEqual(gyro["bridged_share"], 0.01, delta=0.005)
                white = gyro["noise"]["white_noise_dps_rthz"]
                errors.append((white["value"] - truth) / white["sigma"])
        self.assert_normal(errors, "white noise")


class Deviation(Allan):
    def test_curve_is_the_plain_one(self):
        # Other arithmetic, same definition: to the rounding.
        rates = self.record(1, (Noise(n=2e-3, k=1e-3), Noise(n=6e-3)), 6000, 0.01)
        a, b = (records.in_frames(rate) * records.STEP_DPS for rate in rates)
        result = self.judge(self.log)
        for curve, rate in ((result["gyros"][0], a), (result["gyros"][1], b), (result["difference"], a - b)):
            self.assertEqual([round(p["tau_s"] / 0.01) for p in curve["allan"]], [2**i for i in range(11)])
            for i, point in enumerate(curve["allan"]):
                expected = records.allan_deviation(rate, 0.01, 2**i)
                self.assertAlmostEqual(point["deviation_dps"] / expected, 1.0, delta=1e-9)

    def test_bounds_hold_as_often_as_they_say(self):
        inside = total = 0
        for seed in range(40):
            self.record(seed + 700, (Noise(n=2e-3), Noise(n=2e-3)), 4000, 0.1)
            for gyro in self.judge(self.log)["gyros"]:
                for point in gyro["allan"][::3]:
                    total += 1
                    inside += point["low_dps"] <= 2e-3 / math.sqrt(point["tau_s"]) <= point["high_dps"]
        # 80 records; points at every third octave are nearly independent.
        self.assertAlmostEqual(inside / total, 0.95, delta=SIGMAS * math.sqrt(0.95 * 0.05 / total) + 0.01)


class Motion(Allan):
    NOISES = (Noise(n=2e-3, k=1e-4), Noise(n=6e-3, k=3e-4, bias=-0.2))

    def turning(self, count, interval_s, from_s, to_s):
        t = np.arange(count) * interval_s
        turn = 20.0 * np.sin(2 * np.pi * (t - from_s) / 40.0) ** 2
        return np.where((t >= from_s) & (t < to_s), turn, 0.0)

    def test_gyros_are_judged_where_the_platform_rests(self):
        self.record(2, self.NOISES, 12_000, 0.1, motion=self.turning(12_000, 0.1, 300.0, 500.0))
        result = self.judge(self.log)
        self.assertFalse(result["at_rest"])
        self.assertAlmostEqual(result["turned_up_to_dps"], 20.0, delta=1.0)
        self.assertAlmostEqual(result["rest"]["from_s"], 500.0, delta=3.0)
        self.assertAlmostEqual(result["rest"]["to_s"], 1200.0, delta=3.0)
        for gyro, noise in zip(result["gyros"], self.NOISES):
            white = gyro["noise"]["white_noise_dps_rthz"]
            self.assertLess(abs(white["value"] - noise.n), SIGMAS * white["sigma"])

    def test_gentle_motion_behind_a_rest_is_none(self):
        # A turn begins gently within four seconds, and then continues.
        t = np.arange(12_000) * 0.1 - 600.0
        motion = np.where(t > 0, np.where(t < 4, 0.02 * t**2, 0.32 + 10 * np.sin(0.6 * (t - 4))), 0.0)
        self.record(8, (Noise(n=2e-3), Noise(n=6e-3, bias=-0.2)), 12_000, 0.1, motion=motion)
        result = self.judge(self.log)
        self.assertEqual(result["rest"]["from_s"], 0.0)
        self.assertGreater(result["rest"]["to_s"], 580.0)
        self.assertLessEqual(result["rest"]["to_s"], 601.0)
        for gyro in result["gyros"]:
            self.assertFalse(gyro["noise"]["rate_random_walk_dps_rts"]["resolved"])
            self.assertFalse(gyro["noise"]["bias_instability_dps"]["resolved"])

    def test_without_rest_only_the_difference_is_judged(self):
        motion = self.turning(12_000, 0.1, 0.0, 1e9)
        rates = self.record(3, self.NOISES, 12_000, 0.1, motion=motion)
        # The second gyro reads 0.5 % too much.
        records.write_pair(self.log, [rates[0], rates[1] + 0.005 * motion], 0.1)
        result = self.judge(self.log)
        self.assertFalse(result["at_rest"])
        self.assertIsNone(result["rest"])
        self.assertIsNone(result["rho"])
        self.assertEqual(result["model_toml"], "")
        self.assertEqual([gyro["noise"] for gyro in result["gyros"]], [None, None])
        self.assertAlmostEqual(result["difference"]["removed"]["scale_factor"], -0.005, delta=2e-4)
        white = result["difference"]["noise"]["white_noise_dps_rthz"]
        self.assertLess(abs(white["value"] - math.hypot(2e-3, 6e-3)), SIGMAS * white["sigma"])
        said = self.call(self.log).stdout.decode()
        self.assertRegex(said, r"turned or shook: up to 2\d(\.\d+)? deg/s")
        self.assertIn("only the pair's difference is judged", said)

    def test_gap_splits_the_record(self):
        kept = np.ones(12_000, dtype=bool)
        kept[4000:4100] = False
        self.record(4, self.NOISES, 12_000, 0.1, kept=(kept, kept))
        result = self.judge(self.log)
        self.assertEqual([s["parts"] for s in (*result["gyros"], result["difference"])], [2, 2, 2])
        white = result["gyros"][0]["noise"]["white_noise_dps_rthz"]
        self.assertLess(abs(white["value"] - 2e-3), SIGMAS * white["sigma"])

    def test_what_is_not_such_noise_is_said(self):
        # A filter removes the white noise at high frequencies. The estimate comes from below it.
        rates = self.record(5, (Noise(n=2e-3), Noise(n=2e-3)), 40_000, 0.1)
        filtered = np.convolve(rates[0], np.full(8, 1 / 8), mode="same")
        records.write_pair(self.log, [filtered, rates[1]], 0.1)
        noise = self.judge(self.log)["gyros"][0]["noise"]
        self.assertLess(noise["frequency_max_hz"], 1.0)
        white = noise["white_noise_dps_rthz"]
        self.assertAlmostEqual(white["value"] / 2e-3, 1.0, delta=0.1)
        self.assertIn("fitted below", self.call(self.log).stdout.decode())


class Command(Allan):
    def test_advice_can_be_pasted(self):
        noises = (Noise(n=2e-3, k=2e-4, b=0.0), Noise(n=6e-3, b=6e-3, ramp=5e-5))
        self.record(6, noises, 36_000, 0.1)
        said = self.call(self.log).stdout.decode()
        config = tomllib.loads(said.split("Recommended for the configuration:\n")[1].split("\nFor the")[0])["corrector"]
        result = self.judge(self.log)
        self.assertEqual(config, {key: result["recommendation"][key] for key in ("window_s", "order")})
        model = tomllib.loads(said.split("For the model file:\n")[1])
        self.assertEqual(model, tomllib.loads(result["model_toml"]))
        self.assertEqual(model["format"], 1)
        kinds = [(effect["gyro"], effect["kind"]) for effect in model["effect"]]
        self.assertEqual(kinds, [(1, "white_noise"), (1, "rate_random_walk"), (2, "white_noise"), (2, "gauss_markov"),
                                 (2, "gauss_markov"), (2, "gauss_markov"), (2, "bias_ramp")])
        self.assertAlmostEqual(model["effect"][0]["density_dps_rthz"] / 2e-3, 1.0, delta=0.05)

    def test_file_packed_file_and_standard_input_say_the_same(self):
        self.record(7, (Noise(n=2e-3), Noise(n=2e-3)), 2000, 0.1)
        packed = self.folder / "rest.log.xz"
        packed.write_bytes(lzma.compress(self.log.read_bytes()))
        results = [self.judge(self.log), self.judge(packed), self.judge("-", stdin=self.log.read_bytes())]
        for result in results:
            del result["log"]
        self.assertEqual(results[0], results[1])
        self.assertEqual(results[0], results[2])

    def test_picture_is_drawn(self):
        self.record(8, (Noise(n=2e-3), Noise(n=2e-3)), 2000, 0.1)
        self.assertEqual(self.call("--plot", "allan.svg", self.log).returncode, 0)
        picture = (self.folder / "allan.svg").read_text()
        for part in ("<svg", "gyro left", "gyro right", "difference", "Allan deviation: rest.log"):
            self.assertIn(part, picture)
        self.assertIn(".svg", self.bad("--plot", "allan.gif", self.log))

    def test_bad_input_is_told(self):
        self.record(9, (Noise(n=2e-3), Noise(n=2e-3)), 50, 0.1)
        self.assertIn("too short", self.bad(self.log))
        lines = self.log.read_text().splitlines(keepends=True)
        self.assertIn("no frame of gyro right", self.bad("-", stdin="".join(lines[::2]).encode()))
        self.assertIn("can0", self.bad("-", stdin="".join(lines[::2]).encode()))
        self.assertIn("holds no CAN frame", self.bad("-"))
        self.assertIn("gone.log", self.bad("gone.log"))

    def test_rates_that_never_change_are_no_noise(self):
        records.write_pair(self.log, [np.full(2000, 0.1), np.full(2000, 0.2)], 0.1)
        result = self.judge(self.log)
        self.assertIsNone(result["difference"]["noise"])
        self.assertIsNone(result["recommendation"])


if __name__ == "__main__":
    unittest.main()
