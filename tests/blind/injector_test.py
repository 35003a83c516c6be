#!/usr/bin/python3
"""Independent tests of the injector: effects have their stated strength, other programs decode the recordings,
and the motion's formulas are consistent."""

import lzma
import sys
import tempfile
import unittest
from pathlib import Path

import can
import canmatrix.formats
import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import effects as kinds  # noqa: E402
import injector  # noqa: E402
import motion  # noqa: E402
import strangers  # noqa: E402
import strength  # noqa: E402
import surroundings  # noqa: E402
import world as truth  # noqa: E402
from cases import Case  # noqa: E402

SEED = 20
WANTED_T = 12.0


def small_world(seed, rate_hz=4.0, reference=True):
    rng = np.random.default_rng(seed)
    return truth.World(
        motion=motion.Motion(240.0, 40.0, rng),
        temperatures=[surroundings.Temperature(240.0, rng) for _ in range(2)],
        acceleration=surroundings.Acceleration(240.0, rng, vibration=True),
        gyros=[truth.Gyro(0.03, 2e-4, 8e-6), truth.Gyro(-0.02, 6e-4, 2e-5)],
        rates_hz=[rate_hz, rate_hz],
        offset_s=0.0023,
        reference=reference,
        supplies=[surroundings.Supply(240.0, rng) for _ in range(2)],
        roll=surroundings.Roll(rng),
    )


def dense_covariance(count, sigma, walk):
    steps = np.arange(1, count + 1)
    return walk**2 * np.minimum.outer(steps, steps) + sigma**2 * np.eye(count)


def dense_gls(shape, y, covariance, level_known):
    """Estimate and standard error of the shape's size by the textbook's formula."""
    columns = shape[:, None] if level_known else np.column_stack([shape, np.ones(len(shape))])
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, np.column_stack([columns, y]))
    normal = white[:, :-1].T @ white[:, :-1]
    inverse = np.linalg.inv(normal)
    return (inverse @ white[:, :-1].T @ white[:, -1])[0], np.sqrt(inverse[0, 0])


