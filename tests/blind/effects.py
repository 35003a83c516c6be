"""Every kind of effect with equations of its own: its contribution to a gyro, the size that shows with a wanted
|t|, and, for kinds without such a number, a size that is plausible on a bench."""

import numpy as np

import strength

OFFSETS = [
    "bias", "bias_ramp", "bias_step", "warm_up", "temperature_bias", "temperature_bias_quadratic",
    "temperature_rate_bias", "g_sensitivity", "vibration_rectification", "angle_harmonic", "line",
    "supply_voltage_bias", "run_in", "temperature_hysteresis", "cross_axis",
]  # fmt: skip
RESPONSES = [
    "scale_factor", "scale_factor_asymmetry", "scale_factor_quadratic", "scale_factor_cubic",
    "scale_factor_temperature",
]  # fmt: skip
LAGS = ["delay", "bandwidth", "bandwidth_second_order"]
NOISES = ["white_noise", "rate_random_walk", "gauss_markov", "rate_noise", "bias_instability"]
CLIPS = ["saturation", "dead_band", "quantization"]
DISTURBANCES = ["spikes", "stuck", "dropped_frames", "clock_skew", "timestamp_jitter"]
KINDS = OFFSETS + RESPONSES + LAGS + NOISES + CLIPS + DISTURBANCES

# The parameter that the strength sets, and its range on a bench if no strength is given.
SIZE = {
    "bias": ("value_dps", 0.003, 0.02),
    "bias_ramp": ("slope_dps_s", 1e-5, 5e-5),
    "bias_step": ("size_dps", 0.003, 0.01),
    "warm_up": ("amplitude_dps", 0.005, 0.03),
    "temperature_bias": ("coefficient_dps_k", 4e-4, 2e-3),
    "temperature_bias_quadratic": ("coefficient_dps_k2", 4e-5, 2e-4),
    "temperature_rate_bias": ("coefficient_dps_s_k", 0.01, 0.1),
    "g_sensitivity": ("coefficient_dps_g", 0.003, 0.02),
    "vibration_rectification": ("coefficient_dps_g2", 0.03, 0.3),
    "angle_harmonic": ("amplitude_dps", 0.002, 0.008),
    "line": ("amplitude_dps", 0.001, 0.006),
    "supply_voltage_bias": ("coefficient_dps_v", 0.005, 0.03),
    "run_in": ("coefficient_dps", 0.002, 0.01),
    "temperature_hysteresis": ("coefficient_dps_k", 1e-3, 5e-3),
    "cross_axis": ("coefficient", 5e-4, 4e-3),
    "scale_factor": ("error", 2e-4, 2e-3),
    "scale_factor_asymmetry": ("error", 1e-4, 1e-3),
    "scale_factor_quadratic": ("coefficient_per_dps", 1e-6, 1e-5),
    "scale_factor_cubic": ("coefficient_per_dps2", 1e-8, 1e-7),
    "scale_factor_temperature": ("coefficient_per_k", 2e-5, 2e-4),
    "delay": ("seconds", 5e-4, 2e-2),
    "bandwidth": ("cutoff_hz", 4.0, 60.0),
    "bandwidth_second_order": ("cutoff_hz", 4.0, 15.0),
    "white_noise": ("density_dps_rthz", 3e-4, 1.2e-3),
    "rate_random_walk": ("density_dps_rts", 3e-5, 2e-4),
    "gauss_markov": ("sigma_dps", 1e-3, 4e-3),
    "rate_noise": ("ratio_rthz", 1e-5, 6e-5),
    "bias_instability": ("coefficient_dps", 1e-3, 4e-3),
    "saturation": ("limit_dps", 60.0, 90.0),
    "dead_band": ("width_dps", 0.06, 0.4),
    "quantization": ("step_dps", 0.01, 0.05),
    "spikes": ("size_dps", 0.06, 0.5),
    "stuck": ("to_s", 0.0, 0.0),
    "dropped_frames": ("fraction", 0.003, 0.03),
    "clock_skew": ("ppm", 20.0, 200.0),
    "timestamp_jitter": ("sigma_s", 3e-4, 2e-3),
}
SIGNED = set(OFFSETS + RESPONSES + ["clock_skew"]) - {"angle_harmonic", "line"}
# Variants that the catalogue's definition leaves open.
MANNERS = {
    "spikes": ["both ways", "one way"],
    "timestamp_jitter": ["late", "about the due time"],
    "dropped_frames": ["single", "in rows"],
}
REFERENCE_C, REFERENCE_V = 25.0, 5.0
# Beyond these, the stamps' microseconds and the finite sampling rate are the limit, not the noise.
LEAST_DELAY_S = 3e-5
HIGHEST_CUTOFF_HZ = 250.0


