"""Effects that no kind of the catalogue describes: any name for them is false. Each maker takes (world,
rng) and returns a function (world, gyro, t, rng) → deg/s on one gyro."""

import numpy as np

from world import correlated


def _on(gyro, function):
    return lambda world, which, t, rng: function(world, t, rng) if which == gyro else np.zeros(len(t))


def bursts(gyro, size, rng):
    """A bias that comes for a second or two, twenty times."""
    begins, lengths = rng.uniform(0.1, 0.95, 20), rng.uniform(0.7, 2.5, 20)

    def add(world, t, _):
        on = np.zeros(len(t), dtype=bool)
        for begin, length in zip(begins * world.motion.duration_s, lengths):
            on |= (t >= begin) & (t < begin + length)
        return size * on

    return _on(gyro, add)


def chirp(gyro, size, rng):
    """A tone whose frequency climbs through the recording."""
    low, high = rng.uniform(0.3, 1.0), rng.uniform(5.0, 15.0)

    def add(world, t, _):
        rise = np.log(high / low) / world.motion.duration_s
        return size * np.sin(2 * np.pi * low * (np.exp(rise * t) - 1) / rise)

    return _on(gyro, add)


def relaxation(gyro, size, rng):
    """A remainder after each turn: per cent of |rate|, with a memory of some seconds."""
    tau_s = rng.uniform(8.0, 25.0)

    def add(world, t, _):
        grid = np.arange(0.0, world.motion.duration_s + 0.1, 0.1)
        drive, keep, value, out = np.abs(world.motion.rate(grid)) / 50.0, np.exp(-0.1 / tau_s), 0.0, []
        for d in drive.tolist():
            value = keep * value + (1 - keep) * d
            out.append(value)
        quiet = 1.0 - np.clip(drive * 10, 0, 1)  # only once the turn is over
        return size * np.interp(t, grid, np.array(out) * quiet)

    return _on(gyro, add)


def loud_minute(gyro, size, rng):
    """Noise that grows for a minute."""
    begin = rng.uniform(0.2, 0.6)

    def add(world, t, noise):
        g = world.gyros[gyro - 1]
        on = (t >= begin * world.motion.duration_s) & (t < begin * world.motion.duration_s + 60.0)
        return on * noise.standard_normal(len(t)) * 1.7 * g.density * np.sqrt(world.rates_hz[gyro - 1])

    return _on(gyro, add)


def hysteresis(gyro, size, rng):
    """Temperature with play: a part lags behind when the temperature reverses."""
    play_k = rng.uniform(1.0, 3.0)

    def add(world, t, _):
        grid = np.arange(0.0, world.motion.duration_s + 0.2, 0.1)
        temperature, held, out = world.temperatures[gyro - 1].value(grid), None, []
        for value in temperature.tolist():
            held = value if held is None else min(max(held, value - play_k), value + play_k)
            out.append(held)
        return size * np.interp(t, grid, np.array(out) - temperature) / play_k

    return _on(gyro, add)


def hidden_axis(gyro, size, rng):
    """Cross-coupling with a rotation that is not recorded."""
    f, phase = np.exp(rng.uniform(np.log(0.01), np.log(1.5), 12)), rng.uniform(0, 2 * np.pi, 12)

    def add(world, t, _):
        on = np.sin(2 * np.pi * t / (0.37 * world.motion.duration_s)) > 0
        return size * on * sum(np.sin(2 * np.pi * a * t + b) for a, b in zip(f, phase)) / 2.5

    return _on(gyro, add)


def square_wave(gyro, size, rng):
    """A bias that toggles."""
    period_s, phase = rng.uniform(15.0, 60.0), rng.uniform(0, 1)
    return _on(gyro, lambda world, t, _: size * np.sign(np.sin(2 * np.pi * (t / period_s + phase))))


def coloured(gyro, size, rng):
    """Noise with a broad hump at 20 Hz."""
    f, width = rng.uniform(15.0, 25.0), rng.uniform(1.0, 3.0)

    def add(world, t, noise):
        h = 1.0 / world.rates_hz[gyro - 1]
        in_phase, quadrature = (correlated(len(t), h, size, 1 / (np.pi * width), noise) for _ in range(2))
        return in_phase * np.cos(2 * np.pi * f * t) + quadrature * np.sin(2 * np.pi * f * t)

    return _on(gyro, add)


def tilt_times_rate(gyro, size, rng):
    """A scale factor that follows the tilt."""

    def add(world, t, _):
        return size * world.acceleration.value(t)[:, 0] * world.motion.rate(t) / 10.0

    return _on(gyro, add)


def turning_up(gyro, size, rng):
    """An effect quadratic in the angular acceleration."""
    return _on(gyro, lambda world, t, _: size * np.minimum((world.motion.acceleration(t) / 60.0) ** 2, 25.0))


def late_warm_up(gyro, size, rng):
    """A transient of second order: heat that reaches the gyro through a housing."""
    outer_s, inner_s = rng.uniform(60.0, 150.0), rng.uniform(20.0, 50.0)

    def add(world, t, _):
        return 3.0 * size * (np.exp(-t / outer_s) - np.exp(-t / inner_s))

    return _on(gyro, add)


def settling(gyro, size, rng):
    """Drift that goes with the logarithm of time."""
    tau_s = rng.uniform(5.0, 40.0)
    return _on(gyro, lambda world, t, _: 0.5 * size * np.log1p(t / tau_s))


def wheel_hum(gyro, size, rng):
    """A tone at the wheels' frequency, and its second harmonic."""
    around_m, second = rng.uniform(1.8, 2.2), rng.uniform(0.2, 0.6)

    def add(world, t, _):
        grid = np.arange(0.0, world.motion.duration_s + 0.02, 0.01)
        speed = world.motion.course.speed(grid)
        turns = np.interp(t, grid, np.cumsum(speed) * 0.01 / around_m)
        loud = np.interp(t, grid, speed > 1.0)
        return size * loud * (np.sin(2 * np.pi * turns) + second * np.sin(4 * np.pi * turns + 1.0))

    return _on(gyro, add)


ALL = [bursts, chirp, relaxation, loud_minute, hysteresis, hidden_axis, square_wave, coloured]
ALL += [tilt_times_rate, turning_up]
# Effects that occur only in vehicles, or that a later catalogue may name.
ON_THE_ROAD = [late_warm_up, settling, wheel_hum]
MAKERS = {maker.__name__: maker for maker in [*ALL, *ON_THE_ROAD]}
OF_THE_BENCH = [maker.__name__ for maker in ALL]
# Names that are nevertheless right, if the catalogue has them.
ALSO_RIGHT = {"settling": ["run_in"], "hysteresis": ["temperature_hysteresis"]}
