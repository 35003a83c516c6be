#!/usr/bin/python3
"""Compares `vgyro replay` with the paper's method in its literal form: every sample kept, every polynomial fitted
with NumPy, predict, correct, cross-calibrate and average as five separate steps. The recordings have equal stamps
for both gyros, so that the alignment is the identity."""

import dataclasses
import itertools
import logging
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "twin"))
import canlog  # noqa: E402
import make_twin  # noqa: E402
import product  # noqa: E402

SEED = 20240611
REST_RATE_DPS = make_twin.EARTH_DPS
# Differences allowed for rounding to the wire's step and for the arithmetic of two programs.
RATE_TOLERANCE_DPS = canlog.RATE_STEP_DPS / 2 + 1e-9
BIAS_TOLERANCE_DPS = canlog.BIAS_STEP_DPS / 2 + 1e-9
# The pacing gyro is chosen with this many samples of each; the pairs until then are sent together.
PAIRS_HELD = 8


@dataclasses.dataclass(frozen=True)
class Recording:
    log: bytes
    stamps_us: np.ndarray
    y: tuple  # readings of the two gyros, deg/s, as in the frames


def drifting_pair(seed, rest_s, run_s, rate_hz=100.0, jitter_s=200e-6):
    """Two gyros that drift far more than real ones, turning, with uneven but common stamps."""
    rng = np.random.default_rng(seed)
    gyros = [
        dataclasses.replace(
            g,
            bias_dps=rng.uniform(-1.0, 1.0),
            walk_dps_rts=rng.uniform(2e-4, 5e-3),
            white_dps_rthz=rng.uniform(1e-4, 2e-3),
        )
        for g in make_twin.GYROS
    ]
    options = make_twin.Options("drive", rest_s, run_s, rate_hz, phase_s=0.0, jitter_s=jitter_s, seed=seed)
    streams = make_twin.simulate(options, gyros).streams
    streams[1] = dataclasses.replace(streams[1], stamps_us=streams[0].stamps_us)
    return recording(streams)


def recording(streams):
    class Sink:
        def __init__(self):
            self.parts = []

        def write(self, part):
            self.parts.append(part)

    sink = Sink()
    canlog.write(sink, streams)
    log = b"".join(sink.parts)
    frames = canlog.read(log)
    a, b = frames.with_id(0x101), frames.with_id(0x102)
    y1 = canlog.intel(a.payloads, 0, 32, signed=True) * 1e-6
    y2 = canlog.motorola_bytes(b.payloads, 0, 4, signed=True) * 1e-6
    return Recording(log, a.stamps_us, (y1, y2))


def expected_stamps(pair_stamps_us):
    return np.maximum(pair_stamps_us, pair_stamps_us[PAIRS_HELD - 1])


@dataclasses.dataclass(frozen=True)
class Oracle:
    rate_dps: np.ndarray  # NaN while calibrating
    drifts: list  # per completed window, the calibration first: (stamp in µs from which it holds, C_1, C_2)


def mutual_method(stamps_us, y, rest_s, window_s, order):
    us = stamps_us - stamps_us[0]
    t = us * 1e-6
    rest_us, window_us = round(rest_s * 1e6), round(window_s * 1e6)
    calibration = us < rest_us
    P = [Polynomial.fit(t[calibration], y_k[calibration] - REST_RATE_DPS, order) for y_k in y]
    drifts = [(stamps_us[~calibration][0], P[0], P[1])]
    rate = np.full(len(t), np.nan)

    for i in itertools.count():
        begin_us = rest_us + i * window_us
        if begin_us > us[-1]:
            return Oracle(rate, drifts)
        w = (us >= begin_us) & (us < begin_us + window_us)
        tw, y1, y2 = t[w], y[0][w], y[1][w]
        p1, p2 = P[0](tw), P[1](tw)  # predict
        corrected1, corrected2 = y1 - p1, y2 - p2
        d1, d2 = y1 - corrected2, y2 - corrected1  # cross-calibrate
        c1, c2 = (p1 + d1) / 2, (p2 + d2) / 2  # average
        rate[w] = ((y1 - c1) + (y2 - c2)) / 2  # virtual gyro
        after = us >= begin_us + window_us
        if not after.any():
            return Oracle(rate, drifts)
        renewed = [Polynomial.fit(tw, d, order) for d in (d1, d2)]
        # C is linear in the sample values, so its polynomial is the fit of the averaged values.
        C = [Polynomial.fit(tw, (P[k](tw) + renewed[k](tw)) / 2, order) for k in (0, 1)]
        drifts.append((stamps_us[after][0], C[0], C[1]))
        P = renewed