def companions(kind, gyro, world, rng, plain):
    """The parameters beside the size, drawn at random; `plain`: no strength is given."""
    duration_s = world.motion.duration_s
    if kind == "bias_step":
        return {"at_s": round(float(rng.uniform(0.2, 0.8) * duration_s), 1)}
    if kind == "warm_up":
        return {"tau_s": round(float(rng.uniform(25.0, 0.3 * duration_s)), 1)}
    if kind == "run_in":
        return {"tau_s": round(float(np.exp(rng.uniform(np.log(3.0), np.log(0.1 * duration_s)))), 1)}
    if kind in ("temperature_bias", "temperature_bias_quadratic", "scale_factor_temperature"):
        return {"reference_c": REFERENCE_C}
    if kind == "temperature_hysteresis":
        return {"play_k": round(float(rng.uniform(0.1, 0.25) * world.temperatures[gyro - 1].range_k(duration_s)), 2)}
    if kind == "supply_voltage_bias":
        return {"reference_v": REFERENCE_V}
    if kind == "bandwidth_second_order":
        return {"damping": round(float(rng.uniform(0.5, 0.9)), 3)}
    if kind == "cross_axis":
        return {"from": "x"}
    if kind == "g_sensitivity":
        return {"axis": str(rng.choice(["x", "y"]))}
    if kind == "angle_harmonic":
        return {"harmonic": int(rng.integers(1, 9)), "phase_rad": round(float(rng.uniform(0, 2 * np.pi)), 3)}
    if kind == "line":
        return {
            "frequency_hz": round(float(np.exp(rng.uniform(np.log(0.05), np.log(45.0)))), 3),
            "phase_rad": round(float(rng.uniform(0, 2 * np.pi)), 3),
        }
    if kind == "gauss_markov":
        # In some minutes, longer ones cannot be distinguished from a random walk, however strong they are.
        return {"tau_s": round(float(np.exp(rng.uniform(np.log(0.5), np.log(60.0 if plain else 10.0)))), 2)}
    if kind == "spikes":
        return {"rate_hz": round(float(rng.uniform(0.05, 0.4)), 3)}
    if kind == "stuck":
        return {"from_s": round(float(rng.uniform(0.2, 0.8) * duration_s), 2)}
    return {}


def lag_s(kind, p, size):
    """Delay of the reading for a slowly changing rate."""
    if kind == "delay":
        return size
    return (2 * p["damping"] if kind == "bandwidth_second_order" else 1.0) / (2 * np.pi * size)


def shape(kind, p, gyro, t, world, late_rate=None):
    """Contribution of one unit of the effect to a reading at the instants t; a response acts on the late rate,
    which is the true one if nothing delays it."""
    if kind in RESPONSES:
        rate = world.motion.rate(t) if late_rate is None else late_rate
        if kind == "scale_factor_temperature":
            return rate * (world.temperatures[gyro - 1].value(t) - p["reference_c"])
        power = {"scale_factor": rate, "scale_factor_asymmetry": np.abs(rate)}
        power |= {"scale_factor_quadratic": rate**2, "scale_factor_cubic": rate**3}
        return power[kind]
    if kind in LAGS:
        return -world.motion.acceleration(t)
    if kind.startswith("temperature"):
        temperature = world.temperatures[gyro - 1]
        if kind == "temperature_hysteresis":
            return temperature.with_play(t, p["play_k"]) - temperature.value(t)
        if kind == "temperature_rate_bias":
            return temperature.slope(t)
        return (temperature.value(t) - p["reference_c"]) ** (2 if kind.endswith("quadratic") else 1)
    if kind == "supply_voltage_bias":
        return world.supplies[gyro - 1].value(t) - p["reference_v"]
    if kind == "cross_axis":
        return world.roll.value(t)
    if kind == "bias":
        return np.ones_like(t)
    if kind == "bias_ramp":
        return t.copy()
    if kind == "bias_step":
        return (t >= p["at_s"]).astype(float)
    if kind == "warm_up":
        return np.exp(-t / p["tau_s"])
    if kind == "run_in":
        return np.log1p(t / p["tau_s"])
    if kind == "g_sensitivity":
        return world.acceleration.value(t)[:, "xyz".index(p["axis"])]
    if kind == "vibration_rectification":
        return world.acceleration.vibration_g2(t)
    if kind == "angle_harmonic":
        return np.cos(np.deg2rad(p["harmonic"] * world.motion.angle_deg(t)) + p["phase_rad"])
    if kind == "line":
        return np.sin(2.0 * np.pi * p["frequency_hz"] * t + p["phase_rad"])
    raise ValueError(kind)


