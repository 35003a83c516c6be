"""Drives: the properties of a vehicle's gyros, temperatures and accelerometer, and the effects hidden in them. The
numbers are from data sheets: optical gyros and MEMS ones, steps in which buses carry rates and temperatures, filters
of sensors."""

import numpy as np

import drive_strength
import effects as kinds
import motion
import road
import strangers
import strength
from surroundings import Supply
from world import Gyro, World

# name → white noise (deg/s/√Hz), flicker B (deg/s), walk K (deg/s/√s), bias (deg/s): least and most
SENSORS = {
    "fog": ((1e-5, 5e-5), (3e-6, 2e-5), (1e-7, 1e-6), (1e-4, 3e-3)),
    "vibratory": ((1e-4, 5e-4), (1e-5, 1e-4), (1e-6, 8e-6), (3e-3, 5e-2)),
    "mems": ((3e-3, 7e-3), (3e-4, 1.2e-3), (1e-5, 6e-5), (2e-2, 0.5)),
    "cheap mems": ((7e-3, 2e-2), (1e-3, 4e-3), (3e-5, 2e-4), (5e-2, 1.5)),
}
PAIRS = [
    ("fog", "mems"), ("vibratory", "vibratory"), ("mems", "mems"), ("fog", "cheap mems"), ("vibratory", "mems"),
    ("mems", "cheap mems"), ("fog", "fog"), ("vibratory", "cheap mems"),
]  # fmt: skip
RATE_STEPS_DPS = (0.01, 0.02, 0.05, 0.0625, 0.1)
RATES_HZ = [(100, 100)] * 6 + [(50, 50), (200, 200), (100, 50), (50, 100), (100, 200), (125, 100)]
# Largest plausible sizes.
MOST = {
    "bias": 2.0, "bias_ramp": 2e-3, "bias_step": 0.5, "warm_up": 0.5, "temperature_bias": 0.1,
    "temperature_bias_quadratic": 0.01, "temperature_rate_bias": 3.0, "g_sensitivity": 0.1,
    "vibration_rectification": 2.0, "angle_harmonic": 0.2, "line": 0.5, "supply_voltage_bias": 0.5,
    "scale_factor": 0.05, "scale_factor_asymmetry": 0.03, "scale_factor_quadratic": 1e-3,
    "scale_factor_cubic": 3e-5, "scale_factor_temperature": 3e-3, "delay": 0.06, "white_noise": 0.05,
    "rate_random_walk": 5e-3, "gauss_markov": 0.1, "rate_noise": 0.01, "clock_skew": 1000.0,
}  # fmt: skip
# Share of these for the better sorts: drift and offsets, and scale factors.
STEADY = {"fog": 0.02, "vibratory": 0.2, "mems": 1.0, "cheap mems": 1.0}
TRUE_TO_SCALE = {"fog": 0.2, "vibratory": 0.3, "mems": 1.0, "cheap mems": 1.0}
# Least size, as a share of that usual on a bench.
LEAST_SHARE = 0.1
LEAST = {"bandwidth": 2.0, "delay": 2e-4, "clock_skew": 2.0}
# A seed must keep hiding the same effects: kinds that the catalogue gained later hide only in drives that request them
# (`kind`). A low-pass of second order hides like the others, in gyros without a filter.
LATER = {"cross_axis", "temperature_hysteresis", "run_in", "bias_instability"}
HIDE = [k for k in kinds.KINDS if k not in LATER]
FLICKER_TERMS = 3  # most terms in a model file
LAG_KINDS = {"delay", "bandwidth", "clock_skew", "timestamp_jitter"}


class Temperature:
    """Warms up by some kelvin, and is cooled by the airflow while driving; value and slope are exact."""

    def __init__(self, duration_s, rng, shared=None):
        self.start_c = float(rng.uniform(5.0, 35.0)) if shared is None else shared.start_c + float(rng.uniform(0, 5))
        self.warm_k, self.tau_s = float(rng.uniform(2.0, 10.0)), float(rng.uniform(120.0, 900.0))
        count = 3
        self.f = 1.0 / rng.uniform(120.0, 600.0, count)
        self.a, self.phase = rng.uniform(0.3, 1.6, count), rng.uniform(0, 2 * np.pi, count)
        self.shared = shared

    def value(self, t):
        own = self.warm_k * (1.0 - np.exp(-t / self.tau_s))
        own = own + sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(self.a, self.f, self.phase))
        return self.start_c + own + (0.5 * (self.shared.value(t) - self.shared.start_c) if self.shared else 0.0)

    def slope(self, t):
        own = self.warm_k / self.tau_s * np.exp(-t / self.tau_s)
        for a, f, p in zip(self.a, self.f, self.phase):
            own = own + a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p)
        return own + (0.5 * self.shared.slope(t) if self.shared else 0.0)


