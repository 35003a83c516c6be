#!/usr/bin/python3
"""`vgyro init` without DBC files: the layout of two gyros is found among other traffic, and the DBC file that it
writes, read by canmatrix, reproduces the injected motion. Frames are made here by Python alone; seeds are fixed."""

import io
import logging
import random
import re
import struct
import unittest
from contextlib import redirect_stdout

import numpy as np

import bench

logging.disable(logging.CRITICAL)
with redirect_stdout(io.StringIO()):  # canmatrix prints the formats that it lacks to stdout
    import canmatrix.formats

RAD = 180 / np.pi
# Encoding of a number in raw bytes, number of bytes, least and greatest value, zero, usual scales in deg/s.
LAYOUTS = {
    "i16": (lambda n: struct.pack("<h", n), 0, (0.01, 0.02, 0.001 * RAD)),
    "i16 Motorola": (lambda n: struct.pack(">h", n), 0, (0.01, 0.005, RAD / 512)),
    "i24": (lambda n: struct.pack("<i", n)[:3], 0, (0.001, 0.0001 * RAD)),
    "i24 Motorola": (lambda n: struct.pack(">i", n)[1:], 0, (0.001,)),
    "i32": (lambda n: struct.pack("<i", n), 0, (0.001, 0.0001 * RAD)),
    "u16 from the middle": (lambda n: struct.pack("<H", n), 32768, (0.005, 0.01)),
    "u16 of J1939": (lambda n: struct.pack("<H", n), 32000, (1 / 128,)),
    "u16 Motorola": (lambda n: struct.pack(">H", n), 32768, (0.01,)),
    "float": (lambda x: struct.pack("<f", x), None, (1.0,)),
    "float Motorola": (lambda x: struct.pack(">f", x), None, (1.0, RAD)),
}
SECONDS = 70.0


