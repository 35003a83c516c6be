"""Figures, verdicts, tables and a picture from the measurements of bench/accuracy."""

import math

import numpy as np

import command_line
from judge import motion, score
from judge.pair import PAIRS

DPH = 3600.0  # deg/h in 1 deg/s
# Largest heading error of each mode, relative to the bound's.
LIMITS = {"given": 1.05, "estimated": 1.25}
ERROR2_LIMITS = (0.8, 1.2)
RIVALS = {
    "mutual": "`mutual`",
    "mean": "plain mean",
    "better": "better gyro",
    "rest_mean": "mean after rest",
    "stop_mean": "mean after stops",
}
PAPER_S, SHORT_S, LONG_S = score.HORIZONS_S
HORIZON_NAMES = {SHORT_S: "15 min", LONG_S: "1 h"}

# --- figures -------------------------------------------------------------------------------------


def headings(figures, horizon_s):
    return np.array([f["heading_deg"][horizon_s] for f in figures])


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def ratio(of, to):
    """Ratio of two rms values over the same seeds, with its bootstrap interval of 95 %."""
    squares = np.stack([np.square(of), np.square(to)])
    picks = np.random.default_rng(1).integers(0, len(of), (4000, len(of)))
    sums = squares[:, picks].sum(axis=2)
    low, high = np.quantile(np.sqrt(sums[0] / sums[1]), (0.025, 0.975))
    return {"value": rms(of) / rms(to), "low": float(low), "high": float(high)}


def below(measured, limit):
    """Returns "yes", "no", or "open" if the seeds do not decide."""
    if measured["high"] <= limit:
        return "yes"
    return "no" if measured["low"] > limit else "open"


def mean_of(figures, name):
    """Mean over the seeds that have the figure."""
    values = np.array([np.atleast_1d(f[name]) for f in figures], dtype=float)
    counts = np.isfinite(values).sum(axis=0)
    return np.where(counts > 0, np.nansum(values, axis=0) / np.maximum(counts, 1), np.nan)


def summarise_horizon(found, horizon_s, expected_deg):
    errors = {name: headings(figures, horizon_s) for name, figures in found.items()}
    errors["better"] = min((errors.pop("gyro_1"), errors.pop("gyro_2")), key=rms)
    best = min(RIVALS, key=lambda name: rms(errors[name]))
    summary = {"rms_deg": {name: rms(e) for name, e in errors.items()}, "expected_deg": expected_deg, "best_rival": best, "modes": {}}
    for mode in set(score.MODES) & set(errors):
        summary["modes"][mode] = {
            "to_bound": ratio(errors[mode], errors["bound"]),
            "to_best_rival": ratio(errors[mode], errors[best]),
            # Distance from the bound's heading in units of its σ: depends less on the seeds than the ratio.
            "apart": rms(errors[mode] - errors["bound"]) / expected_deg,
            "gain": {name: rms(errors[name]) / rms(errors[mode]) for name in RIVALS},
        }
    return summary


def summarise_mode(figures, horizons, mode, scenario):
    own = {
        name: float(mean_of(figures, name)[0])
        for name in ("error2", "error2_all", "error2_alone", "bias_error2", "gap_s")
    }
    own["bias_dph"] = float(np.sqrt(mean_of(figures, "bias2")[0])) * DPH
    own["bias_each_dph"] = (np.sqrt(mean_of(figures, "bias2_each")) * DPH).tolist()
    own["checks"] = {"sigma": "yes" if ERROR2_LIMITS[0] <= own["error2"] <= ERROR2_LIMITS[1] else "no"}
    for horizon_s, summary in horizons.items():
        name, measured = HORIZON_NAMES[horizon_s], summary["modes"][mode]
        own["checks"][f"rivals, {name}"] = below(measured["to_best_rival"], 1.0)
        if mode == "given" or not scenario.blind_without_model:
            own["checks"][f"bound, {name}"] = below(measured["to_bound"], LIMITS[mode])
    return own


def summarise(found, scenario, expected):
    """found: name → figures, one per seed; expected: horizon → σ of the bound's heading error."""
    horizons = {
        h: summarise_horizon(found, h, expected[h])
        for h in HORIZON_NAMES
        if h in found["bound"][0]["heading_deg"]
    }
    return {
        "horizons": horizons,
        "bound_bias_dph": float(np.sqrt(mean_of(found["bound"], "bias2")[0])) * DPH,
        "modes": {
            mode: summarise_mode(found[mode], horizons, mode, scenario) for mode in score.MODES if mode in found
        },
    }


# --- single limits -------------------------------------------------------------------------------


