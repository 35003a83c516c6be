#!/usr/bin/python3
"""Independent tests of the drives: road noise is one function of time that gyros alias at their own instants,
low-passes are those of continuous signals, flicker has its Allan floor, effects have their stated strength."""

import sys
import unittest
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import drive  # noqa: E402
import drive_strength  # noqa: E402
import motion  # noqa: E402
import road  # noqa: E402
import world as truth  # noqa: E402
from cases import Case, hidden_in, world_for  # noqa: E402

SEED = 30
BROAD = road.Spectrum(1.0, 20.0, 2.0)


def small_drive(seed=SEED, spectrum=BROAD, road_dps=0.5):
    rng = np.random.default_rng(seed)
    return road.Drive(road.Course(120.0, 20.0, rng), spectrum, road_dps, rng)


def world_of(seed, reference=False, **more):
    case = Case("clean", seed, reference=reference, short=True, world="drive", **more)
    return case, world_for(case, np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1]))


def welch(x, interval_s, length):
    parts = x[: len(x) // length * length].reshape(-1, length)
    taper = np.hanning(length)
    power = np.abs(np.fft.rfft(parts * taper, axis=1)) ** 2
    return np.fft.rfftfreq(length, interval_s), 2 * interval_s * power.mean(axis=0) / (taper**2).sum()


class Road(unittest.TestCase):
    def test_is_one_function_of_time_however_it_is_sampled(self):
        drive_ = small_drive()
        fine = np.arange(30.0, 60.0, 1.0 / (4 * road.GRID_HZ))
        values = drive_.rate(fine)
        spectrum = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
        f = np.fft.rfftfreq(len(values), fine[1] - fine[0])
        self.assertLess(spectrum[f > 2 * road.HIGHEST_HZ].sum(), 1e-6 * spectrum[f > road.SLOW_HZ].sum())
        at_samples = drive_.rate(fine[::80])
        np.testing.assert_allclose(at_samples, values[::80], atol=1e-9)

    def test_is_as_large_between_the_points_of_its_grid_as_at_them(self):
        """Two gyros sample at different places between the grid points: a gain of its own there would look like a
        scale factor."""
        drive_ = small_drive()
        at = np.arange(20.0, 100.0, 1.0 / road.GRID_HZ)
        turns = np.sin(2 * np.pi * 1.7 * drive_._grid)
        for share in (0.1, 0.3, 0.5, 0.6):
            t = at + share / road.GRID_HZ
            np.testing.assert_allclose(drive_._read(turns, t), np.sin(2 * np.pi * 1.7 * t), atol=5e-7)

    def test_folds_what_is_beyond_half_the_sampling_rate(self):
        """In samples at 50 Hz, the power below 25 Hz is the power of the whole road noise."""
        drive_ = small_drive(spectrum=road.Spectrum(1.0, 60.0, 4.0))
        t = np.arange(20.0, 119.0, 0.02)
        noise = (drive_.rate(t) - drive_.slow_rate(t)) / np.maximum(drive_.road_rms(t), 1e-9)
        driving = drive_.road_rms(t) > 0.05
        self.assertAlmostEqual(noise[driving].var(), 1.0, delta=0.1)
        f = np.arange(0.0, 25.0, 0.01)
        self.assertLess(drive_.spectrum.power(f).sum() * 0.01, 0.6)

    def test_follows_its_spectrum(self):
        drive_ = small_drive()
        t = np.arange(25.0, 115.0, 1e-3)
        noise = (drive_.rate(t) - drive_.slow_rate(t)) / np.maximum(drive_.road_rms(t), 0.02)
        f, power = welch(noise[drive_.road_rms(t) > 0.1], 1e-3, 2000)
        for low, high in ((2, 8), (8, 30), (30, 100)):
            band = (f >= low) & (f < high)
            self.assertAlmostEqual(power[band].mean() / BROAD.power(f[band]).mean(), 1.0, delta=0.2)

    def test_rests_where_the_vehicle_stands(self):
        drive_ = small_drive()
        t = np.arange(0.5, 19.0, 0.01)
        np.testing.assert_allclose(drive_.rate(t), motion.EARTH_DPS, atol=1e-6)

    def test_low_passes_and_slope_are_those_of_the_continuous_function(self):
        drive_ = small_drive()
        t = np.arange(40.0, 50.0, 0.013)
        h = 1e-4
        slope = (drive_.rate(t + h) - drive_.rate(t - h)) / (2 * h)
        np.testing.assert_allclose(drive_.acceleration(t), slope, atol=5e-3 * np.abs(slope).max())
        cutoff_hz, step = 20.0, 2e-4
        fine = np.arange(39.0, 50.0, step)
        rate, keep = drive_.rate(fine), np.exp(-2 * np.pi * cutoff_hz * step)
        value, out = rate[0], []
        for now, before in zip(rate, np.concatenate([rate[:1], rate])):
            value = keep * value + (1 - keep) * (now + before) / 2
            out.append(value)
        np.testing.assert_allclose(drive_.low_passed(t, cutoff_hz), np.interp(t, fine, out), atol=2e-3)


class Gyros(unittest.TestCase):
    def test_flicker_has_the_allan_floor_of_its_coefficient(self):
        floors = []
        for seed in range(12):
            x = truth.flicker(20_000, 0.1, 2e-3, np.random.default_rng(seed))
            for m in (30, 100, 300):
                means = x[: len(x) // m * m].reshape(-1, m).mean(axis=1)
                floors.append(0.5 * np.mean(np.diff(means) ** 2))
        self.assertAlmostEqual(np.sqrt(np.mean(floors)) / (0.664 * 2e-3), 1.0, delta=0.1)

    def test_markov_terms_of_the_model_file_are_as_loud_as_the_flicker(self):
        coefficient, density = 1e-3, 5e-3
        terms = drive.flicker_terms(coefficient, density, 600.0)
        for f in (0.002, 0.004):
            markov = sum(2 * s**2 * tau / (1 + (2 * np.pi * f * tau) ** 2) for s, tau in terms)
            self.assertAlmostEqual(markov / (coefficient**2 / (2 * np.pi * f)), 1.0, delta=0.45)

    def test_same_seed_same_gyros_and_another_drive_for_the_fresh_recording(self):
        case = Case("clean", 5, reference=False, short=True, world="drive")
        make = lambda i: world_for(case, np.random.default_rng(1), np.random.default_rng(i))
        one, other = make(1), make(2)
        self.assertEqual(one.gyros, other.gyros)
        t = np.arange(60.0, 200.0, 1.0)
        self.assertGreater(np.abs(one.motion.rate(t) - other.motion.rate(t)).max(), 1.0)


class Strength(unittest.TestCase):
    def test_what_folds_hides_effects_as_much_as_the_density_says(self):
        """Two gyros with offset instants: the variance of one's rate that the other does not predict, below 1 Hz."""
        _, world = world_of(41)
        quiet = [dict(density=1e-6, walk=0.0, bias=0.0, flicker=0.0, filters_hz=(), period_ppm=0.0, rate_step=1e-9)] * 2
        world.gyros = [truth.Gyro(**g) for g in quiet]
        world.offset_s = 0.0023
        course = road.Course(240.0, 20.0, np.random.default_rng(3))
        course.stretches, course.bends = [road.Stretch(20.0, 239.0, 20.0, 5.0)], []
        course.rough = course.rough[0], np.ones(len(course.rough[0]))
        world.motion = road.Drive(course, road.Spectrum(1.0, 40.0, 2.0), 0.5, np.random.default_rng(4))
        see = drive_strength.Visible(world, 2)
        left, right = (truth.reading(world, g, [], [], np.random.default_rng(5))[3] for g in (1, 2))
        # Below 1 Hz there are only aliases; the difference shows all of them.
        f, power = welch((right - left)[3000:23000], 0.01, 1000)
        found = power[(f > 0.2) & (f < 0.8)].mean() / 2
        expected = see.slow()[4:22].mean()
        self.assertLess(abs(np.log(found / expected)), np.log(1.6), (found, expected))

    def test_slow_effects_stand_out_as_in_generalised_least_squares(self):
        """Compares the filter's |t| with the textbook's formula with the whole covariance of both gyros, including
        stops."""
        rng = np.random.default_rng(8)
        count = 240
        shape, rests = np.cumsum(rng.standard_normal(count)), np.arange(count) % 60 < 15
        white, alone, walks = np.full(count, 0.5), (0.2, 0.1), (0.01, 0.03)
        drift = np.minimum.outer(np.arange(1, count + 1), np.arange(1, count + 1))
        rows, seen, noise = [], [], []
        for i in range(count):
            for h, k, x, n in ([(1, 0, shape[i], 0.2), (0, 1, 0.0, 0.1)] if rests[i] else [(1, -1, shape[i], 0.5)]):
                rows.append((i, h, k)), seen.append(x), noise.append(n)
        i, h, k = np.array(rows).T
        both = walks[0] * np.outer(h, h) + walks[1] * np.outer(k, k)
        covariance = both * drift[np.ix_(i, i)] + np.diag(noise) + drive_strength.UNKNOWN_DPS**2 * (
            np.outer(h, h) + np.outer(k, k)
        )
        expected = np.sqrt(seen @ np.linalg.solve(covariance, seen))
        found = drive_strength._fisher_t(shape, white, alone, rests, walks, False)
        self.assertAlmostEqual(found / expected, 1.0, delta=1e-6)

    def test_a_delay_shows_by_what_its_information_says(self):
        _, world = world_of(42)
        gyro = dict(walk=0.0, bias=0.0, flicker=0.0, filters_hz=(), period_ppm=0.0, rate_step=1e-9)
        world.gyros = [truth.Gyro(density=1e-6, **gyro), truth.Gyro(density=5e-3, **gyro)]
        world.offset_s = 0.0
        world.motion.spectrum = road.Spectrum(1.0, 10.0, 8.0)
        see = drive_strength.Visible(world, 2)
        t = world.times(2)
        world.motion = road.Drive(world.motion.course, world.motion.spectrum, world.motion.road_dps, np.random.default_rng(9))
        slope = world.motion.acceleration(t) - np.gradient(world.motion.slow_rate(t), t)
        direct = np.sum(slope**2) / (5e-3**2 * 100.0)
        self.assertLess(abs(np.log(see.lateness().sum() / direct)), np.log(1.5))

    def test_what_came_later_to_the_catalogue_hides_only_where_it_is_asked_for(self):
        self.assertLessEqual(drive.LATER, set(drive.kinds.KINDS))
        pairs = [Case("pair", 28 + i, reference=False, short=True, strength=8.0, world="drive") for i in range(40)]
        for case in pairs:
            kinds = drive._chosen(case, np.random.default_rng(case.seed))
            self.assertFalse(drive.LATER & set(kinds))

    def test_a_second_order_filter_hides_in_no_gyro_that_has_one(self):
        for seed in range(12):
            case, world = world_of(50 + seed)
            for gyro in (1, 2):
                if world.gyros[gyro - 1].filters_hz:
                    self.assertFalse(drive.fits("bandwidth_second_order", gyro, world, case))

    def test_sizes_stay_what_a_sensor_may_have(self):
        for seed in range(12):
            case, world = world_of(50 + seed)
            single = Case("single", case.seed, reference=False, short=True, strength=8.0, world="drive")
            found, _, _ = hidden_in(single, world, np.random.default_rng(seed))
            self.assertEqual(len(found), 1)
            size = found[0]["parameters"][drive.kinds.SIZE[found[0]["kind"]][0]]
            sort = world.traits["pair"].split("/")[found[0]["gyro"] - 1]
            self.assertLessEqual(abs(size), drive.most(found[0]["kind"], sort))


if __name__ == "__main__":
    unittest.main()
