"""How plainly an effect shows in a drive. Motion that both gyros feel is known only at the samples: aliases from
beyond half the sampling rate differ between two gyros with different sampling instants, and mask an effect like
noise. Their density follows from the road's spectrum; the |t| is then that of generalised least squares, as in
strength.py. The |t| of a scale factor counts turns, not road noise, so the data show at least as much."""

import numpy as np

import effects as kinds
import motion
import strength

SEGMENT_S = 10.0
BLOCK_S = 0.1
TURNS_DENSITY, TURNS_HZ = 100.0, 0.5  # density of turns, far above any noise: they are known only from the gyros
FLICKER_AS_WALK = 0.163  # K of a walk whose Allan deviation at 50 s is the flicker's
UNKNOWN_DPS = 10.0  # σ of an unknown bias
SWEEPING_PPM = 50.0  # a sampling clock with this error sweeps through all offsets


class Visible:
    """Densities (two-sided) in which one gyro's effect must be found, by stretch of ten seconds and frequency."""

    def __init__(self, world, gyro):
        self.world, self.gyro = world, gyro
        self.duration_s = world.motion.duration_s
        self.middles = np.arange(SEGMENT_S / 2, self.duration_s, SEGMENT_S)
        fine = np.arange(0.0, len(self.middles) * SEGMENT_S, 0.5)
        self.loud = np.sqrt(np.mean(world.motion.road_rms(fine).reshape(len(self.middles), -1) ** 2, axis=1))
        self.moving = np.mean((world.motion.course.speed(fine) > 0).reshape(len(self.middles), -1), axis=1) > 0.3
        self.streams = [self._of_gyro(gyro), self._of_gyro(3 - gyro)]
        if world.reference:
            self.streams.append((0.0, (), world.reference_sigma**2 / world.reference_hz))
        self.rate_hz = min([*world.rates_hz, *([world.reference_hz] if world.reference else [])])
        self.f = np.arange(0.05, self.rate_hz / 2, 0.1)
        self.density = self._effective()

    def _of_gyro(self, number):
        """(offset, filters, density²) of one gyro's response to the motion."""
        g, rate_hz = self.world.gyros[number - 1], self.world.rates_hz[number - 1]
        offset = self.world.offset_s if number == 2 else 0.0
        if abs(g.period_ppm) > SWEEPING_PPM:
            offset = 0.5 / rate_hz
        return offset, g.filters_hz, g.density**2 + g.rate_step**2 / 12.0 / rate_hz

    def _felt(self, stream, f):
        offset, filters, _ = stream
        return np.exp(-2j * np.pi * f * offset) / np.prod([np.ones(len(f)), *(1 + 1j * f / c for c in filters)], axis=0)

    def _effective(self):
        own = self.streams[0][2]
        count = len(self.streams)
        road = np.zeros((len(self.f), count, count), dtype=complex)
        folds = int(np.ceil(250.0 / self.rate_hz))
        for k in range(-folds, folds + 1):
            f = self.f + k * self.rate_hz
            h = np.stack([self._felt(s, f) for s in self.streams], axis=1)
            road += 0.5 * self.world.motion.spectrum.power(f)[:, None, None] * h[:, :, None] * h[:, None, :].conj()
        h = np.stack([self._felt(s, self.f) for s in self.streams], axis=1)
        turns = (TURNS_DENSITY / (1.0 + (self.f / TURNS_HZ) ** 8))[:, None, None] * h[:, :, None] * h[:, None, :].conj()
        noise = np.diag([s[2] for s in self.streams])
        out = np.empty((len(self.middles), len(self.f)))
        for i, (loud, moving) in enumerate(zip(self.loud, self.moving)):
            covariance = loud**2 * road + noise + (turns if moving else 0.0)
            out[i] = 1.0 / np.linalg.inv(covariance)[:, 0, 0].real if moving else own
        return out

    def slow(self):
        """Density below one hertz, by stretch."""
        return self.density[:, self.f < 1.0].mean(axis=1)

    def at(self, values, t):
        """The value of the stretch that contains each instant."""
        return values[np.clip((t / SEGMENT_S).astype(int), 0, len(values) - 1)]

    def lateness(self):
        """Fisher information on a delay (1/s²) by stretch."""
        road = 0.5 * self.world.motion.spectrum.power(self.f) * np.abs(self._felt(self.streams[0], self.f)) ** 2
        per_hz = (2 * np.pi * self.f) ** 2 * road * self.loud[:, None] ** 2 / self.density
        return SEGMENT_S * 2.0 * per_hz.sum(axis=1) * (self.f[1] - self.f[0])