def paper_limits(found, summaries, mode):
    rest = found.get(("twin", "rest"), {})
    if mode in rest:
        own, mean = (headings(rest[name], PAPER_S) / PAPER_S * DPH for name in (mode, "mean"))
        yield "paper's rest, 120 s: deg/h", "≤ 0.576", rms(own), rms(own) <= 0.576
        yield "paper's rest: times better than the mean", "≥ 80", rms(mean) / rms(own), rms(mean) / rms(own) >= 80
    turn = summaries.get(("twin", "turn"))
    if turn and mode in turn["modes"]:
        summary = turn["horizons"][SHORT_S]
        gain, own = summary["modes"][mode]["gain"]["mean"], summary["rms_deg"][mode]
        yield "paper's turn, 900 s: times better than the mean", "≥ 20", gain, gain >= 20
        yield "paper's turn, 900 s: deg", "≤ 0.0185", own, own <= 0.0185


def gain_limits(summaries, mode):
    for pair, scenario, horizon_s, rivals, least in (
        ("k10", "drive", SHORT_S, ("mutual", "rest_mean"), 4),
        ("fog_mems", "stops", LONG_S, ("mutual", "rest_mean"), 100),
    ):
        summary = summaries.get((pair, scenario), {}).get("horizons", {}).get(horizon_s)
        if not summary or mode not in summary["modes"]:
            continue
        for rival in rivals:
            gain = summary["modes"][mode]["gain"][rival]
            what = f"{pair} {scenario}, {HORIZON_NAMES[horizon_s]}: times better than {RIVALS[rival]}"
            yield what, f"≥ {least}", gain, gain >= least


# --- tables --------------------------------------------------------------------------------------


def table(head, rows):
    aligns = ["---"] * 2 + ["---:"] * (len(head) - 2)
    return "".join("| " + " | ".join(map(str, line)) + " |\n" for line in (head, aligns, *rows))


def number(x):
    if not math.isfinite(x):
        return "–"
    return f"{x:.2g}" if x < 1.0 else f"{x:.3g}" if x < 100.0 else f"{x:.0f}"


MARKS = {"yes": "", "no": " ✗", "open": " ?"}


def ratio_cell(summary, mode, horizon_s):
    if mode not in summary["modes"]:
        return "–"
    measured = summary["horizons"][horizon_s]["modes"][mode]["to_bound"]
    checks, name = summary["modes"][mode]["checks"], HORIZON_NAMES[horizon_s]
    beaten = " ✗ rival" if checks[f"rivals, {name}"] == "no" else ""
    return (f"{measured['value']:.2f} ({measured['low']:.2f}…{measured['high']:.2f})"
            f"{MARKS[checks.get(f'bound, {name}', 'yes')]}{beaten}")


def heading_table(summaries, horizon_s):
    head = ["pair", "scenario", "bound, deg (its σ)", *(f"{mode} : bound" for mode in score.MODES), *RIVALS.values()]
    rows = []
    for (pair, scenario), summary in summaries.items():
        horizon = summary["horizons"].get(horizon_s)
        if horizon:
            rows.append([pair, scenario, f"{number(horizon['rms_deg']['bound'])} ({number(horizon['expected_deg'])})",
                         *(ratio_cell(summary, mode, horizon_s) for mode in score.MODES),
                         *(number(horizon["rms_deg"][name]) for name in RIVALS)])
    return table(head, rows) if rows else ""


def sigma_table(summaries):
    head = ["pair", "scenario", "mode", "heading apart", "bias, deg/h", "its bound", "error²", "error², all",
            "error², one gyro", "bias error²"]
    rows = []
    for (pair, scenario), summary in summaries.items():
        last = summary["horizons"][max(summary["horizons"])]
        for mode, own in summary["modes"].items():
            rows.append([pair, scenario, mode, f"{last['modes'][mode]['apart']:.2f}", number(own["bias_dph"]),
                         number(summary["bound_bias_dph"]), number(own["error2"]) + MARKS[own["checks"]["sigma"]],
                         *(number(own[name]) for name in ("error2_all", "error2_alone", "bias_error2"))])
    return table(head, rows)


LEGEND = f"""\
Beside the bound, its σ by its own covariance. Ratios are of heading errors rms over the seeds, with their 95 %
interval. ✗ misses a limit, ? is not decided by so many seeds; limits: {LIMITS['given']} with given parameters,
{LIMITS['estimated']} with estimated ones, error² {ERROR2_LIMITS[0]} … {ERROR2_LIMITS[1]}. ✗ rival: a simpler means is better.
"""
SIGMA_LEGEND = """\
Heading apart: rms distance from the bound's heading, in units of its σ. Bias: of what is taken off the virtual
rate, second half of the run. Error²: mean of ((VG_Rate − true) / VG_Sigma)² in the last quarter, in all of the run, and
with one gyro alone. Bias error²: the same of the bias and VM_BiasSigma, where the wire resolves it.
"""