def mutual_algebra(stamps_us, y, rest_s, window_s, order):
    """The same in closed form: the sum of the drifts is the calibration's, extrapolated, and their difference is the
    fit to y_1 − y_2 over the last completed window. Step by step, a cubic loses all its digits within a thousand
    windows; this form does not."""
    us = stamps_us - stamps_us[0]
    t = us * 1e-6
    rest_us, window_us = round(rest_s * 1e6), round(window_s * 1e6)
    calibration = us < rest_us
    P = [Polynomial.fit(t[calibration], y_k[calibration] - REST_RATE_DPS, order) for y_k in y]
    rate = np.where(calibration, np.nan, (y[0] + y[1] - P[0](t) - P[1](t)) / 2)
    drifts = [(stamps_us[~calibration][0], P[0], P[1])]
    last = (us[-1] - rest_us) // window_us
    for i in range(last):
        w = (us >= rest_us + i * window_us) & (us < rest_us + (i + 1) * window_us)
        difference = Polynomial.fit(t[w], y[0][w] - y[1][w], order)
        C = [lambda s, d=difference, sign=sign: (P[0](s) + P[1](s) + sign * d(s)) / 2 for sign in (1, -1)]
        drifts.append((stamps_us[us >= rest_us + (i + 1) * window_us][0], *C))
    return Oracle(rate, drifts)


def crc8_p11c(data_ids, payloads):
    """AUTOSAR E2E Profile 11C: CRC-8 of low byte of the data ID, zero, and all but byte 0."""
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ 0x1D if value & 0x80 else value << 1
        table.append(value & 0xFF)
    table = np.array(table, dtype=np.uint8)
    crc = table[data_ids & 0xFF]
    crc = table[crc]
    for byte in range(1, payloads.shape[1]):
        crc = table[crc ^ payloads[:, byte]]
    return crc