def _walks(world, gyro):
    """K² of the gyro and of the other one, whose drift counts too without a reference."""
    own, other = (
        g.walk**2 + (FLICKER_AS_WALK * g.flicker) ** 2 + 2.0 * g.markov_sigma**2 / g.markov_tau
        for g in (world.gyros[gyro - 1], world.gyros[2 - gyro])
    )
    return own, (0.0 if world.reference else other)


def _fisher_t(shape, white, alone, rests, walks, level_known):
    """|t| of a shape on the first of two gyros: a Kalman filter of both drifts measures their difference in motion
    (`white`: its variance a block), and at rest each gyro by itself (`alone`: both variances). It runs on the shape;
    the innovations, squared over their variance, are the information."""
    unknown = 0.0 if level_known else UNKNOWN_DPS**2
    m, n, p, q, r = 0.0, 0.0, unknown, unknown, 0.0  # means, variances, covariance
    information = 0.0
    for x, w, still in zip(shape.tolist(), white.tolist(), rests.tolist()):
        p, q = p + walks[0], q + walks[1]
        for seen, (h, k), noise in (
            (((x, (1, 0), alone[0]), (0.0, (0, 1), alone[1])) if still else ((x, (1, -1), w),))
        ):
            a, b = p * h + r * k, r * h + q * k
            total = h * a + k * b + noise
            off = seen - h * m - k * n
            information += off * off / total
            m, n = m + a / total * off, n + b / total * off
            p, q, r = p - a * a / total, q - b * b / total, r - a * b / total
    return float(np.sqrt(information))


def per_unit(kind, p, world, gyro, see):
    """|t| of one unit of the effect (of a bandwidth: of one second of its lag)."""
    if kind in kinds.LAGS:
        return float(np.sqrt(see.lateness().sum()))
    if kind == "clock_skew":
        return float(np.sqrt((see.lateness() * (see.middles * 1e-6) ** 2).sum()))
    if kind == "line" and p["frequency_hz"] > 1.0:
        here = see.density[:, np.argmin(np.abs(see.f - p["frequency_hz"]))]
        return float(np.sqrt((0.5 * SEGMENT_S / here).sum()))
    count = int(see.duration_s / BLOCK_S) - 1
    inside = round(BLOCK_S * 100)
    t = (np.arange(count * inside) + 0.5) * BLOCK_S / inside
    late = world.motion.slow_rate(t) - motion.EARTH_DPS if kind in kinds.RESPONSES else None
    shape = kinds.shape(kind, p, gyro, t, world, late).reshape(count, inside).mean(axis=1)
    t = (np.arange(count) + 0.5) * BLOCK_S
    white = see.at(see.slow(), t) / BLOCK_S
    rests = world.motion.course.speed(t) == 0.0
    alone = [s[2] / BLOCK_S for s in see.streams[:2]]
    walks = [k2 * BLOCK_S for k2 in _walks(world, gyro)]
    return _fisher_t(shape, white, alone, rests, walks, kind == "bias")


def noise_t(kind, p, world, gyro, see, size):
    """|t| of additional noise, as computed by effects._noise_strength."""
    bins = SEGMENT_S * (see.f[1] - see.f[0])
    if kind in ("white_noise", "rate_noise"):
        more = np.full(len(see.middles), size**2)
        if kind == "rate_noise":
            fine = np.arange(0.0, len(see.middles) * SEGMENT_S, 0.5)
            squares = world.motion.slow_rate(fine) ** 2 + world.motion.road_rms(fine) ** 2
            more = more * squares.reshape(len(see.middles), -1).mean(axis=1)
        r = 1.0 + more[:, None] / see.density
        return float(np.sqrt(2.0 * bins * np.sum(r - 1.0 - np.log(r))))
    rate_hz = see.rate_hz
    density = float(np.sqrt(1.0 / np.mean(1.0 / see.slow())))
    even = _Even(see.duration_s, rate_hz, density, np.sqrt(sum(_walks(world, gyro))))
    return kinds._noise_strength(kind, p, 1, even, size)


class _Even:
    """The interface that effects._noise_strength needs of a world: one gyro in constant noise."""

    def __init__(self, duration_s, rate_hz, density, walk):
        self.rates_hz, self._count = [rate_hz], int(duration_s * rate_hz)
        self._seen = density * np.sqrt(rate_hz), max(walk, 1e-12) / np.sqrt(rate_hz)

    def times(self, _):
        return np.zeros(self._count)

    def noise_seen(self, _):
        return self._seen