def text(found, summaries, seeds):
    parts = [f"Seeds {seeds[0]} … {seeds[-1]}. " + LEGEND]
    for horizon_s, name in HORIZON_NAMES.items():
        headings_text = heading_table(summaries, horizon_s)
        if headings_text:
            parts.append(f"Heading error after {name}, deg rms:\n\n{headings_text}")
    parts.append(SIGMA_LEGEND + "\n" + sigma_table(summaries))
    limits = [
        [what, mode, limit, number(measured), "yes" if reached else "**no**"]
        for mode in score.MODES
        for rows in (paper_limits(found, summaries, mode), gain_limits(summaries, mode))
        for what, limit, measured, reached in rows
    ]
    if limits:
        parts.append(table(["what", "mode", "limit", "measured", "reached"], limits))
    return "\n".join(parts)


# --- picture -------------------------------------------------------------------------------------

POINTS = {
    # name: title, point type, size, colour, sideways
    "mean": ("plain mean, uncalibrated", 1, 0.8, "#909090", 0.0),
    "mutual": ("mutual", 8, 0.9, "#d06020", 0.0),
    "rest_mean": ("mean after rest", 4, 0.8, "#a09010", 0.0),
    "stop_mean": ("mean after stops", 12, 0.9, "#409030", 0.0),
    "better": ("better gyro alone", 2, 0.8, "#a03080", 0.0),
    "estimated": ("optimal, parameters estimated", 6, 0.9, "#2060c0", 0.16),
    "given": ("optimal, parameters given", 7, 0.8, "#103060", -0.16),
}

BOUND_LINE = "lc rgb '#404040' lw 1.5"
LIMIT_LINE = "lc rgb '#404040' dt 3"

PREAMBLE = """\
set terminal svg size 1200,900 dynamic font 'DejaVu Sans,13' background 'white'
set logscale y
set format y '%g'
set yrange [0.5:20000]
set grid ytics lt 1 lc rgb '#e4e4e4'
set border 3 lw 1 lc rgb '#808080'
set tics nomirror out scale 0.5
set style line 1 lc rgb '#808080' lw 1
set key off
set multiplot layout 2,2 title 'Heading error in units of the bound, {horizons}' font ',15' \\
  margins 0.06,0.99,0.14,0.90 spacing 0.05,0.12
"""


def panel_lines(title, cells):
    """cells: [(scenario, summary)]"""
    scenarios = [scenario for scenario, _ in cells]
    tics = ", ".join("'%s' %d" % (name.replace("temperature", "temp."), i) for i, name in enumerate(scenarios))
    yield f'set title "{title}" offset 0,-0.5'
    yield f"set xtics ({tics})\nset xrange [-0.6:{len(cells) - 0.4}]"
    plots = [f"1 with lines {BOUND_LINE} notitle", f"{LIMITS['estimated']} with lines {LIMIT_LINE} notitle"]
    for name, (_, kind, size, colour, aside) in POINTS.items():
        rows = []
        for i, (_, summary) in enumerate(cells):
            last = summary["horizons"][max(summary["horizons"])]
            if name in last["modes"]:
                to = last["modes"][name]["to_bound"]
                rows.append(f"{i + aside} {to['value']} {to['low']} {to['high']}")
            elif name in RIVALS:
                value = last["rms_deg"][name] / last["rms_deg"]["bound"]
                rows.append(f"{i + aside} {value} {value} {value}")
        if not rows:
            continue
        yield f"${name} << E\n" + "\n".join(rows) + "\nE"
        if name in score.MODES:
            plots.append(f"${name} using 1:2:3:4 with yerrorbars pt {kind} ps {size} lc rgb '{colour}' notitle")
        else:
            plots.append(f"${name} using 1:2 with points pt {kind} ps {size} lw 1.5 lc rgb '{colour}' notitle")
    yield "plot " + ", ".join(plots)


def key_lines():
    """The legend, once, below the panels."""
    yield "unset title\nunset border\nunset tics\nunset logscale\nset yrange [0:1]\nset xrange [0:1]"
    yield "set lmargin at screen 0\nset rmargin at screen 1\nset bmargin at screen 0\nset tmargin at screen 0.09"
    yield "set key at screen 0.5,0.05 center center maxrows 3 width 2 samplen 2"
    marks = [f"NaN with points pt {kind} ps {size} lw 1.5 lc rgb '{colour}' title '{title}'"
             for title, kind, size, colour, _ in reversed(POINTS.values())]
    marks.append(f"NaN with lines {BOUND_LINE} title 'the bound'")
    marks.append(f"NaN with lines {LIMIT_LINE} title 'limit with estimated parameters'")
    yield "plot " + ", ".join(marks)


def draw(summaries, path):
    names = dict.fromkeys(HORIZON_NAMES[max(s["horizons"])] for s in summaries.values())
    script = [PREAMBLE.format(horizons="after " + " (turn: ".join(names) + ")" * (len(names) - 1))]
    for pair in PAIRS.values():
        cells = [(scenario, s) for (name, scenario), s in summaries.items() if name == pair.name]
        if cells:
            script += panel_lines(pair.title, cells)
    script += [*key_lines(), "unset multiplot"]
    command_line.draw("\n".join(script) + "\n", path)
