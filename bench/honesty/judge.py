"""Tests VG_Rate: is the rate as accurate as its sigma, and is it valid when both gyros are sound? Uses only the
world's truth and the frame's layout (dbc/vgyro.dbc)."""

from dataclasses import dataclass

import numpy as np

import candump

RATE_ID = 0x610
RATE_STEP_DPS, SIGMA_STEP_DPS, AGE_STEP_US = 5e-5, 2e-5, 500
RATE_INVALID, SIGMA_UNKNOWN, AGE_OR_MORE = -(1 << 23), 0xFFF, 15
OLDEST_US = 40_000  # largest age that "7.5 ms or more" may mean
LATER_SAMPLES = 4  # number of one gyro's samples that may be meant
INSTANT_BLOCK_S = 10.0
WORST_SHARE = 0.01  # of a block, ignored in the choice of the instant: a gyro's spike is larger than all other errors

RUN_ENDS_S = 0.2
SMOOTH_S = 1.0
HEADING_S = 60.0
FRAME_HOLDS_S = 0.1  # a rate is valid for this long if no newer frame comes

LONGEST_BEYOND_6_S, LONGEST_BEYOND_4_S = 2.0, 20.0
RATIO_LOW, RATIO_HIGH = 0.5, 2.0
LEAST_VALID = 0.95
KINDS = ("beyond 6 sigma", "beyond 4 sigma", "valid share", "ratio high", "ratio low")
# The requirements, and the share of worlds that may miss each: chance, and errors that both gyros hide, leave some
# ratios out of range.
ALLOWED = {("beyond 6 sigma",): 0.0, ("beyond 4 sigma",): 0.0, ("valid share",): 0.0, ("ratio high", "ratio low"): 0.02}


@dataclass
class Rates:
    """One entry per VG_Rate frame; sigma is NaN if it is not available, and half a step if the frame holds 0."""

    stamps_us: np.ndarray
    age: np.ndarray
    rate: np.ndarray
    sigma: np.ndarray
    valid: np.ndarray


def decode(path):
    stamps_us, frames = candump.read(path, RATE_ID)
    words = np.ascontiguousarray(frames).view("<u8").ravel()

    def bits(first, count):
        return (words >> np.uint64(first) & np.uint64((1 << count) - 1)).astype(np.int64)

    raw = bits(16, 24)
    raw -= (raw >> 23) << 24
    sigma = bits(40, 12)
    valid = bits(55, 1) == 1
    if np.any(valid & (raw == RATE_INVALID)):
        raise ValueError("VG_Valid is 1 with a rate that is labelled invalid")
    return Rates(stamps_us, bits(60, 4), raw * RATE_STEP_DPS,
                 np.where(sigma == SIGMA_UNKNOWN, np.nan, np.maximum(sigma, 0.5) * SIGMA_STEP_DPS), valid)