class Acceleration:
    """The vehicle's acceleration: braking, bends, slopes, and shaking by the road's roughness."""

    GRID_HZ = 1000
    G = 9.81

    def __init__(self, drive, rng):
        count = int((drive.duration_s + 4.0) * self.GRID_HZ)
        self.t = np.arange(count) / self.GRID_HZ - 2.0
        speed = drive.course.speed(self.t)
        knots = np.arange(-30.0, drive.duration_s + 60.0, 25.0)
        grade = np.interp(self.t, knots, 0.03 * rng.standard_normal(len(knots)))
        x = np.gradient(speed, 1.0 / self.GRID_HZ) / self.G + grade
        y = speed * np.deg2rad(drive.slow_rate(self.t) - motion.EARTH_DPS) / self.G
        shake = drive.course.roughness(self.t) * float(rng.uniform(0.02, 0.15))
        noise = [self._band(count, low, high, rng) for low, high in ((1.0, 6.0), (1.0, 6.0), (1.0, 40.0))]
        self.a = np.stack([x + 0.2 * shake * noise[0], y + 0.2 * shake * noise[1], 1.0 + shake * noise[2]], axis=1)
        size = np.linalg.norm(self.a, axis=1)
        n = self.GRID_HZ
        sums = np.cumsum(size), np.cumsum(size * size)
        mean, square = ((np.concatenate([np.zeros(n), s[n:] - s[:-n]])) / n for s in sums)
        self.variance = np.maximum(square - mean * mean, 0.0)
        self.variance[:n] = self.variance[n]

    def _band(self, count, low_hz, high_hz, rng):
        f = np.fft.rfftfreq(count, 1.0 / self.GRID_HZ)
        keep = motion.smooth_step(f / low_hz - 0.5) / (1.0 + (f / high_hz) ** 4)
        wave = np.fft.irfft(np.fft.rfft(rng.standard_normal(count)) * keep, count)
        return wave / wave.std()

    def value(self, t):
        return np.stack([np.interp(t, self.t, self.a[:, i]) for i in range(3)], axis=1)

    def vibration_g2(self, t):
        return np.interp(t, self.t, self.variance)


def _log_uniform(rng, bounds, digits=3):
    low, high = bounds
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.{digits}g}")


def flicker_terms(coefficient, density, duration_s):
    """Three Gauss–Markov terms whose spectra together are B²/(2πf) where that exceeds the white noise."""
    crossing_hz = (coefficient / density) ** 2 / (2 * np.pi)
    shortest = float(np.clip(0.3 / (2 * np.pi * crossing_hz), 0.5, 0.05 * duration_s))
    taus = np.geomspace(shortest, 0.6 * duration_s, FLICKER_TERMS)
    sigma = coefficient * np.sqrt(np.log(taus[1] / taus[0]) / np.pi)
    return tuple((float(f"{sigma:.3g}"), float(f"{tau:.3g}")) for tau in taus)


def _gyro(sort, duration_s, flickers, rng):
    density, flicker, walk, bias = (_log_uniform(rng, b) for b in SENSORS[sort])
    coarse = "mems" in sort and rng.random() < 0.4
    step = float(rng.choice(RATE_STEPS_DPS))
    celsius = float(rng.choice([0.01, 0.5, 1.0], p=[0.4, 0.3, 0.3]))
    return {
        "bias": bias * float(rng.choice([-1, 1])),
        "density": density,
        "walk": walk,
        "flicker": flicker if flickers else 0.0,
        "flicker_terms": flicker_terms(flicker, density, duration_s) if flickers else (),
        "rate_step": step if coarse else 1e-6,
        "temperature_step": celsius,
    }


def _filters(sorts, rng):
    """Low-passes of the two sensors: none, equal, or different; and whether noise passes through them too."""
    manner = str(rng.choice(["none", "alike", "different"], p=[0.4, 0.3, 0.3]))
    both = [float(round(rng.uniform(20.0, 50.0), 1)) for _ in range(2)]
    if manner == "alike":
        both[1] = both[0]
    soft = bool(manner != "none" and rng.random() < 0.25)
    return manner, [() if manner == "none" else (c,) for c in both], soft


