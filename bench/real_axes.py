#!/usr/bin/python3
"""Real recordings of two whole units: makes a log of their three axes from the publishers' own files, and prints how much of the
difference's power below 2 Hz a small rotation between the units explains, and how much is left after `vgyro replay` has learned one.

    bench/real_axes.py dots Horizontal/            # path_N/IMU_1.csv and IMU_2.csv, segments joined by pauses of 2 s
    bench/real_axes.py dataflash log171.bin        # IMU and IMU2 of an ArduPilot log

The shares by least squares are of stretches that the fit has not seen: each half of the recording is judged with the fit of the
other half. docs/real-data.md lists the sources of the files; none is part of this repository."""

import argparse
import csv
import io
import json
import os
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import command_line

SOURCE = Path(__file__).resolve().parents[1]
VGYRO = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")) / "vgyro"
AXES = "xyz"
START_US = 1_690_000_000_000_000
PAUSE_S = 2.0  # between two segments
GAP_S = 0.5  # longer silences cut a recording
SLOW_HZ = 2.0
STRETCH_S = 10.0  # length of a Fourier transform; a shorter remainder is left out
FASTEST_DPS = 400.0  # beyond it a craft tumbles
LAG_MAX_S, LAG_STEP_S = 0.06, 0.001

DBC = 'VERSION ""\n\nBU_: CRAFT\n' + "".join(
    f"\nBO_ {257 + unit} UNIT_{'AB'[unit]}: 16 CRAFT\n"
    + "".join(f' SG_ {axis.upper()} : {32 * i}|32@1- (1E-006,0) [-2147|2147] "deg/s" CRAFT\n' for i, axis in enumerate(AXES))
    + ' SG_ Counter : 96|8@1+ (1,0) [0|255] "" CRAFT\n'
    for unit in range(2)
)


# ---------------------------------------------------------------- the publishers' files
def dots(folder):
    """Time and rates of two modules, segment after segment."""
    paths = sorted(Path(folder).glob("path_*"), key=lambda path: int(path.name.split("_")[1]))
    if not paths:
        sys.exit(f"{folder}: holds no path_1, path_2, …; the folder Horizontal of the repository does")
    units, end_s = [[], []], 0.0
    for path in paths:
        tables = []
        for name in ("IMU_1.csv", "IMU_2.csv"):
            with open(path / name, encoding="utf-8-sig") as file:
                rows = csv.DictReader(file)
                tables.append(np.array([[row["time"], row["Gyr_X"], row["Gyr_Y"], row["Gyr_Z"]] for row in rows], dtype=float))
        begin_s = tables[0][0, 0]
        for unit, table in zip(units, tables):
            table[:, 0] += end_s - begin_s
            unit.append(table)
        end_s = max(table[-1, 0] for table in tables) + PAUSE_S
    return [np.concatenate(unit) for unit in units]


FLOATS = {"f": "f", "d": "d", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "q": "q", "Q": "Q", "c": "h", "C": "H",
          "e": "i", "E": "I", "L": "i", "M": "B", "n": "4s", "N": "16s", "Z": "64s", "a": "64s"}  # fmt: skip


def dataflash(path):
    """Time and rates of IMU and IMU2: a record is A3 95 TYPE and the fields that a record of type 128 has defined."""
    data, kinds, found, at = Path(path).read_bytes(), {}, {"IMU": [], "IMU2": []}, 0
    while (at := data.find(b"\xa3\x95", at)) >= 0 and at + 3 <= len(data):
        kind = data[at + 2]
        if kind == 128 and at + 89 <= len(data):
            number, length, name, form, columns = struct.unpack_from("<BB4s16s64s", data, at + 3)
            text = lambda field: field.split(b"\0")[0].decode("ascii", "replace")
            kinds[number] = text(name), "<" + "".join(FLOATS.get(c, "x") for c in text(form)), text(columns).split(","), length
            at += 89
        elif kind in kinds and at + kinds[kind][3] <= len(data):
            name, form, columns, length = kinds[kind]
            if name in found and struct.calcsize(form) == length - 3:
                row = dict(zip(columns, struct.unpack_from(form, data, at + 3)))
                time_s = row["TimeUS"] * 1e-6 if "TimeUS" in row else row["TimeMS"] * 1e-3
                found[name].append([time_s, row["GyrX"], row["GyrY"], row["GyrZ"]])
            at += length
        else:
            at += 1
    if not all(found.values()):
        sys.exit(f"{path}: holds no IMU and IMU2 of an ArduPilot log")
    units = [np.array(rows) for rows in found.values()]
    begin_s = min(unit[0, 0] for unit in units)
    for unit in units:
        unit[:, 0] -= begin_s
        unit[:, 1:] = np.degrees(unit[:, 1:])
    return units


