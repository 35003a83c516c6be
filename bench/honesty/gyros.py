"""The errors of a gyro: bias, scale, noise, drift, faults, resolution."""

import math
from dataclasses import dataclass, field

import numpy as np

FLICKER_TAUS_S = (3.0, 20.0, 130.0, 850.0)
FLICKER_GRID_S = 0.5


@dataclass
class Class:
    """Data-sheet values of a kind of gyro; values are drawn from the ranges logarithmically."""

    name: str
    density: tuple  # deg/s/rtHz
    bias_dps: float
    scale: float  # 1 sigma
    ramp: tuple  # deg/s^2
    warm_up: tuple  # deg/s
    step: tuple  # deg/s
    per_kelvin: tuple  # deg/s/K
    hidden_slope: float  # deg/s^2 that temperature may cause if no temperature is sent


CLASSES = {
    "fog": Class("fog", (5e-5, 3e-4), 0.02, 5e-5, (2e-7, 2e-6), (2e-4, 3e-3), (1e-4, 5e-3), (1e-6, 2e-5), 2e-6),
    "good MEMS": Class("good MEMS", (1e-3, 3e-3), 0.2, 6e-4, (1e-5, 1.5e-4), (0.02, 0.3), (0.02, 0.3),
                       (2e-4, 5e-3), 1.5e-4),
    "cheap MEMS": Class("cheap MEMS", (3e-3, 1e-2), 1.0, 1e-3, (3e-5, 5e-4), (0.05, 1.0), (0.02, 1.0),
                        (5e-4, 2e-2), 5e-4),
}
PAIRS = (("cheap MEMS", "cheap MEMS"), ("good MEMS", "good MEMS"), ("good MEMS", "cheap MEMS"), ("fog", "good MEMS"),
         ("fog", "cheap MEMS"), ("fog", "fog"))
PAIR_SHARES = (0.25, 0.25, 0.15, 0.1, 0.1, 0.15)
RATES_HZ = (50.0, 100.0, 125.0, 200.0)
# The frame's sigma ends at 0.08 deg/s; real gyros whose single samples are worse are also sent less often.
WORST_SAMPLE_DPS = 0.08
# In units of the class's scale error: the factory rejects worse gyros. The part that both gyros share cannot be
# observed, so it stays below the usual allowance: up to 0.25 % for a cheap MEMS, 0.0125 % for fog.
WORST_SCALE = 2.5


