#!/usr/bin/python3
"""Two whole units from the outside: the rates about all axes compared with the truth of a drive that is made here,
in units of their own sigma; one axis and one unit that fall out; mounts; frames and tables; and the errors for bad
input. Takes the frames from the DBC texts below and shares no code with the product."""

import csv
import hashlib
import json
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import bench  # noqa: E402
from bench import SOURCE, VGYRO  # noqa: E402

RATE_HZ = 50.0
START_US = 1_700_000_000_000_000
AXES = "xyz"

DBC = """\
VERSION ""

BU_: RIG

BO_ 257 IMU_A: 16 RIG
 SG_ X : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Y : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Z : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG

BO_ 258 IMU_B: 16 RIG
 SG_ X : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Y : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Z : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG

BO_ 259 YAW_B: 8 RIG
 SG_ Yaw : 0|32@1- (1E-006,0) [-35|35] "rad/s" RIG
 SG_ YawCounter : 32|8@1+ (1,0) [0|255] "" RIG
"""


def gyro(name, message, more=""):
    return f"""\
[[gyro]]
name = "{name}"
bus = "can0"
dbc = "units.dbc"
message = "{message}"
rate_x = "X"
rate_y = "Y"
rate_z = "Z"
counter = "Counter"
{more}
"""


def config(more_a="", more_b="", calibration="rate_dps = [0.0, 0.0, 0.0]", output=""):
    return (gyro("left", "IMU_A", more_a) + gyro("right", "IMU_B", more_b) +
            f'[calibration]\nrest_s = 30\n{calibration}\n[output]\nbus = "can0"\n{output}\n')


def rotation(vector_rad):
    """The matrix of a rotation by this vector (Rodrigues)."""
    angle = np.linalg.norm(vector_rad)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Drive:
    """A minute of rest, then turns and a swaying road, with a stop of 20 s in every 150."""

    def __init__(self, seconds, seed):
        self.seconds, self.random = seconds, np.random.default_rng(seed)
        self.phases = self.random.uniform(0, 2 * np.pi, 9)

    def rate(self, t):
        since = np.mod(t - 60.0, 150.0)
        ramp = np.clip(np.minimum(since, 130.0 - since) / 2.0, 0.0, 1.0)
        drives = np.where(t > 60.0, ramp * ramp * (3 - 2 * ramp), 0.0)
        p = self.phases
        x = 1.5 * np.sin(2.9 * t + p[0]) + 0.8 * np.sin(0.7 * t + p[1])
        y = 1.2 * np.sin(2.3 * t + p[2]) + 0.9 * np.sin(0.5 * t + p[3])
        z = 25.0 * np.sin(0.33 * t + p[4]) * np.sin(0.05 * t + p[5]) + 4.0 * np.sin(0.9 * t + p[6])
        return drives[:, None] * np.stack([x, y, z], axis=1)

    def unit(self, offset_s, turn, bias_dps, density_dps_rthz=4e-3, walk_dps_rts=1e-4):
        """Instants, and the readings of a unit that is rotated by `turn` against the vehicle."""
        t = np.arange(offset_s, self.seconds, 1.0 / RATE_HZ)
        walk = np.cumsum(self.random.standard_normal((len(t), 3)) * walk_dps_rts / np.sqrt(RATE_HZ), axis=0)
        noise = self.random.standard_normal((len(t), 3)) * density_dps_rthz * np.sqrt(RATE_HZ)
        return t, self.rate(t) @ np.asarray(turn).T + np.asarray(bias_dps) + walk + noise


SBG = f"""\
[[output.layout]]
dbc = "{SOURCE}/dbc/profiles/sbg_ellipse.dbc"
message = "SBG_ImuGyro"
rate_x = "RateX"
rate_y = "RateY"
rate_z = "RateZ"
sign_y = -1
sign_z = -1
rate_not_available = -32768
"""
BIAS_A, BIAS_B = (0.1, -0.2, 0.3), (-0.07, 0.15, -0.25)
TILT_DEG = np.array([0.3, -0.32, 0.24])  # half a degree in all


def frames(t, readings, identifier, counter=None):
    """(time, line) of each sample."""
    raw = np.rint(readings * 1e6).astype("<i4")
    lines = []
    for i, t_s in enumerate(t):
        us = START_US + round(t_s * 1e6)
        count = i % 256 if counter is None else counter[i]
        data = raw[i].tobytes() + bytes([count, 0, 0, 0])
        lines.append((us, f"({us // 1_000_000}.{us % 1_000_000:06d}) can0 {identifier:03X}##1{data.hex().upper()}\n"))
    return lines


