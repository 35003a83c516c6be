#!/usr/bin/python3
"""`vgyro replay` of pairs that are impossible as configured, and of many healthy ones: simulated with drifts, scale
errors, skew, delays, vibration, noise, defects, at rest and in motion. The healthy ones must never be contradicted."""

import json
import math
import struct
import unittest

import bench

RATE = "610"
SEEDS = 3


def rates(text):
    """(t, valid, state) of each VG_Rate."""
    found = []
    for line in text.splitlines():
        stamp, _, frame = line.split()
        name, data = frame.split("#")
        if name == RATE:
            byte = bytes.fromhex(data)[6]
            found.append((float(stamp[1:-1]), byte >> 7, byte >> 4 & 7))
    return found


def turns(t):
    """A drive: 6 s at rest, then turns of some seconds each."""
    if t < 6.0:
        return 0.0
    phase = (t - 6.0) % 12.0
    side = 1.0 if (t - 6.0) % 24.0 < 12.0 else -1.0
    return side * 14.0 * math.sin(math.pi * phase / 5.0) ** 2 if phase < 5.0 else 0.0


MOTIONS = {
    "standing": lambda t: 0.0,
    "one short turn": lambda t: 20.0 * math.sin(math.pi * (t - 20.0)) if 20.0 < t < 21.0 else 0.0,
    "a drive": turns,
    "a ship": lambda t: 0.0 if t < 6.0 else 2.0 * math.sin(0.5 * (t - 6.0)) + 0.7 * math.sin(1.3 * (t - 6.0)),
    "a turntable": lambda t: 0.0 if t < 6.0 else 60.0 * math.sin(2.0 * math.pi * 0.8 * (t - 6.0)),
    "a spin": lambda t: 300.0 * min(max(t - 6.0, 0.0) / 3.0, 1.0),
}

# Errors of gyro 2 besides the noise and bias that both have; all are errors of a sensor, not of the configuration.
EFFECTS = {
    "nothing": "",
    "drift": 'kind = "bias_ramp"\nslope_dps_s = 0.02',
    "random walk": 'kind = "rate_random_walk"\ndensity_dps_rts = 0.02',
    "a step": 'kind = "bias_step"\nsize_dps = 6.0\nat_s = 30.0',
    "scale error": 'kind = "scale_factor"\nerror = 0.3',
    "asymmetry": 'kind = "scale_factor_asymmetry"\nerror = 0.05',
    "much noise": 'kind = "white_noise"\ndensity_dps_rthz = 0.3',
    "delay": 'kind = "delay"\nseconds = 0.25',
    "bandwidth": 'kind = "bandwidth"\ncutoff_hz = 1.0',
    "skew": 'kind = "clock_skew"\nppm = 2300.0',
    "jitter": 'kind = "timestamp_jitter"\nsigma_s = 0.02',
    "vibration": 'kind = "line"\nfrequency_hz = 23.4\namplitude_dps = 3.0\nphase_rad = 0.3',
    "vibration beyond the band": 'kind = "line"\nfrequency_hz = 100.3\namplitude_dps = 1.0\nphase_rad = 0.3',
    "saturation": 'kind = "saturation"\nlimit_dps = 40.0',
    "dead band": 'kind = "dead_band"\nwidth_dps = 0.5',
    "coarse steps": 'kind = "quantization"\nstep_dps = 0.25',
    "outliers": 'kind = "spikes"\nrate_hz = 0.5\nsize_dps = 60.0',
    "stuck": 'kind = "stuck"\nfrom_s = 30.0\nto_s = 50.0',
    "lost frames": 'kind = "dropped_frames"\nfraction = 0.2',
}

COMMON = """\
format = 1

[[effect]]
gyro = 1
kind = "bias"
value_dps = 0.3

[[effect]]
gyro = 1
kind = "white_noise"
density_dps_rthz = 0.002

[[effect]]
gyro = 2
kind = "bias"
value_dps = -0.4

[[effect]]
gyro = 2
kind = "white_noise"
density_dps_rthz = 0.004
"""


