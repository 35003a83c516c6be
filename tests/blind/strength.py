"""How plainly an effect shows: the t value of generalised least squares with known noise and shape.
Effects are injected by this number, whatever their unit."""

import numpy as np


def fisher_t(shape, sigma, walk, level_known=False):
    """|t| of `shape` (the contribution of one unit of the effect to each sample) in white noise of
    `sigma` a sample and a random walk of `walk` a step; the walk's start is unknown unless
    `level_known`."""
    if level_known:
        level, variance, start = 0.0, 0.0, 0
    else:
        level, variance, start = float(shape[0]), sigma**2, 1
    information, white, step = 0.0, sigma**2, walk**2
    for x in shape[start:].tolist():
        variance += step
        total = variance + white
        innovation = x - level
        information += innovation * innovation / total
        gain = variance / total
        level += gain * innovation
        variance *= 1.0 - gain
    return float(np.sqrt(information))


def noise_t(spectrum_ratio):
    """t of a change of noise: √(2·expected log-likelihood ratio). `spectrum_ratio` is new over old
    variance of independent Gaussian quantities."""
    r = np.asarray(spectrum_ratio)
    return float(np.sqrt(np.sum(r - 1.0 - np.log(r))))


def spectrum(frequencies_hz, interval_s, density, walk_density=0.0, sigma_dps=0.0, tau_s=1.0):
    """Variance per frequency of sampled noise (times the interval: density²): white noise, a random
    walk by its increments, and an exponentially correlated part."""
    turn = 2.0 - 2.0 * np.cos(2 * np.pi * frequencies_hz * interval_s)
    keep = np.exp(-interval_s / tau_s)
    markov = sigma_dps**2 * (1 - keep**2) / ((1 - keep) ** 2 + keep * turn)
    return density**2 + interval_s * (walk_density**2 * interval_s / turn + markov)


def solve(strength_of, wanted, low, high):
    """Size at which a growing `strength_of(size)` reaches `wanted`, by bisection of its logarithm."""
    low, high = np.log(low), np.log(high)
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if strength_of(np.exp(middle)) < wanted else (low, middle)
    return float(np.exp(high))
