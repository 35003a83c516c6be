"""Two gyros and their readings on a motion. A sample is the rate at the instant of its stamp (the motion has no
power near half the sample rate) plus one frame's share of white noise, N²/dt; the random walk steps by K·sqrt(dt)."""

import dataclasses

import numpy as np

import canlog
import make_twin
from judge import motion

START_US = 1_700_000_000_000_000


@dataclasses.dataclass(frozen=True)
class Gyro:
    bias_dps: float
    white_dps_rthz: float  # N
    walk_dps_rts: float  # K
    temperature_dps_k: float


@dataclasses.dataclass(frozen=True)
class Pair:
    name: str
    title: str
    gyros: tuple


PAIRS = {
    p.name: p
    for p in (
        Pair("twin", "the paper's two vibratory gyros",
             (Gyro(0.0330, 8e-5, 5e-7, 1e-5), Gyro(-0.0074, 3e-4, 2e-6, -2e-5))),
        Pair("k10", "equal noise, drift 1 : 10",
             (Gyro(0.0200, 1.3e-4, 1.8e-6, 2e-5), Gyro(-0.0500, 1.3e-4, 1.8e-5, -1e-4))),
        Pair("fog_mems", "fibre-optic and MEMS",
             (Gyro(0.0015, 1e-4, 4.6e-6, 2e-5), Gyro(-0.4200, 5e-3, 2e-4, 1e-3))),
        Pair("mems", "two equal MEMS",
             (Gyro(0.3100, 5e-3, 1.5e-4, 1e-3), Gyro(-0.1800, 5e-3, 1.5e-4, 3e-4))),
    )
}

PHASE_2_S = 3.7e-3
CLOCK_2 = 2e-5  # gyro 2's interval is longer by this share


def sample_rate_hz(pair, scenario):
    """The paper's pair has the paper's rate if the recording stays short."""
    return 500.0 if pair.name == "twin" and scenario.drive == "turn" else 100.0


@dataclasses.dataclass(frozen=True)
class Readings:
    """The readings of one gyro; errors are readings less the true rate at the instant of the stamp."""

    t_s: np.ndarray
    error_dps: np.ndarray  # all of them
    drift_dps: np.ndarray  # bias, walk and temperature
    walk_dps: np.ndarray  # bias and walk
    random_dps: np.ndarray  # bias, walk and white noise: the error without the known effects
    there: np.ndarray  # bool: sent


class _Lines(list):
    write = list.append


@dataclasses.dataclass(frozen=True)
class Recording:
    motion: motion.Motion
    dt_s: float
    gyros: tuple
    streams: tuple

    def log(self):
        """The recording as candump lines."""
        lines = _Lines()
        canlog.write(lines, self.streams)
        return b"".join(lines)


def simulate(pair, scenario, run_s, seed):
    """One seed's recording."""
    index = list(motion.SCENARIOS).index(scenario.name)
    motion_seed, *gyro_seeds = np.random.SeedSequence((seed, index)).spawn(3)
    true = motion.Motion(scenario, run_s, np.random.default_rng(motion_seed))
    dt = 1.0 / sample_rate_hz(pair, scenario)
    readings, streams = [], []
    for k, gyro in enumerate(pair.gyros):
        own_dt = dt * (1.0 + CLOCK_2 * k)
        t = np.arange(int(true.length_s / own_dt) + 1) * own_dt + PHASE_2_S * k
        one, frames = _read(gyro, k, t, own_dt, true, np.random.default_rng(gyro_seeds[k]))
        readings.append(one)
        streams.append(frames)
    return Recording(true, dt, tuple(readings), tuple(streams))


def _read(gyro, k, t, dt, true, rng):
    scenario = true.scenario
    white = rng.standard_normal(len(t)) * (gyro.white_dps_rthz / np.sqrt(dt))
    walk = np.cumsum(rng.standard_normal(len(t))) * (gyro.walk_dps_rts * np.sqrt(dt))
    temperature = true.temperature_c(t)
    drift = gyro.bias_dps + walk
    heated = drift + gyro.temperature_dps_k * (temperature - 25.0)
    rate = true.rate(t)
    sensed = rate if k == 0 else (1.0 + scenario.scale_error_2) * true.rate(t - scenario.delay_2_s)
    raw = np.rint((sensed + heated + white) / make_twin.RATE_STEP_DPS).astype(np.int64)
    there = true.there(k, t)
    frames = make_twin.payloads(raw, np.rint(temperature / make_twin.TEMPERATURE_STEP_K), np.arange(len(t)), k == 1)
    stamps = START_US + np.rint(t * 1e6).astype(np.int64)
    stream = canlog.Stream(f"can{k}", 0x101 + k, stamps[there], frames[there])
    error = raw * make_twin.RATE_STEP_DPS - rate
    return Readings(t, error, heated, drift, drift + white, there), stream


def model_text(pair, scenario):
    """The model file with the true parameters of the recording; biases are left to be learned."""
    effects = []
    for k, gyro in enumerate(pair.gyros):
        effects.append((k, "white_noise", f"density_dps_rthz = {gyro.white_dps_rthz!r}"))
        effects.append((k, "rate_random_walk", f"density_dps_rts = {gyro.walk_dps_rts!r}"))
        if scenario.temperature:
            effects.append((k, "temperature_bias", f"coefficient_dps_k = {gyro.temperature_dps_k!r}\nreference_c = 25.0"))
    if scenario.scale_error_2:
        effects.append((1, "scale_factor", f"error = {scenario.scale_error_2!r}"))
    if scenario.delay_2_s:
        effects.append((1, "delay", f"seconds = {scenario.delay_2_s!r}"))
    return "format = 1\n" + "".join(
        f'\n[[effect]]\ngyro = {k + 1}\nkind = "{kind}"\n{parameters}\n' for k, kind, parameters in effects
    )