# ---------------------------------------------------------------- log and product
def log_of(units):
    lines = []
    for number, unit in enumerate(units):
        raw = np.clip(np.rint(unit[:, 1:] * 1e6), -(2**31), 2**31 - 1).astype("<i4")
        for i, t_s in enumerate(unit[:, 0]):
            us = START_US + round(t_s * 1e6)
            text = f"({us // 1_000_000}.{us % 1_000_000:06d}) can{number} {257 + number:03X}##1{raw[i].tobytes().hex().upper()}{i % 256:02X}000000\n"
            lines.append((us, text))
    return "".join(text for _, text in sorted(lines))


def config_text(rest_s):
    reads = "".join(f'rate_{axis} = "{axis.upper()}"\n' for axis in AXES)
    gyros = "".join(f'[[gyro]]\nname = "{name}"\nbus = "can{i}"\ndbc = "units.dbc"\nmessage = "UNIT_{name.upper()}"\n{reads}counter = "Counter"\n'
                    for i, name in enumerate("ab"))
    return gyros + f'[calibration]\nrest_s = {rest_s}\nrate_dps = [0.0, 0.0, 0.0]\nwhen_moving = "accept"\n[output]\nbus = "can0"\n'


def replay(units, rest_s, keep):
    """The rotation by the product's summary."""
    with tempfile.TemporaryDirectory(prefix="vgyro-real-") as scratch:
        folder = Path(keep or scratch)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "units.dbc").write_text(DBC)
        (folder / "vgyro.toml").write_text(config_text(rest_s))
        (folder / "measured.log").write_text(log_of(units))
        done = subprocess.run([VGYRO, "replay", "--quiet", "--config", folder / "vgyro.toml", "-o", "/dev/null", "--json", "-", folder / "measured.log"],
                              capture_output=True, check=False)
    # For a contradicted pair the exit code is 1, after a complete summary.
    if not done.stdout:
        sys.exit(done.stderr.decode(errors="replace"))
    return json.load(io.BytesIO(done.stdout)), done.stderr.decode(errors="replace").strip()


# ---------------------------------------------------------------- the difference
def stretches(units):
    """Parts of STRETCH_S in which both units send and nothing tumbles, on one even grid."""
    one, two = units
    step_s = float(np.median(np.diff(one[:, 0])))
    count = int(STRETCH_S / step_s)
    cuts = np.flatnonzero(np.diff(one[:, 0]) > GAP_S) + 1
    for part in np.split(one, cuts):
        for begin in range(0, len(part) - count + 1, count):
            grid = part[begin, 0] + np.arange(count) * step_s
            near = two[(two[:, 0] > grid[0] - 1.0) & (two[:, 0] < grid[-1] + 1.0)]
            if len(near) < 0.9 * count or np.max(np.diff(near[:, 0])) > GAP_S:
                continue
            a = np.stack([np.interp(grid, part[:, 0], part[:, 1 + i]) for i in range(3)])
            if np.abs(a).max() < FASTEST_DPS:
                yield grid, step_s, a, near


def late_by(grid, a, near):
    """Delay of unit 2 over all axes: the one that leaves the least difference."""
    lags = np.arange(-LAG_MAX_S, LAG_MAX_S + LAG_STEP_S, LAG_STEP_S)
    left = []
    for lag_s in lags:
        off = np.stack([np.interp(grid + lag_s, near[:, 0], near[:, 1 + i]) for i in range(3)]) - a
        left.append(np.sum(off.var(axis=1)))
    return float(lags[int(np.argmin(left))])


def slow(values, step_s):
    """The part below 2 Hz, without mean and trend, which are left to the corrector."""
    n = values.shape[1]
    line = np.linspace(-1.0, 1.0, n)
    level = values - values.mean(axis=1)[:, None]
    level = level - np.outer(level @ line / (line @ line), line)
    spectrum = np.fft.rfft(level, axis=1)
    spectrum[:, np.fft.rfftfreq(n, step_s) >= SLOW_HZ] = 0.0
    return np.fft.irfft(spectrum, n, axis=1)


def rows_of(a):
    """Effect of θ about x, y and z on the difference of each axis: b − a = a × θ, θ in rad. (3 axes, 3 angles, n)"""
    x, y, z = a
    none = np.zeros_like(x)
    return np.array([[none, -z, y], [z, none, -x], [-y, x, none]])


