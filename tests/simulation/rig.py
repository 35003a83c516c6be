"""A bench for `vgyro simulate`: a motion in closed form, its profile as CSV, a configuration whose frames
are easily read with NumPy, and a reader of recordings. Shares no code with the product."""

import os
import subprocess
from pathlib import Path

import numpy as np

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
START_S = 1_700_000_000
RATE_STEP_DPS = 1e-6
ACCELERATION_STEP_G = 1e-4
TEMPERATURE_STEP_C = 0.01
SUPPLY_STEP_V = 0.05
ROLL_STEP_DPS = 1e-3

DBC = """\
VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temperature : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG
 SG_ Supply : 56|8@1+ (50,0) [0|12000] "mV" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Roll : 32|16@1- (0.001,0) [-32|32] "deg/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG
 SG_ Pitch : 56|8@1- (0.1,0) [-12|12] "deg/s" RIG

BO_ 512 TABLE: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG

BO_ 528 ACCEL: 6 RIG
 SG_ AccX : 0|16@1- (0.0001,0) [-3|3] "g" RIG
 SG_ AccY : 16|16@1- (0.0001,0) [-3|3] "g" RIG
 SG_ AccZ : 32|16@1- (0.0001,0) [-3|3] "g" RIG
"""

CONFIG = """\
[[gyro]]
name = "a"
bus = "can0"
dbc = "rig.dbc"
message = "GYRO_A"
rate = "Rate"
temperature = "Temperature"
supply_voltage = "Supply"
counter = "Counter"

[[gyro]]
name = "b"
bus = "can1"
dbc = "rig.dbc"
message = "GYRO_B"
rate = "Rate"
rate_x = "Roll"
rate_y = "Pitch"
counter = "Counter"

[reference]
bus = "can0"
dbc = "rig.dbc"
message = "TABLE"
rate = "Rate"

[accelerometer]
bus = "can1"
dbc = "rig.dbc"
message = "ACCEL"
x = "AccX"
y = "AccY"
z = "AccZ"

[calibration]
rest_s = 30.0
rate_dps = 0.0

[output]
bus = "can0"
fd = true
"""

# Amplitude in deg/s and frequency in Hz of the sines that make up the motion; all begin at zero.
SINES = ((20.0, 0.7), (3.0, 3.1))
ROLL_SINES = ((15.0, 0.9), (4.0, 2.3))


def rate(t):
    return sum(a * np.sin(2 * np.pi * f * t) for a, f in SINES)


def angle_rad(t):
    """The angle turned since the beginning."""
    return np.radians(sum(a * (1 - np.cos(2 * np.pi * f * t)) / (2 * np.pi * f) for a, f in SINES))


def low_passed(t, cutoff_hz):
    return low_passed_sines(t, SINES, cutoff_hz)


def low_passed_sines(t, sines, cutoff_hz):
    """y' = w (input - y), y(0) = 0, solved by hand for each sine."""
    w = 2 * np.pi * cutoff_hz
    total = 0.0
    for a, f in sines:
        v = 2 * np.pi * f
        total = total + a * w / (w * w + v * v) * (w * np.sin(v * t) - v * np.cos(v * t) + v * np.exp(-w * t))
    return total


def low_passed_twice(t, cutoff_hz, damping):
    """y''/w² + 2 damping y'/w + y = rate, y(0) = y'(0) = 0, damping < 1, solved by hand for each sine."""
    w = 2 * np.pi * cutoff_hz
    rings, total = w * np.sqrt(1 - damping**2), 0.0
    for a, f in SINES:
        v = 2 * np.pi * f
        gain = w * w / (w * w - v * v + 2j * damping * w * v)
        cosine = -gain.imag
        sine = (damping * w * cosine - v * gain.real) / rings
        free = np.exp(-damping * w * t) * (cosine * np.cos(rings * t) + sine * np.sin(rings * t))
        total = total + a * ((gain * np.exp(1j * v * t)).imag + free)
    return total


def roll(t):
    return sum(a * np.sin(2 * np.pi * f * t) for a, f in ROLL_SINES)


