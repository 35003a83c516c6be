#!/usr/bin/python3
"""Every effect that the gateway corrects, on a recording that has it: with the model file the virtual rate is as
good as on a recording without the effect; without the file it is many standard errors worse. Errors are 1-s means
of VG_Rate less the true rate, in units of their injected noise. Seeds are printed."""

import math
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402
import effects_twin  # noqa: E402
import product  # noqa: E402

SEED = 11
# σ of a 1-s mean of ½(y₁ + y₂).
SIGMA_DPS = 0.5 * math.hypot(*effects_twin.WHITE)
# Mean square of the normalised error over some 115 seconds: 1 ± 0.13.
GOOD = 1.0 + 4 * 0.13
LEARNED_S = 20.0  # by then the slope of the temperature is known


def effect(kind, gyro=1, **parameters):
    return {"gyro": gyro, "kind": kind, **parameters}


class Effects(unittest.TestCase):
    def errors(self, recording, config, folder, model=None):
        """Normalised errors of 1-s means, from LEARNED_S on."""
        log = folder / "in.log"
        if not log.exists():
            with open(log, "wb") as file:
                canlog.write(file, recording.streams)
        extra = ["--model", str(model)] if model else []
        rate = effects_twin.read_rates(product.replay(config, log, folder / "out.log", "mean", extra))
        t = (rate.t_us - recording.first_us) * 1e-6
        used = rate.valid & (t > LEARNED_S)
        error = rate.rate_dps[used] - recording.truth.rate_at(t[used])
        second = t[used].astype(int) - int(LEARNED_S)
        counts = np.bincount(second)
        whole = counts > 0.9 * effects_twin.RATE_HZ
        means = np.bincount(second, error)[whole] / counts[whole]
        return means / SIGMA_DPS

    def judge(self, effects, at_least=30.0, good=GOOD, **options):
        """Mean squares of the normalised error with and without the model."""
        recording = effects_twin.make(effects, seed=SEED, **options)
        with tempfile.TemporaryDirectory(prefix="vgyro-") as name:
            folder = Path(name)
            config = effects_twin.write_config(folder)
            model = effects_twin.write_model(folder / "known.toml", effects)
            with_model = float(np.mean(self.errors(recording, config, folder, model) ** 2))
            without = float(np.mean(self.errors(recording, config, folder) ** 2))
        kinds = ", ".join(e["kind"] for e in effects)
        print(f"{kinds}: seed {SEED}, normalised square error {with_model:.2f} with the model, {without:.0f} without")
        self.assertLess(with_model, good)
        self.assertGreater(without, at_least)

    def test_without_effects_the_error_is_the_injected_noise(self):
        # Tests the yardstick itself.
        recording = effects_twin.make([], seed=SEED)
        with tempfile.TemporaryDirectory(prefix="vgyro-") as name:
            config = effects_twin.write_config(name)
            square = float(np.mean(self.errors(recording, config, Path(name)) ** 2))
        print(f"none: seed {SEED}, normalised square error {square:.2f}")
        self.assertLess(square, GOOD)
        self.assertGreater(square, 1.0 - 4 * 0.13)

    def test_bias(self):
        self.judge([effect("bias", value_dps=0.0331)])

    def test_bias_ramp(self):
        self.judge([effect("bias_ramp", 2, slope_dps_s=8e-5)])

    def test_bias_step(self):
        self.judge([effect("bias_step", size_dps=0.006, at_s=75.0)])

    def test_warm_up(self):
        self.judge([effect("warm_up", 2, amplitude_dps=0.03, tau_s=60.0)])

    def test_run_in(self):
        self.judge([effect("run_in", coefficient_dps=0.02, tau_s=8.0)])

    def test_temperature_bias(self):
        self.judge([effect("temperature_bias", coefficient_dps_k=1.5e-3, reference_c=20.0)])

    def test_temperature_bias_quadratic(self):
        self.judge([effect("temperature_bias_quadratic", 2, coefficient_dps_k2=1.5e-4)])

    def test_temperature_rate_bias(self):
        self.judge([effect("temperature_rate_bias", coefficient_dps_s_k=0.03)])

    def test_temperature_hysteresis(self):
        self.judge([effect("temperature_hysteresis", 2, coefficient_dps_k=6e-3, play_k=1.5)])

    def test_scale_factor(self):
        self.judge([effect("scale_factor", error=5e-4)])

    def test_scale_factor_of_both_gyros(self):
        self.judge([effect("scale_factor", error=4e-3), effect("scale_factor", 2, error=-3e-3)])

    def test_scale_factor_asymmetry(self):
        self.judge([effect("scale_factor_asymmetry", 2, error=3e-4)])

    def test_scale_factor_quadratic(self):
        self.judge([effect("scale_factor_quadratic", coefficient_per_dps=1e-5)])

    def test_scale_factor_cubic(self):
        self.judge([effect("scale_factor_cubic", 2, coefficient_per_dps2=-3e-7)])

    def test_scale_factor_temperature(self):
        self.judge([effect("scale_factor_temperature", coefficient_per_k=1e-4, reference_c=30.0)])

    def test_cross_axis(self):
        self.judge([effect("cross_axis", **{"from": "x"}, coefficient=1e-3)])

    def test_g_sensitivity(self):
        self.judge([effect("g_sensitivity", axis="x", coefficient_dps_g=0.02)])

    def test_g_sensitivity_to_gravity(self):
        self.judge([effect("g_sensitivity", 2, axis="z", coefficient_dps_g=-0.004)])

    def test_vibration_rectification(self):
        self.judge([effect("vibration_rectification", coefficient_dps_g2=0.5)])

    def test_angle_harmonic(self):
        self.judge([effect("angle_harmonic", 2, harmonic=4, amplitude_dps=0.02, phase_rad=1.9)])

    def test_line(self):
        # Slow enough to show in 1-s means.
        self.judge([effect("line", frequency_hz=0.31, amplitude_dps=0.006, phase_rad=0.4)])

    def test_delay_of_one_gyro(self):
        self.judge([effect("delay", seconds=0.02)])

    def test_delay_of_both_gyros(self):
        # The common part does not show in the difference of the two.
        self.judge([effect("delay", seconds=0.006), effect("delay", 2, seconds=0.004)], at_least=5.0)

    def test_bandwidth(self):
        # A group delay leaves an error of second order in rate/cutoff.
        self.judge([effect("bandwidth", 2, cutoff_hz=40.0)], good=2.0)

    def test_bandwidth_of_second_order(self):
        self.judge([effect("bandwidth_second_order", 2, cutoff_hz=40.0, damping=0.7)], good=2.0)

    def test_many_at_once(self):
        # The effects depend on one another: the response acts on the rate without the offsets.
        self.judge(
            [
                effect("bias", value_dps=0.05),
                effect("temperature_bias", coefficient_dps_k=1e-3),
                effect("scale_factor", error=4e-3),
                effect("scale_factor_asymmetry", error=-2e-3),
                effect("scale_factor_cubic", coefficient_per_dps2=2e-7),
                effect("delay", seconds=0.005),
                effect("angle_harmonic", harmonic=4, amplitude_dps=0.01, phase_rad=0.3),
                effect("bias", 2, value_dps=-0.02),
                effect("g_sensitivity", 2, axis="y", coefficient_dps_g=0.01),
                effect("warm_up", 2, amplitude_dps=0.02, tau_s=100.0),
            ]
        )


if __name__ == "__main__":
    unittest.main()
