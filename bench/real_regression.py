#!/usr/bin/python3
"""Are the names that `vgyro gap` gives a real recording correct? A plain regression, independent of the product's code
and methods: means over cells of 0.2 s, one gyro less the reference (or less the other gyro), least squares on
rate, |rate|, rate², temperature, time and the change of rate, and the recording cut into stretches whose sizes must
agree. Its errors are the scatter between stretches, and a shape has to predict stretches that it was not fitted to.

FOLDER holds one recording a subfolder: vgyro.toml, signals.dbc, measured.log.xz. By default $VGYRO_RECORDINGS."""

import argparse
import json
import lzma
import math
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

import command_line

CELL_S = 0.2  # vibration averages out in it, a turn does not
PAUSE_S = 0.5  # longer silences cut the recording
STRETCH_S = 20.0  # length of the stretches whose sizes are compared
STRETCHES_MIN = 4  # fewer show no scatter
FASTEST_DPS = 400.0  # beyond it a craft tumbles, and these gyros are out of range
OUTLIER_TIMES, OUTLIER_SHARE = 8.0, 0.9  # beyond this many times the quantile of this share of cells: a crash
LAG_MAX_S, LAG_STEP_S = 0.15, 0.001
PARTS = 5  # number of parts of a recording, for lags and levels
ALIKE_MIN = 0.7  # correlation below which a lag is not used
SIGMAS = 3.0  # least size in units of its scatter to be present, and largest deviation
UNSEEN_TIMES = 20.0  # an effect is contradicted if less than a twentieth of its claimed share shows
FORETELLS = 0.002  # least predicted share of the variance of stretches that were left out
BEGIN, END = "<!-- real_regression: begin -->", "<!-- real_regression: end -->"


# ---------------------------------------------------------------- reading
def signals_of(dbc):
    """(message, signal) → (id, start, bits, little-endian, signed, factor, offset)."""
    found, message = {}, None
    for line in dbc.read_text(encoding="utf-8", errors="replace").splitlines():
        if head := re.match(r"BO_ (\d+) (\w+)", line):
            message = int(head[1]) & 0x1FFFFFFF, head[2]
        elif body := re.match(r" SG_ (\w+) : (\d+)\|(\d+)@([01])([+-]) \(([^,]+),([^)]+)\)", line):
            name, start, bits, order, sign, factor, offset = body.groups()
            found[message[1], name] = (
                message[0], int(start), int(bits), order == "1", sign == "-", float(factor), float(offset),
            )  # fmt: skip
    return found


def frames_of(log, wanted):
    """(bus, id) → stamps and eight bytes each, for the wanted frames in a candump log."""
    stamps, data = {key: [] for key in wanted}, {key: [] for key in wanted}
    opened = lzma.open if log.suffix == ".xz" else open
    with opened(log, "rt") as lines:
        for line in lines:
            parts = line.split()
            if len(parts) < 3:
                continue
            identifier, _, payload = parts[2].partition("#")
            key = parts[1], int(identifier, 16)
            if key in data:
                stamps[key].append(float(parts[0][1:-1]))
                data[key].append(payload.ljust(16, "0")[:16])
    raw = {key: np.frombuffer(bytes.fromhex("".join(data[key])), np.uint8).reshape(-1, 8) for key in wanted}
    return {key: (np.array(stamps[key]), raw[key]) for key in wanted}