def yaw_frames(t, yaw_dps):
    """(time, line) of each sample of unit B's yaw in a message of its own, 0.3 ms after the others."""
    lines = []
    for i, t_s in enumerate(t):
        us = START_US + round(t_s * 1e6) + 300
        raw = np.rint(np.radians(yaw_dps[i]) * 1e6).astype("<i4").tobytes() + bytes([i % 256, 0, 0, 0])
        lines.append((us, f"({us // 1_000_000}.{us % 1_000_000:06d}) can0 103#{raw.hex().upper()}\n"))
    return lines


def config_of_own_yaw(more=""):
    return config().replace('message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\ncounter = "Counter"\n',
                            'message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\ncounter = "Counter"\n'
                            f'[[gyro.axis]]\naxis = "z"\nmessage = "YAW_B"\nrate = "Yaw"\n{more}counter = "YawCounter"\n')


def log_of(*streams):
    return "".join(line for _, line in sorted(line for stream in streams for line in stream))


# Unit B's reading of the vehicle's rate: y2 = W + W x theta, with a small theta, is a rotation by -theta.
TILTED = rotation(-np.radians(TILT_DEG))


class Units(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("units.dbc", DBC)

    def replay(self, log, text=None, name="u.toml", more=()):
        self.write(name, text or config())
        self.write("in.log", log)
        self.good("replay", "--config", name, "-q", "-o", "out.log", "--csv", "out.csv", "--json", "out.json", *more, "in.log")
        with open(self.folder / "out.csv", encoding="utf-8") as file:
            return list(csv.DictReader(file)), json.loads(self.read("out.json"))

    def errors(self, rows, drive, axis, begin_s=0.0, end_s=1e9):
        """Errors of an axis's valid rates, in units of their own sigmas and in deg/s."""
        number = AXES.index(axis)
        kept = [row for row in rows if row[f"valid_{axis}"] == "1" and begin_s <= float(row["t_s"]) - START_US / 1e6 < end_s]
        t = np.array([float(row["t_s"]) - START_US / 1e6 for row in kept])
        off = np.array([float(row[f"rate_{axis}_dps"]) for row in kept]) - drive.rate(t)[:, number]
        return off / np.array([float(row[f"sigma_{axis}_dps"]) for row in kept]), off

    def judge(self, rows, drive, axes=AXES, **span):
        for axis in axes:
            with self.subTest(axis=axis, **span):
                relative, _ = self.errors(rows, drive, axis, **span)
                self.assertGreater(len(relative), 1000)
                self.assertGreater(np.mean(relative ** 2), 0.8)
                self.assertLess(np.mean(relative ** 2), 1.2)
                self.assertLess(np.max(np.abs(relative)), 6.0)

    def drive(self, seconds=660.0, seed=1, turn=TILTED):
        print(f"seed {seed}")
        drive = Drive(seconds, seed)
        return drive, drive.unit(0.0, np.eye(3), BIAS_A), drive.unit(0.0043, turn, BIAS_B)


class Truth(Units):
    def test_every_axis_is_as_far_off_as_it_says_and_the_tilt_is_found(self):
        for seed in (1, 2):
            drive, a, b = self.drive(seed=seed)
            rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102)))
            self.judge(rows, drive)
            found = np.array(summary["misalignment"]["angle_deg"])
            sigma = np.array(summary["misalignment"]["sigma_deg"])
            self.assertLess(np.max(np.abs(found - TILT_DEG)), 0.02, found)
            self.assertLess(np.max(np.abs(found - TILT_DEG) / sigma), 4.0, sigma)
            self.assertEqual([axis["axis"] for axis in summary["axes"]], list(AXES))
            for axis in summary["axes"]:
                self.assertGreaterEqual(axis["stops"]["learned"], 3, axis["axis"])
                self.assertEqual(axis["pair"]["contradiction"], "none")

    def test_an_axis_that_is_stuck_is_set_aside_alone(self):
        drive, a, b = self.drive(seed=3)
        t, readings = a
        readings[(t > 300) & (t < 400), 1] = readings[np.searchsorted(t, 300), 1]
        rows, summary = self.replay(log_of(frames(t, readings, 0x101), frames(*b, 0x102)))
        self.judge(rows, drive)
        states = {axis: {row[f"state_{axis}"] for row in rows if 302 < float(row["t_s"]) - START_US / 1e6 < 399 and row[f"state_{axis}"]}
                  for axis in AXES}
        self.assertEqual(states, {"x": {"running"}, "y": {"degraded"}, "z": {"running"}})
        self.assertIn("stuck", summary["axes"][1]["gyros"][0]["faults"])
        self.assertEqual(summary["axes"][0]["gyros"][0]["faults"], {})

    def test_frames_that_are_wrong_set_aside_the_unit(self):
        drive, a, b = self.drive(seed=4)
        t = b[0]
        counter = np.arange(len(t)) % 256
        counter[(t > 300) & (t < 400)] = 7
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102, counter)))
        self.judge(rows, drive)
        for i, axis in enumerate(AXES):
            states = {row[f"state_{axis}"] for row in rows if 302 < float(row["t_s"]) - START_US / 1e6 < 399}
            self.assertEqual(states, {"degraded"}, axis)
            self.assertIn("counter_stuck", summary["axes"][i]["gyros"][1]["faults"])

    def test_an_axis_that_never_lived_leaves_the_others_their_tilt(self):
        drive, a, b = self.drive(seed=13)
        t, readings = a
        readings[:, 1] = 0.5
        rows, summary = self.replay(log_of(frames(t, readings, 0x101), frames(*b, 0x102)))
        for axis in "xz":
            relative, _ = self.errors(rows, drive, axis)
            self.assertGreater(np.mean(relative ** 2), 0.8, axis)
            self.assertLess(np.mean(relative ** 2), 1.2, axis)
        # The rate about the dead axis is that of the other unit.
        relative, _ = self.errors(rows, drive, "y", 100.0)
        self.assertLess(np.mean(relative ** 2), 1.2)
        off = np.abs(np.array(summary["misalignment"]["angle_deg"]) - TILT_DEG)
        self.assertLess(np.max(off / np.array(summary["misalignment"]["sigma_deg"])), 4.0)

    def test_an_axis_may_come_at_a_rate_of_its_own(self):
        """Yaw of one unit comes from another sensor, half as often."""
        drive, a, b = self.drive(seed=14)
        t, readings = b
        lines = yaw_frames(t[::2], readings[::2, 2])
        text = config_of_own_yaw()
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102), lines), text)
        self.judge(rows, drive, axes="xy")
        self.assertEqual(summary["final_state"], "running")
        relative, _ = self.errors(rows, drive, "z")
        self.assertLess(np.mean(relative ** 2), 1.5)

    def test_a_unit_that_falls_silent_leaves_the_other(self):
        drive, a, b = self.drive(seed=5)
        t, readings = a
        there = (t < 300) | (t > 400)
        rows, _ = self.replay(log_of(frames(t[there], readings[there], 0x101), frames(*b, 0x102)))
        self.judge(rows, drive)

    def test_a_mount_turns_a_unit_into_the_vehicles_axes(self):
        """Swapped and flipped axes, a tilt of 20 degrees, and the same as a matrix."""
        for mount, turn in (("[0, 0, 90]", rotation(np.radians([0, 0, 90]))),
                            ("[[0, 0, -1], [0, 1, 0], [1, 0, 0]]", np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])),
                            ("[20, 0, 0]", rotation(np.radians([20, 0, 0])))):
            with self.subTest(mount=mount):
                # The sensor feels the vehicle's rate in its own axes.
                drive, a, b = self.drive(seconds=360.0, seed=6, turn=turn.T)
                rows, _ = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102)), config(more_b=f"mount = {mount}"))
                self.judge(rows, drive)

    def test_an_axis_may_have_a_message_sign_and_unit_of_its_own(self):
        drive, a, b = self.drive(seed=7)
        t, readings = b
        lines = yaw_frames(t, -readings[:, 2])
        text = config_of_own_yaw("sign = -1\n")
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102), lines), text)
        # Axes in different messages have table lines at instants of their own.
        self.judge(rows, drive, axes="xy")
        relative, _ = self.errors(rows, drive, "z")
        # The stamp of the yaw message is 0.3 ms late, which is a skew to be learned.
        self.assertLess(np.mean(relative ** 2), 1.3)
        self.assertEqual(summary["final_state"], "running")

    def test_without_a_heading_the_earth_is_in_sigma(self):
        drive, a, b = self.drive(seconds=200.0, seed=8)
        log = log_of(frames(*a, 0x101), frames(*b, 0x102))
        sigmas = {}
        for name, calibration in (("known", "rate_dps = [0.0, 0.0, 0.0]"), ("latitude", "latitude_deg = 50"), ("nothing", "")):
            rows, _ = self.replay(log, config(calibration=calibration))
            sigmas[name] = {axis: float(rows[-1][f"sigma_{axis}_dps"]) for axis in AXES}
        earth = 15.041 / 3600.0
        for axis in "xy":
            more = sigmas["latitude"][axis] ** 2 - sigmas["known"][axis] ** 2
            self.assertAlmostEqual(np.sqrt(more), earth * np.cos(np.radians(50)) / np.sqrt(2), delta=1e-4)
        self.assertAlmostEqual(sigmas["latitude"]["z"], sigmas["known"]["z"], delta=1e-6)
        for axis in AXES:
            more = sigmas["nothing"][axis] ** 2 - sigmas["known"][axis] ** 2
            self.assertAlmostEqual(np.sqrt(more), earth / np.sqrt(3), delta=1e-4)
        del drive