def _clocks(rng):
    """Error of each gyro's sampling interval, in ppm; positive: too long."""
    manner = str(rng.choice(["exact", "crystal", "oscillator"], p=[0.4, 0.4, 0.2]))
    widths = {"exact": 0.0, "crystal": 30.0, "oscillator": 8000.0}
    return manner, [round(float(rng.uniform(-1.0, 1.0) * widths[manner]), 2) for _ in range(2)]


def world_for(case, rng, motion_rng):
    """The gyros come from `rng`, the same for both recordings of a case; the drive from `motion_rng`."""
    duration_s = 240.0 if case.short else 600.0
    sorts = list(PAIRS[rng.integers(len(PAIRS))])
    flickers = bool(rng.random() < 0.5)
    told = [_gyro(s, duration_s, flickers, rng) for s in sorts]
    rates = [float(r) for r in RATES_HZ[0 if case.short else rng.integers(len(RATES_HZ))]]
    manner, filters, soft = _filters(sorts, rng)
    clocks, ppm = _clocks(rng)
    for i in range(2):
        told[i] |= {"filters_hz": filters[i], "filtered_noise": soft, "period_ppm": ppm[i]}
    offset_s = float(rng.choice([0.0023, round(float(rng.uniform(0.0003, 0.0095)), 4)]))
    reference_hz = float(rng.choice([50.0, 100.0]))
    reference_density = _log_uniform(rng, (5e-4, 5e-3))
    accelerometer = bool(rng.random() < 0.75) or case.kind in ("g_sensitivity", "vibration_rectification")
    speed = bool(rng.random() < 0.5) or case.kind == "wheel_hum"
    spectrum = road.draw_spectrum(rng)
    road_dps = _log_uniform(rng, (0.05, 1.0))
    course = road.Course(duration_s, 45.0 if case.short else 62.0, motion_rng)
    drive = road.Drive(course, spectrum, road_dps, motion_rng)
    first = Temperature(duration_s, motion_rng)
    return World(
        motion=drive,
        temperatures=[first, Temperature(duration_s, motion_rng, first)],
        acceleration=Acceleration(drive, motion_rng),
        gyros=[Gyro(**g) for g in told],
        rates_hz=rates,
        offset_s=offset_s,
        reference=case.reference,
        reference_hz=reference_hz,
        reference_sigma=float(reference_density * np.sqrt(reference_hz)),
        accelerometer=accelerometer,
        speed=speed,
        traits={
            "pair": "/".join(sorts), "road_dps": road_dps, "corner_hz": round(spectrum.corner_hz, 1),
            "slope": round(spectrum.slope, 1), "town": course.town, "filters": manner, "soft_noise": soft,
            "flicker": flickers, "clocks": clocks, "rate_steps": [g["rate_step"] for g in told],
            "temperature_steps": [g["temperature_step"] for g in told],
        },
    )  # fmt: skip


def benign(world, case):
    """(kind, gyro) of true properties of the gyros besides the hidden effects: naming one is not wrong."""
    out = []
    for number, g in enumerate(world.gyros, 1):
        if g.rate_step > 1e-6:
            out.append(["quantization", number])
        if case.nothing_given:
            out += [[k, number] for k in ("bias", "white_noise", "rate_random_walk")]
            out += [[k, number] for k in ("gauss_markov", "bias_instability") if g.flicker > 0]
            out += [["bandwidth", number]] if g.filters_hz else []
        elif g.flicker > 0:
            out.append(["bias_instability", number])
    return out


def fits(kind, gyro, world, case):
    """Can this kind be hidden in this world and be found?"""
    g = world.gyros[gyro - 1]
    if kind in ("bandwidth", "bandwidth_second_order") and g.filters_hz:
        return False
    if kind == "quantization" and g.rate_step > 1e-6:
        return False
    if kind in ("g_sensitivity", "vibration_rectification") and not world.accelerometer:
        return False
    if case.nothing_given and kind in ("bias", "white_noise", "rate_random_walk", "gauss_markov", "bandwidth"):
        return False
    return True


def most(kind, sort):
    """The largest size for a sensor of this sort."""
    if kind in kinds.RESPONSES:
        return MOST[kind] * TRUE_TO_SCALE[sort]
    if kind in kinds.OFFSETS + kinds.NOISES:
        return MOST[kind] * STEADY[sort]
    return MOST.get(kind, np.inf)


