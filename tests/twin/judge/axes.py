"""Two whole units in three axes: their readings on a motion with a tilt between them, and the errors of the
product's angles about each axis, compared with the bound of one axis, which knows the tilt. Each axis of a unit has
a message of its own."""

import csv
import dataclasses
import io
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import canlog
import product
from judge import motion, rivals, score
from judge import pair as gyro_pair

AXES = "xyz"
EARTH_DPS = (0.0, 0.0, motion.EARTH_DPS)
TILT_DEG = np.array([0.32, -0.27, 0.28])  # half a degree in all
RATE_HZ = 100.0
STEP_DPS = 1e-6
CONING_HZ, CONING_DEG = 1.5, 0.5
BANK_S = 0.5  # a turn of 40 deg/s banks by 20 deg


@dataclasses.dataclass(frozen=True)
class Scenario:
    name: str
    title: str
    banked: bool = False
    tilted: bool = False
    gone_s: tuple = ()  # unit 1's y: (from, to) after BEGIN_S


SCENARIOS = {
    s.name: s
    for s in (
        Scenario("coning", "the axis of yaw runs round a cone while driving"),
        Scenario("banked", "turns are banked", banked=True),
        Scenario("tilted", "banked turns, unit 2 is tilted by 0.5 deg", banked=True, tilted=True),
        Scenario("dropout", "the same, and y of unit 1 is gone from minute 7 to 12", banked=True, tilted=True, gone_s=((420.0, 720.0),)),
    )
}


