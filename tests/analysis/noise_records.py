"""Recordings of two gyros with known noise, made with NumPy from the definitions, and the Allan deviation
in its plain form. Shares nothing with the product."""

import dataclasses
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "twin"))
import canlog  # noqa: E402

STEP_DPS = 1e-7  # of the rates in the frames
BEGIN_US = 1_700_000_000_000_000

DBC = """\
VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ Rate : 0|32@1- (1E-007,0) [-200|200] "deg/s" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ Rate : 0|32@1- (1E-007,0) [-200|200] "deg/s" RIG
"""

CONFIG = """\
[[gyro]]
name = "left"
bus = "can0"
dbc = "noise.dbc"
message = "GYRO_A"
rate = "Rate"

[[gyro]]
name = "right"
bus = "can1"
dbc = "noise.dbc"
message = "GYRO_B"
rate = "Rate"

[calibration]
rest_s = 10.0
rate_dps = 0.0

[corrector]
method = "mean"

[output]
bus = "can0"
"""


@dataclasses.dataclass(frozen=True)
class Noise:
    """The noise of one gyro: N deg/s/√Hz, K deg/s/√s, B deg/s, Q deg, ramp deg/s²."""

    n: float
    k: float = 0.0
    b: float = 0.0
    q: float = 0.0
    ramp: float = 0.0
    bias: float = 0.01
    markov: tuple = ()  # σ deg/s, τ s


def flicker(rng, count, interval_s, b):
    """Noise of power density B²/(2πf), two-sided: white noise shaped in the frequency domain. The middle
    of a record four times as long is used, so that its ends do not meet."""
    size = 4 * count
    spectrum = np.fft.rfft(rng.normal(size=size))
    f = np.fft.rfftfreq(size, interval_s)
    f[0] = f[1]
    shaped = spectrum * np.sqrt(b**2 / (2 * np.pi * f) / interval_s)
    return np.fft.irfft(shaped, size)[count : 2 * count]


def gauss_markov(rng, count, interval_s, sigma, tau_s):
    keeps = np.exp(-interval_s / tau_s)
    values = np.empty(count)
    value = sigma * rng.normal()
    for i, shock in enumerate(rng.normal(size=count) * sigma * np.sqrt(1 - keeps**2)):
        values[i] = value = keeps * value + shock
    return values


def rates(rng, noise, count, interval_s):
    white = rng.normal(size=count) * noise.n / np.sqrt(interval_s)
    walk = np.cumsum(rng.normal(size=count)) * noise.k * np.sqrt(interval_s)
    angle = rng.normal(size=count + 1) * noise.q
    t = np.arange(count) * interval_s
    rate = noise.bias + noise.ramp * t + white + walk + np.diff(angle) / interval_s
    if noise.markov:
        rate += gauss_markov(rng, count, interval_s, *noise.markov)
    return rate + flicker(rng, count, interval_s, noise.b) if noise.b else rate


def in_frames(rate_dps):
    """The rates as rounded in frames."""
    return np.round(rate_dps / STEP_DPS).astype(np.int64)


def stream(bus, can_id, stamps_us, rate_dps):
    payloads = np.zeros((len(rate_dps), 8), dtype=np.uint8)
    payloads[:, :4] = in_frames(rate_dps).astype("<i4").view(np.uint8).reshape(-1, 4)
    return canlog.Stream(bus, can_id, np.asarray(stamps_us, dtype=np.int64), payloads)


def write_pair(path, rates_dps, interval_s, offset_us=(0, 0), jitter_us=None, kept=(None, None)):
    """Writes a candump log of both gyros. `kept`: masks of the frames that are in it."""
    streams = []
    for i in range(2):
        stamps = BEGIN_US + offset_us[i] + np.round(np.arange(len(rates_dps[i])) * interval_s * 1e6)
        if jitter_us is not None:
            stamps = stamps + jitter_us[i]
        mask = np.ones(len(stamps), dtype=bool) if kept[i] is None else kept[i]
        streams.append(stream(f"can{i}", 0x101 + i, stamps[mask], rates_dps[i][mask]))
    with canlog.open_out(path) as file:
        canlog.write(file, streams)


def allan_deviation(rate_dps, interval_s, m):
    """Overlapping Allan deviation, from the averages instead of from the angle."""
    averages = np.convolve(rate_dps, np.full(m, 1.0 / m), mode="valid")
    difference = averages[m:] - averages[:-m]
    return np.sqrt(0.5 * np.mean(difference**2))
