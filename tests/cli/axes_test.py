#!/usr/bin/python3
"""`vgyro gap`, `compare` and `allan` of two whole units: each axis is compared with the injected values, in units of
the stated sigma; the axes together; one axis alone; the errors for an impossible choice."""

import json
import re
import unittest

import numpy as np

from units_test import DBC, AXES, BIAS_A, BIAS_B, TILTED, Drive, Units, config, frames, gyro, log_of

# One unit upside down and turned by a quarter: axes exchanged and flipped at once.
MOUNT = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
MOUNT_TEXT = "mount = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]"
NOISE = 4e-3  # deg/s/sqrt(Hz), of each axis
MODEL = "format = 1\n" + "".join(
    f'[[effect]]\ngyro = {unit}\nkind = "{kind}"\n{value}\n'
    for unit in (1, 2) for kind, value in (("white_noise", f"density_dps_rthz = {NOISE}"), ("rate_random_walk", "density_dps_rts = 1e-4")))


def biases(unit, bias_dps):
    return "".join(f'[[effect]]\ngyro = {unit}\nkind = "bias"\naxis = "{axis}"\nvalue_dps = {value}\n' for axis, value in zip(AXES, bias_dps))


class Axes(Units):
    def record(self, seconds, seed, turn_b=np.eye(3), lag_s=0.0, more_b=""):
        """A drive of two units as in.log, u.toml, and m.toml, which has everything except the rotation and the lag
        of B."""
        print(f"seed {seed}")
        drive = Drive(seconds, seed)
        a = drive.unit(0.0, np.eye(3), BIAS_A)
        b = drive.unit(0.0043 - lag_s, turn_b, BIAS_B)
        self.write("in.log", log_of(frames(*a, 0x101), frames(b[0] + lag_s, b[1], 0x102)))
        self.write("u.toml", config(more_b=more_b))
        self.write("m.toml", MODEL + biases(1, BIAS_A) + biases(2, BIAS_B))
        return drive

    def gap(self, *more, model="m.toml"):
        self.good("gap", "--config", "u.toml", "--model", model, "--measured", "in.log", "--out", "found", "-q", *more)
        return json.loads(self.read("found/gap.json"))

    def compare(self, *more, model="m.toml"):
        self.good("compare", "--config", "u.toml", "--model", model, "--measured", "in.log", "--json", "gap.json", "-q", *more)
        return json.loads(self.read("gap.json"))


def is_tilt(effect):
    return effect["kind"] == "cross_axis" and effect["gyro"] == 2


class Gap(Axes):
    def test_biases_that_nobody_gave_are_told_in_the_units_own_signs(self):
        self.record(150.0, 3, MOUNT.T, more_b=MOUNT_TEXT)
        found = self.gap(model=self.empty_model())
        for unit, truth in ((1, BIAS_A), (2, BIAS_B)):
            for axis, bias_dps in zip(AXES, truth):
                [one] = [one for one in found["starting_model"]
                         if (one["gyro"], one.get("axis"), one["kind"]) == (unit, axis, "bias")]
                self.assertLess(abs(one["parameters"]["value_dps"] - bias_dps), 0.01, one)

    def empty_model(self):
        self.write("empty.toml", "format = 1\n")
        return "empty.toml"

    def test_one_axis_alone_is_what_it_is_among_all(self):
        self.record(150.0, 5, TILTED)
        alone = self.compare("--axis", "x")
        self.assertEqual(alone["axis"], "x")
        among = self.compare()
        self.assertEqual(among["axes"][0], alone)
        self.assertEqual([axis["axis"] for axis in among["axes"]], list(AXES))
        gaps = [axis["gap"]["value"] for axis in among["axes"]]
        self.assertTrue(min(gaps) <= among["gap"]["value"] <= max(gaps))
        said = self.good("compare", "--config", "u.toml", "--model", "m.toml", "--measured", "in.log").stdout.decode()
        for axis in AXES:
            self.assertIn(f"Axis {axis}: in.log", said)


TRUTH_DBC = DBC + """
BO_ 260 TABLE: 16 RIG
 SG_ TableX : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ TableY : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ TableZ : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
"""
TABLE = '[reference]\nbus = "can0"\ndbc = "truth.dbc"\nmessage = "TABLE"\n'
TABLE_OF_AXES = TABLE + 'rate_x = "TableX"\nrate_y = "TableY"\nrate_z = "TableZ"\n'


