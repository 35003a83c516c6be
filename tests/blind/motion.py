"""True rotation as a formula of time: rest, plateaus, a wobble of tones up to 5 Hz, a slow sine, rest.
The rate is exact at any instant, so a delay is the rate at another instant and a low-pass a weighted
sum of earlier ones; only the angle is summed on a grid."""

import dataclasses

import numpy as np

EARTH_DPS = 0.0032
PEAK_DPS = 100.0
GRID_HZ = 1000  # of the angle


def smooth_step(x):
    """0 before 0, 1 after 1, two continuous derivatives between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


@dataclasses.dataclass(frozen=True)
class Plateau:
    from_s: float
    to_s: float
    rate_dps: float
    ramp_s: float

    def rate(self, t):
        up, down = (t - self.from_s) / self.ramp_s, (t - self.to_s) / self.ramp_s + 1.0
        return self.rate_dps * (smooth_step(up) - smooth_step(down))


@dataclasses.dataclass(frozen=True)
class Tones:
    from_s: float
    to_s: float
    ramp_s: float
    frequencies_hz: tuple
    amplitudes_dps: tuple
    phases_rad: tuple

    def rate(self, t):
        envelope = smooth_step((t - self.from_s) / self.ramp_s) * smooth_step((self.to_s - t) / self.ramp_s)
        total = np.zeros_like(t)
        for f, a, p in zip(self.frequencies_hz, self.amplitudes_dps, self.phases_rad):
            total += a * np.sin(2.0 * np.pi * f * (t - self.from_s) + p)
        return envelope * total


class Motion:
    def __init__(self, duration_s, rest_s, rng):
        self.duration_s, self.rest_s = duration_s, rest_s
        free_s = duration_s - rest_s - max(20.0, 0.1 * duration_s)
        shares = {"plateaus": 0.5, "wobble": 0.25, "sine": 0.25}
        order = list(shares)
        rng.shuffle(order)
        self.segments, begin = [], rest_s
        for name in order:
            end = begin + shares[name] * free_s
            self.segments += getattr(self, "_" + name)(begin, end, rng)
            begin = end

    @staticmethod
    def _plateaus(begin, end, rng):
        count = 2 * max(3, int((end - begin) / 30.0))
        heights = np.linspace(0.06, 1.0, count // 2) * PEAK_DPS * rng.uniform(0.9, 1.0, count // 2)
        heights = np.concatenate([heights, -heights * rng.uniform(0.93, 1.0, count // 2)])
        rng.shuffle(heights)
        slot_s, ramp_s = (end - begin) / count, rng.uniform(1.2, 2.4)
        made = []
        for i, height in enumerate(heights):
            end_s = begin + (i + 1) * slot_s - rng.uniform(0.5, 0.2 * slot_s)
            made.append(Plateau(begin + i * slot_s + 0.5, end_s, float(height), ramp_s))
        return made

    @staticmethod
    def _wobble(begin, end, rng):
        f = np.geomspace(0.1, rng.uniform(4.2, 5.0), 6) * rng.uniform(0.92, 1.08, 6)
        a = f**-0.25 * rng.uniform(0.8, 1.2, 6)
        a *= 0.98 * PEAK_DPS / a.sum()
        return [Tones(begin + 0.5, end - 0.5, 4.0, tuple(f), tuple(a), tuple(rng.uniform(0, 2 * np.pi, 6)))]

    @staticmethod
    def _sine(begin, end, rng):
        span_s = end - begin - 1.0
        cycles = max(1, round(span_s / rng.uniform(40.0, 80.0)))
        amplitude = rng.uniform(0.8, 1.0) * PEAK_DPS * rng.choice([-1.0, 1.0])
        return [Tones(begin + 0.5, end - 0.5, 5.0, (cycles / span_s,), (amplitude,), (0.0,))]

    def rate(self, t):
        """Rate about the axis, the Earth's share included, in deg/s."""
        t = np.asarray(t, dtype=float)
        total = np.full_like(t, EARTH_DPS)
        for segment in self.segments:
            inside = (t > segment.from_s) & (t < segment.to_s)
            total[inside] += segment.rate(t[inside])
        return total

    def acceleration(self, t):
        """deg/s², by a fourth-order difference of the formula."""
        h = 1e-3
        return (8 * (self.rate(t + h) - self.rate(t - h)) - (self.rate(t + 2 * h) - self.rate(t - 2 * h))) / (
            12 * h
        )

    def low_passed(self, t, cutoff_hz):
        """∫ a·exp(−a·s)·rate(t − s) ds by Gauss–Laguerre; exact for changes slower than the cutoff."""
        nodes, weights = np.polynomial.laguerre.laggauss(24)
        lag_s = 1.0 / (2.0 * np.pi * cutoff_hz)
        return sum(w * self.rate(t - x * lag_s) for x, w in zip(nodes, weights))

    def low_passed_twice(self, t, cutoff_hz, damping):
        """∫ h(s)·rate(t − s) ds with the impulse response of w²/(p² + 2·damping·w·p + w²), damping < 1: a decaying
        sine. Gauss–Laguerre integrates the decay."""
        nodes, weights = np.polynomial.laguerre.laggauss(40)
        w = 2.0 * np.pi * cutoff_hz
        rings = np.sqrt(1.0 - damping**2)
        total = np.zeros_like(t)
        for x, weight in zip(nodes, weights):
            if weight > 1e-12:
                total += weight * np.sin(rings / damping * x) / (rings * damping) * self.rate(t - x / (damping * w))
        return total

    def angle_deg(self, t):
        """∫ of the rate since t = 0: Simpson's rule on a grid, Hermite interpolation between its points."""
        count = int(np.ceil((self.duration_s + 2.0) * GRID_HZ))
        h = 1.0 / GRID_HZ
        grid = np.arange(count + 1) * h
        rate = self.rate(grid)
        steps = h / 6.0 * (rate[:-1] + 4.0 * self.rate(grid[:-1] + h / 2) + rate[1:])
        angle = np.concatenate([[0.0], np.cumsum(steps)])
        i = np.clip((t * GRID_HZ).astype(int), 0, count - 1)
        u = t * GRID_HZ - i
        return (
            angle[i] * (1 + 2 * u) * (1 - u) ** 2
            + angle[i + 1] * u * u * (3 - 2 * u)
            + h * (rate[i] * u * (1 - u) ** 2 - rate[i + 1] * u * u * (1 - u))
        )
