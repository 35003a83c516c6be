"""The truth of one recording before frames are made from it, and the readings of each gyro."""

import dataclasses

import numpy as np

import effects as kinds
import motion
import surroundings

REFERENCE_HZ, REFERENCE_SIGMA_DPS = 200.0, 2e-4
ACCELEROMETER_HZ, ACCELEROMETER_SIGMA_G = 100.0, 2e-3


@dataclasses.dataclass(frozen=True)
class Gyro:
    """The parameters of one gyro."""

    bias: float
    density: float  # deg/s/√Hz
    walk: float  # deg/s/√s
    markov_sigma: float = 0.0
    markov_tau: float = 1.0
    # For vehicles' gyros only: see drive.py.
    flicker: float = 0.0  # coefficient B of bias instability, deg/s; the Allan floor is 0.664·B
    flicker_terms: tuple = ()  # (sigma, tau) of the Markov terms that stand for it in the model file
    filters_hz: tuple = ()  # the sensor's own first-order low-passes
    filtered_noise: bool = False  # its white noise passes the first of them, too
    period_ppm: float = 0.0  # its sampling interval is longer by this; stamps are the receiver's, and right
    rate_step: float = 1e-6
    temperature_step: float = 0.01


@dataclasses.dataclass
class World:
    motion: motion.Motion
    temperatures: list
    acceleration: surroundings.Acceleration
    gyros: list
    rates_hz: list
    offset_s: float  # of the second gyro's stamps
    reference: bool
    supplies: list | None = None  # None: not sent
    roll: surroundings.Roll | None = None  # None: not sent
    reference_hz: float = REFERENCE_HZ
    reference_sigma: float = REFERENCE_SIGMA_DPS
    accelerometer: bool = True
    speed: bool = False
    traits: dict = dataclasses.field(default_factory=dict)  # for tables: properties of the world

    def times(self, gyro):
        """True instants of a gyro's samples."""
        rate_hz = self.rates_hz[gyro - 1]
        first = self.offset_s if gyro == 2 else 0.0
        count = np.arange(int((self.motion.duration_s - 0.01) * rate_hz))
        ppm = self.gyros[gyro - 1].period_ppm
        t = first + count / rate_hz * (1.0 + ppm * 1e-6)
        return t[t < self.motion.duration_s - 0.005] if ppm else t

    def noise_seen(self, gyro):
        """White noise a sample and random walk a step in which an effect of this gyro must be found: its
        own with a reference, else both gyros'."""
        seen = [self.gyros[gyro - 1]] if self.reference else self.gyros
        rate_hz = self.rates_hz[gyro - 1]
        return (
            float(np.sqrt(sum(g.density**2 for g in seen) * rate_hz)),
            float(np.sqrt(sum(g.walk**2 for g in seen) / rate_hz)),
        )

    def peak_dps(self):
        t = np.arange(0, self.motion.duration_s, 0.02)
        return float(np.abs(self.motion.rate(t)).max())


def correlated(count, interval_s, sigma, tau_s, rng):
    """First-order autoregression, exact at any interval."""
    keep = np.exp(-interval_s / tau_s)
    steps = rng.standard_normal(count) * sigma * np.sqrt(1 - keep**2)
    value, out = rng.standard_normal() * sigma, []
    for step in steps.tolist():
        value = keep * value + step
        out.append(value)
    return np.array(out)


def flicker(count, interval_s, coefficient, rng):
    """Noise of two-sided density B²/(2πf), down to a quarter of the recording's own lowest frequency."""
    whole = 4 * count
    f = np.fft.rfftfreq(whole, interval_s)
    f[0] = np.inf
    wave = np.fft.rfft(rng.standard_normal(whole)) * coefficient / np.sqrt(2 * np.pi * f * interval_s)
    return np.fft.irfft(wave, whole)[:count]


def late_rate(world, t, effects, gyro):
    """The rate that a gyro feels at the instants t, in deg/s, after its delays and its low-passes."""
    delay_s = sum(p["seconds"] for p in _of(effects, "delay"))
    twice = _of(effects, "bandwidth_second_order")
    cutoffs = [*world.gyros[gyro - 1].filters_hz, *(p["cutoff_hz"] for p in _of(effects, "bandwidth"))]
    assert not (twice and (cutoffs or len(twice) > 1))
    if twice:
        return world.motion.low_passed_twice(t - delay_s, twice[0]["cutoff_hz"], twice[0]["damping"])
    if cutoffs:
        return world.motion.low_passed(t - delay_s, *cutoffs)
    return world.motion.rate(t - delay_s)