class Contradiction(bench.Bench):
    length_s = 90

    def setUp(self):
        super().setUp()
        self.write("vgyro.toml", bench.CONFIG.replace('method = "mutual"', 'method = "optimal"').replace(
            'rest_s = 1.0', 'rest_s = 4.0'))

    def record(self, motion, effect="", seed=1):
        self.write("motion.csv", "t_s,rate_dps,temperature_c\n" + "".join(
            f"{k / 20.0},{motion(k / 20.0):.9g},25\n" for k in range(20 * self.length_s + 1)))
        self.write("model.toml", COMMON + (f"\n[[effect]]\ngyro = 2\n{effect}\n" if effect else ""))
        self.good("simulate", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "motion.csv", "--seed",
                  str(seed), "-o", "in.log")

    def misread(self, read):
        """Gyro b's frames, encoded differently."""
        lines = []
        for line in self.read("in.log").splitlines():
            head, data = line.split("#")
            if head.endswith(" 102"):
                data = struct.pack(">f", read(struct.unpack(">f", bytes.fromhex(data))[0])).hex().upper()
            lines.append(f"{head}#{data}\n")
        self.write("in.log", "".join(lines))

    def refused(self):
        """The messages and the summary of a replay that must fail."""
        said = self.bad("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "s.json", "in.log")
        return said, json.loads(self.read("s.json"))["pair"]


class Found(Contradiction):
    def test_a_wrong_sign(self):
        self.record(turns)
        self.write("vgyro.toml", self.read("vgyro.toml").replace("sign = -1\n", ""))
        said, pair = self.refused()
        self.assertIn("right moves -1.00 times left: sign = -1?", said)
        self.assertIn("no rate is valid until they move together", said)
        self.assertEqual(pair["contradiction"], "sign")
        self.assertAlmostEqual(pair["slope"], -1.0, delta=0.02)
        begin = rates(self.read("out.log"))[0][0]
        # Found within some seconds of the second turn at the latest.
        late = [(valid, state) for t, valid, state in rates(self.read("out.log")) if t > begin + 25.0]
        self.assertEqual(set(late), {(0, 5)})

    def test_a_wrong_unit(self):
        for factor, words in ((180.0 / math.pi, "rad/s and deg/s"), (math.pi / 180.0, "rad/s and deg/s"),
                              (1.0 / 3600.0, "deg/s and deg/h")):
            with self.subTest(factor=factor):
                self.record(turns)
                self.misread(lambda rate, factor=factor: max(-999.0, min(999.0, rate * factor)))
                said, pair = self.refused()
                self.assertIn(words, said)
                self.assertEqual(pair["contradiction"], "scale")
                self.assertAlmostEqual(math.log(pair["slope"] / factor), 0.0, delta=0.1)

    def test_an_unsigned_value(self):
        self.record(turns)
        self.misread(lambda rate: (round(rate / 0.01) & 0xFFFF) * 0.01)
        said, pair = self.refused()
        self.assertIn("signed or unsigned", said)
        self.assertEqual(pair["contradiction"], "erratic")

    def test_a_late_stream(self):
        self.length_s = 200
        self.record(turns)
        late = []
        for line in self.read("in.log").splitlines():
            stamp, bus, frame = line.split()
            t = float(stamp[1:-1]) + (1.5 if bus == "can1" else 0.0)
            late.append((t, f"({t:.6f}) {bus} {frame}\n"))
        self.write("in.log", "".join(line for _, line in sorted(late)))
        said, pair = self.refused()
        self.assertIn("right moves 1.5 s later than left", said)
        self.assertAlmostEqual(pair["lag_s"], 1.5, delta=0.11)

    def test_another_axis(self):
        self.length_s = 200
        self.record(turns)
        a = [line for line in self.read("in.log").splitlines() if " can0 " in line]
        self.record(lambda t: 0.1 * turns(t) + (9.0 * math.sin(0.9 * t) * math.sin(0.37 * t) if t > 6.0 else 0.0), seed=2)
        b = [line for line in self.read("in.log").splitlines() if " can1 " in line]
        self.write("in.log", "".join(f"{line}\n" for line in sorted(a + b, key=lambda line: float(line[1:18]))))
        said, pair = self.refused()
        self.assertIn("both move, and not together", said)
        self.assertEqual(pair["contradiction"], "unrelated")

    def test_every_method_says_it(self):
        self.record(turns)
        self.misread(lambda rate: -rate)
        for method in ("mutual", "mean"):
            said = self.bad("replay", "--config", "vgyro.toml", "--method", method, "-o", "out.log", "in.log")
            self.assertIn("sign = -1?", said)


class Healthy(Contradiction):
    def test_pairs_are_never_accused(self):
        runs = 0
        for number, (effect, text) in enumerate(EFFECTS.items()):
            for name, motion in MOTIONS.items():
                seed = 100 * number + runs % SEEDS
                with self.subTest(effect=effect, motion=name, seed=seed):
                    self.record(motion, text, seed)
                    done = self.good("replay", "--config", "vgyro.toml", "-q", "-o", "out.log", "--json", "-", "in.log")
                    pair = json.loads(done.stdout)["pair"]
                    self.assertEqual((pair["contradiction"], pair["contradictions"]), ("none", 0))
                runs += 1
        print(f"{runs} healthy recordings")

    def test_one_that_drops_out_is_not(self):
        self.record(turns)
        begin = float(self.read("in.log")[1:18])
        kept = [line for line in self.read("in.log").splitlines()
                if " can0 " in line or not 30.0 < float(line[1:18]) - begin < 55.0]
        self.write("in.log", "".join(f"{line}\n" for line in kept))
        done = self.good("replay", "--config", "vgyro.toml", "-q", "-o", "out.log", "--json", "-", "in.log")
        self.assertEqual(json.loads(done.stdout)["pair"]["contradictions"], 0)


if __name__ == "__main__":
    unittest.main()
