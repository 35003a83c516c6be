"""Inputs of the gyros besides the rotation: a temperature for each, the platform's acceleration, and optionally a
supply voltage for each."""

import numpy as np


class Temperature:
    """Straight ramps between random turning points, rounded by a mean over ±2 s; value and slope exact."""

    HALF_S = 2.0

    def __init__(self, duration_s, rng, swing_k=8.0, start_c=25.0):
        knots = [-10.0, 0.0]
        while knots[-1] < duration_s + 10.0:
            knots.append(knots[-1] + rng.uniform(0.08, 0.25) * duration_s)
        self.t = np.array(knots)
        levels, side = [0.0, 0.0], rng.choice([-1.0, 1.0])
        for _ in knots[2:]:
            levels.append(side * rng.uniform(0.2, 1.0) * swing_k + 0.35 * swing_k)
            side = -side
        self.c = start_c + np.array(levels)
        self.area = np.concatenate([[0.0], np.cumsum(np.diff(self.t) * (self.c[1:] + self.c[:-1]) / 2)])

    def _area(self, t):
        i = np.clip(np.searchsorted(self.t, t) - 1, 0, len(self.t) - 2)
        u = t - self.t[i]
        slope = (self.c[i + 1] - self.c[i]) / (self.t[i + 1] - self.t[i])
        return self.area[i] + u * (self.c[i] + u * slope / 2)

    def value(self, t):
        return (self._area(t + self.HALF_S) - self._area(t - self.HALF_S)) / (2 * self.HALF_S)

    GRID_S = 0.05

    def range_k(self, duration_s):
        return float(np.ptp(self.value(np.arange(0.0, duration_s, 1.0))))

    def with_play(self, t, play_k):
        """Position of something that the temperature drags along only when it is `play_k` away."""
        grid = np.arange(0.0, t[-1] + 2 * self.GRID_S, self.GRID_S)
        out, at = [], None
        for now in self.value(grid).tolist():
            if at is None:
                at = now
            if abs(now - at) > play_k:
                at = now - np.copysign(play_k, now - at)
            out.append(at)
        # Between two instants of the grid it is dragged or stays: the nearest place within the play.
        before = np.array(out)[np.minimum((t / self.GRID_S).astype(int), len(out) - 1)]
        now = self.value(t)
        return now + np.clip(before - now, -play_k, play_k)

    def slope(self, t):
        line = lambda at: np.interp(at, self.t, self.c)
        return (line(t + self.HALF_S) - line(t - self.HALF_S)) / (2 * self.HALF_S)


class Flat:
    def __init__(self, level_c):
        self.level_c = level_c

    def value(self, t):
        return np.full_like(t, self.level_c)

    def slope(self, t):
        return np.zeros_like(t)


class Supply:
    """Levels between 4.6 and 5.1 V that jump at random, in steps that a frame of 0.02 V a step carries exactly."""

    STEP_V = 0.02

    def __init__(self, duration_s, rng):
        self.t = [0.0]
        while self.t[-1] < duration_s:
            self.t.append(self.t[-1] + rng.uniform(4.0, 20.0))
        self.v = np.round(rng.uniform(4.6, 5.1, len(self.t)) / self.STEP_V) * self.STEP_V

    def value(self, t):
        return self.v[np.maximum(np.searchsorted(self.t, t, side="right") - 1, 0)]


class Roll:
    """Rate about the axis of travel in deg/s: a sway of several periods that comes and goes."""

    STEP_DPS, SIGMA_DPS = 0.004, 0.01

    def __init__(self, rng):
        self.f = np.exp(rng.uniform(np.log(0.06), np.log(0.9), 6))
        self.phase = rng.uniform(0, 2 * np.pi, 6)
        self.size = rng.uniform(2.0, 9.0, 6)
        self.slow = rng.uniform(25.0, 60.0)

    def value(self, t):
        sway = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(self.size, self.f, self.phase))
        return sway * np.sin(np.pi * t / self.slow) ** 2


class Acceleration:
    """One g along z, tilts of some seconds along x and y, and, where wanted, vibration along z."""

    GRID_HZ = 400

    def __init__(self, duration_s, rng, vibration):
        self.tilts, self.bursts, self.duration_s = [], [], duration_s
        for axis in (0, 1):
            t = rng.uniform(5.0, 30.0)
            while t < duration_s - 10.0:
                length = rng.uniform(8.0, 16.0)
                self.tilts.append((axis, t, t + length, rng.uniform(0.05, 0.55) * rng.choice([-1, 1])))
                t += length + rng.uniform(15.0, 60.0)
        t = rng.uniform(5.0, 20.0)
        while vibration and t < duration_s - 10.0:
            length = rng.uniform(5.0, 20.0)
            self.bursts.append(
                (t, t + length, rng.uniform(0.2, 0.7), rng.uniform(13.0, 37.0), rng.uniform(0, 6.28))
            )
            t += length + rng.uniform(10.0, 40.0)

    def value(self, t):
        """Columns x, y, z in g."""
        a = np.zeros((len(t), 3))
        for axis, begin, end, size in self.tilts:
            a[(t >= begin) & (t < end), axis] += size
        a[:, 2] = 1.0
        for begin, end, size, f, phase in self.bursts:
            inside = (t >= begin) & (t < end)
            a[inside, 2] += size * np.sin(2 * np.pi * f * t[inside] + phase)
        return a

    def vibration_g2(self, t):
        """Variance of |a| over the previous second."""
        grid = np.arange(-1.0, self.duration_s + 1.0, 1.0 / self.GRID_HZ)
        size = np.linalg.norm(self.value(grid), axis=1)
        sums = np.cumsum(size), np.cumsum(size * size)
        n = self.GRID_HZ
        mean, square = ((np.concatenate([np.zeros(n), s[n:] - s[:-n]])) / n for s in sums)
        return np.interp(t, grid, np.maximum(square - mean * mean, 0.0))
