#!/usr/bin/python3
"""`vgyro init`: finds the right pair in mixtures of a vehicle's traffic with known truth. The frames are made here,
by Python alone; seeds are fixed."""

import random
import re
import struct
import subprocess
import unittest

import numpy as np

import bench

DBC = """\
VERSION ""

BU_: X

BO_ 257 FOG: 8 X
 SG_ YawRate : 0|32@1- (%(fog)s,0) [0|0] "%(unit)s" X
 SG_ Temp : 32|8@1- (1,0) [-40|125] "degC" X
 SG_ Alive : 40|8@1+ (1,0) [0|255] "" X
 SG_ State : 48|4@1+ (1,0) [0|15] "" X
 SG_ Check : 56|8@1+ (1,0) [0|255] "" X

BO_ 258 MEMS: 8 X
 SG_ RateZ : 7|16@0- (0.01,0) [0|0] "deg/s" X
 SG_ RateX : 23|16@0- (0.01,0) [0|0] "deg/s" X
 SG_ Count : 35|4@0+ (1,0) [0|15] "" X

BO_ 259 COPY: 8 X
 SG_ VehYawRate : 0|16@1- (%(copy)s,0) [0|0] "deg/s" X

BO_ 260 STEER: 4 X
 SG_ SteeringRate : 0|16@1- (0.1,0) [0|0] "deg/s" X
 SG_ SteeringAngle : 16|16@1- (0.1,0) [0|0] "deg" X

BO_ 261 ENGINE: 4 X
 SG_ EngineSpeed : 0|16@1+ (0.25,0) [0|0] "rpm" X

BO_ 262 WHEELS: 4 X
 SG_ WheelSpeed : 0|16@1+ (0.01,0) [0|0] "km/h" X

BO_ 263 ACC: 8 X
 SG_ AccCheck : 0|8@1+ (1,0) [0|0] "" X
 SG_ AccCount : 8|4@1+ (1,0) [0|0] "" X
 SG_ AccX : 16|16@1- (0.01,0) [0|0] "m/s^2" X
 SG_ AccY : 32|16@1- (0.01,0) [0|0] "m/s^2" X
 SG_ AccZ : 48|16@1- (0.01,0) [0|0] "m/s^2" X

BO_ 264 WHEEL_SPEEDS: 8 X
 SG_ FL : 7|16@0+ (0.01,-67.67) [0|250] "km/h" X
 SG_ FR : 23|16@0+ (0.01,-67.67) [0|250] "km/h" X
 SG_ CruiseSetSpeed : 40|8@1+ (1,0) [0|255] "km/h" X
 SG_ Round : 48|4@1+ (1,0) [0|15] "" X

BO_ 265 LONELY: 8 X
 SG_ LateralAcc : 0|16@1- (0.01,0) [0|0] "m/s^2" X

VAL_ 257 State 0 "ok" 1 "init" ;
"""


def crc8(data, crc=0xFF):
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc ^ 0xFF


def profile_1a(data, data_id):
    """AUTOSAR E2E profile 1, both bytes of the data ID; the CRC routine's initial and final values are undone."""
    return crc8(bytes([data_id & 0xFF, data_id >> 8]) + data, 0x00) ^ 0xFF


