#!/usr/bin/python3
"""`vgyro simulate` from the outside: frames of unusual forms decoded with canmatrix, the results of replay and allan
on a recording with known truth, the same bytes for the same seed, and the errors for bad input. The equations of the
effects are tested in tests/simulation/effects_test.py."""

import io
import json
import logging
import math
import sys
import unittest
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "simulation"))
import bench  # noqa: E402
import rig  # noqa: E402
from rig import effect  # noqa: E402

logging.disable(logging.CRITICAL)
with redirect_stdout(io.StringIO()):  # canmatrix prints the formats that it lacks to stdout
    import canmatrix.formats

SEED = 17

# The gyros' signals in one CAN FD message; a temperature and a supply voltage that share a page of their own; a
# sender's sign bit.
ODD_DBC = """\
VERSION ""

BU_: RIG

BO_ 2566844158 FD: 24 RIG
 SG_ A : 7|32@0- (1,0) [0|0] "rad/s" RIG
 SG_ Counter : 32|4@1+ (1,0) [0|14] "" RIG
 SG_ State : 36|3@1+ (1,0) [0|7] "" RIG
 SG_ AccX : 64|16@1- (0.01,0) [0|0] "m/s^2" RIG
 SG_ AccY : 87|16@0- (0.01,0) [0|0] "m/s^2" RIG
 SG_ AccZ : 96|16@1- (0.01,0) [0|0] "m/s^2" RIG

BO_ 300 PAGED: 5 RIG
 SG_ Page M : 0|2@1+ (1,0) [0|3] "" RIG
 SG_ B m1 : 8|20@1+ (0.5,0) [0|0] "deg/h" RIG
 SG_ Negative m1 : 28|1@1+ (1,0) [0|1] "" RIG
 SG_ Warmth m2 : 8|8@1+ (0.5,-40) [0|0] "degC" RIG
 SG_ Volts m2 : 16|8@1+ (0.05,0) [0|0] "V" RIG

SIG_VALTYPE_ 2566844158 A : 1;
"""

ODD_CONFIG = """\
[[gyro]]
name = "a"
bus = "can0"
dbc = "odd.dbc"
message = "FD"
rate = "A"
sign = -1
counter = "Counter"
valid = "State >= 5"

[[gyro]]
name = "b"
bus = "can1"
dbc = "odd.dbc"
message = "PAGED"
rate = "B"
sign_signal = "Negative"
temperature = "Warmth"
supply_voltage = "Volts"

[accelerometer]
bus = "can0"
dbc = "odd.dbc"
message = "FD"
x = "AccX"
y = "AccY"
z = "AccZ"

[output]
bus = "can0"
"""


def slow(t):
    return 30.0 * np.sin(2 * np.pi * 0.2 * t)