def draw(kind, gyro, wanted_t, world, rng):
    """effects.draw for a drive; None if no gyro has such a size."""
    name, low, high = kinds.SIZE[kind]
    if kind in kinds.CLIPS or kind in kinds.DISTURBANCES and kind != "clock_skew":
        effect = kinds.draw(kind, gyro, wanted_t, world, rng)
        p, sigma = effect["parameters"], world.gyros[gyro - 1].density * np.sqrt(world.rates_hz[gyro - 1])
        if kind == "spikes":  # road noise changes as much between two samples
            p[name] = float(f"{p[name] + 20.0 * world.motion.road_dps * rng.uniform(0.3, 1.0):.4g}")
        if kind == "dead_band":
            p[name] = float(f"{max(p[name], 3.0 * sigma):.4g}")
        return effect
    see = drive_strength.Visible(world, gyro)
    p = kinds.companions(kind, gyro, world, rng, wanted_t is None)
    if kind == "line":
        p["frequency_hz"] = round(min(p["frequency_hz"], 0.45 * see.rate_hz), 3)
    wanted = float(np.exp(rng.uniform(np.log(15.0), np.log(80.0)))) if wanted_t is None else wanted_t
    if kind in kinds.NOISES:
        t_of = lambda s: drive_strength.noise_t(kind, p, world, gyro, see, s)
        size = strength.solve(t_of, wanted, 1e-8, 10.0)
    else:
        unit = drive_strength.per_unit(kind, p, world, gyro, see)
        size = unit / (2 * np.pi * wanted) if kind == "bandwidth" else wanted / unit
        t_of = lambda s: unit * (1 / (2 * np.pi * s) if kind == "bandwidth" else s)
    if kind == "bandwidth":
        size = min(size, kinds.HIGHEST_CUTOFF_HZ)
    sort = world.traits["pair"].split("/")[gyro - 1]
    least = LEAST_SHARE * low * (STEADY[sort] if kind in kinds.OFFSETS + kinds.NOISES else 1.0)
    size = max(size, LEAST.get(kind, least))
    if size > most(kind, sort) or kind == "bandwidth" and size <= LEAST["bandwidth"]:
        return None
    t = round(float(t_of(size)), 2)
    p[name] = float(f"{size * (rng.choice([-1.0, 1.0]) if kind in kinds.SIGNED else 1.0):.6g}")
    return {"kind": kind, "gyro": gyro, "parameters": p, "t": t}


def draw_somehow(kind, gyro, wanted_t, world, rng):
    """draw(), made weaker until a sensor can have it."""
    for wanted in (wanted_t, 12.0, 6.0, 3.0, 1.0, 0.1):
        if effect := draw(kind, gyro, wanted, world, rng):
            return effect
    raise ValueError(f"{kind} of gyro {gyro} fits no sensor in this world")


def _chosen(case, rng):
    """Kinds to try, the wanted one first; enough for any case."""
    order = [str(k) for k in rng.permutation([k for k in HIDE if k != "supply_voltage_bias"])]
    return [case.kind, *order] if case.kind else order


def hidden_in(case, world, rng):
    """Like cases.hidden_in; a kind that cannot hide in this world is replaced by the next."""
    count = {"single": 1, "pair": 2, "triple": 3}.get(case.group, 0)
    found, odd, label = [], [], None
    for kind in _chosen(case, rng) if count else []:
        taken = {e["kind"] for e in found}
        rival = any(kind in group and group & taken for group in _rivals())
        first = int(rng.integers(1, 3))
        for gyro in (first, 3 - first):
            if len(found) == count or rival or kind in taken or not fits(kind, gyro, world, case):
                continue
            if kind == "supply_voltage_bias":
                world.supplies = [Supply(world.motion.duration_s, rng) for _ in range(2)]
            effect = draw(kind, gyro, case.strength, world, rng)
            if effect is not None:
                found.append(effect)
                break
    if case.group == "outside":
        gyro = int(rng.integers(1, 3))
        see = drive_strength.Visible(world, gyro)
        size = float(np.sqrt(np.median(see.slow()) * world.rates_hz[gyro - 1]) * rng.uniform(0.6, 1.5))
        odd, label = [strangers.MAKERS[case.kind](gyro, size, rng)], {"name": case.kind, "gyro": gyro}
    return found, odd, label


def _rivals():
    return [{"saturation", "dead_band", "quantization", "stuck"}, LAG_KINDS]
