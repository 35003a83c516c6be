"""A blind world of three axes: two whole units on one platform that rests, turns and sways. Each axis of each unit
may have a hidden effect. Has equations, frames and a configuration of its own, and shares no code with the product."""

import dataclasses
import json
import lzma
from pathlib import Path

import numpy as np

AXES = "xyz"
KINDS = ("cross_axis", "scale_factor", "scale_factor_asymmetry", "delay")
UNIT_KINDS = ("delay",)  # of all axes of a unit at once
RATE_HZ, REFERENCE_HZ, START_US = 50.0, 100.0, 1_700_000_000_000_000
OFFSET_S = 0.0061  # time offset of the second unit's samples
FIRST_REST_S, DRIVE_S, STOP_S = 60.0, 120.0, 20.0
DENSITIES = (2e-3, 8e-3)  # deg/s/√Hz, least and most, of an axis
WALK_DPS_RTS = 1e-5
REFERENCE_SIGMA_DPS = 2e-3

DBC = 'VERSION ""\n\nBU_: RIG\n' + "".join(
    f"\nBO_ {number} {name}: 16 RIG\n"
    + "".join(f' SG_ {axis.upper()} : {32 * i}|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG\n' for i, axis in enumerate(AXES))
    + ' SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG\n'
    for number, name in ((769, "UNIT_A"), (770, "UNIT_B"), (771, "TABLE"))
)
READS = "".join(f'rate_{axis} = "{axis.upper()}"\n' for axis in AXES)


@dataclasses.dataclass(frozen=True)
class Case:
    seed: int
    kind: str = ""  # kind of the hidden effect; empty: none
    strength: float = 20.0  # its |t| in the noise in which it must be found
    reference: bool = True
    seconds: float = 340.0

    @property
    def name(self):
        return "-".join(["units", self.kind or "clean", f"t{self.strength:g}", "ref" if self.reference else "noref", str(self.seed)])


class Motion:
    """Rest, then drives with stops between them: yaw turns to both sides, roll and pitch sway; all at the same time,
    independent of each other."""

    def __init__(self, seconds, rng):
        self.seconds = seconds
        self.f = rng.uniform(0.03, 0.9, (3, 5))
        self.a = rng.uniform(0.3, 1.0, (3, 5)) * np.array([[3.0], [2.5], [12.0]])
        self.phase = rng.uniform(0, 2 * np.pi, (3, 5))

    def rate(self, t):
        since = np.mod(t - FIRST_REST_S, DRIVE_S + STOP_S)
        edge = np.clip(np.minimum(since, DRIVE_S - since) / 3.0, 0.0, 1.0)
        moves = np.where(t > FIRST_REST_S, edge**3 * (10 - 15 * edge + 6 * edge**2), 0.0)
        waves = np.sin(2 * np.pi * self.f[:, :, None] * t + self.phase[:, :, None])
        return (moves * np.einsum("ij,ijk->ik", self.a, waves)).T


def regressor(effect, motion, t):
    """Contribution of one unit of the effect's size to the reading of its axis, or of each axis for an effect of the
    whole unit."""
    rate = motion.rate(t)
    if effect["kind"] == "cross_axis":
        return rate[:, AXES.index(effect["parameters"]["from"])]
    if effect["kind"] == "scale_factor":
        return rate[:, AXES.index(effect["axis"])]
    if effect["kind"] == "scale_factor_asymmetry":
        return np.abs(rate[:, AXES.index(effect["axis"])])
    h = 1e-3
    return -(motion.rate(t + h) - motion.rate(t - h)) / (2 * h)


SIZE_OF = {"cross_axis": "coefficient", "scale_factor": "error", "scale_factor_asymmetry": "error", "delay": "seconds"}


def hidden(case, motion, densities, rng):
    """The hidden effect with the case's strength: |t| = size · √(Σ g² / variance), with g less its mean, which a
    bias absorbs. An effect of the whole unit has this strength about the axis that shows it best: the workflow
    treats one axis after the other."""
    if not case.kind:
        return []
    gyro, axis = int(rng.integers(1, 3)), AXES[rng.integers(3)]
    effect = {"kind": case.kind, "gyro": gyro, "parameters": {}}
    if case.kind not in UNIT_KINDS:
        effect["axis"] = axis
    if case.kind == "cross_axis":
        effect["parameters"]["from"] = str(rng.choice([other for other in AXES if other != axis]))
    t = np.arange(0.0, motion.seconds, 1.0 / RATE_HZ)
    g = np.atleast_2d(regressor(effect, motion, t).T)
    places = range(3) if case.kind in UNIT_KINDS else [AXES.index(axis)]
    information = 0.0
    for row, place in zip(g, places):
        seen = [gyro - 1] if case.reference else [0, 1]
        variance = sum(densities[unit][place] ** 2 for unit in seen) * RATE_HZ
        information = max(information, np.sum((row - row.mean()) ** 2) / variance)
    sign = 1.0 if case.kind == "delay" else float(rng.choice([-1.0, 1.0]))
    effect["parameters"][SIZE_OF[case.kind]] = float(f"{sign * case.strength / np.sqrt(information):.4g}")
    return [effect]


