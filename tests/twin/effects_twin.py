"""Recordings of two gyros with known effects: the equations of docs/model-file.md in NumPy, on a motion with turns
both ways, a swing of temperature and a rough road. Shares nothing with the product, so that it can judge the
product's corrections."""

import cmath
import dataclasses
import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402

START_US = 1_700_000_000_000_000
RATE_HZ = 200.0
FINE = 20  # steps of the integration in one sample
EARTH_DPS = 0.0032
REST_S = 30.0
RATE_STEP_DPS = 1e-6
TEMPERATURE_STEP_C = 0.01
ACCELERATION_STEP_G = 1e-4
ROLL_STEP_DPS = 2e-3
WHITE = (2e-4, 3e-4)  # N of gyro 1 and 2, deg/s/sqrt(Hz)
PHASES_S = (0.0, 0.0013)  # time offsets of the gyros' samples
ACCELEROMETER_PHASE_S = -0.0004

DBC = """\
VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temperature : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Roll : 48|16@1- (0.002,0) [-65|65] "deg/s" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ Rate : 7|32@0- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temperature : 39|16@0- (0.01,0) [-40|125] "degC" RIG
 SG_ Roll : 55|16@0- (0.002,0) [-65|65] "deg/s" RIG

BO_ 528 ACCEL: 8 RIG
 SG_ AccX : 0|16@1- (0.0001,0) [-3|3] "g" RIG
 SG_ AccY : 16|16@1- (0.0001,0) [-3|3] "g" RIG
 SG_ AccZ : 32|16@1- (0.0001,0) [-3|3] "g" RIG
"""

CONFIG = """\
[[gyro]]
name = "a"
bus = "can0"
dbc = "effects.dbc"
message = "GYRO_A"
rate = "Rate"
temperature = "Temperature"
rate_x = "Roll"

[[gyro]]
name = "b"
bus = "can1"
dbc = "effects.dbc"
message = "GYRO_B"
rate = "Rate"
temperature = "Temperature"
rate_x = "Roll"

[accelerometer]
bus = "can0"
dbc = "effects.dbc"
message = "ACCEL"
x = "AccX"
y = "AccY"
z = "AccZ"

[calibration]
rest_s = {rest_s!r}
rate_dps = {rate_dps!r}

[output]
bus = "can0"
fd = true
"""


def rate_of(t, top_dps):
    """The Earth's rate at rest, then turns to the left and to the right, some of them quick."""
    after = t - REST_S - 1.0
    begin = np.clip(after / 2.0, 0.0, 1.0)
    ease = begin * begin * (3.0 - 2.0 * begin)
    swing = 0.6 * np.sin(2 * np.pi * after / 23.0) + 0.25 * np.sin(2 * np.pi * after / 5.1) + 0.15 * np.sin(2 * np.pi * after / 3.1)
    return EARTH_DPS + np.where(after > 0.0, top_dps * ease * swing, 0.0)


def roll_of(t):
    """Rate about the direction of travel, on a road with waves."""
    return 14.0 * np.sin(2 * np.pi * t / 7.3) + 6.0 * np.sin(2 * np.pi * t / 1.9)


def temperature_of(t, gyro):
    return 28.0 + 2.0 * gyro + 6.0 * np.sin(2 * np.pi * t / 240.0 + 0.5 * gyro)


def followed(temperature, play_k):
    """The position of something that the temperature drags along once it is farther away than the play."""
    out, at = np.empty_like(temperature), temperature[0]
    for i, now in enumerate(temperature):
        if now - at > play_k:
            at = now - play_k
        elif at - now > play_k:
            at = now + play_k
        out[i] = at
    return out


def temperature_slope_of(t, gyro):
    return 6.0 * 2 * np.pi / 240.0 * np.cos(2 * np.pi * t / 240.0 + 0.5 * gyro)


def acceleration_of(t, rng):
    """x, y, z in g at the accelerometer's samples: braking, bends, gravity and a road that is rough in parts."""
    x = 0.3 * np.sin(2 * np.pi * t / 17.0)
    y = 0.2 * np.sin(2 * np.pi * t / 11.0)
    rough = 0.02 + 0.13 * (np.sin(2 * np.pi * t / 40.0) > 0.3)
    return np.stack([x, y, 1.0 + rough * rng.standard_normal(len(t))], axis=1)


