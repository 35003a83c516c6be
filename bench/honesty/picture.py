"""One world as a picture: the error of every valid rate within bands of its sigma, and the truth with the wheels."""

import subprocess

import numpy as np

import judge

MOST_POINTS = 12_000

SCRIPT = """\
set terminal {terminal}
set output "{out}"
set datafile separator ","
set multiplot layout 2,1 title "{title}" noenhanced
set lmargin 12
set rmargin 10
set grid
set xrange [0:{end}]
set yrange [-{height}:{height}]
set ylabel "error, deg/s"
set key top left horizontal
plot "{data}" using 1:(6*$3):(-6*$3) with filledcurves lc rgb "#f6e3d0" title "6 σ", \\
  "" using 1:(4*$3):(-4*$3) with filledcurves lc rgb "#f0c48f" title "4 σ", \\
  "" using 1:3:(-$3) with filledcurves lc rgb "#d99a4e" title "σ", \\
  "" using 1:2 with dots lc rgb "#5577aa" title "error", \\
  "" using 1:4 with lines lw 1.5 lc rgb "#202020" title "error, mean over 1 s"
set yrange [*:*]
set ylabel "true rate, deg/s"
set y2label "wheels, m/s"
set y2tics
set ytics nomirror
set xlabel "s"
plot "{truth}" using 1:3 axes x1y2 with lines lc rgb "#99bb88" title "wheels, m/s", \\
  "" using 1:2 with lines lc rgb "#303060" title "true rate"
unset multiplot
"""


def thinned(columns):
    """Every nth row, and of the rows in between the one with the greatest error."""
    error = np.abs(columns[:, 1])
    group = max(1, len(error) // (MOST_POINTS // 2))
    if group < 4:
        return columns
    whole = columns[:len(columns) // group * group].reshape(-1, group, columns.shape[1])
    worst = np.argmax(error[:len(whole) * group].reshape(-1, group), axis=1)
    picked = np.stack([whole[:, 0], whole[np.arange(len(whole)), worst]], axis=1).reshape(-1, columns.shape[1])
    return picked[np.argsort(picked[:, 0], kind="stable")]


def draw(folder, name, rates, recording):
    """Writes NAME.svg and NAME.png; returns their paths."""
    error, t = judge.errors(rates, recording)
    sigma = rates.sigma[rates.valid]
    order = np.argsort(t, kind="stable")
    columns = np.stack([t, error, np.nan_to_num(sigma, nan=0.0)], axis=1)[order]
    columns = thinned(np.column_stack([columns, judge.smoothed(columns[:, 0], columns[:, 1])]))
    np.savetxt(folder / f"{name}.csv", columns, fmt="%.6g", delimiter=",")
    step = slice(None, None, 100)
    np.savetxt(folder / f"{name}-truth.csv", np.stack([recording.grid[step], recording.rate[step], recording.speed[step]], axis=1),
               fmt="%.6g", delimiter=",")
    height = max(8 * np.median(columns[:, 2]), min(np.abs(columns[:, 3]).max() * 1.3, 3 * np.percentile(np.abs(columns[:, 1]), 99.9)), 1e-4)
    for kind, terminal in (("svg", "svg size 1200,760 font 'sans,11'"), ("png", "pngcairo size 1200,760 font 'sans,10'")):
        script = SCRIPT.format(terminal=terminal, out=folder / f"{name}.{kind}", title=title(name, recording), end=recording.world.duration_s,
                               height=f"{height:.4g}", data=folder / f"{name}.csv", truth=folder / f"{name}-truth.csv")
        subprocess.run(["gnuplot"], input=script, text=True, check=True)
    return f"{folder / name}.svg and .png"


def title(name, recording):
    tags = recording.world.tags
    return f"{name}: {', '.join(tags['motion'])}; drift {', '.join(tags['drift'])}; fault {', '.join(tags['fault'])}; {tags['pair'][0]}"