def values_of(raw, layout):
    _, start, bits, little, signed, factor, offset = layout
    words = np.ascontiguousarray(raw).view("<u8" if little else ">u8")[:, 0].astype(np.uint64)
    # Motorola: the start is the highest bit, counted from the left in the row of bytes.
    shift = start if little else 64 - (start // 8 * 8 + 7 - start % 8) - bits
    value = ((words >> np.uint64(shift)) & np.uint64((1 << bits) - 1)).astype(np.int64)
    if signed:
        value -= (value >> (bits - 1)) << bits
    return value * factor + offset


class Recording:
    """Two gyros and the other signals, as (t, value) in seconds since the first frame."""

    def __init__(self, folder):
        config = tomllib.loads((folder / "vgyro.toml").read_text())
        tables = [*config["gyro"], *([config["reference"]] if "reference" in config else [])]
        layouts = [signals_of(folder / table["dbc"]) for table in tables]
        keys = [(t["bus"], layout[t["message"], t["rate"]][0]) for t, layout in zip(tables, layouts)]
        log = next(folder / name for name in ("measured.log.xz", "measured.log") if (folder / name).exists())
        frames = frames_of(log, set(keys))
        begin = min(frames[key][0][0] for key in keys)
        read = lambda i, name: values_of(frames[keys[i]][1], layouts[i][tables[i]["message"], name])
        self.name, self.log, self.config = folder.name, log, folder / "vgyro.toml"
        self.gyros, self.temperatures, self.counters = [], [], []
        for i, table in enumerate(config["gyro"]):
            t = frames[keys[i]][0] - begin
            self.gyros.append((t, table.get("sign", 1) * read(i, table["rate"])))
            self.temperatures.append(read(i, table["temperature"]) if "temperature" in table else None)
            self.counters.append(read(i, table["counter"]) if "counter" in table else None)
        self.reference = (frames[keys[2]][0] - begin, read(2, tables[2]["rate"])) if len(tables) > 2 else None


# ---------------------------------------------------------------- cells
def lag_of(late, early):
    """Delay of the first stream behind the second, s: the best correlation, refined by a parabola."""
    t = np.arange(max(late[0][0], early[0][0]) + 1.0, min(late[0][-1], early[0][-1]) - 1.0, 0.02)
    calm = lambda x: np.convolve(x, np.hanning(17) / np.hanning(17).sum(), "same")
    fixed = calm(np.interp(t, *early))
    change = np.abs(np.gradient(fixed, t))
    use = (np.abs(fixed) < FASTEST_DPS) & (change < 50 * np.median(change) + 1e-9)
    lags = np.arange(-LAG_MAX_S, LAG_MAX_S + LAG_STEP_S, 5 * LAG_STEP_S)
    score = np.array([np.corrcoef(fixed[use], calm(np.interp(t + lag, *late))[use])[0, 1] for lag in lags])
    best = int(np.clip(np.argmax(score), 1, len(lags) - 2))
    a, b, c = score[best - 1 : best + 2]
    return float(lags[best] + 5 * LAG_STEP_S * 0.5 * (a - c) / (a - 2 * b + c)), float(score[best])


def cell_means(t, y, edges):
    """Mean of each cell from the trapezoids' area, and its number of samples. A plain mean of samples belongs to the
    middle of the samples, not of the cell, and half a sample is a delay of milliseconds."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
    count = np.diff(np.searchsorted(t, edges))
    return np.diff(np.interp(edges, t, area)) / np.diff(edges), count


class Cells:
    """Input of the regression: `y` of one gyro less `truth` (the reference, or the other gyro), and the shapes."""

    def __init__(self, recording, gyro):
        own, other = recording.gyros[gyro - 1], recording.gyros[2 - gyro]
        self.against = "reference" if recording.reference else "other gyro"
        truth = recording.reference or other
        self.lag_s, self.alike = lag_of(own, truth)
        own = own[0] - self.lag_s, own[1]
        edges = np.arange(max(own[0][0], truth[0][0]) + 0.5, min(own[0][-1], truth[0][-1]) - 0.5, CELL_S)
        y, n1 = cell_means(*own, edges)
        x, n2 = cell_means(*truth, edges)
        usual = [max(1.0, 0.7 * np.median(n[n > 0])) for n in (n1, n2)]
        self.t = 0.5 * (edges[1:] + edges[:-1])
        ends = [np.interp(edges, *truth)[i:][: len(self.t)] for i in (0, 1)]
        good = (n1 >= usual[0]) & (n2 >= usual[1]) & (np.abs(x) < FASTEST_DPS) & (np.abs(y) < FASTEST_DPS)
        d = np.where(good, y - x, 0.0)
        good &= _usual(d, [np.ones(len(d)), x, ends[1] - ends[0]], good)
        temperature = recording.temperatures[gyro - 1]
        self.heat = None if temperature is None else np.interp(self.t, own[0], temperature)[good]
        self.y, self.x, self.t = y[good], x[good], self.t[good]
        self.d, self.slope = self.y - self.x, (ends[1] - ends[0])[good] / CELL_S
        self.angle = np.cumsum(np.where(n2 > 0, x, 0.0) * CELL_S)[good]
        pauses = np.cumsum(np.concatenate([[0], np.diff(self.t) > PAUSE_S]))
        self.stretch = _stretches(self.t, pauses)


def _usual(d, columns, good):
    """The cells in which the difference, less its fit by level, rate and change, is no outlier."""
    a = np.column_stack(columns)
    for _ in range(3):
        off = np.abs(d - a @ np.linalg.lstsq(a[good], d[good], rcond=None)[0])
        good = good & (off < OUTLIER_TIMES * np.quantile(off[good], OUTLIER_SHARE))
    return good


def _stretches(t, pauses):
    """Index of each cell's stretch: stretches are as near to STRETCH_S as pauses allow, at least STRETCHES_MIN in
    all."""
    length = min(STRETCH_S, (t[-1] - t[0]) / (STRETCHES_MIN + 1))
    label = np.floor((t - t[0]) / length).astype(int)
    if pauses[-1] >= STRETCHES_MIN:
        label = pauses * 1000 + np.floor((t - t[0]) / length).astype(int)
    return np.unique(label, return_inverse=True)[1]


# ---------------------------------------------------------------- regression
class Fit:
    """Least squares. The errors come from the scatter of stretches (a jackknife over them), and `foretells` is the
    share that the last column predicts of stretches that were left out."""

    def __init__(self, y, columns, stretch):
        scale = np.array([max(np.abs(c).max(), 1e-300) for c in columns])
        a = np.column_stack(columns) / scale
        parts = [(a[stretch == s], y[stretch == s]) for s in range(stretch.max() + 1)]
        normal = [p.T @ p for p, _ in parts]
        right = [p.T @ q for p, q in parts]
        ridge = 1e-12 * np.eye(len(columns)) * len(y)
        solve = lambda n, r: np.linalg.solve(n + ridge[: len(r), : len(r)], r)
        whole, total = sum(normal), sum(right)
        self.value = solve(whole, total) / scale
        left_out = [solve(whole - n, total - r) for n, r in zip(normal, right)]
        k = len(parts)
        spread = np.array(left_out) / scale
        self.sigma = np.sqrt((k - 1) / k * np.sum((spread - spread.mean(axis=0)) ** 2, axis=0))
        less = [solve((whole - n)[:-1, :-1], (total - r)[:-1]) for n, r in zip(normal, right)]
        full = sum(np.sum((q - p @ b) ** 2) for (p, q), b in zip(parts, left_out))
        bare = sum(np.sum((q - p[:, :-1] @ b) ** 2) for (p, q), b in zip(parts, less))
        self.foretells = 1.0 - full / bare
        beside = a[:, -1] - a[:, :-1] @ solve(whole[:-1, :-1], whole[:-1, -1])
        self.of_one_unit = float(beside @ beside) * scale[-1] ** 2 / bare  # share of the remainder that one unit would be


def shape_of(kind, p, cells):
    """Effect of one unit on `d`; None if a plain regression has no such column."""
    c = cells
    heat = None if c.heat is None else c.heat - p.get("reference_c", 25.0)
    table = {
        "bias_ramp": lambda: c.t - c.t[0],
        "bias_step": lambda: (c.t >= p["at_s"]).astype(float),
        "warm_up": lambda: np.exp(-c.t / p["tau_s"]),
        "scale_factor": lambda: c.x,
        "scale_factor_asymmetry": lambda: np.abs(c.x),
        "scale_factor_quadratic": lambda: c.x**2,
        "scale_factor_cubic": lambda: c.x**3,
        "delay": lambda: -c.slope,
        "bandwidth": lambda: -c.slope,
        "clock_skew": lambda: -c.slope * c.t * 1e-6,
        "temperature_bias": lambda: heat,
        "temperature_bias_quadratic": lambda: None if heat is None else heat**2,
        "temperature_rate_bias": lambda: None if heat is None else np.gradient(heat, c.t),
        "scale_factor_temperature": lambda: None if heat is None else heat * c.x,
        "angle_harmonic": lambda: np.cos(np.deg2rad(p["harmonic"] * c.angle) + p["phase_rad"]),
    }
    return table[kind]() if kind in table else None


def base_columns(cells, without):
    """The other columns of a regression: level, rate, change of rate, except the shape itself."""
    columns = {"level": np.ones(len(cells.t)), "rate": cells.x, "change": cells.slope}
    if without in ("scale_factor",):
        del columns["rate"]
    if without in ("delay", "bandwidth"):
        del columns["change"]
    return list(columns.values())


def looked_at(kind, p, cells):
    """(size, error, predicted share, share that one unit would be) of one shape together with the base columns."""
    shape = shape_of(kind, p, cells)
    if shape is None or np.ptp(shape) < 1e-12:
        return None
    fit = Fit(cells.d, [*base_columns(cells, kind), shape], cells.stretch)
    size, sigma = float(fit.value[-1]), float(fit.sigma[-1])
    if kind == "delay":
        size += cells.lag_s  # the cells were shifted by it
    return size, sigma, float(fit.foretells), fit.of_one_unit


def both_ways(cells):
    """Scale factor from y on x and from x on y: noise makes one too small and the other too large; the truth is
    between."""
    centred = lambda v: v - v.mean()
    x, y = centred(cells.x), centred(cells.y)
    xy = float(x @ y)
    return xy / float(x @ x) - 1.0, float(y @ y) / xy - 1.0


SIZES = {
    "bias": "value_dps", "bias_ramp": "slope_dps_s", "bias_step": "size_dps", "warm_up": "amplitude_dps",
    "temperature_bias": "coefficient_dps_k", "temperature_bias_quadratic": "coefficient_dps_k2",
    "temperature_rate_bias": "coefficient_dps_s_k", "scale_factor": "error", "scale_factor_asymmetry": "error",
    "scale_factor_quadratic": "coefficient_per_dps", "scale_factor_cubic": "coefficient_per_dps2",
    "scale_factor_temperature": "coefficient_per_k", "delay": "seconds", "clock_skew": "ppm",
    "angle_harmonic": "amplitude_dps",
}  # fmt: skip


def allan(cells_d, t, tau_cells):
    """Allan deviation of the difference at some multiple of a cell, within unbroken runs."""
    squares = []
    for run in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > 1.5 * CELL_S) + 1):
        count = len(run) // tau_cells
        if count >= 2:
            means = cells_d[run][: count * tau_cells].reshape(count, tau_cells).mean(axis=1)
            squares += (0.5 * np.diff(means) ** 2).tolist()
    return math.sqrt(np.mean(squares)) if squares else math.nan


def steps_between(values):
    """(step, how well values agree with it: 1 on a lattice, 0 for arbitrary values)."""
    levels = np.unique(np.round(values, 9))
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9]
    if not len(gaps):
        return math.nan, 0.0
    near = values[np.argsort(np.abs(values - np.median(values)))[: len(values) // 2]]
    steps = np.median(gaps[gaps < 1.5 * np.quantile(gaps, 0.05)]) * np.linspace(0.95, 1.05, 2001)
    kept = np.array([np.abs(np.mean(np.exp(2j * np.pi * near / step))) for step in steps])
    return float(steps[np.argmax(kept)]), float(kept.max())


# ---------------------------------------------------------------- judgement
def judge_size(effect, told):
    """(word, reason) for an effect whose size is that of a column."""
    kind, name = effect["kind"], SIZES[effect["kind"]]
    claimed = effect["parameters"][name]
    doubt = effect.get("sigma", {}).get(name, 0.0) or 0.0
    size, sigma, share, of_one = told
    unseen = claimed if kind != "delay" else 0.0  # a delay was shifted away before
    off = abs(size - claimed) / math.hypot(sigma, doubt, 0.1 * abs(claimed))
    there = abs(size) > SIGMAS * sigma and share > FORETELLS
    text = f"{size:.3g} ± {sigma:.2g}, foretells {100 * share:.1f} % of what was left out"
    if there and off < SIGMAS:
        return "agrees", text
    if off >= SIGMAS and abs(claimed) > SIGMAS * sigma:
        return "contradicts", text
    if unseen**2 * of_one > UNSEEN_TIMES * max(share, FORETELLS):
        return "contradicts", f"{text}, where {claimed:.3g} would foretell {100 * claimed**2 * of_one:.0f} %"
    return "cannot tell", text


def judge_other(effect, recording, cells):
    """(word, reason) for kinds that show in the raw frames, in the scatter or in the spectrum."""
    kind, p = effect["kind"], effect["parameters"]
    t, y = recording.gyros[effect["gyro"] - 1]
    if kind == "quantization":
        step, share = steps_between(y)
        good = share > 0.9 and abs(step / p["step_dps"] - 1) < 0.02
        return "agrees" if good else "contradicts", f"values lie {step:.4g} apart, and keep to it by {100 * share:.0f} %"
    if kind == "dropped_frames":
        intervals = np.diff(t)[np.diff(t) < PAUSE_S]
        missing = max(0.0, 1.0 - float(np.median(intervals) / np.mean(intervals)))
        good = 0.6 < p["fraction"] / max(missing, 1e-9) < 1.6
        return "agrees" if good else "contradicts", f"by the median of their intervals {100 * missing:.2f} % of frames are missing"
    if kind in ("white_noise", "rate_random_walk", "gauss_markov", "bias_instability", "rate_noise"):
        short, long = (allan(cells.d, cells.t, n) for n in (1, 50))
        falls = short / math.sqrt(50)
        text = f"Allan deviation of the difference {short:.3g} at {CELL_S:g} s, {long:.3g} at {50 * CELL_S:g} s; white noise would leave {falls:.2g}"
        if kind == "white_noise":
            return "cannot tell", text
        return ("agrees" if long > 1.5 * falls else "contradicts"), text
    if kind == "line":
        return judge_line(p, t, y)
    if kind == "bias":
        level = Fit(cells.d, [cells.x, np.ones(len(cells.t))], cells.stretch)
        size, sigma = float(level.value[-1]), float(level.sigma[-1])
        return "cannot tell", f"level against the {cells.against} {size:.3g} ± {sigma:.2g}"
    return "cannot tell", "no column of a plain regression"


def judge_line(p, t, y):
    """The tone's power against its neighbourhood, by least squares on the raw samples, part by part."""
    ratios = []
    for part in np.array_split(np.arange(len(t)), 8):
        rate = y[part] - np.polyval(np.polyfit(t[part] - t[part[0]], y[part], 3), t[part] - t[part[0]])
        power = lambda f: np.abs(np.mean(rate * np.exp(-2j * np.pi * f * t[part])))
        width = 1.0 / (t[part[-1]] - t[part[0]])
        beside = np.median([power(p["frequency_hz"] + k * 2 * width) for k in range(-12, 13) if abs(k) > 1])
        ratios.append(power(p["frequency_hz"]) / max(beside, 1e-300))
    ratio = float(np.median(ratios))
    word = "agrees" if ratio > 4.0 else "contradicts" if ratio < 1.5 else "cannot tell"
    return word, f"{ratio:.1f} times its neighbourhood, median of eight parts"


def judge(effect, recording, cells):
    own = cells[effect["gyro"]]
    told = looked_at(effect["kind"], effect["parameters"], own) if effect["kind"] in SIZES and effect["kind"] != "bias" else None
    if effect["kind"] in ("scale_factor",):
        low, high = sorted(both_ways(own))
        word, text = judge_size(effect, told)
        claimed, sigma = effect["parameters"]["error"], told[1]
        if word != "agrees" and low - SIGMAS * sigma <= claimed <= high + SIGMAS * sigma:
            word = "agrees" if low * high > 0 or abs(claimed) > SIGMAS * sigma else "cannot tell"
        return word, f"{text}; between {low:.3g} and {high:.3g}, by which of the two is taken as noisy"
    if told is not None:
        return judge_size(effect, told)
    return judge_other(effect, recording, own)


# ---------------------------------------------------------------- report
def lags_by_part(recording, gyro):
    own, truth = recording.gyros[gyro - 1], recording.reference or recording.gyros[2 - gyro]
    cuts = np.linspace(truth[0][0], truth[0][-1], PARTS + 1)
    found = []
    for begin, end in zip(cuts, cuts[1:]):
        cut = lambda s: tuple(v[(s[0] >= begin) & (s[0] < end)] for v in s)
        lag, alike = lag_of(cut(own), cut(truth))
        found.append(f"{1e3 * lag:+.0f}" if alike > ALIKE_MIN else "?")
    return f"late by {', '.join(found)} ms in {PARTS} parts"


def levels_by_part(cells):
    less = Fit(cells.d, [np.ones(len(cells.t)), cells.slope, cells.x], cells.stretch).value
    rest = cells.d - cells.x * less[2] - cells.slope * less[1]
    parts = np.array_split(rest, PARTS)
    return "level " + ", ".join(f"{np.mean(p):+.2g}" for p in parts) + " deg/s"


def findings(recording, cells):
    """The findings of the regression itself, independent of the names."""
    lines = []
    for gyro, c in cells.items():
        if c.against == "other gyro" and gyro == 1:
            continue
        low, high = sorted(both_ways(c))
        scale = looked_at("scale_factor", {}, c)
        said = [lags_by_part(recording, gyro), levels_by_part(c)]
        said += [f"scale factor {100 * low:+.2f} to {100 * high:+.2f} % (± {100 * scale[1]:.2g})"]
        kinds = ["bias_ramp", "scale_factor_asymmetry", "temperature_bias", "temperature_rate_bias"]
        for kind in kinds:
            told = looked_at(kind, {"reference_c": 25.0}, c)
            if told and abs(told[0]) > SIGMAS * told[1] and told[2] > FORETELLS:
                said.append(f"`{kind}` {told[0]:.3g} ± {told[1]:.2g}")
            elif told:
                said.append(f"no `{kind}` beyond {SIGMAS * told[1]:.2g}")
        lines.append(f"| `{recording.name}` | gyro {gyro} less the {c.against} | {'; '.join(said)} |")
    return lines


def named_by(vgyro, recording, limit_s):
    """(gap.json, seconds) or (None, why)."""
    with tempfile.TemporaryDirectory() as scratch:
        out, begun = Path(scratch) / "found", time.monotonic()
        command = [vgyro, "gap", "--config", recording.config, "--measured", recording.log, "--out", out]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=limit_s)
        except subprocess.TimeoutExpired:
            return None, f"not done after {limit_s} s"
        if done.returncode != 0:
            return None, done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit {done.returncode}"
        return json.loads((out / "gap.json").read_text()), time.monotonic() - begun


