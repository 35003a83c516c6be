#!/usr/bin/python3
"""`vgyro compare` on a recording that `vgyro simulate` made from the same model: both use one equation, so no
residual remains. A scale error of the present rate instead of the late rate would cause an error of error * slope *
delay, 4e-3 deg/s here; noise of 1e-4 deg/s a sample would show that at once."""

import json
import math
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "simulation"))
import bench  # noqa: E402
import rig  # noqa: E402
from rig import effect  # noqa: E402

SEED = 29
REST_S, LENGTH_S, RATE_HZ = 35.0, 95.0, 100.0
SLOPE_DPS2, TURNS_HZ = 100.0, 0.4
SCALE_ERROR, DELAY_S = 2e-3, 0.02
# Noise of one sample. A hundred steps of the frame, so that rounding does not matter.
NOISE_DPS = 1e-4
WRONG_DPS = SCALE_ERROR * SLOPE_DPS2 * DELAY_S
MOST_DPS = WRONG_DPS / 50


def motion(t):
    """At rest, then sines; the steepest slope of the rate is SLOPE_DPS2."""
    w = 2 * np.pi * TURNS_HZ
    return np.where(t < REST_S, 0.0, SLOPE_DPS2 / w * (1 - np.cos(w * (t - REST_S))))


class SimulateCompare(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("rig.dbc", rig.DBC)
        self.write("vgyro.toml", rig.CONFIG)
        self.write("profile.csv", rig.profile(LENGTH_S, motion=motion))
        self.noise = [effect("white_noise", gyro, density_dps_rthz=NOISE_DPS / math.sqrt(RATE_HZ)) for gyro in (1, 2)]

    def residual_dps(self, played, judged):
        """The rms model error, in addition to the noise, that corresponds to the gap in nats per sample."""
        self.write("played.toml", rig.model(*played, *self.noise))
        self.write("judged.toml", rig.model(*judged, *self.noise))
        config = ("--config", "vgyro.toml")
        self.good("simulate", *config, "--model", "played.toml", "--profile", "profile.csv", "--seed", str(SEED), "-o", "drive.log")
        text = self.good("compare", *config, "--model", "judged.toml", "--measured", "drive.log", "--json", "-").stdout
        nats = json.loads(text)["gap"]["value"]
        return NOISE_DPS * math.sqrt(2 * max(0.0, nats))

    def test_a_scale_error_of_a_late_gyro_is_of_the_late_rate(self):
        effects = [effect("scale_factor", error=SCALE_ERROR), effect("delay", seconds=DELAY_S)]
        self.assertLess(self.residual_dps(effects, effects), MOST_DPS)

    def test_everything_that_is_the_same_each_time_at_once(self):
        effects = [effect("scale_factor", error=SCALE_ERROR), effect("scale_factor_asymmetry", error=1e-3),
                   effect("scale_factor_quadratic", coefficient_per_dps=1e-4), effect("scale_factor_cubic", coefficient_per_dps2=1e-6),
                   effect("scale_factor_temperature", coefficient_per_k=1e-4), effect("delay", seconds=DELAY_S),
                   effect("bandwidth", cutoff_hz=20.0), effect("bias_ramp", slope_dps_s=1e-4), effect("clock_skew", 2, ppm=50.0),
                   effect("temperature_bias", coefficient_dps_k=1e-2), effect("g_sensitivity", axis="y", coefficient_dps_g=0.04),
                   effect("angle_harmonic", harmonic=2, amplitude_dps=0.02, phase_rad=0.4), effect("delay", 2, seconds=-0.004)]
        self.assertLess(self.residual_dps(effects, effects), MOST_DPS)

    def test_the_other_convention_would_be_seen(self):
        """A late gyro with the scale error of the present rate is like one whose delay is shorter by error * delay,
        while the rate is a straight line."""
        played = [effect("scale_factor", error=SCALE_ERROR), effect("delay", seconds=DELAY_S)]
        judged = [effect("scale_factor", error=SCALE_ERROR), effect("delay", seconds=DELAY_S / (1 + SCALE_ERROR))]
        self.assertGreater(self.residual_dps(played, judged), 0.2 * WRONG_DPS)


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main(verbosity=1)