class Simulate(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("rig.dbc", rig.DBC)
        self.write("vgyro.toml", rig.CONFIG)
        self.write("model.toml", rig.model(effect("white_noise", density_dps_rthz=2e-4)))
        self.write("profile.csv", rig.rest(5))

    def simulate(self, *arguments):
        return self.good("simulate", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "profile.csv", *arguments)

    def test_frames_of_odd_forms_say_to_canmatrix_what_was_meant(self):
        self.write("odd.dbc", ODD_DBC)
        self.write("vgyro.toml", ODD_CONFIG)
        self.write("model.toml", rig.model())
        self.write("profile.csv", rig.profile(4, motion=slow))
        self.simulate("-o", "out.log")
        matrix = next(iter(canmatrix.formats.loadp(str(self.folder / "odd.dbc")).values()))
        fd, paged = matrix.frame_by_name("FD"), matrix.frame_by_name("PAGED")
        self.assertTrue(fd.arbitration_id.extended)
        fd_id, seen = f"{fd.arbitration_id.id:08X}", {"FD": 0, "1": 0, "2": 0}
        for line in self.read("out.log").splitlines():
            stamp, bus, frame = line.split()
            t = float(stamp[1:-1]) - rig.START_S
            if frame.startswith(f"{fd_id}##0"):
                self.assertEqual(bus, "can0")
                values = {k: float(v.phys_value) for k, v in fd.decode(bytes.fromhex(frame[11:])).items()}
                self.assertEqual(len(frame[11:]), 48)
                self.assertEqual(values["Counter"], seen["FD"] % 15)
                self.assertGreaterEqual(values["State"], 5)
                if 0.3 < t < 3.7:
                    self.assertAlmostEqual(values["A"], -math.radians(slow(t)), delta=4e-7)
                    for axis, wanted in zip(("AccX", "AccY", "AccZ"), rig.acceleration(t)):
                        self.assertAlmostEqual(values[axis], wanted * 9.80665, delta=0.0051)
                seen["FD"] += 1
                continue
            self.assertEqual((bus, frame[:4], len(frame)), ("can1", "12C#", 14))
            values = {k: float(v.phys_value) for k, v in paged.decode(bytes.fromhex(frame[4:])).items()}
            seen[str(int(values["Page"]))] += 1
            if values["Page"] == 2:
                self.assertAlmostEqual(values["Warmth"], rig.temperature(t), delta=0.26)
                self.assertAlmostEqual(values["Volts"], rig.supply(t), delta=0.026)
            elif 0.3 < t < 3.7:
                self.assertAlmostEqual(values["B"] * (1 - 2 * values["Negative"]) / 3600, slow(t), delta=0.25 / 3600 + 2e-5)
        self.assertEqual(seen, {"FD": 401, "1": 400, "2": 40})

    def test_one_seed_gives_one_recording(self):
        self.write("model.toml", rig.model(effect("white_noise", density_dps_rthz=2e-4), effect("dropped_frames", 2, fraction=0.1),
                                           effect("timestamp_jitter", sigma_s=1e-4)))
        first = self.simulate("--seed", str(SEED)).stdout
        self.simulate("--seed", str(SEED), "-o", "out.log")
        self.assertEqual(self.read("out.log").encode(), first)
        self.assertNotEqual(self.simulate("--seed", str(SEED + 1)).stdout, first)
        stamps = [line.split()[0] for line in first.decode().splitlines()]
        self.assertEqual(stamps, sorted(stamps))
        self.assertTrue(stamps[0].startswith("(1700000000.0000") or stamps[0].startswith("(1700000000.0001"))
        self.assertTrue(self.simulate("--start", "12.5").stdout.decode().startswith("(0000000012.5"))

    def test_replay_finds_the_drifts_that_were_put_in(self):
        """After 60 s of rest, one bias is known to N / sqrt(60 s)."""
        noise, biases = (2e-4, 3e-4), (0.0331, -0.0172)
        self.write("model.toml", rig.model(
            *(effect("bias", i + 1, value_dps=biases[i]) for i in range(2)),
            *(effect("white_noise", i + 1, density_dps_rthz=noise[i]) for i in range(2))))
        self.write("profile.csv", rig.rest(60))
        self.simulate("--seed", str(SEED), "-o", "out.log")
        self.write("classic.toml", rig.CONFIG.replace("fd = true\n", "").replace("rest_s = 30.0", "rest_s = 59.0"))
        frames = self.good("replay", "--config", "classic.toml", "--method", "mutual", "out.log").stdout.decode()
        last = int.from_bytes(bytes.fromhex([x for x in frames.splitlines() if " 611#" in x][-1].split("#")[1]), "little")
        for i, start in enumerate((16, 36)):
            raw = last >> start & 0xFFFFF
            found = (raw - (raw >> 19 << 20)) * 1e-5
            self.assertAlmostEqual(found, biases[i], delta=4 * noise[i] / math.sqrt(59) + 1e-5)

    def test_replay_with_the_same_model_gives_the_motion_back(self):
        """All effects that can be corrected, at once and without noise, compared with the motion in closed form."""
        def motion(t):
            return np.where(t < 35.0, 0.0, rig.rate(t - 35.0))
        self.write("model.toml", rig.model(
            effect("bias", value_dps=0.3), effect("bias_ramp", 2, slope_dps_s=1e-4), effect("scale_factor", error=3e-3),
            effect("scale_factor_quadratic", 2, coefficient_per_dps=1e-4), effect("g_sensitivity", 2, axis="x", coefficient_dps_g=0.05),
            effect("supply_voltage_bias", coefficient_dps_v=0.1), effect("delay", seconds=0.004)))
        self.write("profile.csv", rig.profile(60, motion=motion))
        self.simulate("-o", "out.log")
        wrong = []
        for model in ((), ("--model", "model.toml")):
            out = self.good("replay", "--config", "vgyro.toml", *model, "out.log").stdout.decode()
            payloads = [line.split("610##")[1][1:65] for line in out.splitlines() if " 610##" in line]
            frames = np.frombuffer(bytes.fromhex("".join(payloads)), dtype=np.uint8).reshape(-1, 32)
            rate = np.ascontiguousarray(frames[:, 4:8]).view("<i4")[:, 0] * 1e-6
            t = np.ascontiguousarray(frames[:, 12:20]).view("<u8")[:, 0].astype(np.int64) * 1e-6 - rig.START_S
            used = (frames[:, 3] >> 3 & 1 == 1) & (t > 36)
            self.assertGreater(np.count_nonzero(used), 2000)
            wrong.append(np.sqrt(np.mean((rate[used] - motion(t[used])) ** 2)))
        self.good("replay", "--config", "vgyro.toml", "-o", "again.log", "--json", "sum.json", "out.log")
        gyros = json.loads(self.read("sum.json"))["gyros"]
        self.assertAlmostEqual(gyros[0]["supply_v"], rig.supply(60.0), delta=0.51 * rig.SUPPLY_STEP_V)
        self.assertNotIn("supply_v", gyros[1], "of a gyro that tells none")
        # The remaining error comes from the linear interpolation of the pairs.
        self.assertGreater(wrong[0], 0.02, "there was nothing to take back")
        self.assertLess(wrong[1], 0.01)

    @unittest.skipIf(bench.SANITIZED, "an hour of samples takes a minute with sanitizers")
    def test_allan_finds_the_noise_that_was_put_in(self):
        truth = {"a": (2e-4, 4e-5), "b": (6e-4, 8e-5)}
        self.write("model.toml", rig.model(*(
            effect(kind, i + 1, **{name: truth["ab"[i]][j]}) for i in range(2)
            for j, (kind, name) in enumerate((("white_noise", "density_dps_rthz"), ("rate_random_walk", "density_dps_rts"))))))
        self.write("profile.csv", rig.rest(3600))
        self.simulate("--seed", str(SEED), "-o", "out.log")
        self.good("allan", "--config", "vgyro.toml", "--json", "allan.json", "out.log")
        found = json.loads(self.read("allan.json"))
        for gyro in found["gyros"]:
            n, k = truth[gyro["name"]]
            for name, wanted in (("white_noise_dps_rthz", n), ("rate_random_walk_dps_rts", k)):
                estimate = gyro["noise"][name]
                self.assertAlmostEqual(estimate["value"], wanted, delta=4 * estimate["sigma"], msg=name)
                self.assertLess(estimate["sigma"], 0.2 * wanted, name)

    def test_bad_input_is_told_with_place_and_remedy(self):
        def said(*arguments, code=1, model="model.toml", profile="profile.csv"):
            return self.bad("simulate", "--config", "vgyro.toml", "--model", model, "--profile", profile, *arguments, code=code)
        self.write("bad.csv", "t_s,rate_dps\n0,1\n1,nan\n")
        self.assertIn("bad.csv:3: rate_dps is nan", said(profile="bad.csv"))
        self.write("bad.csv", "t_s,rate_dps\n0,1\n")
        self.assertIn("at least two", said(profile="bad.csv"))
        self.assertIn("none.csv: ", said(profile="none.csv"))
        self.write("warm.toml", rig.model(effect("bias", value_dps=1.0), effect("temperature_bias", 2, coefficient_dps_k=1e-3)))
        self.assertIn("warm.toml:8: temperature_bias needs what profile.csv does not contain; a profile with the column temperature_c",
                      said(model="warm.toml"))
        self.write("g.toml", rig.model(effect("g_sensitivity", axis="y", coefficient_dps_g=1e-3)))
        self.assertIn("acc_y_g", said(model="g.toml"))
        self.write("v.toml", rig.model(effect("supply_voltage_bias", coefficient_dps_v=1e-3)))
        self.assertIn("a profile with the column supply_v", said(model="v.toml"))
        self.write("odd.toml", rig.model(effect("scale_facter", error=1e-3)))
        self.assertIn("did you mean \"scale_factor\"?", said(model="odd.toml"))
        self.write("low.toml", rig.model(*[effect("bandwidth", cutoff_hz=9.0)] * 4))
        self.assertIn("at most 3", said(model="low.toml"))
        self.assertIn("xz", said("-o", "out.log.xz"))
        self.assertIn("is also an input", said("-o", "profile.csv"))
        self.assertEqual(self.read("profile.csv"), rig.rest(5))
        self.assertIn("cannot be written", said("-o", "no/such/folder.log"))
        self.write("long.csv", rig.rest(100_000_000))
        self.assertIn("more samples", said(profile="long.csv"))
        said("--gyro-rate", "0", code=2)
        said("--gyro-rate", "100,100,100", code=2)
        said("--jitter", "-1", code=2)

    def test_the_summary_tells_what_was_left_out_and_what_did_not_fit(self):
        text = self.simulate("-o", "out.log").stderr.decode()
        self.assertIn("5 s of profile.csv", text)
        self.assertIn("the profile has no column acc_x_g", text)
        self.assertIn("25 degC throughout", text)
        self.assertNotIn(" 210#", self.read("out.log"))
        self.write("model.toml", rig.model(effect("bias", value_dps=3000.0)))
        self.assertIn("501 readings are beyond the 2147.48 deg/s", self.simulate("-o", "out.log").stderr.decode())
        self.assertEqual(self.simulate("-q", "-o", "out.log").stderr.decode().count("\n"), 1, "the warning stays")


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main(verbosity=1)