def _log_bins(count):
    """Indices of Fourier frequencies 1…count, thinned logarithmically, and the number that each represents."""
    edges = np.unique(np.round(np.geomspace(1, count + 1, 400)).astype(int))
    return (edges[:-1] + edges[1:] - 1) / 2.0, np.diff(edges)


def _noise_strength(kind, p, gyro, world, size):
    """|t| of additional noise; for correlated drift, the part that a stronger walk does not explain."""
    t, sigma, walk = world.times(gyro), *world.noise_seen(gyro)
    interval_s = 1.0 / world.rates_hz[gyro - 1]
    density = sigma * np.sqrt(interval_s)
    if kind == "white_noise":
        return strength.noise_t(np.full(len(t), 1 + (size / density) ** 2))
    if kind == "rate_noise":
        return strength.noise_t(1 + (size * world.motion.rate(t) / density) ** 2)
    number, weight = _log_bins(len(t) // 2)
    f = number / (len(t) * interval_s)
    walk_density = walk / np.sqrt(interval_s)

    def against(new, old):
        r = new / old
        return np.sqrt(2.0 * np.sum(weight * (r - 1 - np.log(r))))

    if kind == "rate_random_walk":
        walks = np.hypot(walk_density, size), walk_density
        return against(*(strength.spectrum(f, interval_s, density, k) for k in walks))
    if kind == "bias_instability":
        new = strength.spectrum(f, interval_s, density, walk_density) + size**2 / (2 * np.pi * f)
    else:
        new = strength.spectrum(f, interval_s, density, walk_density, size, p["tau_s"])
    rivals = [
        strength.spectrum(f, interval_s, density * more, walk_density * k)
        for k in [1.0, *np.geomspace(1.2, 300.0, 24)]
        for more in (1.0, 1.02, 1.05, 1.1)
    ]
    return min(against(new, rival) for rival in rivals)


def _without_strength(kind, level, p, gyro, world, rng):
    """Sizes of effects without a |t|; level 1 is plain, below is weaker, above stronger."""
    name, low, high = SIZE[kind]
    sigma = world.gyros[gyro - 1].density * np.sqrt(world.rates_hz[gyro - 1])
    size = float(np.exp(rng.uniform(np.log(max(low, 1e-12)), np.log(max(high, 1e-12)))))
    if kind == "stuck":
        return round(p["from_s"] + float(np.clip(level * rng.uniform(2.0, 12.0), 1.0, 30.0)), 2)
    if kind == "spikes":
        return round(float(level * rng.uniform(10.0, 60.0) * sigma), 5)
    if kind == "quantization":
        return round(float(level * np.exp(rng.uniform(np.log(0.3), np.log(8.0))) * sigma), 5)
    if kind == "saturation":
        return round(float(world.peak_dps() * rng.uniform(0.65, 0.92)), 2)
    if kind in ("dropped_frames", "clock_skew", "timestamp_jitter", "dead_band"):
        size *= np.clip(level, 0.7, 2.0)
    return float(f"{size:.4g}")


def draw(kind, gyro, wanted_t, world, rng):
    """An effect of this kind as {"kind", "gyro", "parameters", "t"}; `wanted_t` None: a size that is usual on a
    bench."""
    p = companions(kind, gyro, world, rng, wanted_t is None)
    name, low, high = SIZE[kind]
    size_of_t = None
    if kind in CLIPS or kind in DISTURBANCES:
        level = 1.0 if wanted_t is None else wanted_t / 12.0
        size = _without_strength(kind, level, p, gyro, world, rng)
    elif kind in NOISES:
        size_of_t = lambda size: _noise_strength(kind, p, gyro, world, size)
        size = (
            float(np.exp(rng.uniform(np.log(low), np.log(high))))
            if wanted_t is None
            else strength.solve(size_of_t, wanted_t, 1e-9, 10.0)
        )
    else:
        sigma, walk = world.noise_seen(gyro)
        per_unit = strength.fisher_t(
            shape(kind, p, gyro, world.times(gyro), world), sigma, walk, kind == "bias"
        )
        if wanted_t is None:
            size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        elif kind == "delay":
            size = max(wanted_t / per_unit, LEAST_DELAY_S)
        elif kind in LAGS:
            size = min(per_unit * lag_s(kind, p, 1.0) / wanted_t, HIGHEST_CUTOFF_HZ)
        else:
            size = wanted_t / per_unit
        size_of_t = lambda s: per_unit * (lag_s(kind, p, s) if kind in LAGS else s)
    t = None if size_of_t is None else round(float(size_of_t(size)), 2)
    if kind in SIGNED:
        size *= rng.choice([-1.0, 1.0])
    p[name] = float(f"{size:.6g}")
    effect = {"kind": kind, "gyro": gyro, "parameters": p, "t": t}
    if kind in MANNERS:
        effect["manner"] = str(rng.choice(MANNERS[kind]))
    return effect
