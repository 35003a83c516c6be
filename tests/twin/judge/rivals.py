"""The bound, and the results of simpler means on the same recording. All use the gyros' errors,
paired in time without loss, so no rival suffers from alignment."""

import dataclasses
import functools

import numpy as np

from judge import motion

FIRST_SIGMA_DPS = 1.0  # of an unknown bias


@dataclasses.dataclass(frozen=True)
class Paired:
    """Both gyros at gyro 1's instants."""

    t_s: np.ndarray
    dt_s: float
    error_dps: np.ndarray  # (2, n)
    random_dps: np.ndarray  # (2, n)
    walk_dps: np.ndarray  # (2, n)
    there: np.ndarray  # (2, n)
    standing: np.ndarray


def pair_up(recording):
    one, two = recording.gyros
    nearest = np.rint((one.t_s - two.t_s[0]) / (two.t_s[1] - two.t_s[0])).astype(int)
    nearest = np.clip(nearest, 0, len(two.t_s) - 1)

    def both(name):
        return np.stack([getattr(one, name), getattr(two, name)[nearest]])

    return Paired(one.t_s, recording.dt_s, both("error_dps"), both("random_dps"), both("walk_dps"),
                  both("there"), recording.motion.standing(one.t_s))


# --- the bound -----------------------------------------------------------------------------------
# Kalman filter at full rate over both drifts, true N and K, true standstills. Its gains depend on no
# data. Each step has at most two scalar measurements: while moving the difference, while standing
# each gyro.

NOTHING, DIFFERENCE, FIRST, SECOND, BOTH = range(5)


def step_kinds(there, standing):
    both = there[0] & there[1]
    kinds = np.where(both & ~standing, DIFFERENCE, NOTHING)
    kinds = np.where(standing & there[0], FIRST, kinds)
    kinds = np.where(standing & there[1], SECOND, kinds)
    return np.where(standing & both, BOTH, kinds)


@functools.lru_cache(maxsize=2)
def bound_gains(gyros, dt, kinds_bytes):
    """Per step the gains of two scalar updates, (n, 4), and the covariance after it, (n, 3)."""
    kinds = np.frombuffer(kinds_bytes, dtype=np.int8).tolist()
    q1, q2 = (g.walk_dps_rts**2 * dt for g in gyros)
    r1, r2 = (g.white_dps_rthz**2 / dt for g in gyros)
    p11 = p22 = FIRST_SIGMA_DPS**2
    p12 = 0.0
    rows = []
    for kind in kinds:
        p11 += q1
        p22 += q2
        a1 = a2 = b1 = b2 = 0.0
        if kind == DIFFERENCE:
            h1, h2 = p11 - p12, p12 - p22
            s = h1 - h2 + r1 + r2
            a1, a2 = h1 / s, h2 / s
            p11, p12, p22 = p11 - a1 * h1, p12 - a1 * h2, p22 - a2 * h2
        if kind in (FIRST, BOTH):
            s = p11 + r1
            a1, a2 = p11 / s, p12 / s
            p22, p12, p11 = p22 - a2 * p12, p12 - a1 * p12, p11 - a1 * p11
        if kind in (SECOND, BOTH):
            s = p22 + r2
            b1, b2 = p12 / s, p22 / s
            p11, p12, p22 = p11 - b1 * p12, p12 - b1 * p22, p22 - b2 * p22
        rows.append((a1, a2, b1, b2, p11, p12, p22))
    table = np.array(rows)
    return table[:, :4], table[:, 4:]


def bound_drifts(gyros, paired):
    """The estimated drifts (2, n), and their covariance (n, 3)."""
    kinds = step_kinds(paired.there, paired.standing).astype(np.int8)
    gains, covariance = bound_gains(gyros, paired.dt_s, kinds.tobytes())
    e1, e2 = paired.random_dps
    x1 = x2 = 0.0
    out1, out2 = [], []
    for kind, z1, z2, (a1, a2, b1, b2) in zip(kinds.tolist(), e1.tolist(), e2.tolist(), gains.tolist()):
        if kind == DIFFERENCE:
            v = z1 - z2 - x1 + x2
            x1 += a1 * v
            x2 += a2 * v
        elif kind != NOTHING:
            if kind != SECOND:
                v = z1 - x1
                x1 += a1 * v
                x2 += a2 * v
            if kind != FIRST:
                v = z2 - x2
                x1 += b1 * v
                x2 += b2 * v
        out1.append(x1)
        out2.append(x2)
    return np.array((out1, out2)), covariance


def weights_of(gyros, there):
    """Weights (2, n) by the white noise alone; a missing gyro has none."""
    w = np.array([g.white_dps_rthz**-2.0 for g in gyros])[:, None] * there
    total = w.sum(axis=0)
    return np.where(total > 0.0, w / np.where(total > 0.0, total, 1.0), 0.0)


# --- rivals --------------------------------------------------------------------------------------


def averaged(error, there):
    """Half the sum; a gyro alone counts in full."""
    return (error * there).sum(axis=0) / np.maximum(there.sum(axis=0), 1)


def calibration_means(paired):
    return paired.error_dps[:, paired.t_s < motion.CALIBRATION_S].mean(axis=1)[:, None]


def last_stop_means(paired):
    """For each gyro and instant, the mean over the last standstill that has ended."""
    means = np.empty_like(paired.error_dps)
    edges = np.flatnonzero(np.diff(paired.standing.astype(int))) + 1
    bounds = [0, *edges, len(paired.t_s)]
    for k in range(2):
        present = paired.error_dps[k, : bounds[1]].mean()
        for begin, end in zip(bounds[:-1], bounds[1:]):
            means[k, begin:end] = present
            used = paired.there[k, begin:end]
            if paired.standing[begin] and used.any():
                present = paired.error_dps[k, begin:end][used].mean()
    return means


def rate_errors(pair, paired):
    """Rival → error of its rate at each instant."""
    e, there = paired.error_dps, paired.there
    rested = e - calibration_means(paired)
    drifts, _ = bound_drifts(pair.gyros, paired)
    weights = weights_of(pair.gyros, there)
    return {
        "bound": (weights * (paired.random_dps - drifts)).sum(axis=0),
        "mean": averaged(e, there),
        "gyro_1": np.where(there[0], rested[0], rested[1]),
        "gyro_2": np.where(there[1], rested[1], rested[0]),
        "rest_mean": averaged(rested, there),
        "stop_mean": averaged(e - last_stop_means(paired), there),
    }, drifts