def import_canmatrix():
    """Debian's canmatrix reports every format that it cannot import, and old modules that it uses."""
    logging.disable(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import canmatrix.formats
    logging.disable(logging.NOTSET)
    return canmatrix


class Replay:
    """One folder with a config and a log; replays as often as required."""

    def __init__(self, folder, log, rest_s, window_s=10.0, order=1):
        self.folder = Path(folder)
        self.config = product.write_config(folder, rest_s, window_s, order, REST_RATE_DPS)
        self.log = self.folder / "in.log"
        self.log.write_bytes(log)

    def run(self, method):
        return product.replay(self.config, self.log, self.folder / "out.log", method)

    def run_from_pipe(self, method, chunk_bytes):
        out = self.folder / "piped.log"
        data = self.log.read_bytes()
        with subprocess.Popen(
            product.replay_command(self.config, "-", out, method, ["--quiet"]), stdin=subprocess.PIPE, bufsize=0
        ) as process:
            for first in range(0, len(data), chunk_bytes):
                process.stdin.write(data[first : first + chunk_bytes])
            process.stdin.close()
        if process.returncode != 0:
            raise RuntimeError(f"exit code {process.returncode}")
        return out.read_bytes()


class WithFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name


class MutualMethod(WithFolder):
    REST_S, RUN_S = 20.0, 41.0

    def check(self, seed, window_s, order, method=mutual_method, **pair_options):
        pair_options = {"rest_s": self.REST_S, "run_s": self.RUN_S} | pair_options
        r = drifting_pair(seed, **pair_options)
        rest_s = pair_options["rest_s"]
        frames = canlog.read(Replay(self.folder, r.log, rest_s, window_s, order).run("mutual"))
        oracle = method(r.stamps_us, r.y, rest_s, window_s, order)
        self.check_rates(canlog.virtual_rate(frames), r, oracle)
        self.check_biases(frames, r, oracle)

    def check_rates(self, rate, r, oracle):
        np.testing.assert_array_equal(rate.stamps_us, expected_stamps(r.stamps_us))
        np.testing.assert_array_equal(rate.valid, np.isfinite(oracle.rate_dps))
        np.testing.assert_array_equal(rate.age_us[PAIRS_HELD:], 0)
        np.testing.assert_allclose(rate.rate_dps, oracle.rate_dps, rtol=0, atol=RATE_TOLERANCE_DPS)

    def check_biases(self, frames, r, oracle):
        stamps_us, biases = canlog.virtual_bias(frames)
        seconds = (stamps_us - r.stamps_us[0]) * 1e-6
        self.assertGreaterEqual(len(stamps_us), 9.9 * (r.stamps_us[-1] - r.stamps_us[0]) * 1e-6)
        self.assertLessEqual(np.diff(stamps_us).max(), 100_000 + 2 * np.diff(r.stamps_us).max())
        holds_from = np.array([d[0] for d in oracle.drifts])
        expected = np.array([[c(seconds) for c in d[1:]] for d in oracle.drifts])  # window, gyro, frame
        frame = np.arange(len(stamps_us))
        # A VG_Bias sent for the very pair that completes a window may hold the drifts before or after it.
        last = np.searchsorted(holds_from, stamps_us, side="right") - 1
        before = np.searchsorted(holds_from, stamps_us, side="left") - 1
        known = before >= 0
        error_last = np.abs(expected[last, :, frame] - biases).max(axis=1)
        error_before = np.abs(expected[before, :, frame] - biases).max(axis=1)
        error = np.minimum(error_last, error_before)[known]
        self.assertTrue(known.any())
        worst = int(np.argmax(error))
        self.assertLessEqual(
            error[worst], BIAS_TOLERANCE_DPS,
            f"at {seconds[known][worst]} s: {biases[known][worst]} instead of {expected[last, :, frame][known][worst]}",
        )

    def test_follows_the_paper_for_every_order_and_window(self):
        print("seeds from", SEED)
        for order, window_s in itertools.product(range(4), (2.0, 7.3, 10.0)):
            with self.subTest(order=order, window_s=window_s):
                self.check(SEED + order, window_s, order)

    def test_follows_the_paper_when_windows_end_between_samples(self):
        self.check(SEED + 10, 0.777, 1)

    def test_follows_the_paper_when_windows_end_on_samples(self):
        self.check(SEED + 11, 2.0, 2, jitter_s=0.0)

    def test_follows_the_paper_through_a_thousand_windows(self):
        long_run = {"rest_s": 1000.0, "run_s": 2000.0, "rate_hz": 20.0}
        self.check(SEED + 13, 2.0, 1, mutual_method, **long_run)
        self.check(SEED + 13, 2.0, 3, mutual_algebra, **long_run)

    def test_the_algebra_is_that_of_the_steps(self):
        r = drifting_pair(SEED + 14, self.REST_S, self.RUN_S)
        stepwise, closed = (f(r.stamps_us, r.y, self.REST_S, 2.0, 2) for f in (mutual_method, mutual_algebra))
        np.testing.assert_allclose(stepwise.rate_dps, closed.rate_dps, rtol=0, atol=1e-9)
        self.assertEqual(len(stepwise.drifts), len(closed.drifts))
        for (from_us, *C), (closed_from_us, *closed_C) in zip(stepwise.drifts, closed.drifts):
            self.assertEqual(from_us, closed_from_us)
            at_s = (from_us - r.stamps_us[0]) * 1e-6
            np.testing.assert_allclose([c(at_s) for c in C], [c(at_s) for c in closed_C], rtol=0, atol=1e-9)

    def test_publishes_nothing_as_valid_before_the_calibration_ends(self):
        r = drifting_pair(SEED + 12, 5.0, 0.0)
        rate = canlog.virtual_rate(canlog.read(Replay(self.folder, r.log, 5.0).run("mutual")))
        self.assertEqual(len(rate.valid), len(r.stamps_us))
        self.assertFalse(rate.valid.any())


class MeanMethod(WithFolder):
    def test_is_the_mean_of_the_two_readings_at_once(self):
        r = drifting_pair(SEED + 20, 5.0, 10.0)
        rate = canlog.virtual_rate(canlog.read(Replay(self.folder, r.log, 5.0).run("mean")))
        np.testing.assert_array_equal(rate.stamps_us, expected_stamps(r.stamps_us))
        self.assertTrue(rate.valid.all())
        np.testing.assert_allclose(rate.rate_dps, (r.y[0] + r.y[1]) / 2, rtol=0, atol=RATE_TOLERANCE_DPS)

    def test_takes_the_earlier_gyro_between_its_samples_when_the_phases_differ(self):
        options = make_twin.Options("drive", 5.0, 30.0, 100.0, phase_s=5.2e-3, jitter_s=300e-6, seed=SEED + 21)
        streams = make_twin.simulate(options).streams
        r = recording(streams)
        rate = canlog.virtual_rate(canlog.read(Replay(self.folder, r.log, 5.0).run("mean")))
        self.assertGreaterEqual(len(rate.valid), len(r.stamps_us) - 2)
        self.assertTrue(rate.valid.all())
        all_stamps = np.concatenate([s.stamps_us for s in streams])
        self.assertTrue(np.isin(rate.stamps_us, all_stamps).all(), "every stamp is that of an input frame")
        self.assertTrue((np.diff(rate.stamps_us[PAIRS_HELD:]) > 0).all())

        def matches(pacing):
            at_us, other = streams[pacing].stamps_us, 1 - pacing
            mean = (r.y[pacing] + np.interp(at_us, streams[other].stamps_us, r.y[other])) / 2
            instants_us = (rate.stamps_us - rate.age_us)[PAIRS_HELD:]
            nearest = np.abs(at_us[:, None] - instants_us).argmin(axis=0)
            return (
                np.abs(at_us[nearest] - instants_us).max() <= 251  # half the step of VG_Age, and rounding
                and np.abs(mean[nearest] - rate.rate_dps[PAIRS_HELD:]).max() <= RATE_TOLERANCE_DPS
            )

        self.assertTrue(matches(0) or matches(1))


class OutputFrames(WithFolder):
    def setUp(self):
        super().setUp()
        self.recording = drifting_pair(SEED + 30, 2.0, 8.0)
        self.replay = Replay(self.folder, self.recording.log, 2.0, 2.0, 1)

    def test_the_profile_11_vectors_hold_for_this_tests_own_crc(self):
        payload = np.zeros((2, 8), dtype=np.uint8)
        payload[:, 1] = [0x10, 0x11]
        self.assertEqual(list(crc8_p11c(np.array([0x123, 0x123]), payload)), [0x2A, 0x77])

    def test_every_frame_carries_a_right_profile_11c_header(self):
        for method in ("mutual", "mean"):
            frames = canlog.read(self.replay.run(method))
            self.assertEqual(set(np.unique(frames.ids)), {canlog.RATE_ID, canlog.BIAS_ID, canlog.MODEL_ID})
            np.testing.assert_array_equal(frames.payloads[:, 0], crc8_p11c(frames.ids, frames.payloads))
            np.testing.assert_array_equal(frames.payloads[:, 1] >> 4, frames.ids >> 8)
            for can_id in np.unique(frames.ids):
                counter = frames.with_id(can_id).payloads[:, 1] & 0x0F
                np.testing.assert_array_equal(counter, np.arange(len(counter)) % 15)

    def test_the_dbc_file_says_what_the_frames_hold(self):
        canmatrix = import_canmatrix()
        database = canmatrix.formats.loadp_flat(str(product.SOURCE / "dbc/vgyro.dbc"))
        frames = canlog.read(self.replay.run("mutual"))
        rate = canlog.virtual_rate(frames)
        for frame, expected in list(zip(frames.with_id(canlog.RATE_ID).payloads, rate.rate_dps))[-200:]:
            message = database.frame_by_id(canmatrix.ArbitrationId(canlog.RATE_ID))
            decoded = message.decode(bytes(frame))
            self.assertAlmostEqual(float(decoded["VG_Rate"].phys_value), expected, places=9)
            self.assertEqual(int(decoded["VG_Valid"].raw_value), 1)
        biases = canlog.virtual_bias(frames)[1]
        for frame, expected in list(zip(frames.with_id(canlog.BIAS_ID).payloads, biases))[-20:]:
            message = database.frame_by_id(canmatrix.ArbitrationId(canlog.BIAS_ID))
            decoded = message.decode(bytes(frame))
            self.assertAlmostEqual(float(decoded["VB_Bias1"].phys_value), expected[0], places=9)
            self.assertAlmostEqual(float(decoded["VB_Bias2"].phys_value), expected[1], places=9)

    def test_every_stamp_is_that_of_an_input_frame_in_order(self):
        frames = canlog.read(self.replay.run("mutual"))
        self.assertTrue(np.isin(frames.stamps_us, self.recording.stamps_us).all())
        self.assertTrue((np.diff(frames.stamps_us) >= 0).all())

    def test_two_runs_and_any_chunking_of_the_input_give_the_same_bytes(self):
        first = self.replay.run("mutual")
        self.assertEqual(first, self.replay.run("mutual"))
        for chunk_bytes in (1, 7, 4096):
            with self.subTest(chunk_bytes=chunk_bytes):
                self.assertEqual(first, self.replay.run_from_pipe("mutual", chunk_bytes))


if __name__ == "__main__":
    unittest.main()
