#!/usr/bin/python3
"""Is the difference of the two corrected gyros white? Runs `vgyro replay` over a recording, takes both corrected
rates from its CAN FD frames (dbc/vgyro_fd.dbc), and judges the record stretch by stretch.

The statistic is Ljung and Box's in the form that tolerates noise of changing strength (vibration comes and goes):
Q = Σ_k (Σ_t d_t·d_{t+k})² / Σ_t d_t²·d_{t+k}², which for white d of any such strength is χ² with as many degrees of
freedom as lags, so Q/lags is about 1. The mean is *not* subtracted first: a remaining bias is not white noise.
It is computed for single samples and for means over 0.1 s, the corrector's cells; and for these once more less the
stretch's own line, which shows the part that no correction of biases could have made white. r1 is the correlation
of neighbouring samples."""

import argparse
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import command_line

SOURCE = Path(__file__).resolve().parents[1]
RATE_ID_DEFAULT = 0x610


def frame_type():
    """The signals of VG_Rate in dbc/vgyro_fd.dbc that are used here, all of whole bytes."""
    text = (SOURCE / "dbc/vgyro_fd.dbc").read_text(encoding="utf-8")
    names, formats, offsets = [], [], []
    for name in ("VG_Rate", "VG_Time", "VG_Rate1", "VG_Rate2"):
        start, bits, sign = re.search(rf"SG_ {name} : (\d+)\|(\d+)@1([+-])", text).groups()
        names.append(name)
        formats.append(("<i" if sign == "-" else "<u") + str(int(bits) // 8))
        offsets.append(int(start) // 8)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": 32})


def configured(config, folder, accept_motion):
    """A copy of the configuration that sends VG_Rate as CAN FD; its relative paths become absolute."""
    lines, section = [], ""
    for line in config.read_text(encoding="utf-8").splitlines():
        header = re.match(r"\s*\[+\s*([\w.]+)", line)
        section = header.group(1) if header else section
        if section == "output" and re.match(r"\s*fd\s*=", line):
            continue
        if section == "calibration" and accept_motion and re.match(r"\s*when_moving\s*=", line):
            continue
        line = re.sub(r'^(\s*(?:dbc|model)\s*=\s*")([^"]+)"',
                      lambda m: f'{m.group(1)}{(config.parent / m.group(2)).resolve()}"', line)
        lines.append(line)
        if header and section == "output":
            lines.append("fd = true")
        if header and section == "calibration" and accept_motion:
            lines.append('when_moving = "accept"')
    copy = folder / "vgyro.toml"
    copy.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = re.search(r"^\s*rate_id\s*=\s*(\w+)", copy.read_text(encoding="utf-8"), re.MULTILINE)
    return copy, int(found.group(1), 0) if found else RATE_ID_DEFAULT


def corrected_rates(vgyro, config, log, method, accept_motion):
    """Seconds since the first valid rate, virtual rate, both corrected rates: deg/s."""
    with tempfile.TemporaryDirectory() as folder:
        copy, rate_id = configured(config, Path(folder), accept_motion)
        out = Path(folder) / "out.log"
        done = subprocess.run([vgyro, "replay", "--config", copy, "--method", method, "-o", out, log],
                              capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(done.stderr)
        marker = f" {rate_id:03X}##".encode()
        with open(out, "rb") as lines:
            payload = b"".join(bytes.fromhex(line[line.index(b"##") + 3:].split()[0].decode())
                               for line in lines if marker in line)
    frames = np.frombuffer(payload, frame_type())
    invalid = np.iinfo(np.int32).min
    good = np.ones(len(frames), bool)
    for name in ("VG_Rate", "VG_Rate1", "VG_Rate2"):
        good &= frames[name] != invalid
    frames = frames[good]
    if not len(frames):
        sys.exit(f"{log}: no pair of valid rates; without rest in the recording try --accept-motion")
    t = (frames["VG_Time"] - frames["VG_Time"][0]) * 1e-6
    return (t, *(frames[name] * 1e-6 for name in ("VG_Rate", "VG_Rate1", "VG_Rate2")))


def chi_square_tail(q, degrees):
    """P(χ² > q), exact for an even number of degrees."""
    half = 0.5 * q
    logs = [k * math.log(max(half, 1e-300)) - math.lgamma(k + 1) - half for k in range(degrees // 2)]
    return min(sum(math.exp(value) for value in logs), 1.0)


def box_statistic(d, lags):
    q = 0.0
    for k in range(1, lags + 1):
        product = d[:-k] * d[k:]
        q += product.sum() ** 2 / max((product**2).sum(), 1e-300)
    return q


def cells(t, d, cell_s):
    index = np.floor((t - t[0]) / cell_s).astype(int)
    count = np.bincount(index)
    return (np.bincount(index, d)[count > 0] / count[count > 0]), len(d) / np.count_nonzero(count)


def without_line(d):
    x = np.linspace(-1.0, 1.0, len(d))
    return d - np.polyval(np.polyfit(x, d, 1), x)


def judge(t, rate, difference, lags, cell_s):
    means, per_cell = cells(t, difference, cell_s)
    row = {
        "from_s": t[0],
        "rate_rms": math.sqrt(np.mean(rate**2)),
        "mean": difference.mean(),
        "scatter": difference.std(),
        "r1": np.mean(difference[:-1] * difference[1:]) / np.mean(difference**2),
        "samples": box_statistic(difference, lags),
    }
    if per_cell >= 2.0 and len(means) > 4 * lags:
        row["cells"] = box_statistic(means, lags)
        row["cells_flat"] = box_statistic(without_line(means), lags)
    return row


def thinned(t, values, points):
    """Means over equal times, at most `points`; a break where nothing was measured."""
    place = np.minimum(((t - t[0]) / (t[-1] - t[0] + 1e-9) * points).astype(int), points - 1)
    count = np.bincount(place, minlength=points)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(place, values, points) / count
    middle = t[0] + (np.arange(points) + 0.5) * (t[-1] - t[0]) / points
    return "\n".join(f"{x:.2f} {y:.4f}" if n else "" for x, y, n in zip(middle, mean, count))


def draw(path, t, rate, difference, rows, options):
    """Rate, difference and statistic over time, as SVG by gnuplot."""
    points = 900
    step = (t[-1] - t[0]) / points
    middles = [row["from_s"] + 0.5 * options.stretch for row in rows]
    limit = next(x for x in np.arange(1.0, 9.0, 0.01) if chi_square_tail(x * options.lags, options.lags) < 0.01)

    def dots(key):
        return "\n".join(f"{x:.1f} {max(row[key] / options.lags, 0.1):.3g}" for x, row in zip(middles, rows) if key in row)

    blocks = {"rate": thinned(t, rate, points), "difference": thinned(t, difference, points),
              "samples": dots("samples"), "cells": dots("cells"), "flat": dots("cells_flat")}
    inline = "".join(f"${name} << EOD\n{text}\nEOD\n" for name, text in blocks.items())
    script = f"""set terminal svg size 900,640 dynamic background rgb 'white' font 'sans,13'
{inline}
set multiplot layout 3,1 margins 0.09,0.97,0.1,0.95 spacing 0.09
set grid lc rgb '#dddddd'
set xrange [{t[0]:.1f}:{t[-1]:.1f}]
set key at graph 1, graph 1.2 right top horizontal maxrows 1 samplen 1.5 width -2
set ylabel 'deg/s'
plot $rate with lines lc rgb '#0060ad' title 'virtual rate ({options.method}), means of {step:.2g} s'
plot $difference with lines lc rgb '#444444' title 'difference of the corrected gyros, means of {step:.2g} s'
set xlabel 's'
set ylabel 'Q / lags'
set logscale y
plot $samples with points pt 6 lc rgb '#999999' title 'samples', $cells with points pt 7 ps 0.7 lc rgb '#c03000' title 'cells of {options.cell:g} s', \\
  $flat with points pt 2 ps 0.7 lc rgb '#007040' title 'less own line', {limit:.2f} with lines dt 2 lc rgb 'black' title '99 % of white noise'
"""
    command_line.draw(script, path)


def self_check(lags):
    """White noise of changing strength must be found white, and a remaining bias must not."""
    rng = np.random.default_rng(7)
    strength = np.exp(np.sin(np.arange(1000) / 50.0))
    tails = [chi_square_tail(box_statistic(strength * rng.standard_normal(1000), lags), lags) for _ in range(400)]
    early = np.mean(np.array(tails) < 0.05)
    biased = chi_square_tail(box_statistic(0.5 + rng.standard_normal(1000), lags), lags)
    if not (0.02 < early < 0.09 and biased < 1e-6):
        sys.exit(f"the statistic is wrong: {early:.3f} of white records below 0.05, biased {biased:.2g}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config", type=command_line.file_name)
    parser.add_argument("log", type=command_line.file_name)
    parser.add_argument("--method", default="optimal", choices=("optimal", "mutual"))
    parser.add_argument("--accept-motion", action="store_true", help='as with when_moving = "accept"')
    parser.add_argument("--stretch", type=command_line.number(1.0, 1e5), default=20.0, metavar="S", help="seconds of each stretch (20)")
    parser.add_argument("--lags", type=command_line.whole(2, 1000), default=10, help="even; (10)")
    parser.add_argument("--cell", type=command_line.number(1e-3, 1e3), default=0.1, metavar="S", help="seconds of each mean (0.1)")
    parser.add_argument("--quiet-dps", type=command_line.number(0.0, 1e5), default=2.0, help="rms of the rate in a quiet stretch, at most (2)")
    parser.add_argument("--gap", type=command_line.number(1e-3, 1e5), default=0.5, metavar="S", help="a longer silence ends a stretch (0.5)")
    parser.add_argument("--plot", type=command_line.file_name, metavar="FILE.svg", help="also draw it, with gnuplot")
    options = parser.parse_args()
    command_line.refuse_overwriting(parser, [options.config, options.log], [options.plot])
    if options.lags % 2:
        parser.error("--lags must be even")
    self_check(options.lags)
    vgyro = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")) / "vgyro"
    t, rate, first, second = corrected_rates(vgyro, options.config, options.log, options.method, options.accept_motion)

    breaks = [0, *(np.flatnonzero(np.diff(t) > options.gap) + 1), len(t)]
    rows = []
    for begin, end in zip(breaks, breaks[1:]):
        stretch = np.floor((t[begin:end] - t[begin]) / options.stretch).astype(int)
        for number in np.unique(stretch):
            part = np.flatnonzero(stretch == number) + begin
            if t[part[-1]] - t[part[0]] < 0.5 * options.stretch:
                continue
            rows.append(judge(t[part], rate[part], (first - second)[part], options.lags, options.cell))

    if not rows:
        sys.exit(f"no stretch is half of {options.stretch:g} s long")
    if options.plot:
        draw(options.plot, t, rate, first - second, rows, options)

    def shown(q):
        if q is None:
            return f"{'–':>16}"
        return f"{q / options.lags:8.2f} {chi_square_tail(q, options.lags):7.1e}"

    print(f"{options.method}, stretches of {options.stretch:g} s, {options.lags} lags; Q/lags is 1 for white noise, then P(χ² > Q)")
    print("  from s  rate rms   difference: mean    ± scatter     r1         samples     cells of "
          f"{options.cell:g} s   less own line")
    for row in rows:
        quiet = "quiet" if row["rate_rms"] <= options.quiet_dps else ""
        print(f"{row['from_s']:8.0f} {row['rate_rms']:9.2f} {row['mean']:18.4f} {row['scatter']:12.4f} {row['r1']:6.2f} "
              f"{shown(row['samples'])} {shown(row.get('cells'))} {shown(row.get('cells_flat'))} {quiet}")
    for title, chosen in (("all", rows), ("quiet", [r for r in rows if r["rate_rms"] <= options.quiet_dps])):
        parts = []
        for key in ("samples", "cells", "cells_flat"):
            q = np.array([r[key] for r in chosen if key in r])
            if len(q):
                white = np.mean([chi_square_tail(one, options.lags) > 0.01 for one in q])
                parts.append(f"{key}: median Q/lags {np.median(q) / options.lags:.2f}, white {100 * white:.0f} %")
        print(f"{title}, {len(chosen)} stretches: " + "; ".join(parts))


if __name__ == "__main__":
    main()