class Frames(Units):
    def test_classic_and_fd_frames_say_the_same_and_decode(self):
        _, a, b = self.drive(seconds=100.0, seed=9)
        log = log_of(frames(*a, 0x101), frames(*b, 0x102))
        rows, _ = self.replay(log)
        decoded = self.decode("vgyro_axes.dbc")
        self.assertEqual({line["message"] for line in decoded}, {f"VG_{what}_{axis}" for what in ("Rate", "Bias", "Model") for axis in "XYZ"})
        classic = {axis: [line["signals"]["VG_Rate"]["value"] for line in decoded if line["message"] == f"VG_Rate_{axis}"] for axis in "XYZ"}
        fd_rows, _ = self.replay(log, config(output="fd = true"))
        self.assertEqual(rows, fd_rows)
        fd = [line for line in self.decode("vgyro_axes_fd.dbc") if line["message"] == "VG_Rates"]
        self.assertEqual(len(fd), len(rows))
        for axis in "XYZ":
            table = [float(row[f"rate_{axis.lower()}_dps"]) if row[f"valid_{axis.lower()}"] == "1" else None for row in rows]
            self.assertEqual(len(classic[axis]), len(table))
            for wanted, coarse, line in zip(table, classic[axis], fd):
                fine = line["signals"][f"VG_Rate{axis}"]["value"]
                if wanted is None:
                    self.assertEqual((coarse, fine), (None, None))
                else:
                    self.assertAlmostEqual(coarse, wanted, delta=2.51e-5)
                    self.assertAlmostEqual(fine, wanted, delta=6e-7)
        signals = fd[-1]["signals"]
        self.assertEqual({signals[f"VG_State{axis}"]["label"] for axis in "XYZ"}, {"running"})
        self.assertEqual(signals["VG_Time"]["value"], round(float(rows[-1]["t_s"]) * 1e6))

    def decode(self, dbc):
        done = self.good("decode", "--dbc", str(SOURCE / "dbc" / dbc), "out.log")
        return [json.loads(line) for line in done.stdout.decode().splitlines()]

    def test_the_same_log_gives_the_same_bytes(self):
        _, a, b = self.drive(seconds=80.0, seed=10)
        log = log_of(frames(*a, 0x101), frames(*b, 0x102))
        self.replay(log)
        first = (self.folder / "out.log").read_bytes()
        done = self.good("replay", "--config", "u.toml", "-q", "-o", "again.log", "-", stdin=log.encode())
        self.assertEqual(first, (self.folder / "again.log").read_bytes())
        del done

    def test_a_layout_carries_the_axis_that_it_names(self):
        _, a, b = self.drive(seconds=60.0, seed=11)
        layout = '[[output.layout]]\ndbc = "units.dbc"\nmessage = "YAW_B"\nrate = "Yaw"\naxis = "z"\nrate_not_available = -2147483648\n'
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102)), config(output=layout))
        self.assertEqual(summary["out"]["layouts"][0]["valid"], sum(row["valid_z"] == "1" for row in rows))

    def test_a_layout_carries_all_axes(self):
        """In SBG's frame, in which y points to the right and z down."""
        _, a, b = self.drive(seconds=90.0, seed=15)
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102)), config(output=SBG))
        self.assertEqual(self.judge_layout(rows), len(rows))
        valid = sum(all(row[f"valid_{axis}"] == "1" for axis in AXES) for row in rows)
        self.assertEqual(summary["out"]["layouts"][0], {"bus": "can0", "id": 290, "message": "SBG_ImuGyro", "frames": len(rows),
                                                        "valid": valid, "out_of_range": 0, "withheld": 0})
        checked = self.good("check", "u.toml").stdout.decode()
        for said in ("SBG_ImuGyro.RateX", "y: RateY", "z: RateZ, bit 32, 16 bits", "sign flipped"):
            self.assertIn(said, checked)

    def judge_layout(self, rows):
        """Each frame equals the table's line, or holds "not available"; returns the number of frames."""
        lines = [line.split() for line in self.read("out.log").splitlines() if " 122#" in line]
        table = {axis: [float(row[f"rate_{axis}_dps"]) if row[f"valid_{axis}"] == "1" else None for row in rows] for axis in AXES}
        for i, line in enumerate(lines):
            raw = np.frombuffer(bytes.fromhex(line[2].split("#")[1]), "<i2")
            for axis, value, sign in zip(AXES, raw, (1, -1, -1)):
                wanted = table[axis][i]
                self.assertEqual(value == -32768, wanted is None, line)
                if wanted is not None:
                    self.assertAlmostEqual(sign * np.degrees(value * 1e-3), wanted, delta=np.degrees(0.5e-3) + 1e-6)
        return len(lines)

    def test_two_simulated_units_are_replayed_to_the_truth(self):
        drive = Drive(240.0, 12)
        t = np.arange(0.0, 240.0, 0.05)
        table = np.column_stack([t, drive.rate(t)])
        text = "t_s,rate_x_dps,rate_y_dps,rate_z_dps\n" + "\n".join(",".join(f"{v:.9f}" for v in row) for row in table) + "\n"
        self.write("p.csv", text)
        effects = ["format = 1"]
        for unit in (1, 2):
            effects.append(f'[[effect]]\ngyro = {unit}\nkind = "white_noise"\ndensity_dps_rthz = 4e-3')
            for i, axis in enumerate(AXES):
                effects.append(f'[[effect]]\ngyro = {unit}\nkind = "bias"\naxis = "{axis}"\nvalue_dps = {0.1 * (i + 1) * unit}')
        for axis, source, value in (("x", "z", 0.0056), ("z", "x", -0.0056)):
            effects.append(f'[[effect]]\ngyro = 2\nkind = "cross_axis"\naxis = "{axis}"\nfrom = "{source}"\ncoefficient = {value}')
        self.write("m.toml", "\n".join(effects) + "\n")
        self.write("u.toml", config(more_b="mount = [0, 0, 90]"))
        self.good("simulate", "--config", "u.toml", "--model", "m.toml", "--profile", "p.csv", "--seed", "5", "-q", "-o", "sim.log")
        rows, _ = self.replay(self.read("sim.log"), config(more_b="mount = [0, 0, 90]"))
        self.judge(rows, drive)
        # The model's effects are corrected before anything is learned.
        rows, summary = self.replay(self.read("sim.log"), config(more_b="mount = [0, 0, 90]"), more=("--model", "m.toml"))
        self.judge(rows, drive)
        self.assertLess(np.max(np.abs(summary["misalignment"]["angle_deg"])), 0.05)