class Table(Axes):
    def setUp(self):
        super().setUp()
        self.write("truth.dbc", TRUTH_DBC)

    def with_table(self, seconds, seed):
        """A drive of two units, one tilted, and a reference with the true rate 100 times a second."""
        print(f"seed {seed}")
        drive = Drive(seconds, seed)
        t = np.arange(0.0017, seconds, 0.01)
        self.write("in.log", log_of(frames(*drive.unit(0.0, np.eye(3), BIAS_A), 0x101), frames(*drive.unit(0.0043, TILTED, BIAS_B), 0x102),
                                    frames(t, drive.rate(t), 0x104)))
        self.write("u.toml", config() + TABLE_OF_AXES)
        self.write("m.toml", MODEL + biases(1, BIAS_A) + biases(2, BIAS_B))
        return drive


class Reference(Table):
    def test_a_reference_of_one_rate_is_about_z(self):
        self.with_table(100.0, 12)
        self.write("u.toml", config() + TABLE + 'rate = "TableZ"\n')
        told = [axis["recording"]["with_reference"] for axis in self.compare()["axes"]]
        self.assertEqual(told, [False, False, True])

    def test_it_calibrates_a_platform_that_moves(self):
        drive = self.with_table(260.0, 13)
        # The log begins in the middle of the first drive, without rest.
        lines = self.read("in.log").splitlines(keepends=True)
        moving = [line for line in lines if float(line[1:line.index(")")]) > 1_700_000_065]
        rows, summary = self.replay("".join(moving), config(calibration='source = "reference"') + TABLE_OF_AXES)
        self.assertEqual(summary["final_state"], "running")
        for axis in AXES:
            relative, _ = self.errors(rows, drive, axis)
            self.assertGreater(len(relative), 5000)
            self.assertLess(np.mean(relative ** 2), 1.3, axis)
            self.assertLess(np.max(np.abs(relative)), 6.0, axis)

    def test_it_must_tell_every_axis_to_calibrate(self):
        self.write("u.toml", config(calibration='source = "reference"') + TABLE + 'rate_x = "TableX"\nrate_z = "TableZ"\n')
        said = self.bad("check", "u.toml")
        self.assertIn("the reference does not give the rate about y", said)
        self.assertIn("rate_x, rate_y, rate_z in [reference]", said)

    def test_beside_gyros_of_one_axis_it_tells_one_rate(self):
        single = config(calibration="").replace('rate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\n', 'rate = "Z"\n')
        self.write("u.toml", single + TABLE_OF_AXES)
        said = self.bad("check", "u.toml")
        self.assertIn("are of a reference of whole units", said)
        self.assertNotIn("unknown key", said)

    def test_the_simulated_reference_tells_the_motion_of_the_profile(self):
        self.write("u.toml", config() + TABLE_OF_AXES)
        self.write("none.toml", "format = 1\n")
        t = np.arange(0.0, 20.0, 0.05)
        motion = np.stack([3 * np.sin(0.7 * t), 2 * np.cos(0.9 * t), 20 * np.sin(0.5 * t)], axis=1)
        rows = "\n".join(",".join(f"{value:.9f}" for value in row) for row in np.column_stack([t, motion]))
        self.write("p.csv", "t_s,rate_x_dps,rate_y_dps,rate_z_dps\n" + rows + "\n")
        self.good("simulate", "--config", "u.toml", "--model", "none.toml", "--profile", "p.csv", "-q", "-o", "sim.log")
        done = self.good("decode", "--dbc", "truth.dbc", "sim.log")
        table = [line for line in map(json.loads, done.stdout.decode().splitlines()) if line["message"] == "TABLE"]
        self.assertGreater(len(table), 3900)
        for line in table:
            t_s = line["t"] - 1_700_000_000
            truth = (3 * np.sin(0.7 * t_s), 2 * np.cos(0.9 * t_s), 20 * np.sin(0.5 * t_s))
            for axis, rate_dps in zip("XYZ", truth):
                self.assertAlmostEqual(line["signals"][f"Table{axis}"]["value"], rate_dps, delta=2e-4)
        said = self.good("check", "u.toml").stdout.decode()
        for axis in "XYZ":
            self.assertIn(f"Table{axis}", said)


class Picture(Axes):
    def test_every_axis_has_a_picture_of_its_own(self):
        self.record(200.0, 14, TILTED)
        self.good("replay", "--config", "u.toml", "-q", "-o", "out.log", "--plot", "drift.svg", "in.log")
        self.assertFalse((self.folder / "drift.svg").exists())
        pictures = [self.read(f"drift-{axis}.svg") for axis in AXES]
        for axis, picture in zip(AXES, pictures):
            self.assertIn(f"in.log about {axis}, method optimal", picture)
            self.assertIn("virtual gyro", picture)
        self.assertEqual(len(set(pictures)), 3)

    def test_a_picture_never_writes_over_what_is_read(self):
        self.record(60.0, 15)
        (self.folder / "in-y.svg").symlink_to("in.log")
        said = self.bad("replay", "--config", "u.toml", "-q", "-o", "out.log", "--plot", "in.svg", "in.log")
        self.assertIn("in-y.svg", said)


