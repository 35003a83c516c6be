"""Scores of one recording: heading, bias and σ of `vgyro replay` and of its rivals."""

import functools
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import canlog
import product
from judge import motion, rivals
from judge import pair as gyro_pair

SIGMA_STEP_DPS = 2e-5
BIAS_SIGMA_STEP_DPS = 1e-5
NOT_AVAILABLE = 0xFFF
AGE_STEP_US, AGE_MAX_US = 500, 7500
DEGRADED = 3
# A σ of fewer steps than this is limited by the wire's resolution.
STEPS_MIN = 5
MODES = ("given", "estimated")
HORIZONS_S = (120.0, motion.MINUTES_15_S, motion.HOUR_S)


@functools.cache
def takes_model():
    """Does this build accept a model file?"""
    said = subprocess.run([product.VGYRO, "replay", "--help"], capture_output=True, text=True, check=False)
    return "--model" in said.stdout


def replay(recording, log, pair, method, mode=None):
    """The output frames of one run over the recording's log."""
    with tempfile.TemporaryDirectory(prefix="vgyro-") as folder:
        config = product.write_config(folder, motion.CALIBRATION_S, rate_dps=motion.EARTH_DPS)
        command = [product.VGYRO, "replay", "--quiet", "--config", config, "--method", method]
        if mode == "given":
            model = Path(folder) / "model.toml"
            model.write_text(gyro_pair.model_text(pair, recording.motion.scenario))
            command += ["--model", model]
        done = subprocess.run([*map(str, command), "-"], input=log, capture_output=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{done.args}: exit code {done.returncode}\n{done.stderr.decode(errors='replace')}")
    return canlog.read(done.stdout)


def instants_s(rate, recording):
    """The instant of each VG_Rate. VG_Age has steps of 0.5 ms and a largest value; the instant is that of a sample
    of the pacing gyro, so its stamps, less its known delay, give it exactly."""
    about_us = rate.stamps_us - rate.age_us - gyro_pair.START_US
    ended = rate.age_us >= AGE_MAX_US
    paired = rate.state != DEGRADED
    best_us, best_off = about_us, np.inf
    for k, delay_s in ((0, 0.0), (1, 0.0), (1, recording.motion.scenario.delay_2_s)):
        own_us = np.rint((recording.gyros[k].t_s - delay_s) * 1e6).astype(np.int64)
        last_us = own_us[np.clip(np.searchsorted(own_us, about_us + AGE_STEP_US, side="right") - 1, 0, len(own_us) - 1)]
        off = np.abs(about_us - last_us)
        if off[paired & ~ended].mean() < best_off:
            best_off = off[paired & ~ended].mean()
            best_us = np.where(paired & (ended | (off < AGE_STEP_US)), last_us, about_us)
    return best_us * 1e-6


def heading_errors(t_s, error_dps, run_s, horizons_s):
    """Heading error after each horizon within the run; between two instants the error is held."""
    lengths = np.diff(t_s, append=t_s[-1])
    return {
        horizon: float(np.dot(error_dps, lengths * ((t_s >= motion.BEGIN_S) & (t_s < motion.BEGIN_S + horizon))))
        for horizon in horizons_s
        if horizon <= run_s
    }


def second_half(t_s, run_s):
    return t_s >= motion.BEGIN_S + 0.5 * run_s


def mean_square(values):
    return float(np.mean(np.square(values))) if len(values) else float("nan")


def judge_product(recording, pair, frames, horizons_s=HORIZONS_S):
    """Heading errors, and mean squares of errors in units of the σ in VG_Rate, VG_Bias and VG_Model."""
    run_s = recording.motion.run_s
    rate = canlog.virtual_rate(frames)
    t = instants_s(rate, recording)
    valid = rate.valid
    t, state = t[valid], rate.state[valid]
    if not len(t):
        raise RuntimeError("no valid VG_Rate")
    raw_sigma = canlog.intel(frames.with_id(canlog.RATE_ID).payloads, 40, 12)[valid]
    error = rate.rate_dps[valid] - recording.motion.rate(t)
    last = (t >= motion.BEGIN_S + 0.75 * run_s) & (raw_sigma != NOT_AVAILABLE)
    counted = (t >= motion.BEGIN_S) & (raw_sigma != NOT_AVAILABLE)
    sigma = raw_sigma * SIGMA_STEP_DPS
    result = {
        "heading_deg": heading_errors(t, error, run_s, horizons_s),
        "gap_s": float(np.maximum(np.diff(t) - 4.0 * recording.dt_s, 0.0).sum()),
        "error2": mean_square(error[last] / sigma[last]),
        "error2_all": mean_square(error[counted] / sigma[counted]),
        "error2_alone": mean_square((error / np.where(sigma > 0.0, sigma, 1.0))[counted & (state == DEGRADED)]),
    }
    return result | judge_bias(recording, pair, frames)


def true_drifts(recording, t_s):
    return np.stack([np.interp(t_s, g.t_s, g.drift_dps) for g in recording.gyros])


def judge_bias(recording, pair, frames):
    """VG_Bias and VM_BiasSigma, over the second half of the run. The drift subtracted from the virtual rate is
    weighted as the bound weighs it."""
    run_s = recording.motion.run_s
    stamps, bias = canlog.virtual_bias(frames)
    t = (stamps - gyro_pair.START_US) * 1e-6
    model = frames.with_id(canlog.MODEL_ID)
    raw_sigma = canlog.intel(model.payloads, 40, 12)
    used = second_half(t, run_s) & (t < recording.motion.length_s)
    t, bias, raw_sigma = t[used], bias[used].T, raw_sigma[used]
    error = bias - true_drifts(recording, t)
    there = np.stack([recording.motion.there(k, t) for k in range(2)])
    taken_off = (rivals.weights_of(pair.gyros, there) * error).sum(axis=0)
    known = raw_sigma != NOT_AVAILABLE
    fine = known.any() and np.median(raw_sigma[known]) >= STEPS_MIN
    sigma = np.maximum(raw_sigma[known], 0.5) * BIAS_SIGMA_STEP_DPS
    return {
        "bias2": mean_square(taken_off),
        "bias2_each": [mean_square(e) for e in error],
        "bias_error2": mean_square(taken_off[known] / sigma) if fine else float("nan"),
    }


def judge_rivals(recording, pair, horizons_s=HORIZONS_S):
    run_s = recording.motion.run_s
    paired = rivals.pair_up(recording)
    errors, drifts = rivals.rate_errors(pair, paired)
    judged = {name: {"heading_deg": heading_errors(paired.t_s, e, run_s, horizons_s)} for name, e in errors.items()}
    half = second_half(paired.t_s, run_s)
    off = drifts - paired.walk_dps
    weights = rivals.weights_of(pair.gyros, paired.there)
    judged["bound"] |= {
        "bias2": mean_square((weights * off).sum(axis=0)[half]),
        "bias2_each": [mean_square(o[half]) for o in off],
    }
    return judged


def judge(pair, scenario, run_s, seed, modes=MODES, mutual=True):
    """All methods on one seed's recording: name → figures. The product is under its modes."""
    recording = gyro_pair.simulate(pair, scenario, run_s, seed)
    judged = judge_rivals(recording, pair)
    log = recording.log()
    if mutual:
        judged["mutual"] = judge_product(recording, pair, replay(recording, log, pair, "mutual"))
    for mode in modes:
        judged[mode] = judge_product(recording, pair, replay(recording, log, pair, "optimal", mode))
    return judged
