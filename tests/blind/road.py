"""A vehicle's rotation about its vertical axis: stops, bends and lane changes as formulas of time, and road noise, a
Gaussian process whose spectrum extends from 1 Hz to beyond half of any gyro's sampling rate. The sum is a function
of continuous time: it is computed on a grid many times as fine as the samples and interpolated by a windowed sinc,
so that a gyro that samples it aliases the fast part at its own instants, like a real one."""

import dataclasses

import numpy as np

from motion import EARTH_DPS, smooth_step

GRID_HZ = 2000
GUARD_S = 3.0  # margin of the grid before the first and after the last instant, for lags and the sinc
HIGHEST_HZ = 240.0  # of road noise; an eighth of the grid's rate, where the sinc is exact to 3e-6
TAPS, KAISER = 24, 12.0
SLOW_HZ = 1.0  # turns are slower, road noise is faster


@dataclasses.dataclass(frozen=True)
class Spectrum:
    """Power of road noise over frequency: rises about `low_hz`, falls by `slope` (of power) beyond `corner_hz`, with
    resonances (frequency, width, height) of body and wheels."""

    low_hz: float
    corner_hz: float
    slope: float
    resonances: tuple = ()

    def power(self, f):
        """Power per Hz at the frequencies f ≥ 0, of variance 1 in all."""
        return self._shape(f) / self._whole

    def _shape(self, f):
        f = np.abs(np.asarray(f, dtype=float))
        rise = (f / self.low_hz) ** 8 / (1.0 + (f / self.low_hz) ** 8)
        fall = 1.0 / (1.0 + (f / self.corner_hz) ** self.slope)
        bumps = sum((h / (1.0 + ((f - at) / width) ** 2) for at, width, h in self.resonances), np.ones_like(f))
        end = smooth_step((HIGHEST_HZ - f) / (0.1 * HIGHEST_HZ))
        return rise * fall * bumps * end

    @property
    def _whole(self):
        f = np.arange(0.0, HIGHEST_HZ, 0.05)
        return float(self._shape(f).sum() * 0.05)


def draw_spectrum(rng):
    """A narrow spectrum, quiet beyond some 12 Hz, or one that extends far beyond half the sampling rate."""
    if rng.random() < 0.4:
        return Spectrum(float(rng.uniform(0.9, 1.3)), float(rng.uniform(9.0, 14.0)), float(rng.uniform(6.0, 9.0)))
    bumps = (
        (float(rng.uniform(1.2, 2.2)), 0.4, float(rng.uniform(0.5, 4.0))),
        (float(rng.uniform(9.0, 15.0)), 1.5, float(rng.uniform(0.5, 4.0))),
        (float(rng.uniform(25.0, 70.0)), 4.0, float(rng.uniform(0.0, 2.0))),
    )
    return Spectrum(
        float(rng.uniform(0.9, 1.3)), float(rng.uniform(4.0, 30.0)), float(rng.uniform(1.6, 4.0)), bumps
    )


@dataclasses.dataclass(frozen=True)
class Stretch:
    """From a start to the next stop."""

    from_s: float
    to_s: float
    speed_mps: float
    ramp_s: float


@dataclasses.dataclass(frozen=True)
class Bend:
    from_s: float
    to_s: float
    rate_dps: float
    ramp_s: float

    def rate(self, t):
        return self.rate_dps * (
            smooth_step((t - self.from_s) / self.ramp_s) - smooth_step((t - self.to_s) / self.ramp_s + 1.0)
        )