def log_uniform(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


@dataclass
class Gyro:
    kind: str
    density: float
    walk: float  # deg/s/rts
    flicker_dps: float
    bias_dps: float
    scale: float
    rate_hz: float
    phase_s: float
    ppm: float
    step_dps: float
    lag_s: float  # from the housing's temperature to the drifting part's
    temperature_step_k: float
    drifts: list = field(default_factory=list)
    faults: list = field(default_factory=list)

    def words(self):
        return (f"{self.kind}, N {self.density:.1e}, K {self.walk:.1e}, {self.rate_hz:g} Hz, step {self.step_dps:.1g}, "
                f"scale {self.scale:+.1e}")


def draw_gyro(rng, kind, rate_hz, coarse):
    of = CLASSES[kind]
    density = log_uniform(rng, *of.density)
    rates = [hz for hz in RATES_HZ if density * math.sqrt(hz) <= WORST_SAMPLE_DPS]
    rate_hz = rate_hz if rate_hz in rates else rng.choice(rates)
    finest = 1e-6 if kind == "fog" else 1e-4
    step = rng.uniform(0.06, 0.25) if coarse else log_uniform(rng, finest, 1e-4 if kind == "fog" else 5e-3)
    return Gyro(kind, density, density * 10 ** rng.uniform(-2.7, -1.2),
                density * 10 ** rng.uniform(-1.5, -0.5) if rng.random() < 0.4 else 0.0, rng.normal(0, of.bias_dps),
                of.scale * float(np.clip(rng.standard_normal(), -WORST_SCALE, WORST_SCALE)), float(rate_hz),
                rng.uniform(0, 1 / rate_hz), rng.uniform(-60, 60), float(f"{step:.2g}"), rng.uniform(5, 60),
                round(rng.uniform(0.1, 1.0), 1))


@dataclass
class Drift:
    """One effect on one gyro, as a function of time; `kind` for the tables."""

    kind: str
    size: float
    begin_s: float = 0.0
    tau_s: float = 1.0

    def at(self, t, lagged_k):
        if self.kind == "ramp":
            return self.size * np.maximum(0, t - self.begin_s)
        if self.kind == "warm-up":
            return self.size * -np.expm1(-t / self.tau_s)
        if self.kind == "bias step":
            return self.size * (t >= self.begin_s)
        return self.size * lagged_k

    def words(self):
        return {"ramp": f"ramp of {self.size:+.1e} deg/s2 from {self.begin_s:.0f} s",
                "warm-up": f"warm-up by {self.size:+.2g} deg/s in {self.tau_s:.0f} s",
                "bias step": f"step of {self.size:+.2g} deg/s at {self.begin_s:.0f} s",
                "thermal": f"{self.size:+.1e} deg/s/K"}[self.kind]


@dataclass
class Thermal:
    """The housing's temperature: alternates between two levels."""

    swing_k: float
    half_s: float
    phase_s: float
    start_c: float

    def housing_c(self, t):
        x = (t + self.phase_s) / self.half_s
        return self.start_c + self.swing_k * 0.5 * (1 - np.cos(np.pi * x))

    def lagged_k(self, t, lag_s):
        """Temperature change of the drifting part: it follows the housing, which is a cosine, with a first-order
        lag; at the start they agree."""
        w = math.pi / self.half_s
        angle = w * (t + self.phase_s) - math.atan(w * lag_s)
        settled = -0.5 * self.swing_k * np.cos(angle) / math.sqrt(1 + (w * lag_s) ** 2)
        first = -0.5 * self.swing_k * math.cos(w * self.phase_s)
        begin = -0.5 * self.swing_k * math.cos(w * self.phase_s - math.atan(w * lag_s)) / math.sqrt(1 + (w * lag_s) ** 2)
        return settled + (first - begin) * np.exp(-t / lag_s) - first


@dataclass
class Fault:
    kind: str
    begin_s: float
    end_s: float
    size: float = 0.0

    def words(self):
        until = "" if math.isinf(self.end_s) else f" to {self.end_s:.0f} s"
        return f"{self.kind} from {self.begin_s:.0f} s{until}"


def flicker(rng, t, size_dps):
    """Gauss-Markov terms a decade apart: close to 1/f."""
    grid = np.arange(0, t[-1] + 2 * FLICKER_GRID_S, FLICKER_GRID_S)
    decay = np.exp(-FLICKER_GRID_S / np.array(FLICKER_TAUS_S))
    kicks = rng.standard_normal((len(grid), len(decay))) * np.sqrt(1 - decay**2)
    state, total = rng.standard_normal(len(decay)), np.empty(len(grid))
    for i, kick in enumerate(kicks):
        state = state * decay + kick
        total[i] = state.sum()
    return np.interp(t, grid, size_dps * total)


def drift_of(gyro, t, thermal, drifts):
    lagged = thermal.lagged_k(t, gyro.lag_s) if thermal else 0.0
    return sum((d.at(t, lagged) for d in drifts), np.zeros(len(t)))


def sample(gyro, rng, duration_s, grid, rate, thermal):
    """Instants in s and raw values of all frames that the gyro sends, after the faults."""
    interval_s = (1 + gyro.ppm * 1e-6) / gyro.rate_hz
    t = np.round(np.arange(gyro.phase_s, duration_s, interval_s) * 1e6) * 1e-6
    true = np.interp(t, grid, rate)
    for fault in gyro.faults:
        if fault.kind == "blind":
            true[t >= fault.begin_s] = 0.0
    y = true * (1 + gyro.scale) + gyro.bias_dps + drift_of(gyro, t, thermal, gyro.drifts)
    y += rng.standard_normal(len(t)) * (gyro.density * math.sqrt(gyro.rate_hz))
    y += np.cumsum(rng.standard_normal(len(t))) * (gyro.walk / math.sqrt(gyro.rate_hz))
    if gyro.flicker_dps:
        y += flicker(rng, t, gyro.flicker_dps)
    sent = np.ones(len(t), bool)
    raw = np.rint(y / gyro.step_dps).astype(np.int64)
    for fault in gyro.faults:
        inside = (t >= fault.begin_s) & (t < fault.end_s)
        if fault.kind == "silent":
            sent &= ~inside
        elif fault.kind == "reads zero":
            raw[inside] = 0
        elif fault.kind in ("stuck", "reads a constant"):
            raw[inside] = raw[inside][:1]
        elif fault.kind == "spike":
            raw[np.flatnonzero(inside)[:1]] += round(fault.size / gyro.step_dps)
    return t[sent], raw[sent]
