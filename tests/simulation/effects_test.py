#!/usr/bin/python3
"""Every kind of effect in the recordings of `vgyro simulate`, against its equation in closed form: readings
without noise agree to the frame's last digit, noise has the right variance, frames and stamps are wrong as
often and by as much as stated. The profile has 50 rows a second, the gyros take 100 samples a second from it.
Statistical tolerances are in standard errors; seeds are printed."""

import math
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import rig  # noqa: E402
from rig import effect  # noqa: E402
from streams import Stream, Twister64  # noqa: E402

SEED = 3
SIGMAS = 4.0
LENGTH_S = 20.0
# Rounding to the step, and the error of the curve through the profile's points.
CLOSE_DPS = 0.75 * rig.RATE_STEP_DPS
RATE_HZ = 100.0


def vibration(t, accelerometer_t):
    """Variance of |a| over the accelerometer's samples of the last second before each t."""
    size = np.linalg.norm(rig.acceleration(accelerometer_t), axis=0)
    result = np.zeros_like(t)
    for i, now in enumerate(t):
        newest = np.searchsorted(accelerometer_t, now, side="right")
        result[i] = np.var(size[max(0, newest - 100):newest]) if newest else 0.0
    return result


class Equations(unittest.TestCase):
    """Without noise."""

    def readings(self, *effects):
        with tempfile.TemporaryDirectory() as folder:
            log = rig.simulate(folder, effects, rig.profile(LENGTH_S))
        self.accelerometer = rig.Frames(log, 0x210)
        self.table = rig.Frames(log, 0x200)
        other = rig.Frames(log, 0x102)
        inside = self.inside(other.t)
        np.testing.assert_allclose(other.rate()[inside], rig.rate(other.t[inside]), atol=CLOSE_DPS, err_msg="gyro b")
        return rig.Frames(log, 0x101)

    def inside(self, t):
        """Far enough from the profile's ends that no points are missing, and that low-passes have settled."""
        return (t > 0.9) & (t < LENGTH_S - 0.2)

    def check(self, wanted, *effects, close=CLOSE_DPS):
        frames = self.readings(*effects)
        inside = self.inside(frames.t)
        np.testing.assert_allclose(frames.rate()[inside], wanted(frames.t)[inside], rtol=0, atol=close, err_msg=str(effects))
        return frames

    def test_without_effects_all_say_the_truth(self):
        frames = self.check(rig.rate)
        np.testing.assert_allclose(frames.temperature(), rig.temperature(frames.t), atol=0.51 * rig.TEMPERATURE_STEP_C)
        np.testing.assert_allclose(frames.supply(), rig.supply(frames.t), atol=0.51 * rig.SUPPLY_STEP_V)
        inside = self.inside(self.table.t)
        np.testing.assert_allclose(self.table.rate()[inside], rig.rate(self.table.t[inside]), atol=CLOSE_DPS)
        t = self.accelerometer.t
        inside = self.inside(t)
        np.testing.assert_allclose(self.accelerometer.acceleration()[:, inside], rig.acceleration(t[inside]),
                                   atol=0.6 * rig.ACCELERATION_STEP_G)
        self.assertEqual([len(frames.t), len(self.table.t), len(t)], [2001, 4000, 2000])
        np.testing.assert_array_equal(frames.counter(), np.arange(2001) % 256)

    def test_offsets(self):
        def plus(added):
            return lambda t: rig.rate(t) + added(t)
        t_ref = 21.0
        self.check(plus(lambda t: 0.25), effect("bias", value_dps=0.25))
        self.check(plus(lambda t: -2e-3 * t), effect("bias_ramp", slope_dps_s=-2e-3))
        self.check(plus(lambda t: 0.1 * (t >= 7.0)), effect("bias_step", size_dps=0.1, at_s=7.0))
        self.check(plus(lambda t: 0.3 * np.exp(-t / 6.0)), effect("warm_up", amplitude_dps=0.3, tau_s=6.0))
        self.check(plus(lambda t: 0.2 * np.log(1 + t / 0.7)), effect("run_in", coefficient_dps=0.2, tau_s=0.7))
        self.check(plus(lambda t: 0.02 * (rig.temperature(t) - t_ref)),
                   effect("temperature_bias", coefficient_dps_k=0.02, reference_c=t_ref))
        self.check(plus(lambda t: 0.01 * (rig.temperature(t) - 25.0) ** 2),
                   effect("temperature_bias_quadratic", coefficient_dps_k2=0.01))
        self.check(plus(lambda t: 0.05 * rig.temperature_slope(t)), effect("temperature_rate_bias", coefficient_dps_s_k=0.05))
        for play_k in (0.7, 2.5):
            self.check(plus(lambda t: 0.05 * (rig.follow(rig.temperature(t), play_k) - rig.temperature(t))),
                       effect("temperature_hysteresis", coefficient_dps_k=0.05, play_k=play_k))
        self.check(plus(lambda t: 0.3 * (rig.supply(t) - 4.5)),
                   effect("supply_voltage_bias", coefficient_dps_v=0.3, reference_v=4.5))
        self.check(plus(lambda t: -0.3 * (rig.supply(t) - 5.0)), effect("supply_voltage_bias", coefficient_dps_v=-0.3))
        for axis in range(3):
            self.check(plus(lambda t: 0.04 * rig.acceleration(t)[axis]),
                       effect("g_sensitivity", axis="xyz"[axis], coefficient_dps_g=0.04))
        # The angle includes the error of the curve in the first rows.
        self.check(plus(lambda t: 0.2 * np.cos(2 * rig.angle_rad(t) + 0.4)),
                   effect("angle_harmonic", harmonic=2, amplitude_dps=0.2, phase_rad=0.4), close=2e-6)
        self.check(plus(lambda t: 0.2 * np.sin(2 * np.pi * 33.3 * t + 1.0)),
                   effect("line", frequency_hz=33.3, amplitude_dps=0.2, phase_rad=1.0))

    def test_other_axes(self):
        """The second gyro's frame holds them; they have the same lag as its own rate, in the reading and in the frame."""
        for axis, coefficient, other in (("x", 0.03, rig.roll), ("y", -0.2, rig.pitch)):
            known = effect("cross_axis", 2, **{"from": axis}, coefficient=coefficient)
            self.check_second(lambda t: rig.rate(t) + coefficient * other(t), rig.roll, known)
        late = effect("cross_axis", 2, **{"from": "x"}, coefficient=0.03), effect("delay", 2, seconds=0.02), effect("bandwidth", 2, cutoff_hz=8.0)
        low_passed = lambda t, sines: rig.low_passed_sines(t - 0.02, sines, 8.0)
        self.check_second(lambda t: low_passed(t, rig.SINES) + 0.03 * low_passed(t, rig.ROLL_SINES),
                          lambda t: low_passed(t, rig.ROLL_SINES), *late)

    def check_second(self, wanted, roll, *effects):
        with tempfile.TemporaryDirectory() as folder:
            frames = rig.Frames(rig.simulate(folder, effects, rig.profile(LENGTH_S)), 0x102)
        inside = self.inside(frames.t)
        # The stamp has whole microseconds, the reading belongs to the exact instant.
        t = (np.arange(len(frames.t)) + 0.23) / RATE_HZ
        np.testing.assert_allclose(frames.t, t, atol=1e-6)
        np.testing.assert_allclose(frames.rate()[inside], wanted(t)[inside], rtol=0, atol=1.5 * CLOSE_DPS)
        np.testing.assert_allclose(frames.roll()[inside], roll(t)[inside], rtol=0, atol=0.51 * rig.ROLL_STEP_DPS)

    def test_vibration(self):
        self.check(lambda t: rig.rate(t) + 2.0 * vibration(t, self.accelerometer.t),
                   effect("vibration_rectification", coefficient_dps_g2=2.0), close=3e-6)

    def test_responses(self):
        r = rig.rate
        self.check(lambda t: r(t) * (1 + 4e-3), effect("scale_factor", error=4e-3))
        self.check(lambda t: r(t) + 4e-3 * np.abs(r(t)), effect("scale_factor_asymmetry", error=4e-3))
        self.check(lambda t: r(t) + 1e-3 * r(t) ** 2, effect("scale_factor_quadratic", coefficient_per_dps=1e-3))
        self.check(lambda t: r(t) + 1e-5 * r(t) ** 3, effect("scale_factor_cubic", coefficient_per_dps2=1e-5))
        self.check(lambda t: r(t) * (1 + 1e-3 * (rig.temperature(t) - 25.0)), effect("scale_factor_temperature", coefficient_per_k=1e-3))
        self.check(lambda t: 1.004 * r(t) + 1e-3 * r(t) ** 2, effect("scale_factor", error=4e-3),
                   effect("scale_factor_quadratic", coefficient_per_dps=1e-3))

    def test_lags(self):
        self.check(lambda t: rig.rate(t - 0.0137), effect("delay", seconds=0.0137))
        self.check(lambda t: rig.rate(t + 0.004), effect("delay", seconds=-0.004))
        self.check(lambda t: rig.low_passed(t, 5.0), effect("bandwidth", cutoff_hz=5.0))
        self.check(lambda t: rig.low_passed(t, 60.0), effect("bandwidth", cutoff_hz=60.0))
        for damping in (0.3, 0.7):
            self.check(lambda t: rig.low_passed_twice(t, 6.0, damping), effect("bandwidth_second_order", cutoff_hz=6.0, damping=damping))
        self.check(lambda t: 1.01 * rig.low_passed(t - 0.005, 60.0), effect("bandwidth", cutoff_hz=60.0),
                   effect("delay", seconds=0.005), effect("scale_factor", error=0.01))

    def test_clips(self):
        r = rig.rate
        self.check(lambda t: np.clip(r(t), -12.5, 12.5), effect("saturation", limit_dps=12.5))
        self.check(lambda t: np.where(np.abs(r(t)) < 5.0, 0.0, r(t)), effect("dead_band", width_dps=5.0))
        frames = self.readings(effect("quantization", step_dps=0.25))
        np.testing.assert_allclose(frames.rate() / 0.25, np.rint(frames.rate() / 0.25), atol=1e-5)
        inside = self.inside(frames.t)
        self.assertLess(np.max(np.abs(frames.rate() - r(frames.t))[inside]), 0.125 + 2e-6)

    def test_stuck(self):
        frames = self.readings(effect("stuck", from_s=5.005, to_s=6.005))
        frozen = (frames.t >= 5.005) & (frames.t < 6.005)
        self.assertEqual(np.count_nonzero(frozen), 100)
        self.assertEqual(set(frames.rate()[frozen]), {frames.rate()[500]})
        free = self.inside(frames.t) & ~frozen
        np.testing.assert_allclose(frames.rate()[free], rig.rate(frames.t[free]), atol=CLOSE_DPS)