def trailing_variance(values, count):
    """Variance of the last `count` values, fewer at the beginning."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    squares = np.concatenate([[0.0], np.cumsum(values**2)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - count, 0)
    n = last - first
    return (squares[last] - squares[first]) / n - ((sums[last] - sums[first]) / n) ** 2


@dataclasses.dataclass(frozen=True)
class Truth:
    t_s: np.ndarray  # fine grid from the first frame
    rate_dps: np.ndarray
    angle_rad: np.ndarray

    def rate_at(self, t_s):
        return np.interp(t_s, self.t_s, self.rate_dps)


@dataclasses.dataclass(frozen=True)
class Recording:
    streams: list
    truth: Truth
    first_us: int


def added(effect, t, rate, truth, gyro, acceleration, vibration):
    """Contribution of one effect to the readings at times t; `rate` is the rate of the sensing element."""
    p = effect
    temperature = temperature_of(t, gyro)
    excess = temperature - p.get("reference_c", 25.0)
    kind = p["kind"]
    if kind == "bias":
        return np.full_like(t, p["value_dps"])
    if kind == "bias_ramp":
        return p["slope_dps_s"] * t
    if kind == "bias_step":
        return p["size_dps"] * (t >= p["at_s"])
    if kind == "warm_up":
        return p["amplitude_dps"] * np.exp(-t / p["tau_s"])
    if kind == "run_in":
        return p["coefficient_dps"] * np.log(1.0 + t / p["tau_s"])
    if kind == "temperature_bias":
        return p["coefficient_dps_k"] * excess
    if kind == "temperature_bias_quadratic":
        return p["coefficient_dps_k2"] * excess**2
    if kind == "temperature_rate_bias":
        return p["coefficient_dps_s_k"] * temperature_slope_of(t, gyro)
    if kind == "temperature_hysteresis":
        return p["coefficient_dps_k"] * (followed(temperature, p["play_k"]) - temperature)
    if kind == "cross_axis":
        return p["coefficient"] * {"x": roll_of}[p["from"]](t)
    if kind == "scale_factor":
        return p["error"] * rate
    if kind == "scale_factor_asymmetry":
        return p["error"] * np.abs(rate)
    if kind == "scale_factor_quadratic":
        return p["coefficient_per_dps"] * rate**2
    if kind == "scale_factor_cubic":
        return p["coefficient_per_dps2"] * rate**3
    if kind == "scale_factor_temperature":
        return p["coefficient_per_k"] * excess * rate
    if kind == "g_sensitivity":
        return p["coefficient_dps_g"] * acceleration["xyz".index(p["axis"])]
    if kind == "vibration_rectification":
        return p["coefficient_dps_g2"] * vibration
    if kind == "angle_harmonic":
        angle = np.interp(t, truth.t_s, truth.angle_rad)
        return p["amplitude_dps"] * np.cos(p["harmonic"] * angle + p["phase_rad"])
    if kind == "line":
        return p["amplitude_dps"] * np.sin(2 * np.pi * p["frequency_hz"] * t + p["phase_rad"])
    if kind in ("delay", "bandwidth", "bandwidth_second_order"):
        return np.zeros_like(t)
    raise ValueError(kind)


def second_order(rate, dt, cutoff_hz, damping):
    """y'' = w² (rate - y) - 2 damping w y', damping < 1: z' = p (rate - z) with the complex p, of which y is a part."""
    w = 2 * math.pi * cutoff_hz
    p = w * complex(damping, math.sqrt(1.0 - damping**2))
    keep, z, out = cmath.exp(-p * dt), complex(rate[0]), np.empty_like(rate)
    for i, value in enumerate((0.5 * (rate + np.concatenate([rate[:1], rate[:-1]]))).tolist()):
        z = keep * z + (1.0 - keep) * value
        out[i] = (p.conjugate() * z).imag / -p.imag
    return out


def sensed_rate(effects, truth, t):
    """The rate as it reaches the reading: late, or through a low-pass."""
    rate = truth.rate_dps
    dt = truth.t_s[1] - truth.t_s[0]
    for effect in effects:
        if effect["kind"] == "bandwidth":
            keep = math.exp(-2 * math.pi * effect["cutoff_hz"] * dt)
            out = np.empty_like(rate)
            state = rate[0]
            # The mean of both ends of a step has a lag of second order only.
            for i, value in enumerate(0.5 * (rate + np.concatenate([rate[:1], rate[:-1]]))):
                state = keep * state + (1.0 - keep) * value
                out[i] = state
            rate = out
        if effect["kind"] == "bandwidth_second_order":
            rate = second_order(rate, dt, effect["cutoff_hz"], effect["damping"])
    late = sum(e["seconds"] for e in effects if e["kind"] == "delay")
    return np.interp(t - late, truth.t_s, rate)


def make(effects, length_s=150.0, top_dps=60.0, seed=1):
    """`effects`: dictionaries as in the model file, `gyro` 1 or 2."""
    count = int(round(length_s * RATE_HZ))
    fine = np.arange(count * FINE + FINE) / (RATE_HZ * FINE)
    rate = rate_of(fine, top_dps)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])) / (RATE_HZ * FINE)])
    truth = Truth(fine, rate, np.radians(turned))
    seeds = np.random.SeedSequence(seed).spawn(3)

    # The accelerometer sends first: its first frame is time zero of the model.
    t_frame = np.arange(count) / RATE_HZ
    a = acceleration_of(t_frame, np.random.default_rng(seeds[2]))
    a_raw = np.rint(a / ACCELERATION_STEP_G).astype(np.int16)
    vibration = trailing_variance(np.linalg.norm(a, axis=1), int(RATE_HZ))
    payload = np.zeros((count, 8), dtype=np.uint8)
    payload[:, 0:6] = a_raw.astype("<i2").view(np.uint8).reshape(-1, 6)
    offset_s = -ACCELEROMETER_PHASE_S
    streams = [canlog.Stream("can0", 0x210, stamps(t_frame), payload)]

    for gyro in range(2):
        own = [e for e in effects if e["gyro"] == gyro + 1]
        t = t_frame + offset_s + PHASES_S[gyro]
        sensed = sensed_rate(own, truth, t)
        reading = sensed.copy()
        for effect in own:
            reading += added(effect, t, sensed, truth, gyro, a.T, vibration)
        rng = np.random.default_rng(seeds[gyro])
        reading += rng.standard_normal(count) * WHITE[gyro] * math.sqrt(RATE_HZ)
        order = "<" if gyro == 0 else ">"
        payload = np.zeros((count, 8), dtype=np.uint8)
        payload[:, 0:4] = np.rint(reading / RATE_STEP_DPS).astype(order + "i4").view(np.uint8).reshape(-1, 4)
        temperature = np.rint(temperature_of(t, gyro) / TEMPERATURE_STEP_C)
        payload[:, 4:6] = temperature.astype(order + "i2").view(np.uint8).reshape(-1, 2)
        roll = np.rint(roll_of(t) / ROLL_STEP_DPS)
        payload[:, 6:8] = roll.astype(order + "i2").view(np.uint8).reshape(-1, 2)
        streams.append(canlog.Stream(f"can{gyro}", 0x101 + gyro, stamps(t), payload))
    return Recording(streams, truth, START_US)


def stamps(t_s):
    return START_US + np.rint(t_s * 1e6).astype(np.int64)


@dataclasses.dataclass(frozen=True)
class Rates:
    t_us: np.ndarray  # the instant that the rate refers to
    rate_dps: np.ndarray
    valid: np.ndarray


def read_rates(data):
    """VG_Rate as in dbc/vgyro_fd.dbc: the CAN FD frame holds the instant to the microsecond."""
    payloads = [line.split(b"610##")[1][1:65] for line in data.splitlines() if b" 610##" in line]
    frames = np.frombuffer(bytes.fromhex(b"".join(payloads).decode()), dtype=np.uint8).reshape(-1, 32)
    rate = np.ascontiguousarray(frames[:, 4:8]).view("<i4")[:, 0] * 1e-6
    instant = np.ascontiguousarray(frames[:, 12:20]).view("<u8")[:, 0].astype(np.int64)
    return Rates(instant, rate, (frames[:, 3] >> 3 & 1).astype(bool))


def write_config(folder):
    folder = Path(folder)
    (folder / "effects.dbc").write_text(DBC)
    path = folder / "vgyro.toml"
    path.write_text(CONFIG.format(rest_s=REST_S, rate_dps=EARTH_DPS))
    return path


def write_model(path, effects):
    lines = ["format = 1"]
    for effect in effects:
        lines += ["", "[[effect]]"]
        lines += [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v!r}" for k, v in effect.items()]
    Path(path).write_text("\n".join(lines) + "\n")
    return path