def reading(motion, unit, t, bias, density, effects, rng):
    late_s = sum(e["parameters"]["seconds"] for e in effects if e["kind"] == "delay")
    value = motion.rate(t - late_s) + np.array(bias)
    for e in effects:
        if e["kind"] != "delay":
            value[:, AXES.index(e["axis"])] += e["parameters"][SIZE_OF[e["kind"]]] * regressor(e, motion, t)
    value += rng.standard_normal(value.shape) * np.array(density) * np.sqrt(RATE_HZ)
    return value + np.cumsum(rng.standard_normal(value.shape) * WALK_DPS_RTS / np.sqrt(RATE_HZ), axis=0)


def frames(t, values, number):
    raw = np.rint(values * 1e6).astype("<i4")
    for i, t_s in enumerate(t):
        us = START_US + round(t_s * 1e6)
        yield us, f"({us // 1_000_000}.{us % 1_000_000:06d}) can0 {number:03X}##1{raw[i].tobytes().hex().upper()}{i % 256:02X}000000\n"


def model_text(biases, densities):
    text = "format = 1\n"
    for unit in range(2):
        for place, axis in enumerate(AXES):
            of = f'\n[[effect]]\ngyro = {unit + 1}\naxis = "{axis}"\n'
            text += of + f'kind = "bias"\nvalue_dps = {biases[unit][place]}\n'
            text += of + f'kind = "white_noise"\ndensity_dps_rthz = {densities[unit][place]}\n'
            text += of + f'kind = "rate_random_walk"\ndensity_dps_rts = {WALK_DPS_RTS}\n'
    return text


def config_text(reference):
    text = "".join(f'[[gyro]]\nname = "{name}"\nbus = "can0"\ndbc = "units.dbc"\nmessage = "{message}"\n{READS}counter = "Counter"\n\n'
                   for name, message in (("a", "UNIT_A"), ("b", "UNIT_B")))
    text += f"[calibration]\nrest_s = {FIRST_REST_S - 5.0}\nrate_dps = [0.0, 0.0, 0.0]\n\n[output]\nbus = \"can0\"\n"
    return text + (f'\n[reference]\nbus = "can0"\ndbc = "units.dbc"\nmessage = "TABLE"\n{READS}' if reference else "")


def make(case, folder):
    """Writes the recording with its known parameters; returns the answer, which is not written."""
    folder = Path(folder)
    folder.mkdir(parents=True)
    rng = np.random.default_rng([case.seed, 3])
    motion = Motion(case.seconds, rng)
    biases = [[float(f"{b:.4f}") for b in rng.uniform(-0.3, 0.3, 3)] for _ in range(2)]
    densities = [[float(f"{d:.4g}") for d in np.exp(rng.uniform(*np.log(DENSITIES), 3))] for _ in range(2)]
    effects = hidden(case, motion, densities, rng)
    lines = []
    for unit in range(2):
        t = np.arange(unit * OFFSET_S, case.seconds, 1.0 / RATE_HZ)
        own = [e for e in effects if e["gyro"] == unit + 1]
        lines += frames(t, reading(motion, unit, t, biases[unit], densities[unit], own, rng), 0x301 + unit)
    if case.reference:
        t = np.arange(0.0013, case.seconds, 1.0 / REFERENCE_HZ)
        lines += frames(t, motion.rate(t) + rng.standard_normal((len(t), 3)) * REFERENCE_SIGMA_DPS, 0x303)
    (folder / "measured.log.xz").write_bytes(lzma.compress("".join(line for _, line in sorted(lines)).encode(), preset=1))
    (folder / "units.dbc").write_text(DBC)
    (folder / "vgyro.toml").write_text(config_text(case.reference))
    (folder / "model.toml").write_text(model_text(biases, densities))
    return effects


# --- the judge ----------------------------------------------------------------------------------------------------------


def label(effect):
    return effect["kind"], int(effect["gyro"]), effect.get("axis"), effect.get("parameters", {}).get("from")


def told(effect):
    """A named effect and all that it may also be."""
    return {label(effect), *(label(other) for other in effect.get("ambiguous_with", []))}


def judge(truths, gap):
    """For one recording: the effects found, with their errors in sigma, and the names that are false."""
    true = {label(e) for e in truths}
    named = gap["effects"]
    errors = []
    for e in truths:
        size = SIZE_OF[e["kind"]]
        errors += [(one["parameters"][size] - e["parameters"][size]) / one["sigma"][size] for one in named if label(one) == label(e)]
    return {
        "truth": [list(t) for t in sorted(true, key=str)],
        "named": [list(label(e)) for e in named],
        "found": [t in set().union(*map(told, named)) for t in sorted(true, key=str)] if named else [False] * len(true),
        "wrong": [list(label(e)) for e in named if not told(e) & true],
        "applied": [list(label(e)) for e in named if e["applied"]],
        "errors": errors,
        "verdicts": {axis["axis"]: axis["verdict"] for axis in gap["axes"]},
    }


def as_wished(judged):
    return all(judged["found"]) and not judged["wrong"]


def one_line(case, judged):
    return json.dumps({"case": case.name, "as_wished": as_wished(judged), **judged})