class Chance(unittest.TestCase):
    """Random effects, at rest unless stated."""

    def frames(self, seconds, *effects, arguments=(), text=None):
        with tempfile.TemporaryDirectory() as folder:
            log = rig.simulate(folder, effects, text or rig.rest(seconds), "--seed", SEED, *arguments)
        return rig.Frames(log, 0x101), rig.Frames(log, 0x102)

    def expect_variance(self, values, wanted, degrees=None):
        degrees = degrees or len(values)
        self.assertAlmostEqual(np.mean(values**2) / wanted, 1.0, delta=SIGMAS * math.sqrt(2.0 / degrees))

    def test_white_noise_of_both_gyros_at_their_own_rates(self):
        a, b = self.frames(400, effect("white_noise", density_dps_rthz=2e-4), effect("white_noise", 2, density_dps_rthz=3e-4),
                           arguments=("--gyro-rate", "50,200"))
        self.assertEqual([len(a.t), len(b.t)], [20001, 80000])
        step = rig.RATE_STEP_DPS**2 / 12
        self.expect_variance(a.rate(), 2e-4**2 * 50 + step)
        self.expect_variance(b.rate(), 3e-4**2 * 200 + step)
        # For white noise, the sum over seconds follows from the mean square alone.
        sums = b.rate()[:80000].reshape(-1, 200).mean(axis=1)
        self.expect_variance(sums, 3e-4**2 + step / 200)

    def test_random_walk(self):
        a, _ = self.frames(600, effect("rate_random_walk", density_dps_rts=2e-3))
        for samples in (1, 100):
            increments = np.diff(a.rate()[::samples])
            self.expect_variance(increments, 2e-3**2 * samples / RATE_HZ + 2 * rig.RATE_STEP_DPS**2 / 12)

    def test_gauss_markov(self):
        a, _ = self.frames(2000, effect("gauss_markov", sigma_dps=5e-3, tau_s=0.5))
        y = a.rate()
        independent = 2000 / 0.5
        self.expect_variance(y, 5e-3**2, degrees=independent)
        for lag in (10, 50, 100):
            wanted = math.exp(-lag / RATE_HZ / 0.5)
            self.assertAlmostEqual(np.mean(y[lag:] * y[:-lag]) / 5e-3**2, wanted, delta=SIGMAS * math.sqrt(2 / independent))

    def test_bias_instability(self):
        """Flicker: the Allan deviation is 0.664 B for any averaging time."""
        a, _ = self.frames(4000, effect("bias_instability", coefficient_dps=5e-3))
        sums = np.concatenate([[0.0], np.cumsum(a.rate())])
        for samples in (20, 100, 500, 2000):
            means = np.diff(sums[::samples]) / samples
            steps = np.diff(means)
            # Neighbouring steps of flicker are slightly correlated: half of them count.
            self.expect_variance(steps / math.sqrt(2), (0.664 * 5e-3) ** 2, degrees=len(steps) / 2)
        # At the end of the spectrum, the sampling rate, nothing is aliased and little is missing.
        self.assertAlmostEqual(np.mean(np.diff(a.rate()) ** 2) / 2 / (0.664 * 5e-3) ** 2, 1.0, delta=0.15)

    def test_rate_noise(self):
        text = rig.profile(300)
        a, b = self.frames(300, effect("rate_noise", ratio_rthz=1e-4), text=text)
        inside = (a.t > 0.2) & (a.t < 299.8)
        truth = rig.rate(a.t)[inside]
        noise = a.rate()[inside] - truth
        moving = np.abs(truth) > 0.5
        self.expect_variance(noise[moving] / np.abs(truth[moving]), 1e-4**2 * RATE_HZ)

    def test_spikes(self):
        a, _ = self.frames(2000, effect("spikes", rate_hz=0.4, size_dps=3.0))
        up, down = np.count_nonzero(np.isclose(a.rate(), 3.0)), np.count_nonzero(np.isclose(a.rate(), -3.0))
        self.assertEqual(up + down, np.count_nonzero(a.rate()))
        self.assertAlmostEqual(up + down, 800, delta=SIGMAS * math.sqrt(800))
        self.assertAlmostEqual(up - down, 0, delta=SIGMAS * math.sqrt(800))

    def test_dropped_frames_leave_gaps_in_stamps_and_counters(self):
        a, b = self.frames(300, effect("dropped_frames", fraction=0.1))
        sent = 30001
        self.assertEqual(len(b.t), sent - 1)
        self.assertAlmostEqual(len(a.t), 0.9 * sent, delta=SIGMAS * math.sqrt(sent * 0.09))
        steps = np.diff(a.counter()) % 256
        np.testing.assert_array_equal(steps, np.rint(np.diff(a.t) * RATE_HZ).astype(int))

    def test_clock_skew_stretches_the_stamps_of_one_gyro(self):
        a, b = self.frames(1000, effect("clock_skew", ppm=200.0))
        np.testing.assert_allclose(a.t, np.arange(len(a.t)) / RATE_HZ * (1 + 200e-6), atol=1e-6)
        np.testing.assert_allclose(np.diff(b.t), 1 / RATE_HZ, atol=1.1e-6)

    def test_jitter_makes_stamps_late_and_keeps_their_order(self):
        for effects, arguments in (([effect("timestamp_jitter", sigma_s=5e-4)], ()), ([], ("--jitter", "5e-4"))):
            a, _ = self.frames(300, *effects, arguments=arguments)
            late = a.t - np.arange(len(a.t)) / RATE_HZ
            self.assertGreater(late.min(), -1e-6)
            self.expect_variance(late, 5e-4**2)
            self.assertAlmostEqual(late.mean(), 5e-4 * math.sqrt(2 / math.pi), delta=SIGMAS * 5e-4 / math.sqrt(len(late)))
        a, _ = self.frames(100, effect("timestamp_jitter", sigma_s=0.05))
        self.assertEqual(len(a.t), 10001)
        self.assertTrue(np.all(np.diff(a.t) >= 0))
        np.testing.assert_array_equal(np.diff(a.counter()) % 256, 1)

    def test_one_more_effect_leaves_the_noise_as_it_is(self):
        white = effect("white_noise", density_dps_rthz=2e-4)
        alone, _ = self.frames(20, white)
        both, _ = self.frames(20, effect("spikes", rate_hz=0.5, size_dps=1.0), white, effect("white_noise", 2, density_dps_rthz=1e-3))
        np.testing.assert_allclose(np.mod(both.rate() + 0.5, 1.0) - 0.5, alone.rate(), atol=1.1e-6)