class BadInput(Units):
    def refused(self, text, *said):
        self.write("u.toml", text)
        message = self.bad("check", "u.toml")
        self.assertRegex(message, r"u\.toml:\d+")
        for words in said:
            self.assertIn(words, message)

    def test_an_axis_missing_in_one_unit(self):
        self.refused(config().replace('rate_z = "Z"\n', "", 1), "left measures the vehicle's axes x, y", "right measures x, y, z", "name the missing one")

    def test_two_axes_of_one_signal(self):
        self.refused(config().replace('rate_y = "Y"', 'rate_y = "X"', 1), "axes x and y are read from the same signal: X of IMU_A", "a signal for each axis")

    def test_a_mount_that_mirrors(self):
        self.refused(config(more_a="mount = [1, 0, 0, 0, 1, 0, 0, 0, -1]"), "mount mirrors: its determinant is -1", "wrong sign, or two are exchanged")

    def test_a_mount_that_is_no_rotation(self):
        self.refused(config(more_a="mount = [1, 0.2, 0, 0, 1, 0, 0, 0, 1]"), "mount is not a rotation", "right angles")
        self.refused(config(more_a="mount = [0.7, 0, 0, 0, 0.7, 0, 0, 0, 0.7]"), "mount is not a rotation: the nearest one differs by 0.3 in an element")
        self.refused(config(more_a="mount = [0, 0, 0, 0, 0, 0, 0, 0, 0]"), "mount is not a rotation: its determinant is 0")
        self.refused(config(more_a="mount = [1, 2]"), "neither three numbers nor nine")
        self.refused(config(more_a="mount = [0, 0, 900]"), "an angle of 900 deg", "-360 to 360")

    def test_a_rounded_mount_is_taken_and_told(self):
        self.write("u.toml", config(more_a="mount = [0.707, -0.707, 0, 0.707, 0.707, 0, 0, 0, 1]"))
        said = self.good("check", "u.toml").stdout.decode()
        self.assertIn("as given; its elements differ from a rotation by up to 0.00011", said)
        self.assertIn("vehicle's x = +0.707107 x -0.707107 y +0.000000 z", said)

    def test_one_axis_and_three(self):
        single = '[[gyro]]\nname = "right"\nbus = "can0"\ndbc = "units.dbc"\nmessage = "IMU_B"\nrate = "Z"\n'
        self.refused(config().replace(gyro("right", "IMU_B"), single), "gyro left has 3 axes, and gyro right has one", "in both [[gyro]] tables")

    def test_one_axis_and_three_are_one_complaint(self):
        single = '[[gyro]]\nname = "right"\nbus = "can0"\ndbc = "units.dbc"\nmessage = "IMU_B"\nrate = "Z"\n'
        self.write("u.toml", config().replace(gyro("right", "IMU_B"), single))
        message = self.bad("check", "u.toml")
        self.assertNotIn("rate_dps", message)
        self.assertEqual(message.count("error:"), 1, message)

    def test_more_than_two_units(self):
        self.refused(config() + gyro("third", "IMU_B"), "there are 3 [[gyro]] tables", "exactly two are needed", "in its own table: rate_x, rate_y, rate_z")
        axes = "".join(f'[[gyro]]\nname = "{unit}{axis}"\nbus = "can0"\ndbc = "units.dbc"\nmessage = "IMU_{unit}"\nrate = "{axis}"\n'
                       for unit in "AB" for axis in "XYZ")
        self.refused(axes + '[output]\nbus = "can0"\n', "there are 6 [[gyro]] tables", "several axes of one unit stand in its own table")

    def test_two_units_of_one_message(self):
        self.refused(config().replace("IMU_B", "IMU_A"), "both gyros are read from the same frame: IMU_A on can0", "two different gyros are needed")
        text = config().replace('message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\ncounter = "Counter"\n',
                                'message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\ncounter = "Counter"\n'
                                '[[gyro.axis]]\naxis = "z"\nmessage = "IMU_A"\nrate = "Z"\n')
        self.refused(text, "both gyros are read from the same frame: IMU_A on can0")

    def test_a_mount_that_mixes_axes_of_two_messages_is_warned_of(self):
        """The rates of the two messages may differ, which no file shows."""
        def unit(mount):
            return config().replace('message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\ncounter = "Counter"\n',
                                    f'message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\ncounter = "Counter"\nmount = {mount}\n'
                                    '[[gyro.axis]]\naxis = "z"\nmessage = "YAW_B"\nrate = "Yaw"\ncounter = "YawCounter"\n')
        self.write("u.toml", unit("[20, 0, 0]"))
        said = self.good("check", "u.toml").stderr.decode()
        self.assertRegex(said, r"u\.toml:19: mount mixes Y of IMU_B and Yaw of YAW_B about the vehicle's y")
        self.assertIn("only swaps axes and signs", said)
        self.write("u.toml", unit("[180, 0, 90]"))
        self.assertNotIn("mount mixes", self.good("check", "u.toml").stderr.decode())

    def test_axes_at_different_rates_under_a_mount_are_right_within_sigma(self):
        """Yaw of one unit comes half as often, and the mount mixes it with pitch."""
        drive, a, b = self.drive(seconds=240.0, seed=16, turn=rotation(np.radians([20, 0, 0])).T)
        t, readings = b
        readings = readings.copy()
        lines = []
        for n, i in enumerate(range(0, len(t), 2)):
            us = START_US + round(t[i] * 1e6) + 300
            raw = np.rint(np.radians(readings[i, 2]) * 1e6).astype("<i4").tobytes() + bytes([n % 256, 0, 0, 0])
            lines.append((us, f"({us // 1_000_000}.{us % 1_000_000:06d}) can0 103#{raw.hex().upper()}\n"))
        text = config().replace('message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\ncounter = "Counter"\n',
                                'message = "IMU_B"\nrate_x = "X"\nrate_y = "Y"\ncounter = "Counter"\nmount = [20, 0, 0]\n'
                                '[[gyro.axis]]\naxis = "z"\nmessage = "YAW_B"\nrate = "Yaw"\ncounter = "YawCounter"\n')
        rows, summary = self.replay(log_of(frames(*a, 0x101), frames(*b, 0x102), lines), text)
        for axis in AXES:
            relative, _ = self.errors(rows, drive, axis)
            self.assertGreater(len(relative), 5000, axis)
            self.assertLess(np.mean(relative ** 2), 1.5, axis)
            self.assertLess(np.max(np.abs(relative)), 7.0, axis)
        self.assertEqual(summary["final_state"], "running")

    def test_a_unit_of_one_axis(self):
        self.refused(config().replace('rate_x = "X"\nrate_y = "Y"\n', ""), "a unit of one axis", 'rate = "SIGNAL"')

    def test_a_mount_of_a_single_gyro(self):
        self.refused(config().replace('rate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\n', 'rate = "Z"\nmount = [0, 0, 90]\n'), "mount is of a gyro with one axis")

    def test_keys_of_the_calibration(self):
        self.refused(config(calibration="rate_dps = 0.1"), "rate_dps must be a list of 3 numbers, one for each axis")
        self.refused(config(calibration="rate_dps = [0.1]"), "rate_dps is not a list of 3 numbers")
        self.refused(config(calibration="heading_deg = 12"), "heading_deg needs latitude_deg")

    def test_axes_of_the_model_file(self):
        self.write("u.toml", config())
        self.write("m.toml", 'format = 1\n[[effect]]\ngyro = 1\nkind = "delay"\naxis = "x"\nseconds = 0.01\n')
        self.assertIn("delay of one axis: it is of a unit, with all of its axes", self.bad("check", "--model", "m.toml", "u.toml"))
        self.write("m.toml", 'format = 1\n[[effect]]\ngyro = 1\nkind = "bias"\naxis = "w"\nvalue_dps = 0.01\n')
        self.assertIn('there is no axis "w"', self.bad("check", "--model", "m.toml", "u.toml"))
        self.write("m.toml", 'format = 1\n[[effect]]\ngyro = 1\nkind = "bias"\naxis = "x"\nvalue_dps = 0.01\n')
        self.assertIn("an effect of one axis", self.bad("check", "--model", "m.toml", "vgyro.toml"))