def candidate_instants_us(rates, samples_us):
    """The instants that a frame may mean. The age has steps of 0.5 ms, and the rate belongs to a gyro's sample: that
    of the resulting instant, or, if the age is 7.5 ms or more, one of the last samples that are old enough."""
    told = rates.stamps_us - rates.age * AGE_STEP_US
    open_age = rates.age == AGE_OR_MORE
    yield told
    for stamps in samples_us:
        after = np.clip(np.searchsorted(stamps, told), 1, len(stamps) - 1)
        nearest = np.where(stamps[after] - told < told - stamps[after - 1], stamps[after], stamps[after - 1])
        near = np.where(np.abs(nearest - told) <= AGE_STEP_US // 2 + 1, nearest, told)
        last_old = np.searchsorted(stamps, told + AGE_STEP_US // 2, side="right") - 1
        for earlier in range(LATER_SAMPLES if open_age.any() else 1):
            old = stamps[np.maximum(0, last_old - earlier)]
            old = np.where(old < rates.stamps_us - OLDEST_US, told, old)
            yield np.where(open_age, old, near)


def misfit(error, block):
    """Sum of squares per block, without the worst errors."""
    square = error * error
    order = np.lexsort((square, block))
    counts = np.bincount(block)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
    usual = order[rank < np.repeat(np.ceil(counts * (1 - WORST_SHARE)), counts)]
    return np.bincount(block[usual], square[usual], minlength=len(counts))


def errors(rates, recording):
    """Errors and instants of the valid rates, each with the candidate that fits best over ten seconds. One choice
    for so many frames cannot profit from their noise."""
    samples_us = [np.rint(t * 1e6).astype(np.int64) for t, _ in recording.samples]
    choices = [c[rates.valid] * 1e-6 for c in candidate_instants_us(rates, samples_us)]
    rate = rates.rate[rates.valid]
    block = ((rates.stamps_us[rates.valid] * 1e-6) / INSTANT_BLOCK_S).astype(np.int64)
    all_errors = [rate - recording.truth(c) for c in choices]
    if not len(rate):
        return rate, rate
    sums = np.array([misfit(e, block) for e in all_errors])
    best = np.argmin(sums, axis=0)[block]
    pick = np.arange(len(rate))
    return np.array(all_errors)[best, pick], np.array(choices)[best, pick]


def longest_run_s(t, beyond):
    """Length and beginning of the longest stretch of exceedances that follow each other within 0.2 s."""
    at = t[beyond]
    if not len(at):
        return 0.0, 0.0
    breaks = np.flatnonzero(np.diff(at) > RUN_ENDS_S)
    begins = at[np.concatenate([[0], breaks + 1])]
    lengths = at[np.concatenate([breaks, [len(at) - 1]])] - begins
    worst = int(np.argmax(lengths))
    return float(lengths[worst]), float(begins[worst])


def smoothed(t, error):
    """Mean over the second about each instant."""
    total = np.concatenate([[0.0], np.cumsum(error)])
    first = np.searchsorted(t, t - SMOOTH_S / 2)
    last = np.searchsorted(t, t + SMOOTH_S / 2, side="right")
    return (total[last] - total[first]) / np.maximum(1, last - first)


def worst_heading(t, error, sigma):
    """Worst heading error over 60 s, in deg and in units of the integral of sigma, with their places."""
    if len(t) < 2:
        return 0.0, 0.0
    dt = np.minimum(np.diff(t, append=t[-1]), FRAME_HOLDS_S)
    edges = np.arange(t[0], t[-1] + 1.0, 1.0)
    at = np.searchsorted(t, edges)
    sums = [np.concatenate([[0.0], np.cumsum(x * dt)])[at] for x in (error, sigma, np.ones(len(t)))]
    n = int(HEADING_S)
    if len(edges) <= n:
        return 0.0, 0.0
    heading, announced, covered = (s[n:] - s[:-n] for s in sums)
    whole = covered > 0.8 * HEADING_S
    if not whole.any():
        return 0.0, 0.0
    return float(np.abs(heading[whole]).max()), float((np.abs(heading) / np.maximum(announced, 1e-12))[whole].max())


def valid_share(rates, stretches):
    """Share of the time in these stretches that has a valid rate."""
    length = sum(b - a for a, b in stretches)
    if length < 1.0:
        return None
    begin = rates.stamps_us * 1e-6
    end = np.minimum(np.append(begin[1:], begin[-1:]), begin + FRAME_HOLDS_S)
    begin, end = begin[rates.valid], end[rates.valid]
    inside = sum(np.clip(np.minimum(end, b) - np.maximum(begin, a), 0, None).sum() for a, b in stretches)
    return float(inside / length)


def mean_square(error, sigma):
    """Mean of error^2/sigma^2; None if there is nothing to judge."""
    return float(np.mean((error / sigma) ** 2)) if len(error) > 100 else None


def figures(rates, recording):
    world = recording.world
    error, t = errors(rates, recording)
    sigma = rates.sigma[rates.valid]
    known = ~np.isnan(sigma)
    order = np.argsort(t[known], kind="stable")
    tk, ek, sk = t[known][order], error[known][order], sigma[known][order]
    mean_1s = smoothed(tk, ek)
    found = {"valid": valid_share(rates, [(world.rest_s, world.duration_s)]),
             "valid_sound": valid_share(rates, recording.sound()),
             "without_sigma": float(1 - known.mean()) if len(known) else None,
             "ratio": mean_square(ek, sk)}
    late = tk > world.duration_s * 2 / 3
    found["ratio_late"] = mean_square(ek[late], sk[late])
    for k in (4, 6):
        runs = [longest_run_s(tk, np.abs(e) > k * sk) for e in (ek, mean_1s)]
        found[f"beyond_{k}_s"], found[f"beyond_{k}_from_s"] = max(runs)
    found["heading_deg"], found["heading_announced"] = worst_heading(tk, ek, sk)
    found["worst_dps"] = float(np.abs(error).max(initial=0.0))
    return found


def failures(found):
    failed = []
    if found["beyond_6_s"] > LONGEST_BEYOND_6_S:
        failed.append("beyond 6 sigma")
    if found["beyond_4_s"] > LONGEST_BEYOND_4_S:
        failed.append("beyond 4 sigma")
    if found["valid_sound"] is not None and found["valid_sound"] < LEAST_VALID:
        failed.append("valid share")
    if found["ratio_late"] is not None and found["ratio_late"] > RATIO_HIGH:
        failed.append("ratio high")
    if found["ratio_late"] is not None and found["ratio_late"] < RATIO_LOW:
        failed.append("ratio low")
    return failed


def judge(path, recording):
    """All figures of one world, and the requirements that it failed."""
    found = figures(decode(path), recording)
    return {"seed": recording.world.seed, "failed": failures(found), "figures": found, "tags": recording.world.tags,
            "description": recording.description()}