class Course:
    """Stops, speed and turns of a vehicle, and the roughness of its road."""

    def __init__(self, duration_s, rest_s, rng):
        self.duration_s, self.rest_s = duration_s, rest_s
        self.town = bool(rng.random() < 0.6)  # a stop each minute or so; else long stretches without one
        self.stretches, self.bends = [], []
        begin = rest_s
        while begin < duration_s - 15.0:
            length = rng.uniform(30.0, 80.0) if self.town else rng.uniform(200.0, 500.0)
            end = min(begin + length, duration_s - (rng.uniform(4.0, 12.0) if rng.random() < 0.7 else 0.0))
            speed = rng.uniform(5.0, 15.0) if self.town else rng.uniform(18.0, 36.0)
            self.stretches.append(Stretch(begin, end, float(speed), float(rng.uniform(4.0, 8.0))))
            begin = end + rng.uniform(8.0, 25.0)
        for stretch in self.stretches:
            self._turn(stretch, rng)
        knots = np.arange(-10.0, duration_s + 40.0, 20.0)
        self.rough = knots, np.exp(0.5 * rng.standard_normal(len(knots)))

    def _turn(self, stretch, rng):
        t = stretch.from_s + stretch.ramp_s * 0.6
        while True:
            t += rng.exponential(4.0 if self.town else 12.0)
            sharp = self.town and rng.random() < 0.6
            length = rng.uniform(3.0, 7.0) if sharp else rng.uniform(3.0, 25.0)
            if t + length > stretch.to_s - 1.5:
                return
            angle = rng.uniform(60.0, 110.0) if sharp else rng.uniform(4.0, 50.0)
            ramp = min(rng.uniform(1.0, 2.5), 0.45 * length)
            rate = rng.choice([-1.0, 1.0]) * angle / (length - ramp)
            self.bends.append(Bend(float(t), float(t + length), float(rate), float(ramp)))
            t += length

    def turning(self, t):
        """Rate of the bends, in deg/s, without road noise."""
        total = np.full(len(t), EARTH_DPS)
        for bend in self.bends:
            inside = (t > bend.from_s) & (t < bend.to_s)
            total[inside] += bend.rate(t[inside])
        return total

    def speed(self, t):
        """m/s."""
        total = np.zeros(len(t))
        for s in self.stretches:
            inside = (t > s.from_s) & (t < s.to_s)
            u = t[inside]
            total[inside] = s.speed_mps * (
                smooth_step((u - s.from_s) / s.ramp_s) * smooth_step((s.to_s - u) / s.ramp_s)
            )
        return total

    def roughness(self, t):
        """Strength of the road noise, from the speed and the road; mean square about 1 while driving."""
        top = max(s.speed_mps for s in self.stretches)
        return (self.speed(t) / top) ** 0.8 * np.interp(t, *self.rough)


class Drive:
    """The motion of one recording; the interface of motion.Motion."""

    def __init__(self, course, spectrum, road_dps, rng):
        self.course, self.spectrum, self.road_dps = course, spectrum, road_dps
        self.duration_s, self.rest_s = course.duration_s, course.rest_s
        count = int(round((self.duration_s + 2 * GUARD_S) * GRID_HZ))
        self._grid = np.arange(count) / GRID_HZ - GUARD_S
        loud = course.roughness(self._grid)
        self._loudness = road_dps / np.sqrt(np.mean(loud[loud > 0] ** 2))
        noise = self._coloured(count, rng) * loud * self._loudness
        self._fine = course.turning(self._grid) + noise
        self._lagged = {}
        self._angle = None

    def _coloured(self, count, rng):
        f = np.fft.rfftfreq(count, 1.0 / GRID_HZ)
        white = np.fft.rfft(rng.standard_normal(count))
        return np.fft.irfft(white * np.sqrt(self.spectrum.power(f) * GRID_HZ / 2.0), count)

    def road_rms(self, t):
        """Expected rms of the road noise at the instants t, in deg/s."""
        return self.course.roughness(t) * self._loudness

    def _read(self, values, t):
        """The band-limited function through the grid's values, at the instants t."""
        at = (np.asarray(t, dtype=float) + GUARD_S) * GRID_HZ
        first = np.floor(at).astype(int) - TAPS // 2 + 1
        first = np.clip(first, 0, len(values) - TAPS)
        out, weights = np.zeros(len(at)), np.zeros(len(at))
        for k in range(TAPS):
            x = at - (first + k)
            weight = np.sinc(x) * np.i0(KAISER * np.sqrt(np.maximum(0.0, 1.0 - (x / (TAPS / 2)) ** 2)))
            out += values[first + k] * weight
            weights += weight
        return out / weights

    def _filtered(self, response):
        f = np.fft.rfftfreq(len(self._fine), 1.0 / GRID_HZ)
        return np.fft.irfft(np.fft.rfft(self._fine) * response(f), len(self._fine))

    def rate(self, t):
        return self._read(self._fine, t)

    def slow_rate(self, t):
        """The rate without road noise."""
        return self.course.turning(np.asarray(t, dtype=float))

    def acceleration(self, t):
        """deg/s²."""
        if "slope" not in self._lagged:
            self._lagged["slope"] = self._filtered(lambda f: 2j * np.pi * f * (f < 2 * HIGHEST_HZ))
        return self._read(self._lagged["slope"], t)

    def low_passed(self, t, *cutoffs_hz):
        """The rate after first-order low-passes in series, each exact for a continuous signal."""
        if cutoffs_hz not in self._lagged:
            stages = lambda f: np.prod([1.0 / (1.0 + 1j * f / c) for c in cutoffs_hz], axis=0)
            self._lagged[cutoffs_hz] = self._filtered(stages)
        return self._read(self._lagged[cutoffs_hz], t)

    def angle_deg(self, t):
        """∫ of the rate since t = 0; between two points of the grid, road noise turns little."""
        if self._angle is None:
            steps = 0.5 * (self._fine[1:] + self._fine[:-1]) / GRID_HZ
            self._angle = np.concatenate([[0.0], np.cumsum(steps)])
            self._angle -= np.interp(0.0, self._grid, self._angle)
        return np.interp(t, self._grid, self._angle)