class Sensor:
    def __init__(self, chance, identifier, bus, sign=1):
        self.kind = chance.choice(sorted(LAYOUTS))
        self.pack, self.zero, scales = LAYOUTS[self.kind]
        self.scale = chance.choice(scales)
        self.identifier, self.bus, self.sign = identifier, bus, sign
        self.size = len(self.pack(0))
        self.place = chance.randrange(8 - self.size)  # one byte stays free for the counter
        self.chance = chance

    def frame(self, i, dps):
        raw = self.sign * dps / self.scale
        field = self.pack(raw) if self.zero is None else self.pack(round(raw) + self.zero)
        rest = [i % 256, 0x5A, self.chance.randrange(256), 40 + i // 1500, 0, 0]
        before, after = rest[1:1 + self.place], rest[1 + self.place:]
        data = bytes(before) + field + bytes(after)
        return data[:7] + bytes([i % 256])


class Drive:
    """10 s of rest, then bends; two sensors among other traffic."""

    def __init__(self, seed, second=True):
        noise = np.random.default_rng(seed)
        chance = random.Random(seed)
        self.t = np.arange(0.0, SECONDS, 0.001)

        def wander(peak):
            walk = np.convolve(np.cumsum(noise.standard_normal(self.t.size)), np.ones(400) / 400, "same")
            walk -= walk[self.t > 10.0].mean()
            return peak * walk / np.abs(walk[self.t > 10.0]).max() * np.clip((self.t - 10.0) / 2, 0, 1)

        self.rate_dps = wander(35.0) + np.where(self.t > 10.0, 3.0, 0.0)
        self.sensors = (Sensor(chance, 0x1A0, "can0"), Sensor(chance, 0x2B0, "can1", chance.choice((1, -1))))
        self.lines = []
        other, level = wander(1000.0), wander(300.0)
        for i, when in enumerate(np.arange(0.02, SECONDS - 0.1, 0.01)):
            self.put(when, self.sensors[0], self.sensors[0].frame(i, self.at(when) + 0.2 + 0.05 * noise.standard_normal()))
            self.write(when + 0.001, "can0", 0x3C0, struct.pack("<hHHH", round(np.interp(when, self.t, other)), 30000 + i // 7, i % 65536,
                                                                round(5000 + np.interp(when, self.t, level))))
            self.write(when + 0.002, "can1", 0x3C1, chance.randbytes(8))
        for i, when in enumerate(np.arange(0.025, SECONDS - 0.1, 0.02)):
            if second:
                self.put(when, self.sensors[1], self.sensors[1].frame(i, 1.005 * self.at(when - 0.01) - 0.5 + 0.1 * noise.standard_normal()))

    def at(self, when):
        return float(np.interp(when, self.t, self.rate_dps))

    def turned_deg(self):
        return float(np.trapz(self.rate_dps, self.t))

    def put(self, when, sensor, data):
        self.write(when, sensor.bus, sensor.identifier, data)

    def write(self, when, bus, identifier, data):
        us = 1_700_000_000_000_000 + round(when * 1e6)
        self.lines.append((us, bus, identifier, data))

    def log(self):
        return "".join(f"{bench.stamp(us)} {bus} {identifier:03X}#{data.hex().upper()}\n" for us, bus, identifier, data in sorted(self.lines))

    def describe(self):
        return ", ".join(f"{one.kind} at byte {one.place} of {one.scale:.4g} deg/s, sign {one.sign}" for one in self.sensors)


class InitLayouts(bench.Bench):
    def prepare(self, drive):
        self.write("drive.log", drive.log())
        for name in ("vgyro.toml", "vgyro-guess.dbc"):
            (self.folder / name).unlink(missing_ok=True)

    def slopes(self, drive, text):
        """For each sensor in the written DBC file: its value as read by canmatrix over the truth, with the sign of
        the configuration. The fit must leave only noise: no bit is missing, none is too many."""
        with redirect_stdout(io.StringIO()):
            matrix = canmatrix.formats.loadp_flat(str(self.folder / "vgyro-guess.dbc"))
        slopes = {}
        gyros = text.split("[[gyro]]")[1:3]
        for sensor in drive.sensors:
            frame = matrix.frame_by_id(canmatrix.ArbitrationId(sensor.identifier, extended=False))
            if frame is None:
                continue
            mine = [gyro for gyro in gyros if f"Frame_{sensor.identifier:03X}" in gyro]
            self.assertEqual(len(mine), 1, text)
            rows = [(us * 1e-6 - 1.7e9, data) for us, _, identifier, data in drive.lines if identifier == sensor.identifier][::7]
            read = np.array([float(frame.decode(data)["Rate"].phys_value) for _, data in rows])
            true = np.array([drive.at(when - (0.01 if sensor.identifier == 0x2B0 else 0.0)) for when, _ in rows])
            slope, zero = np.polyfit(true, read, 1)
            left = np.std(read - slope * true - zero)
            self.assertLess(left, 0.25 * abs(slope) + abs(slope) * 0.3 * sensor.scale, text)
            slopes[sensor.identifier] = slope * (-1 if re.search(r"(?m)^sign = -1", mine[0]) else 1)
        return slopes

    def test_finds_layouts_and_their_ratio(self):
        for seed in range(3 if bench.SANITIZED else 16):
            drive = Drive(seed)
            with self.subTest(seed=seed, sensors=drive.describe()):
                self.prepare(drive)
                said = self.good("init", "drive.log").stderr.decode()
                text = self.read("vgyro.toml")
                slopes = self.slopes(drive, text)
                self.assertEqual(len(slopes), 2, said + text)
                self.assertAlmostEqual(slopes[0x1A0] / slopes[0x2B0], 1.0, delta=0.04)  # same sign, usual scales
                self.assertIn("The log does not show the scale", text)
                self.assertIn("multiply the factors", self.read("vgyro-guess.dbc"))
                self.assertEqual(len(re.findall(r'(?m)^counter = "Counter_56"', text)), 2)
                self.assertIn("vgyro.toml: good", self.good("check", "vgyro.toml").stdout.decode())

    def test_a_known_turn_gives_scale_and_sign(self):
        for seed in (20, 21) if bench.SANITIZED else (20, 21, 22, 23):
            drive = Drive(seed)
            with self.subTest(seed=seed, sensors=drive.describe()):
                self.prepare(drive)
                self.good("init", "drive.log", "--turned", f"{drive.turned_deg():.1f}")
                slopes = self.slopes(drive, self.read("vgyro.toml"))
                for slope in slopes.values():
                    self.assertAlmostEqual(slope, 1.0, delta=0.03)

    def test_a_gyro_that_is_known_gives_the_scale_of_the_other(self):
        for seed in range(30, 36):
            drive = Drive(seed)
            first = drive.sensors[0]
            if "i16" not in first.kind and "float" not in first.kind:
                continue
            with self.subTest(seed=seed, sensors=drive.describe()):
                self.prepare(drive)
                motorola = "Motorola" in first.kind
                bits = f"{8 * first.place + (7 if motorola else 0)}|{8 * first.size}@{0 if motorola else 1}-"
                self.write("one.dbc", f'BO_ 416 FIRST: 8 X\n SG_ YawRate : {bits} ({first.scale:.15f},0) [0|0] "deg/s" X\n'
                           + ("SIG_VALTYPE_ 416 YawRate : 1;\n" if "float" in first.kind else ""))
                self.good("init", "drive.log", "one.dbc")
                text = self.read("vgyro.toml")
                self.assertIn("By the other gyro one bit", text)
                self.assertIn('message = "FIRST"', text)
                self.assertAlmostEqual(self.slopes(drive, text)[0x2B0], 1.0, delta=0.04)
                self.good("check", "vgyro.toml")

    def test_says_that_nothing_moves_alike(self):
        self.prepare(Drive(3, second=False))
        said = self.bad("init", "drive.log")
        self.assertIn("no two fields", said)
        self.assertFalse((self.folder / "vgyro.toml").exists())

    def test_looks_at_the_identifiers_that_are_named(self):
        self.prepare(Drive(4))
        self.good("init", "drive.log", "--id", "1a0", "--id", "0x2B0")
        self.assertIn("no two fields", self.bad("init", "drive.log", "--id", "1A0", "--force"))
        self.assertIn("hexadecimal", self.bad("init", "drive.log", "--id", "gyro", code=2))

    def test_keeps_files_and_wants_a_place_for_the_dbc_file(self):
        self.prepare(Drive(4))
        self.assertIn("-o vgyro.toml", self.bad("init", "drive.log", "-o", "-"))
        self.write("vgyro-guess.dbc", "precious")
        self.assertIn("vgyro-guess.dbc", self.bad("init", "drive.log"))
        self.assertEqual(self.read("vgyro-guess.dbc"), "precious")
        self.assertFalse((self.folder / "vgyro.toml").exists())
        self.good("init", "drive.log", "--force")
        first = self.read("vgyro.toml"), self.read("vgyro-guess.dbc")
        self.good("init", "drive.log", "--force")
        self.assertEqual((self.read("vgyro.toml"), self.read("vgyro-guess.dbc")), first)


if __name__ == "__main__":
    unittest.main()