class Allan(Axes):
    def test_each_axis_has_the_noise_that_it_was_given(self):
        random = np.random.default_rng(7)
        print("seed 7")
        t = np.arange(0.0, 300.0, 0.02)
        densities = {1: (2e-3, 4e-3, 8e-3), 2: (3e-3, 6e-3, 1e-3)}
        streams = [frames(t + offset, random.standard_normal((len(t), 3)) * np.array(densities[unit]) * np.sqrt(50.0), 0x100 + unit)
                   for unit, offset in ((1, 0.0), (2, 0.0043))]
        self.write("rest.log", log_of(*streams))
        self.write("u.toml", config(more_b=MOUNT_TEXT))
        done = self.good("allan", "--config", "u.toml", "--json", "allan.json", "--plot", "allan.svg", "rest.log")
        axes = json.loads(self.read("allan.json"))["axes"]
        self.assertEqual([axis["axis"] for axis in axes], list(AXES))
        for place, axis in enumerate(axes):
            for unit in (1, 2):
                own = place if unit == 1 else (1, 0, 2)[place]
                white = axis["gyros"][unit - 1]["noise"]["white_noise_dps_rthz"]
                self.assertLess(abs(white["value"] - densities[unit][own]) / white["sigma"], 4.0, (axis["axis"], unit))
                self.assertIn(f'gyro = {unit}\nkind = "white_noise"\naxis = "{AXES[own]}"\n', axis["model_toml"])
        for axis in AXES:
            self.assertIn(f"Axis {axis}: rest.log", done.stdout.decode())
            self.assertIn(f"Allan deviation about {axis}", self.read(f"allan-{axis}.svg"))
        self.assertFalse((self.folder / "allan.svg").exists())

    def test_one_axis_has_the_picture_that_is_asked_for(self):
        self.record(60.0, 8)
        self.good("allan", "--config", "u.toml", "--axis", "y", "--json", "allan.json", "--plot", "allan.svg", "in.log")
        self.assertEqual(json.loads(self.read("allan.json"))["axis"], "y")
        self.assertTrue((self.folder / "allan.svg").exists())

    def test_a_log_from_a_pipe_serves_all_axes(self):
        self.record(60.0, 9)
        self.good("allan", "--config", "u.toml", "--json", "file.json", "in.log")
        self.good("allan", "--config", "u.toml", "--json", "pipe.json", "-", stdin=self.read("in.log").encode())
        by_name, piped = (json.loads(self.read(name))["axes"] for name in ("file.json", "pipe.json"))
        self.assertEqual([axis["gyros"] for axis in by_name], [axis["gyros"] for axis in piped])


class BadChoice(Axes):
    COMMANDS = (("allan", "in.log"), ("compare", "--model", "m.toml", "--measured", "in.log"), ("gap", "--measured", "in.log", "--out", "found"))

    def setUp(self):
        super().setUp()
        self.write("in.log", "")
        self.write("m.toml", "format = 1\n")

    def refused(self, text, *said, axis="x"):
        self.write("u.toml", text)
        for command, *more in self.COMMANDS:
            message = self.bad(command, "--config", "u.toml", "--axis", axis, *more)
            for words in said:
                self.assertIn(words, message)

    def test_an_axis_that_the_units_do_not_tell(self):
        self.refused(config(calibration="rate_dps = [0.0, 0.0]").replace('rate_x = "X"\n', ""), "has no axis x: its units measure y, z", "one of these for --axis")

    def test_two_gyros_of_one_axis(self):
        single = config().replace('rate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\n', 'rate = "Z"\n').replace("rate_dps = [0.0, 0.0, 0.0]", "rate_dps = 0.0")
        self.refused(single, "has two gyros of one axis each", "leave --axis out")

    def test_a_mount_that_tilts(self):
        self.refused(config(more_b="mount = [0, 2, 0]"), "the mount of gyro right tilts it by other than quarter turns", "cross_axis")

    def test_no_such_axis_is_wrong_usage(self):
        self.write("u.toml", config())
        self.assertIn("--axis", self.bad("allan", "--config", "u.toml", "--axis", "w", "in.log", code=2))

    def test_a_unit_that_is_not_in_the_log(self):
        drive = Drive(20.0, 10)
        self.write("u.toml", config())
        self.write("in.log", log_of(frames(*drive.unit(0.0, np.eye(3), BIAS_A), 0x101)))
        for command, *more in self.COMMANDS:
            self.assertIn("no frame of gyro right about x (IMU_B 102 on can0)", self.bad(command, "--config", "u.toml", *more))
        self.assertIn("IMU_B", gyro("right", "IMU_B"))


if __name__ == "__main__":
    unittest.main()