class Strength(unittest.TestCase):
    def test_effects_stand_out_by_the_wanted_t_in_generalised_least_squares(self):
        found = {}
        for i, kind in enumerate(kinds.OFFSETS + kinds.RESPONSES):
            world = small_world(SEED + i)
            rng = np.random.default_rng([SEED, i])
            gyro = 1 + i % 2
            effect = kinds.draw(kind, gyro, WANTED_T, world, rng)
            t = world.times(gyro)
            _, _, _, y = truth.reading(world, gyro, [effect], [], rng)
            y -= world.motion.rate(t) + world.gyros[gyro - 1].bias
            sigma, walk = world.noise_seen(gyro)
            shape = kinds.shape(kind, effect["parameters"], gyro, t, world)
            size, error = dense_gls(shape, y, dense_covariance(len(t), sigma, walk), kind == "bias")
            true = effect["parameters"][kinds.SIZE[kind][0]]
            self.assertAlmostEqual(abs(true) / error, WANTED_T, delta=0.01, msg=kind)
            found[kind] = (size - true) / error
        worst = max(found, key=lambda kind: abs(found[kind]))
        self.assertLess(abs(found[worst]), 4.0, f"{worst}: {found}")
        rms = np.sqrt(np.mean(np.square(list(found.values()))))
        self.assertTrue(0.5 < rms < 1.5, found)

    def test_without_a_reference_an_effect_shows_among_the_noise_of_both(self):
        seen, alone = (small_world(SEED, reference=r).noise_seen(1) for r in (False, True))
        np.testing.assert_allclose(alone, [2e-4 * 2.0, 8e-6 / 2.0])
        np.testing.assert_allclose(seen, [np.hypot(2e-4, 6e-4) * 2.0, np.hypot(8e-6, 2e-5) / 2.0])

    def test_lags_are_as_large_as_their_first_order(self):
        """Delay and bandwidth, sized by −dΩ/dt, shift the reading by that much."""
        world = small_world(SEED, 100.0)
        t = world.times(1)
        for kind, parameters, lag_s in (
            ("delay", {"seconds": 1e-4}, 1e-4),
            ("bandwidth", {"cutoff_hz": 1600.0}, 1 / (2 * np.pi * 1600.0)),
            ("bandwidth_second_order", {"cutoff_hz": 1600.0, "damping": 0.6}, 0.6 / (np.pi * 1600.0)),
        ):
            e = {"kind": kind, "gyro": 1, "parameters": parameters}
            with_it, without = (
                truth.reading(world, 1, es, [], np.random.default_rng(1))[3] for es in ([e], [])
            )
            added = with_it - without
            np.testing.assert_allclose(
                added, -lag_s * world.motion.acceleration(t), atol=0.01 * np.abs(added).max()
            )

    def test_responses_are_to_the_rate_that_comes_late(self):
        """A scale error enlarges every reading by its share, late or not."""
        world = small_world(SEED, 100.0)
        lags = [
            {"kind": "delay", "gyro": 1, "parameters": {"seconds": 0.02}},
            {"kind": "bandwidth", "gyro": 1, "parameters": {"cutoff_hz": 10.0}},
        ]
        scale = {"kind": "scale_factor", "gyro": 1, "parameters": {"error": 2e-3}}
        for late in (lags[:1], lags[1:], lags):
            with_it, without = (
                truth.reading(world, 1, es, [], np.random.default_rng(1))[3] for es in ([scale, *late], late)
            )
            # The late rate, by the definition of each lag.
            t = world.times(1) - (0.02 if late[0]["kind"] == "delay" else 0.0)
            rate = world.motion.low_passed(t, 10.0) if late[-1]["kind"] == "bandwidth" else world.motion.rate(t)
            np.testing.assert_allclose(with_it - without, 2e-3 * rate, atol=1e-12)

    def test_noise_stands_out_by_the_wanted_t_in_the_likelihood(self):
        """Twice the mean log-likelihood ratio of true to false noise is t²."""
        for kind in ("white_noise", "rate_noise", "rate_random_walk"):
            world, ratios = small_world(SEED), []
            effect = kinds.draw(kind, 1, WANTED_T, world, np.random.default_rng(SEED))
            sigma, walk = world.noise_seen(1)
            t = world.times(1)
            size = next(iter(effect["parameters"].values()))
            before = dense_covariance(len(t), sigma, walk)
            after = before.copy()
            if kind == "white_noise":
                after += np.eye(len(t)) * size**2 * 4.0
            elif kind == "rate_noise":
                after += np.diag((size * world.motion.rate(t)) ** 2 * 4.0)
            else:
                after += dense_covariance(len(t), 0.0, size / 2.0)
            factors = [np.linalg.cholesky(c) for c in (before, after)]
            whiteners = [(np.linalg.inv(f), np.log(np.diag(f)).sum()) for f in factors]
            for draw in range(60):
                rng = np.random.default_rng([SEED, draw])
                _, _, _, y = truth.reading(world, 1, [effect], [], rng)
                y -= world.motion.rate(t) + world.gyros[0].bias
                score = [np.sum((w @ y) ** 2) / 2 + logarithm for w, logarithm in whiteners]
                ratios.append(score[0] - score[1])
            t_found = np.sqrt(2 * np.mean(ratios))
            self.assertAlmostEqual(t_found / WANTED_T, 1.0, delta=0.15, msg=kind)


