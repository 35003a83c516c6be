#!/usr/bin/python3
"""bench/real_axes.py on files made here in the publishers' forms: it reads the injected data and finds the injected
rotation, and so does the product from the log that it makes."""

import contextlib
import csv
import importlib.util
import io
import re
import struct
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import product  # noqa: E402
from judge import axes  # noqa: E402

sys.path.insert(0, str(product.SOURCE / "bench"))
_SPEC = importlib.util.spec_from_file_location("real_axes", product.SOURCE / "bench/real_axes.py")
real_axes = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(real_axes)

TILT_DEG = np.array([0.9, -0.1, -1.8])
RATE_HZ, SECONDS, SEED = 120.0, 60.0, 6


def segments(count, lag_s=0.0):
    """For each segment a table of both units: time and rates, the second unit turned and late."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    turn = axes.rotation(-np.radians(TILT_DEG))
    for _ in range(count):
        f, phase = rng.uniform(0.1, 1.5, (3, 4)), rng.uniform(0, 2 * np.pi, (3, 4))
        rate = lambda t: 12.0 * np.sin(2 * np.pi * f[:, :, None] * t + phase[:, :, None]).sum(axis=1)
        t = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
        noise = lambda: 0.1 * rng.standard_normal((3, len(t)))
        yield [np.vstack([t, rate(t) + noise()]).T, np.vstack([t, turn @ rate(t - lag_s) + 0.3 + noise()]).T]


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-real-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def dots(self, tables):
        for number, both in enumerate(tables, 1):
            path = self.folder / f"path_{number}"
            path.mkdir()
            for unit, table in enumerate(both, 1):
                with open(path / f"IMU_{unit}.csv", "w", newline="", encoding="utf-8") as file:
                    writer = csv.writer(file)
                    writer.writerow(["time", "Euler_X", "Gyr_X", "Gyr_Y", "Gyr_Z"])
                    writer.writerows([t, 0.0, *rates] for t, *rates in table.tolist())
        return self.folder

    def test_segments_stand_behind_each_other_with_a_pause(self):
        tables = list(segments(3))
        units = real_axes.dots(self.dots(tables))
        for number, unit in enumerate(units):
            gaps = np.diff(unit[:, 0])
            self.assertEqual(np.sum(gaps > 1.0), 2)
            np.testing.assert_allclose(gaps[gaps > 1.0], real_axes.PAUSE_S)
            np.testing.assert_allclose(unit[:, 1:], np.concatenate([both[number][:, 1:] for both in tables]))

    def test_an_ardupilot_log_is_read_by_what_it_announces(self):
        [both] = segments(1)
        out = io.BytesIO()
        columns, form = b"TimeUS,GyrX,GyrY,GyrZ,AccX", b"Qffff"
        for kind, name in ((128, b"FMT"), (200, b"IMU"), (201, b"IMU2"), (202, b"MSG")):
            length, own_form, own_columns = {128: (89, b"BBnNZ", b"Type,Length,Name,Format,Columns"), 202: (67, b"Z", b"Message")}.get(kind, (27, form, columns))
            out.write(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, own_form, own_columns))
        for row in zip(*both):
            out.write(b"\xa3\x95" + bytes([202]) + b"not a gyro".ljust(64, b"\0") + b"\x00\xa3")  # and some rubbish
            for kind, (t_s, *rates) in zip((200, 201), row):
                out.write(b"\xa3\x95" + bytes([kind]) + struct.pack("<Qffff", 5_000_000 + round(t_s * 1e6), *np.radians(rates), 9.8))
        path = self.folder / "a.bin"
        path.write_bytes(out.getvalue()[:-3])  # cut off
        one, two = real_axes.dataflash(path)
        self.assertEqual((len(one), len(two)), (len(both[0]), len(both[1]) - 1))
        np.testing.assert_allclose(one, both[0], atol=2e-5)

    def test_the_rotation_is_found_and_explains_what_it_makes(self):
        units = real_axes.dots(self.dots(segments(6, lag_s=0.02)))
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            real_axes.report(units, 10.0, None)
        text = said.getvalue()
        self.assertIn("unit 2 is late by +20 ms", text)
        # With the lag removed, the rotation explains nearly all of the slow difference; half a millisecond of lag, the
        # step, and noise remain.
        aligned = text[text.index("lag taken off"):]
        for share in re.findall(r"\(([+-]\d+) %\)", aligned.splitlines()[1]):
            self.assertGreater(int(share), 90, text)
        found = re.search(r"of each half, deg \| (.*) \|", aligned).group(1)
        for angles, truth in zip(found.split(" | "), TILT_DEG):
            for angle in angles.split(" and "):
                self.assertAlmostEqual(float(angle), truth, delta=0.1)
        learned = re.findall(r"([+-][\d.]+) ± [\d.]+", text)
        for angle, truth in zip(learned, TILT_DEG, strict=True):
            self.assertAlmostEqual(float(angle), truth, delta=0.1)


if __name__ == "__main__":
    unittest.main()