class SingleAxis(bench.Bench):
    """The output of two single gyros is the same, to the byte, as before whole units were supported."""

    EXAMPLES = {
        "optimal": "9eeac77ecbf0d990fec4f40aa28f97187d5677f0b439d77bb9eaa14198fbe25f",
        "mutual": "75f54c275b9646479f8bd1f38e91fcc9c740248a400901d861c82a8e6b6e6e79",
        "mean": "dedeaceee2bbd8e68d920011e64139040e23f94d60cce90e69f7eb3181066c7c",
    }

    def test_the_example_is_replayed_to_the_same_bytes(self):
        for method, digest in self.EXAMPLES.items():
            with self.subTest(method=method):
                done = subprocess.run([VGYRO, "replay", "--config", "twin.toml", "--method", method, "-q", "-o", "-", "twin.log.xz"],
                                      cwd=SOURCE / "examples", capture_output=True, check=True)
                self.assertEqual(hashlib.sha256(done.stdout).hexdigest(), digest)

    def test_the_example_is_simulated_to_the_same_bytes(self):
        done = subprocess.run([VGYRO, "simulate", "--config", "twin.toml", "--model", "turns.toml", "--profile", "turns.csv", "--seed", "7", "-q"],
                              cwd=SOURCE / "examples", capture_output=True, check=True)
        self.assertEqual(hashlib.sha256(done.stdout).hexdigest(), "454fa9eb87da4892c18e6eb7478d041d798a53e845420a3df108b30399587009")


if __name__ == "__main__":
    unittest.main()