class Truth(unittest.TestCase):
    def test_angle_rate_and_acceleration_are_of_one_motion(self):
        m = small_world(SEED).motion
        t = np.random.default_rng(SEED).uniform(1.0, 238.0, 3000)
        h = 1e-3
        np.testing.assert_allclose((m.angle_deg(t + h) - m.angle_deg(t - h)) / (2 * h), m.rate(t), atol=2e-2)
        np.testing.assert_allclose(
            (m.rate(t + h) - m.rate(t - h)) / (2 * h), m.acceleration(t), rtol=1e-3, atol=0.2
        )

    def test_angle_is_the_integral(self):
        m = small_world(SEED).motion
        fine = (np.arange(240 * 5000) + 0.5) / 5000
        self.assertAlmostEqual(m.angle_deg(np.array([240.0]))[0], m.rate(fine).sum() / 5000, delta=1e-4)

    def test_low_pass_solves_its_differential_equation(self):
        m = small_world(SEED).motion
        for cutoff_hz in (4.0, 60.0):
            h, begin, seconds = 1 / 8000, 45.0, 20.0
            t = begin + np.arange(int(seconds / h)) * h
            rates = m.rate(np.stack([t, t + h / 2, t + h])).T.tolist()
            a, y, out = 2 * np.pi * cutoff_hz, float(m.low_passed(np.array([begin]), cutoff_hz)[0]), []
            for r0, r1, r2 in rates:  # Runge–Kutta of y' = a·(rate − y)
                out.append(y)
                k1 = a * (r0 - y)
                k2 = a * (r1 - y - h / 2 * k1)
                k3 = a * (r1 - y - h / 2 * k2)
                k4 = a * (r2 - y - h * k3)
                y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            # A twentieth of the quietest gyro's noise a sample.
            np.testing.assert_allclose(m.low_passed(t[::40], cutoff_hz), out[::40], atol=5e-5)

    def test_low_pass_of_second_order_turns_a_sine_as_its_formula_says(self):
        m = small_world(SEED).motion
        m.segments = [motion.Tones(-1e3, 1e3, 1.0, (1.3,), (50.0,), (0.4,))]
        t = np.arange(100.0, 104.0, 0.01)
        for cutoff_hz, damping in ((4.0, 0.5), (9.0, 0.9)):
            x = 1j * 1.3 / cutoff_hz
            sine = 50.0 * np.exp(1j * (2 * np.pi * 1.3 * (t + 1e3) + 0.4)) / (1 + 2 * damping * x + x * x)
            np.testing.assert_allclose(
                m.low_passed_twice(t, cutoff_hz, damping), sine.imag + motion.EARTH_DPS, atol=5e-5
            )

    def test_motion_reaches_the_form_that_recordings_need(self):
        for seed in range(5):
            m = motion.Motion(480.0, 62.0, np.random.default_rng(seed))
            t = np.arange(0, 480, 0.01)
            rate = m.rate(t)
            self.assertTrue(80.0 < np.abs(rate).max() <= 101.0)
            np.testing.assert_array_equal(rate[t < 62.0], motion.EARTH_DPS)
            self.assertLess(rate.min(), -60.0)
            tones = [f for s in m.segments if isinstance(s, motion.Tones) for f in s.frequencies_hz]
            self.assertTrue(3.5 < max(tones) < 5.6)

    def test_temperature_slope_is_the_derivative(self):
        T = small_world(SEED).temperatures[0]
        t = np.random.default_rng(SEED).uniform(3.0, 235.0, 2000)
        np.testing.assert_allclose((T.value(t + 1e-3) - T.value(t - 1e-3)) / 2e-3, T.slope(t), atol=1e-4)

    def test_play_is_dragged_along_by_the_temperature_and_never_further_away(self):
        T = small_world(SEED).temperatures[0]
        t = np.arange(0.0, 240.0, 0.013)
        now, held = T.value(t), T.with_play(t, 1.2)
        self.assertLess(np.abs(now - held).max(), 1.2 + 1e-12)
        self.assertGreater(np.abs(now - held).max(), 1.2 - 1e-9)
        moved = np.diff(held)
        dragged = np.abs(np.abs(now - held)[1:] - 1.2) < 1e-9
        # Except for the part by which it was dragged before the temperature reversed between two instants.
        np.testing.assert_allclose(moved[~dragged], 0.0, atol=1e-4)
        # While it is dragged, it moves in the direction of the temperature.
        self.assertTrue(np.all(moved[dragged] * np.diff(now)[dragged] >= -1e-12))
        self.assertEqual(held[0], now[0])

    def test_flicker_has_the_allan_deviation_that_its_coefficient_says(self):
        """0.664 B at every averaging time."""
        rng, squares = np.random.default_rng(SEED), {4: [], 32: [], 256: []}
        for _ in range(40):
            y = truth.flicker(8192, 0.01, 3e-3, rng)
            for n in squares:
                means = y[: 8192 // n * n].reshape(-1, n).mean(axis=1)
                squares[n].append(np.mean(np.diff(means) ** 2) / 2)
        for n, values in squares.items():
            self.assertAlmostEqual(np.sqrt(np.mean(values)) / (0.664 * 3e-3), 1.0, delta=0.04, msg=f"{n} samples")

    def test_vibration_is_the_variance_of_the_second_before(self):
        a = small_world(SEED).acceleration
        t = np.arange(10.0, 60.0, 1.3)
        slow = [np.linalg.norm(a.value(np.arange(x - 1.0, x, 1e-3)), axis=1).var() for x in t]
        self.assertGreater(max(slow), 0.01)
        np.testing.assert_allclose(a.vibration_g2(t), slow, atol=0.003)

    def test_every_kind_and_stranger_touches_its_own_gyro_alone(self):
        world = small_world(SEED, 100.0)
        for i, kind in enumerate([*kinds.KINDS, *strangers.OF_THE_BENCH]):
            rng = np.random.default_rng([SEED, i])
            if kind in kinds.KINDS:
                with_it = [kinds.draw(kind, 2, None, world, rng)], []
            else:
                with_it = [], [strangers.MAKERS[kind](2, 0.01, rng)]
            for gyro in (1, 2):
                changed, plain = (
                    truth.reading(world, gyro, *e, np.random.default_rng(7)) for e in (with_it, ([], []))
                )
                same = len(changed[3]) == len(plain[3]) and all(
                    np.array_equal(a, b) for a, b in zip(changed, plain)
                )
                self.assertEqual(same, gyro == 1, kind)


class Transport(unittest.TestCase):
    def read(self, kind, parameters):
        world = small_world(SEED, 100.0)
        e = {"kind": kind, "gyro": 1, "parameters": parameters}
        return truth.reading(world, 1, [e], [], np.random.default_rng(SEED))

    def test_each_disturbance_is_as_large_as_it_says(self):
        t, stamps, counter, rate = self.read("dropped_frames", {"fraction": 0.02})
        missing = counter[-1] + 1 - len(counter)
        self.assertAlmostEqual(missing, 480, delta=4 * np.sqrt(480))
        t, stamps, counter, rate = self.read("clock_skew", {"ppm": 150.0})
        np.testing.assert_allclose(stamps - t, 150e-6 * t, atol=1e-9)
        t, stamps, counter, rate = self.read("timestamp_jitter", {"sigma_s": 1e-3})
        self.assertGreaterEqual((stamps - t).min(), 0.0)
        self.assertAlmostEqual(np.sqrt(np.mean((stamps - t) ** 2)), 1e-3, delta=2e-5)
        t, stamps, counter, rate = self.read("stuck", {"from_s": 50.0, "to_s": 55.0})
        self.assertEqual(len(np.unique(rate[(t >= 50.0) & (t < 55.0)])), 1)
        t, stamps, counter, rate = self.read("saturation", {"limit_dps": 70.0})
        self.assertEqual(np.abs(rate).max(), 70.0)
        t, stamps, counter, rate = self.read("dead_band", {"width_dps": 0.2})
        self.assertTrue(np.all((rate == 0.0) | (np.abs(rate) >= 0.2)))
        t, stamps, counter, rate = self.read("quantization", {"step_dps": 0.02})
        np.testing.assert_allclose(np.round(rate / 0.02) * 0.02, rate, atol=1e-9)
        t, stamps, counter, rate = self.read("spikes", {"rate_hz": 0.5, "size_dps": 5.0})
        off = np.abs(rate - small_world(SEED, 100.0).motion.rate(t)) > 2.5
        self.assertAlmostEqual(off.sum(), 120, delta=4 * np.sqrt(120))


class Recording(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.scratch.name) / "case"
        cls.case = Case("clean", SEED, short=True)
        injector.make(cls.case, cls.folder, Path(cls.scratch.name) / "answer.json")
        text = lzma.open(cls.folder / "measured.log.xz").read()
        plain = Path(cls.scratch.name) / "measured.log"
        plain.write_bytes(text[: text.index(b"\n", 1_000_000) + 1])
        cls.frames = list(can.CanutilsLogReader(str(plain)))
        cls.matrix = canmatrix.formats.loadp_flat(str(cls.folder / "bench.dbc"))

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def signals(self, message):
        """Seconds and decoded signals of one message."""
        frame = self.matrix.frame_by_name(message)
        chosen = [f for f in self.frames if f.arbitration_id == frame.arbitration_id.id][:3000]
        decoded = [frame.decode(bytes(f.data)) for f in chosen]
        values = {n: np.array([float(d[n].phys_value) for d in decoded]) for n in decoded[0]}
        return np.array([f.timestamp for f in chosen]) - 1.7e9, values

    def test_others_decode_the_frames_and_find_the_noise_of_the_model_file(self):
        text = (self.folder / "model.toml").read_text()
        values = {(g, k): float(v) for g, k, v in _model_numbers(text)}
        for gyro, message in ((1, "LEFT_GYRO"), (2, "RIGHT_GYRO")):
            t, s = self.signals(message)
            rest = t < 20.0
            density = values[gyro, "white_noise"]
            noise = np.diff(s["YawRate"][rest]).std() / np.sqrt(2)
            self.assertAlmostEqual(noise / (density * 10.0), 1.0, delta=0.08)
            near = s["YawRate"][:200].mean() - values[gyro, "bias"] - motion.EARTH_DPS
            self.assertLess(abs(near), 5 * density / np.sqrt(2.0) + 5e-3 * ("gauss" in text))
            self.assertTrue(np.all(np.diff(s["Alive"]) % 256 == 1))
            self.assertLess(np.ptp(np.diff(t)), 3e-6)
            self.assertTrue(np.all(np.abs(s["Celsius"] - 25.0) < 40.0))
        t, s = self.signals("RATE_TABLE")
        self.assertAlmostEqual(s["Speed"][t < 20.0].std() / truth.REFERENCE_SIGMA_DPS, 1.0, delta=0.08)
        t, s = self.signals("CUBE")
        self.assertAlmostEqual(np.median(s["Az"]), 1.0, delta=0.01)

    def test_a_seed_makes_the_same_bytes_again_and_the_second_recording_is_another(self):
        again = Path(self.scratch.name) / "again"
        injector.make(self.case, again, None)
        for name in ("vgyro.toml", "bench.dbc", "model.toml", "measured.log.xz", "fresh.log.xz"):
            self.assertEqual((self.folder / name).read_bytes(), (again / name).read_bytes(), name)
        self.assertNotEqual((again / "measured.log.xz").read_bytes(), (again / "fresh.log.xz").read_bytes())


def _model_numbers(text):
    for table in text.split("[[effect]]")[1:]:
        lines = dict(line.split(" = ") for line in table.strip().splitlines())
        yield int(lines["gyro"]), lines["kind"].strip('"'), list(lines.values())[2]


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