def figure(effect):
    told = ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in effect["parameters"].items())
    rivals = "; ".join(f"{r['kind']} {r['gyro']}" for r in effect.get("ambiguous_with", []))
    return f"`{effect['kind']}` of gyro {effect['gyro']} ({told})" + (f", or {rivals}" if rivals else "")


def product_rows(vgyro, recording, cells, limit_s):
    gap, cost = named_by(vgyro, recording, limit_s)
    if gap is None:
        return [f"| `{recording.name}` | – | {cost} | | |"]
    g = gap["gap"]
    state = f"{gap['verdict']}, gap {g['before']:.3g} → {g['after']:.3g} in {cost:.0f} s"
    rows = []
    for effect in gap["effects"]:
        word, why = judge(effect, recording, cells)
        sure = "applied" if effect.get("applied", True) else "not applied"
        rows.append(f"| `{recording.name}` | {figure(effect)} | {sure}; {state} | **{word}** | {why} |")
    return rows or [f"| `{recording.name}` | nothing | {state} | | |"]


def table(folders, vgyro, limit_s):
    own, product = [], []
    for folder in folders:
        recording = Recording(folder)
        cells = {gyro: Cells(recording, gyro) for gyro in (1, 2)}
        own += findings(recording, cells)
        if vgyro:
            product += product_rows(vgyro, recording, cells, limit_s)
    text = ["| recording | regression of | what it sees |", "|---|---|---|", *own]
    if vgyro:
        text += ["", "| recording | `vgyro gap` named | and said | the regression | because |", "|---|---|---|---|---|", *product]
    return "\n".join(text) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=command_line.file_name, default=os.environ.get("VGYRO_RECORDINGS"))
    parser.add_argument("--vgyro", "--build", type=command_line.file_name, help="judge what this program's `gap` names")
    parser.add_argument("--time-limit", type=command_line.whole(1, 100_000), default=600, metavar="S")
    parser.add_argument("--only", default="", metavar="TEXT", help="only recordings whose name holds TEXT")
    parser.add_argument("--update", type=command_line.file_name, help="Markdown file whose table is written anew")
    a = parser.parse_args()
    if a.folder is None:
        parser.error("no folder of recordings: give FOLDER or set VGYRO_RECORDINGS; docs/real-data.md says how to get them")
    if a.vgyro and a.vgyro.is_dir():
        a.vgyro = a.vgyro / "vgyro"
    folders = sorted(f for f in Path(a.folder).iterdir() if (f / "vgyro.toml").exists() and a.only in f.name)
    text = table(folders, a.vgyro, a.time_limit)
    if not a.update:
        print(text)
        return
    page = a.update.read_text(encoding="utf-8")
    if BEGIN not in page or END not in page:
        sys.exit(f"{a.update}: no place for the table; put the lines {BEGIN} and {END} where it is to stand")
    head, tail = page.split(BEGIN)[0], page.split(END)[1]
    a.update.write_text(f"{head}{BEGIN}\n{text}{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