def _white(g, count, rate_hz, density, rng):
    """White noise at the samples, after the sensor's low-pass if it has one."""
    if g.filtered_noise:
        sigma = density * np.sqrt(np.pi * g.filters_hz[0])
        return correlated(count, 1.0 / rate_hz, sigma, 1.0 / (2 * np.pi * g.filters_hz[0]), rng)
    return rng.standard_normal(count) * density * np.sqrt(rate_hz)


def _noise(world, gyro, t, rate, effects, rng):
    g, rate_hz = world.gyros[gyro - 1], world.rates_hz[gyro - 1]
    total = np.zeros(len(t))
    for density in [g.density, *(e["density_dps_rthz"] for e in _of(effects, "white_noise"))]:
        total += _white(g, len(t), rate_hz, density, rng)
    for walk in [g.walk, *(e["density_dps_rts"] for e in _of(effects, "rate_random_walk"))]:
        total += np.cumsum(rng.standard_normal(len(t))) * walk / np.sqrt(rate_hz)
    markov = [(e["sigma_dps"], e["tau_s"]) for e in _of(effects, "gauss_markov")]
    if g.markov_sigma > 0:
        markov.append((g.markov_sigma, g.markov_tau))
    for sigma, tau_s in markov:
        total += correlated(len(t), 1.0 / rate_hz, sigma, tau_s, rng)
    if g.flicker > 0:
        total += flicker(len(t), 1.0 / rate_hz, g.flicker, rng)
    for e in _of(effects, "bias_instability"):
        total += flicker(len(t), 1.0 / rate_hz, e["coefficient_dps"], rng)
    for e in _of(effects, "rate_noise"):
        total += rng.standard_normal(len(t)) * e["ratio_rthz"] * np.abs(rate) * np.sqrt(rate_hz)
    return total


def _of(effects, kind):
    return [e["parameters"] for e in effects if e["kind"] == kind]


def reading(world, gyro, effects, strangers, rng):
    """The stream of one gyro: stamps in seconds, counter, rate. `strangers` are functions
    (world, gyro, t, rng) → deg/s outside the catalogue."""
    effects = [e for e in effects if e["gyro"] == gyro]
    t = world.times(gyro)
    # The delay comes first; the sensor's other responses act on the late rate.
    rate = late_rate(world, t, effects, gyro)
    y = rate.copy()
    y += world.gyros[gyro - 1].bias
    for e in effects:
        if e["kind"] in kinds.OFFSETS + kinds.RESPONSES:
            p = e["parameters"]
            y += p[kinds.SIZE[e["kind"]][0]] * kinds.shape(e["kind"], p, gyro, t, world, rate)
    y += _noise(world, gyro, t, rate, effects, rng)
    for stranger in strangers:
        y += stranger(world, gyro, t, rng)
    manner = {e["kind"]: e.get("manner") for e in effects}
    for p in _of(effects, "spikes"):
        hit = rng.random(len(t)) < p["rate_hz"] / world.rates_hz[gyro - 1]
        sides = [1.0] if manner["spikes"] == "one way" else [-1.0, 1.0]
        y[hit] += p["size_dps"] * rng.choice(sides, hit.sum())
    for p in _of(effects, "saturation"):
        y = np.clip(y, -p["limit_dps"], p["limit_dps"])
    for p in _of(effects, "dead_band"):
        y[np.abs(y) < p["width_dps"]] = 0.0
    for p in _of(effects, "quantization"):
        y = np.round(y / p["step_dps"]) * p["step_dps"]
    for p in _of(effects, "stuck"):
        held = np.flatnonzero((t >= p["from_s"]) & (t < p["to_s"]))
        y[held] = y[held[0]]
    stamps = t.copy()
    for p in _of(effects, "clock_skew"):
        stamps *= 1.0 + p["ppm"] * 1e-6
    for p in _of(effects, "timestamp_jitter"):
        lateness = rng.standard_normal(len(t)) * p["sigma_s"]
        if manner["timestamp_jitter"] == "about the due time":
            stamps = np.sort(np.maximum(stamps + lateness, 0.0))
        else:
            stamps += np.abs(lateness)
    kept = np.ones(len(t), dtype=bool)
    for p in _of(effects, "dropped_frames"):
        row = 4 if manner["dropped_frames"] == "in rows" else 1
        kept &= np.repeat(rng.random(len(t) // row + 1) >= p["fraction"], row)[: len(t)]
    kept[0] = True
    return t[kept], stamps[kept], np.arange(len(t))[kept], y[kept]