def pitch(t):
    return 9.0 * np.sin(2 * np.pi * 0.41 * t)


def temperature(t):
    return 24.0 + 4.0 * np.sin(2 * np.pi * t / 40.0)


def temperature_slope(t):
    return 4.0 * 2 * np.pi / 40.0 * np.cos(2 * np.pi * t / 40.0)


def follow(values, play):
    """A follower that `values` drag along once they are further from it than the play."""
    out, at = [], None
    for value in values.tolist():
        at = value if at is None else min(max(at, value - play), value + play)
        out.append(at)
    return np.array(out)


def supply(t):
    return 5.0 + 0.4 * np.sin(2 * np.pi * t / 9.0)


def acceleration(t):
    x = 0.3 * np.sin(2 * np.pi * 0.2 * t)
    y = 0.2 * np.cos(2 * np.pi * 0.3 * t)
    z = 1.0 + (0.05 + 0.002 * t) * np.sin(2 * np.pi * 2.3 * t)
    return np.stack([x, y, z])


def profile(seconds, rate_hz=50.0, motion=rate):
    t = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    columns = np.column_stack([t, motion(t), temperature(t), *acceleration(t), supply(t), roll(t), pitch(t)])
    rows = [",".join(map(repr, row)) for row in columns.tolist()]
    return "\n".join(["t_s,rate_dps,temperature_c,acc_x_g,acc_y_g,acc_z_g,supply_v,rate_x_dps,rate_y_dps", *rows]) + "\n"


def rest(seconds):
    return f"t_s,rate_dps\n0,0\n{seconds},0\n"


def model(*effects):
    lines = ["format = 1"]
    for effect in effects:
        lines += ["", "[[effect]]"]
        lines += [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v!r}" for k, v in effect.items()]
    return "\n".join(lines) + "\n"


def effect(kind, gyro=1, **parameters):
    return {"gyro": gyro, "kind": kind, **parameters}


class Frames:
    """All frames of one identifier: seconds from the start, and payloads padded to eight bytes."""

    def __init__(self, log, can_id):
        mark = f" {can_id:03X}#"
        lines = [line for line in log.splitlines() if mark in line]
        microseconds = [int(line[1:11]) * 1_000_000 + int(line[12:18]) for line in lines]
        self.t = (np.array(microseconds, dtype=np.int64) - START_S * 1_000_000) * 1e-6
        hexes = [line.split("#")[1].split()[0].ljust(16, "0") for line in lines]
        self.bytes = np.frombuffer(bytes.fromhex("".join(hexes)), dtype=np.uint8).reshape(-1, 8)

    def rate(self):
        return np.ascontiguousarray(self.bytes[:, 0:4]).view("<i4")[:, 0] * RATE_STEP_DPS

    def temperature(self):
        return np.ascontiguousarray(self.bytes[:, 4:6]).view("<i2")[:, 0] * TEMPERATURE_STEP_C

    def supply(self):
        return self.bytes[:, 7] * SUPPLY_STEP_V

    def roll(self):
        return np.ascontiguousarray(self.bytes[:, 4:6]).view("<i2")[:, 0] * ROLL_STEP_DPS

    def acceleration(self):
        return np.ascontiguousarray(self.bytes[:, 0:6]).view("<i2").T * ACCELERATION_STEP_G

    def counter(self):
        return self.bytes[:, 6].astype(int)


def vgyro(folder, *arguments):
    return subprocess.run([str(BIN / "vgyro"), *map(str, arguments)], cwd=folder, capture_output=True, check=False, timeout=100)


def simulate(folder, effects, profile_text, *arguments):
    """The log's text."""
    folder = Path(folder)
    (folder / "rig.dbc").write_text(DBC)
    (folder / "vgyro.toml").write_text(CONFIG)
    (folder / "model.toml").write_text(model(*effects))
    (folder / "profile.csv").write_text(profile_text)
    done = vgyro(folder, "simulate", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "profile.csv", *arguments)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.decode())
    return done.stdout.decode()