class Streams(unittest.TestCase):
    """A seed gives the same recording in every version: each stream of random numbers is identified by names, not by
    the place of a kind in a list. The names are those of the model file."""

    SECONDS, JITTER_S, SEED = 8, 2e-4, 2**40 + 11

    def setUp(self):
        effects = [effect("white_noise", density_dps_rthz=2e-4), effect("rate_random_walk", density_dps_rts=1e-3),
                   effect("gauss_markov", sigma_dps=5e-3, tau_s=0.5), effect("bias_instability", coefficient_dps=4e-3),
                   effect("white_noise", density_dps_rthz=3e-4),
                   effect("spikes", rate_hz=4.0, size_dps=3.0), effect("timestamp_jitter", sigma_s=3e-4),
                   effect("white_noise", 2, density_dps_rthz=2e-4), effect("rate_noise", 2, ratio_rthz=1e-4),
                   effect("dropped_frames", 2, fraction=0.2), effect("bias", 2, value_dps=1.0)]
        text = rig.profile(self.SECONDS, motion=lambda t: np.full_like(t, 20.0))
        with tempfile.TemporaryDirectory() as folder:
            log = rig.simulate(folder, effects, text, "--seed", self.SEED, "--jitter", self.JITTER_S)
        self.a, self.b, self.table, self.accelerometer = (rig.Frames(log, i) for i in (0x101, 0x102, 0x200, 0x210))

    def normals(self, count, *names):
        stream = Stream(self.SEED, *names)
        return np.array([stream.normal() for _ in range(count)])

    def test_the_generator_here_is_the_standards(self):
        """[rand.predef] states the 10000th number of a generator that is seeded with 5489 and without seed_seq."""
        twister = Twister64([0])
        state = [5489]
        for i in range(1, 312):
            state.append((6364136223846793005 * (state[-1] ^ state[-1] >> 62) + i) % 2**64)
        twister.state, twister.next = state, 312
        for _ in range(9999):
            twister.draw()
        self.assertEqual(twister.draw(), 9981545732273789042)

    def test_readings(self):
        n = len(self.a.t)
        root = math.sqrt(RATE_HZ)
        wanted = 20.0 + root * (2e-4 * self.normals(n, "gyro 1", "white_noise") + 3e-4 * self.normals(n, "gyro 1", "white_noise", 1))
        walk = 1e-3 / root * self.normals(n, "gyro 1", "rate_random_walk")
        wanted += np.cumsum(np.where(np.arange(n) == 0, 0.0, walk))
        keep, drift = math.exp(-1 / RATE_HZ / 0.5), 0.0
        for i, normal in enumerate(self.normals(n, "gyro 1", "gauss_markov")):
            drift = 5e-3 * normal if i == 0 else keep * drift + 5e-3 * math.sqrt(1 - keep**2) * normal
            wanted[i] += drift
        # 15 terms, each for a factor of exp(step) of time, from 0.4 samples on, over nine decades.
        step = math.log(1e9) / 15
        keeps = [math.exp(-1 / RATE_HZ / (0.4 / RATE_HZ * math.exp((k + 0.5) * step))) for k in range(15)]
        sigma, terms = 4e-3 * math.sqrt(step / math.pi), [0.0] * 15
        for i, normals in enumerate(self.normals(15 * n, "gyro 1", "bias_instability").reshape(n, 15).tolist()):
            for k, (keep, normal) in enumerate(zip(keeps, normals)):
                keep = keep if i else 0.0
                terms[k] = keep * terms[k] + sigma * math.sqrt(1 - keep**2) * normal
            wanted[i] += sum(terms)
        spikes = Stream(self.SEED, "gyro 1", "spikes")
        for i in range(n):
            hit, sign = spikes.uniform() < 1 - math.exp(-4.0 / RATE_HZ), -1 if spikes.uniform() < 0.5 else 1
            wanted[i] += 3.0 * sign * hit
        np.testing.assert_allclose(self.a.rate(), wanted, rtol=0, atol=CLOSE_DPS)

    def test_losses(self):
        sent = round(self.SECONDS * RATE_HZ)
        losses = Stream(self.SEED, "gyro 2", "dropped_frames")
        kept = np.array([losses.uniform() >= 0.2 for _ in range(sent)])
        np.testing.assert_array_equal(self.b.counter(), np.arange(sent)[kept] % 256)
        wanted = 21.0 + math.sqrt(RATE_HZ) * (2e-4 * self.normals(sent, "gyro 2", "white_noise")
                                              + 1e-4 * 20.0 * self.normals(sent, "gyro 2", "rate_noise"))
        np.testing.assert_allclose(self.b.rate(), wanted[kept], rtol=0, atol=CLOSE_DPS)

    def test_stamps(self):
        for frames, sender, rate_hz, offset in ((self.a, "gyro 1", 100, 0.0), (self.table, "reference", 200, 0.22),
                                                (self.accelerometer, "accelerometer", 100, 0.06)):
            n = len(frames.t)
            late = np.abs(self.JITTER_S * self.normals(n, sender, "jitter"))
            if sender == "gyro 1":
                late += np.abs(3e-4 * self.normals(n, sender, "timestamp_jitter"))
            np.testing.assert_allclose(frames.t, (np.arange(n) + offset) / rate_hz + late, rtol=0, atol=1.1e-6, err_msg=sender)


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main(verbosity=1)