def rotation(vector_rad):
    """The matrix of a rotation by this vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector_rad))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Motion:
    """The rates about x, y and z: the drive with stops of one axis, and its effect through roll and pitch."""

    def __init__(self, scenario, run_s, rng):
        self.drive = motion.Motion(motion.SCENARIOS["stops"], run_s, rng)
        self.scenario, self.run_s, self.length_s = scenario, run_s, self.drive.length_s
        self._t = self.drive._t
        driving = self.drive._driving(self._t - motion.BEGIN_S)
        sway = np.stack([motion.band_noise(self._t, rng) for _ in range(2)]) * driving
        yaw = self.drive._rate - motion.EARTH_DPS
        if scenario.banked:
            # Euler angles: the heading turns about the vertical, and the vehicle is rolled.
            bank = np.radians(BANK_S * yaw)
            self._rates = np.stack([np.degrees(np.gradient(bank, self._t)), yaw * np.sin(bank), yaw * np.cos(bank)])
        else:
            phase = 2 * np.pi * CONING_HZ * self._t
            round_dps = CONING_DEG * 2 * np.pi * CONING_HZ * driving
            self._rates = np.stack([round_dps * np.cos(phase), round_dps * np.sin(phase), yaw])
        self._rates[:2] += sway
        self._rates += np.array(EARTH_DPS)[:, None]

    def rate(self, t_s):
        """(3, n)"""
        return np.stack([np.interp(t_s, self._t, rate) for rate in self._rates])

    def standing(self, t_s):
        return self.drive.standing(t_s)

    def there(self, unit, axis, t_s):
        there = np.ones(len(t_s), dtype=bool)
        for begin, end in self.scenario.gone_s if (unit, axis) == (0, 1) else ():
            there &= (t_s < motion.BEGIN_S + begin) | (t_s >= motion.BEGIN_S + end)
        return there


@dataclasses.dataclass(frozen=True)
class AxisRecording:
    """The recording of one axis, in the form that the judges of one axis need."""

    motion: Motion
    dt_s: float
    gyros: tuple


@dataclasses.dataclass(frozen=True)
class Recording:
    motion: Motion
    axes: tuple
    streams: tuple

    def log(self):
        lines = gyro_pair._Lines()
        canlog.write(lines, self.streams)
        return b"".join(lines)


def tilt(scenario):
    """Unit 2's reading of the vehicle's rate."""
    return rotation(-np.radians(TILT_DEG)) if scenario.tilted else np.eye(3)


def simulate(pair, scenario, run_s, seed):
    motion_seed, *seeds = np.random.SeedSequence((seed, list(SCENARIOS).index(scenario.name), 3)).spawn(7)
    true = Motion(scenario, run_s, np.random.default_rng(motion_seed))
    readings, streams = [[], [], []], []
    for unit, gyro in enumerate(pair.gyros):
        dt = (1.0 + gyro_pair.CLOCK_2 * unit) / RATE_HZ
        t = np.arange(int(true.length_s / dt) + 1) * dt + gyro_pair.PHASE_2_S * unit
        rates = true.rate(t)
        felt = (tilt(scenario) if unit == 1 else np.eye(3)) @ rates
        for axis in range(3):
            one, frames = _read(gyro, t, dt, rates[axis], felt[axis], true.there(unit, axis, t), np.random.default_rng(seeds[3 * unit + axis]))
            readings[axis].append(one)
            stamps = gyro_pair.START_US + np.rint(t * 1e6).astype(np.int64)
            streams.append(canlog.Stream(f"can{unit}", 0x101 + axis, stamps[one.there], frames[one.there]))
    axes = tuple(AxisRecording(true, 1.0 / RATE_HZ, tuple(both)) for both in readings)
    return Recording(true, axes, tuple(streams))


def _read(gyro, t, dt, rate, felt, there, rng):
    white = rng.standard_normal(len(t)) * (gyro.white_dps_rthz / np.sqrt(dt))
    drift = gyro.bias_dps + np.cumsum(rng.standard_normal(len(t))) * (gyro.walk_dps_rts * np.sqrt(dt))
    raw = np.rint((felt + drift + white) / STEP_DPS).astype("<i4")
    frames = np.zeros((len(t), 8), dtype=np.uint8)
    frames[:, :4] = raw.view(np.uint8).reshape(-1, 4)
    frames[:, 4] = np.arange(len(t)) % 256
    return gyro_pair.Readings(t, raw * STEP_DPS - rate, drift, drift, drift + white, there), frames


DBC = 'VERSION ""\n\nBU_: RIG\n' + "".join(
    f'\nBO_ {257 + i} RATE_{axis}: 8 RIG\n SG_ Rate{axis} : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG\n'
    f' SG_ Count{axis} : 32|8@1+ (1,0) [0|255] "" RIG\n'
    for i, axis in enumerate(AXES)
)


def config_text():
    text = ""
    for unit, name in enumerate("ab"):
        text += f'[[gyro]]\nname = "{name}"\nbus = "can{unit}"\ndbc = "axes.dbc"\nmessage = "RATE_x"\nrate_x = "Ratex"\ncounter = "Countx"\n'
        for axis in "yz":
            text += f'[[gyro.axis]]\naxis = "{axis}"\nmessage = "RATE_{axis}"\nrate = "Rate{axis}"\ncounter = "Count{axis}"\n'
    return text + f'[calibration]\nrest_s = {motion.CALIBRATION_S}\nrate_dps = {list(EARTH_DPS)}\n[output]\nbus = "can0"\n'


def model_text(pair):
    """N and K of every axis. The tilt is left to be learned: the axes are in messages of their own, for which
    cross_axis is not corrected."""
    return "format = 1\n" + "".join(
        f'[[effect]]\ngyro = {unit + 1}\nkind = "{kind}"\n{key} = {value!r}\n'
        for unit, gyro in enumerate(pair.gyros)
        for kind, key, value in (("white_noise", "density_dps_rthz", gyro.white_dps_rthz), ("rate_random_walk", "density_dps_rts", gyro.walk_dps_rts))
    )


def replay(log, pair, mode):
    """The table of one run, column → values; empty ones are NaN."""
    with tempfile.TemporaryDirectory(prefix="vgyro-axes-") as folder:
        folder = Path(folder)
        (folder / "axes.dbc").write_text(DBC)
        (folder / "axes.toml").write_text(config_text())
        command = [product.VGYRO, "replay", "--quiet", "--config", folder / "axes.toml", "--csv", "-"]
        if mode == "given":
            (folder / "model.toml").write_text(model_text(pair))
            command += ["--model", folder / "model.toml"]
        done = subprocess.run([*map(str, command), "-"], input=log, capture_output=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{done.args}: exit code {done.returncode}\n{done.stderr.decode(errors='replace')}")
    rows = csv.reader(io.StringIO(done.stdout.decode()))
    names = next(rows)
    wanted = [i for i, name in enumerate(names) if name == "t_s" or name.split("_")[0] in ("rate", "sigma", "valid")]
    values = np.array([[row[i] or "nan" for i in wanted] for row in rows], dtype=float).T
    return dict(zip((names[i] for i in wanted), values))


def angle_errors(t_s, error_dps, run_s, halves=2):
    """Error of the angle over each half of the run: the second drive is judged by itself."""
    lengths = np.diff(t_s, append=t_s[-1])
    edges = motion.BEGIN_S + np.linspace(0.0, run_s, halves + 1)
    return [float(np.dot(error_dps, lengths * ((t_s >= begin) & (t_s < end)))) for begin, end in zip(edges[:-1], edges[1:])]


def judge(pair, scenario, run_s, seed, modes=score.MODES):
    """name → for each axis {"angle_deg": of both halves, "error2": of the last quarter}."""
    recording = simulate(pair, scenario, run_s, seed)
    judged = {"bound": [], "rest_mean": []}
    for one in recording.axes:
        paired = rivals.pair_up(one)
        errors, _ = rivals.rate_errors(pair, paired)
        for name, figures in judged.items():
            figures.append({"angle_deg": angle_errors(paired.t_s, errors[name], run_s)})
    log = recording.log()
    for mode in modes:
        table = replay(log, pair, mode)
        judged[mode] = [judge_axis(recording.motion, table, axis, run_s) for axis in range(3)]
    return judged


def judge_axis(true, table, axis, run_s):
    name = AXES[axis]
    valid = table[f"valid_{name}"] == 1
    t = table["t_s"][valid] - gyro_pair.START_US * 1e-6
    error = table[f"rate_{name}_dps"][valid] - true.rate(t)[axis]
    relative = error / table[f"sigma_{name}_dps"][valid]
    last = t >= motion.BEGIN_S + 0.75 * run_s
    return {"angle_deg": angle_errors(t, error, run_s), "error2": score.mean_square(relative[last])}