def fit(parts, with_scale):
    """θ (and a scale factor of each axis) by least squares over these stretches."""
    size = 6 if with_scale else 3
    normal, right = np.zeros((size, size)), np.zeros(size)
    for a, d in parts:
        for axis, rows in enumerate(rows_of(a)):
            shape = np.concatenate([rows, np.eye(3)[axis][:, None] * a[axis]]) if with_scale else rows
            normal += shape @ shape.T
            right += shape @ d[axis]
    return np.linalg.solve(normal, right)


def power(parts, theta, scale=np.zeros(3)):
    """Mean square of the slow difference of each axis, less the prediction by this rotation and these scale factors."""
    squares, count = np.zeros(3), 0
    for a, d in parts:
        left = d - np.einsum("ijk,j->ik", rows_of(a), theta) - scale[:, None] * a
        squares, count = squares + np.sum(left**2, axis=1), count + a.shape[1]
    return squares / count


def held_out(parts, with_scale):
    """Like power(), each half with the fit of the other half."""
    halves = [parts[: len(parts) // 2], parts[len(parts) // 2 :]]
    found = [fit(half, with_scale) for half in halves]
    total = sum(len(half) * power(half, other[:3], other[3:] if with_scale else np.zeros(3)) for half, other in zip(halves, reversed(found)))
    return total / len(parts), found


def report(units, rest_s, keep):
    lags, raw, aligned = [], [], []
    for grid, step_s, a, near in stretches(units):
        lags.append(late_by(grid, a, near))
        for lag_s, parts in ((0.0, raw), (lags[-1], aligned)):
            b = np.stack([np.interp(grid + lag_s, near[:, 0], near[:, 1 + i]) for i in range(3)])
            parts.append((slow(a, step_s), slow(b - a, step_s)))
    if len(aligned) < 4:
        sys.exit(f"only {len(aligned)} stretches of {STRETCH_S:g} s in which both speak: too few for two halves")
    print(f"{len(aligned)} stretches of {STRETCH_S:g} s; unit 2 is late by {np.median(lags) * 1e3:+.0f} ms (5 to 95 %: "
          f"{np.percentile(lags, 5) * 1e3:+.0f} to {np.percentile(lags, 95) * 1e3:+.0f} ms), stretch by stretch")
    summary, said = replay(units, rest_s, keep)
    learned = summary.get("misalignment")
    theta = np.radians(learned["angle_deg"]) if learned else np.zeros(3)
    rows = ["| below 2 Hz, deg/s rms | x | y | z |", "|---|---:|---:|---:|"]
    add = lambda name, squares, of: rows.append(f"| {name} | " + " | ".join(f"{np.sqrt(s):.3f} ({100 * (1 - s / w):+.0f} %)" for s, w in zip(squares, of)) + " |")
    for title, parts in (("as stamped", raw), ("each stretch's lag taken off", aligned)):
        before = power(parts, np.zeros(3))
        rows.append(f"| difference, {title} | " + " | ".join(f"{np.sqrt(s):.3f}" for s in before) + " |")
        by_angle, angles = held_out(parts, False)
        add("less a rotation, of the other half", by_angle, before)
        add("less rotation and scale factors, of the other half", held_out(parts, True)[0], before)
        if learned:
            add("less what `vgyro replay` had learned at the end", power(parts, theta), before)
        rows.append("| rotation by least squares, of each half, deg | " + " | ".join(" and ".join(f"{np.degrees(a[i]):+.2f}" for a in angles) for i in range(3)) + " |")
    if learned:
        rows.append("| learned by the product, deg | " + " | ".join(f"{a:+.3f} ± {s:.3f}" for a, s in zip(learned["angle_deg"], learned["sigma_deg"])) + " |")
    print("\n".join(rows))
    print("the product: " + (said or "nothing to complain of"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("form", choices=["dots", "dataflash"])
    parser.add_argument("source", type=Path)
    parser.add_argument("--rest", type=float, default=10.0, metavar="S", help="calibration (default %(default)s)")
    parser.add_argument("--keep", type=command_line.file_name, metavar="FOLDER", help="for measured.log, units.dbc and vgyro.toml")
    a = parser.parse_args()
    if not os.access(VGYRO, os.X_OK):
        sys.exit(f"{VGYRO}: is no program; build the preset release first, or set VGYRO_BIN to a build's bin")
    report({"dots": dots, "dataflash": dataflash}[a.form](a.source), a.rest, a.keep)


if __name__ == "__main__":
    main()