class Mixture:
    """40 s: rest, then bends; the frames of each sender and their times."""

    def __init__(self, seed, fog=True, mems=True, copy="exact", rest_s=15.0):
        self.rest_s = rest_s
        self.random = random.Random(seed)
        noise = np.random.default_rng(seed)
        self.sign = self.random.choice((1, -1))
        self.unit = self.random.choice(("deg/s", "rad/s", "deg/h"))
        self.buses = {name: f"can{self.random.randrange(3)}" for name in ("fog", "mems", "other")}
        self.delay_s = self.random.uniform(0.0, 0.08)
        per_unit = {"deg/s": 1.0, "rad/s": np.pi / 180, "deg/h": 3600.0}[self.unit]
        self.step = {"deg/s": 1e-6, "rad/s": 1e-8, "deg/h": 1e-2}[self.unit]
        self.copy_step = self.random.choice((0.001, 0.005))
        t = np.arange(0.0, 60.0, 0.001)
        walk = np.cumsum(noise.standard_normal(t.size))
        smooth = np.convolve(walk - np.linspace(walk[0], walk[-1], t.size), np.ones(400) / 400, "same")
        rate = np.where(t < rest_s, 0.0, smooth / np.abs(smooth).max() * 25.0)
        self.turned_deg = float(np.trapz(rate[t < 59.0], t[t < 59.0]))
        other = np.convolve(np.cumsum(noise.standard_normal(t.size)), np.ones(300) / 300, "same")
        other *= 10.0 / np.abs(other).max()
        at = lambda when, values: np.interp(when, t, values)
        self.lines = []
        fog_t = np.arange(0.05, 59.0, 0.01)
        fog_dps = at(fog_t, rate) + 0.05 + 0.02 * noise.standard_normal(fog_t.size)
        for i, (when, value) in enumerate(zip(fog_t, fog_dps)):
            data = struct.pack("<ibBB", round(value * per_unit / self.step), 30, i % 256, 0)
            if fog:
                self.put(when, "fog", 0x101, data + bytes([crc8(data)]))
        for i, when in enumerate(np.arange(0.053, 59.0, 0.02)):
            value = self.sign * (at(when - self.delay_s, rate) * 1.003 - 0.4 + 0.05 * noise.standard_normal())
            roll = at(when, other) + 0.05 * noise.standard_normal()
            if mems:
                self.put(when, "mems", 0x102, struct.pack(">hhBBBB", round(value * 100), round(roll * 100), i % 16, 7, 7, 7))
        filtered = np.convolve(fog_dps, np.ones(4) / 4)[:fog_dps.size] if copy == "filtered" else fog_dps
        for when, value in zip(fog_t, filtered):
            if copy:
                self.put(when + 0.004, "other", 0x103, struct.pack("<h6x", round(value / self.copy_step)))
            self.put(when + 0.001, "other", 0x104,
                     struct.pack("<hh", round(np.gradient(at([when, when + 0.05], rate))[0] * 200), round(at(when, rate) * 10)))
            self.put(when + 0.002, "other", 0x105, struct.pack("<Hxx", round(8000 + 200 * at(when, other))))
            self.put(when + 0.003, "other", 0x106, struct.pack("<Hxx", 0 if when < rest_s else 5000))
            self.put(when + 0.005, "other", 0x300 + self.random.randrange(4), self.random.randbytes(8))

    def add_surroundings(self, seed, speed_kmh=60.0, gravity=9.81, creep_kmh=0.0):
        """An accelerometer, wheel speeds that are 0 while the gyros rest, and a single acceleration."""
        noise = np.random.default_rng(1000 + seed)
        for i, when in enumerate(np.arange(0.0135, 59.0, 0.02)):
            acc = struct.pack("<Bhhh", i % 15, *(round(100 * value) for value in
                                                 np.array([0.1, -0.2, gravity]) + 0.05 * noise.standard_normal(3)))
            self.put(when, "other", 0x107, bytes([profile_1a(acc, 0x1234)]) + acc)
            moving = creep_kmh if when < self.rest_s else speed_kmh + when / 10
            wheels = [round((wheel * moving + 67.67) * 100) for wheel in (1.0, 1.01)]
            self.put(when + 0.004, "other", 0x108, struct.pack(">HHBBBx", *wheels, 0, 50 + i // 500, i % 10))
            self.put(when + 0.006, "other", 0x109, struct.pack("<hxxxxxx", round(100 * noise.standard_normal())))

    def put(self, when, sender, identifier, data):
        us = 1_700_000_000_000_000 + round(when * 1e6)
        self.lines.append((us, f"{bench.stamp(us)} {self.buses[sender]} {identifier:03X}#{data.hex().upper()}\n"))

    def log(self):
        return "".join(line for _, line in sorted(self.lines))

    def dbc(self):
        return DBC % {"fog": self.step, "unit": self.unit, "copy": self.copy_step}


class Init(bench.Bench):
    def prepare(self, mixture):
        (self.folder / "vgyro.toml").unlink(missing_ok=True)
        self.write("drive.log", mixture.log())
        self.write("all.dbc", mixture.dbc())

    def test_finds_the_pair_in_twenty_mixtures(self):
        # Two sensors among a gateway's copies, other axes, and other rotations.
        for seed in range(3 if bench.SANITIZED else 20):
            mixture = Mixture(seed, copy=("exact", "filtered")[seed % 2])
            with self.subTest(seed=seed, unit=mixture.unit, sign=mixture.sign, buses=mixture.buses):
                self.prepare(mixture)
                said = self.good("init", "drive.log", "--dbc", "all.dbc").stderr.decode()
                text = self.read("vgyro.toml")
                gyros = text.split("[[gyro]]")[1:3]
                self.assertEqual([re.search(r'message = "(\w+)"', gyro).group(1) for gyro in gyros], ["FOG", "MEMS"]
                                 if 'message = "FOG"' in gyros[0] else ["MEMS", "FOG"], said + text)
                fog, mems = gyros if 'message = "FOG"' in gyros[0] else gyros[::-1]
                for part in ('rate = "YawRate"', f'bus = "{mixture.buses["fog"]}"', 'counter = "Alive"', 'temperature = "Temp"',
                             'valid = "State == 0"', 'crc = "Check"', 'e2e = "crc8_j1850"'):
                    self.assertIn(part, fog)
                for part in ('rate = "RateZ"', f'bus = "{mixture.buses["mems"]}"', 'counter = "Count"'):
                    self.assertIn(part, mems)
                self.assertEqual(text.count("\nsign = -1"), 1 if mixture.sign < 0 else 0)
                self.assertIn("the same sensor as", said)
                self.assertIn("vgyro.toml: good", self.good("check", "vgyro.toml").stdout.decode())

    def test_one_gyro_and_its_copy_are_one_gyro(self):
        for copy in ("exact", "filtered", None):
            with self.subTest(copy=copy):
                self.prepare(Mixture(3, mems=False, copy=copy))
                said = self.bad("init", "drive.log", "--dbc", "all.dbc")
                self.assertIn("only one gyro", said)
                self.assertIn("FOG.YawRate", said)
                self.assertEqual(len(re.findall(r"^\[\[gyro\]\]", self.read("vgyro.toml"), re.MULTILINE)), 1)
                self.assertIn("exactly two", self.bad("check", "vgyro.toml"))

    def test_a_copy_that_no_dbc_file_knows_is_no_second_gyro(self):
        for copy in ("exact", "filtered"):
            with self.subTest(copy=copy):
                mixture = Mixture(3, mems=False, copy=copy)
                mixture.lines = [line for line in mixture.lines if " 104#" not in line[1]]  # the motion without noise
                self.prepare(mixture)
                self.write("all.dbc", mixture.dbc().replace("BO_ 259 COPY", "BO_ 1859 COPY"))
                said = self.bad("init", "drive.log", "--dbc", "all.dbc")
                self.assertIn("only one gyro", said)
                self.assertIn("the same sensor as", said)

    def test_finds_speed_accelerometer_and_their_checks(self):
        mixture = Mixture(4, rest_s=40.0)
        mixture.add_surroundings(4)
        self.prepare(mixture)
        self.good("init", "drive.log", "--dbc", "all.dbc")
        text = self.read("vgyro.toml")
        speed = re.search(r"(?ms)^\[speed\]\n.*?\n\n", text).group()
        for part in ('message = "WHEEL_SPEEDS"', "# 0 while the gyros rest", 'counter = "Round"', "counter_max = 9"):
            self.assertIn(part, speed)
        acceleration = re.search(r"(?ms)^\[accelerometer\]\n.*?\n\n", text).group()
        for part in ('message = "ACC"', 'x = "AccX"', 'y = "AccY"', 'z = "AccZ"', "1.00 g", 'counter = "AccCount"',
                     'crc = "AccCheck"', "found by trial"):
            self.assertIn(part, acceleration)
        # A data ID is a constant in the check value: each low byte of 1c corresponds to 256 of 1a.
        self.assertRegex(acceleration, 'e2e = "profile_1[ac]"')
        self.assertRegex(text, r"rest_s = 3\d +# CHECK: all that this log has, from 0 s to (38|39|40) s")
        self.assertIn("vgyro.toml: good", self.good("check", "vgyro.toml").stdout.decode())
        self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "out.json", "drive.log")
        report = self.read("out.json")
        self.assertIn('"crc_wrong": 0', report)
        self.assertNotRegex(report, r'"crc_wrong": [1-9]')

    def test_does_not_propose_what_contradicts_the_rest(self):
        # Wheels that roll while the gyros rest would prevent every stop; a signal without gravity is no accelerometer.
        mixture = Mixture(4, rest_s=40.0)
        mixture.lines = [line for line in mixture.lines if " 106#" not in line[1]]
        mixture.add_surroundings(4, gravity=4.0, creep_kmh=3.0)
        self.prepare(mixture)
        self.good("init", "drive.log", "--dbc", "all.dbc")
        text = self.read("vgyro.toml")
        self.assertRegex(text, r"(?m)^# \[speed\]")
        self.assertIn("CHECK: 0.8", text)
        self.assertRegex(text, r"(?m)^# \[accelerometer\]")
        self.assertIn("which is not gravity", text)
        self.assertIn("vgyro.toml: good", self.good("check", "vgyro.toml").stdout.decode())

    def test_a_known_turn_tells_the_sign_and_checks_the_unit(self):
        mixture = Mixture(2)
        self.assertEqual((mixture.sign, mixture.unit), (1, "deg/s"))
        self.prepare(mixture)
        turn = mixture.turned_deg
        self.good("init", "drive.log", "all.dbc", "--turned", f"{turn:.1f}")
        self.assertIn(f"Gyro a turned by {turn:+.0f}"[:-1], self.read("vgyro.toml"))
        self.assertNotRegex(self.read("vgyro.toml"), "sign = -1|which way is positive|CHECK: Gyro a")
        self.good("init", "drive.log", "all.dbc", "--turned", f"{-turn:.1f}", "--force")
        self.assertEqual(self.read("vgyro.toml").count("\nsign = -1"), 2)
        self.good("init", "drive.log", "all.dbc", "--turned", f"{1.2 * turn:.1f}", "--force")
        self.assertIn("CHECK: Gyro a turned by", self.read("vgyro.toml"))
        self.assertIn("number", self.bad("init", "drive.log", "--turned", "left", code=2))

    def test_says_that_a_log_has_no_rest(self):
        self.prepare(Mixture(6))
        self.good("init", "drive.log", "--dbc", "all.dbc")
        self.assertIn("CHECK: of rest, and this log has no 30 s of it", self.read("vgyro.toml"))

    def test_reads_several_logs_of_one_drive_and_other_forms(self):
        mixture = Mixture(7)
        self.prepare(mixture)
        whole = self.good("init", "drive.log", "all.dbc", "-o", "-").stdout
        for bus in ("can0", "can1", "can2"):
            self.write(f"{bus}.log", "".join(line for line in mixture.log().splitlines(True) if f" {bus} " in line) or f"{mixture.log()[:19]} {bus} 7FF#\n")
        merged = self.good("init", "can0.log", "can1.log", "can2.log", "all.dbc", "-o", "-").stdout
        self.assertEqual(merged.split(b"[output]")[0], whole.split(b"[output]")[0])
        packed = subprocess.run(["xz", "-c", self.folder / "drive.log"], check=True, stdout=subprocess.PIPE).stdout
        self.write("drive", packed)
        self.assertEqual(self.good("init", "drive", "all.dbc", "-o", "-").stdout, whole)
        self.write("drive.log", mixture.log() + "(1.5) can0 12\n")
        said = self.good("init", "drive.log", "all.dbc", "-o", "-").stderr.decode()
        self.assertRegex(said, "1 lines? not understood")

    def test_replaces_a_file_only_when_told_to(self):
        self.prepare(Mixture(1))
        self.write("vgyro.toml", "precious")
        self.assertIn("--force", self.bad("init", "drive.log", "all.dbc"))
        self.assertEqual(self.read("vgyro.toml"), "precious")
        self.good("init", "drive.log", "all.dbc", "--force")
        self.assertIn("[[gyro]]", self.read("vgyro.toml"))

    def test_the_same_log_gives_the_same_bytes(self):
        self.prepare(Mixture(5))
        first = self.good("init", "drive.log", "all.dbc", "-o", "-").stdout
        self.assertEqual(self.good("init", "drive.log", "all.dbc", "-o", "-").stdout, first)

    def test_says_what_is_missing(self):
        self.prepare(Mixture(1))
        self.assertIn("cannot be read", self.bad("init", "drive.log", "--dbc", "missing.dbc").replace("No such file", "cannot be read"))
        self.write("still.log", "".join(f"({1700000000 + i / 100:.6f}) can0 101#{i % 256:02X}00\n" for i in range(3000)))
        self.assertIn("no signal of the DBC files looks like a rate", self.bad("init", "still.log", "all.dbc"))
        self.write("empty.log", "")
        self.assertIn("holds no CAN frame", self.bad("init", "empty.log", "all.dbc"))

    def test_one_stamp_far_ahead_costs_one_frame(self):
        mixture = Mixture(8)
        self.prepare(mixture)
        whole = self.good("init", "drive.log", "all.dbc", "-o", "-").stdout
        lines = mixture.log().splitlines(True)
        spoilt = next(i for i, line in enumerate(lines) if i > 9000 and " 101#" in line)
        lines[spoilt] = lines[spoilt].replace("(17000", "(19000")
        self.write("drive.log", "".join(lines))
        text = self.good("init", "drive.log", "all.dbc", "-o", "-").stdout.decode()
        self.assertEqual(re.findall("(?m)^(?:message|rate|sign|bus) = .*?(?= *#|$)", text), re.findall("(?m)^(?:message|rate|sign|bus) = .*?(?= *#|$)", whole.decode()))


if __name__ == "__main__":
    unittest.main()
