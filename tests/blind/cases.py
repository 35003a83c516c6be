"""The effects hidden in a recording: a world, a group, a seed and the group's parameters give one case,
always the same. Worlds: bench, a rate table with its reference; drive, a vehicle on a road, usually without
one (drive.py). Groups: clean, single, pair, triple, outside, decoy. Development seeds are below 1000,
evaluation seeds from 1000 on."""

import dataclasses

import numpy as np

import drive
import effects as kinds
import motion
import strangers
import surroundings
from world import Gyro, World

# Two effects of one set in one recording mask each other, so they are never injected together.
RIVALS = [
    {"saturation", "dead_band", "quantization", "stuck"},
    {"delay", "bandwidth", "clock_skew", "timestamp_jitter"},
]
# A seed must keep hiding the same effects: kinds that the catalogue gained later hide only alone.
HIDE_ALONE = {"supply_voltage_bias", "run_in", "temperature_hysteresis", "bias_instability", "cross_axis"}
HIDE_ALONE |= {"bandwidth_second_order"}
DECOYS = ["shuffled", "reversed", "flat", "common"]


@dataclasses.dataclass(frozen=True)
class Case:
    group: str
    seed: int
    kind: str = ""  # the kind of a single; the maker of an outside or a decoy
    strength: float | None = None  # wanted |t|; None: a size that is usual on a bench
    reference: bool = True
    short: bool = False  # 240 s and 100 Hz, for tests
    world: str = "bench"
    nothing_given: bool = False  # no model file: the workflow begins without one

    @property
    def name(self):
        size = "plain" if self.strength is None else f"t{self.strength:g}"
        parts = [
            "" if self.world == "bench" else self.world,
            self.group,
            self.kind,
            "" if self.group == "clean" else size,
            "" if self.reference else "noref",
            "nothing" if self.nothing_given else "",
        ]
        return "-".join([part for part in parts if part] + [str(self.seed)])


def world_for(case, rng, motion_rng):
    """The gyros come from `rng`, the same for both recordings of a case; everything else from `motion_rng`."""
    if case.world == "drive":
        return drive.world_for(case, rng, motion_rng)
    strong = case.group == "clean" and rng.random() < 0.5
    markov = strong and rng.random() < 0.5
    gyros = []
    quiet = rng.uniform(1e-4, 4e-4), rng.uniform(2e-6, 8e-6)
    loud = rng.uniform(3e-4, 1e-3), rng.uniform(4e-6, 1.5e-5)
    for density, walk in (quiet, loud):
        gyros.append(
            Gyro(
                bias=round(float(rng.uniform(0.01, 0.05) * rng.choice([-1, 1])), 4),
                density=float(f"{density:.2g}"),
                walk=float(f"{walk * (15.0 if strong and not markov else 1.0):.2g}"),
                markov_sigma=float(f"{rng.uniform(2e-4, 1e-3):.2g}") if markov else 0.0,
                markov_tau=float(round(rng.uniform(20.0, 100.0))),
            )
        )
    rates = [100.0, 100.0]
    if not case.short and rng.random() < 0.25:
        rates = [[100.0, 50.0], [200.0, 100.0], [125.0, 100.0], [50.0, 100.0]][rng.integers(4)]
    duration_s = 240.0 if case.short else float(rng.choice([240, 300, 420, 480, 480, 600]))
    offset_s = round(float(rng.uniform(0.0005, 0.0045)), 4)
    shaken = case.kind == "vibration_rectification" or rng.random() < 0.3
    rest_s = 45.0 if duration_s < 300 else 62.0
    swing_k = motion_rng.uniform(6.0, 16.0)
    return World(
        motion=motion.Motion(duration_s, rest_s, motion_rng),
        temperatures=[
            surroundings.Temperature(duration_s, motion_rng, swing_k * motion_rng.uniform(0.6, 1.0))
            for _ in range(2)
        ],
        acceleration=surroundings.Acceleration(duration_s, motion_rng, shaken),
        gyros=gyros,
        rates_hz=rates,
        offset_s=offset_s,
        reference=case.reference,
    )


def _chosen_kinds(case, rng):
    if case.group == "single":
        return [case.kind]
    count = {"pair": 2, "triple": 3}.get(case.group, 0)
    while True:
        several = [k for k in kinds.KINDS if k not in HIDE_ALONE]
        chosen = [str(k) for k in rng.choice(several, count, replace=False)]
        if all(len(group & set(chosen)) < 2 for group in RIVALS):
            return chosen


def shake(world, rng):
    """Gives the platform the vibration that its effect needs."""
    world.acceleration = surroundings.Acceleration(world.motion.duration_s, rng, vibration=True)


def feed(world, rng):
    """Gives each gyro a changing supply voltage, and a signal for it."""
    world.supplies = [surroundings.Supply(world.motion.duration_s, rng) for _ in range(2)]


def sway(world, rng):
    """Lets the platform roll, and gives each gyro a signal for it."""
    world.roll = surroundings.Roll(rng)


def hidden_in(case, world, rng):
    """(effects of the catalogue, functions outside it, name and gyro of the one outside)."""
    if case.world == "drive" and case.group != "decoy":
        return drive.hidden_in(case, world, rng)
    found, odd, label = [], [], None
    chosen = _chosen_kinds(case, rng)
    gyro = int(rng.integers(1, 3))
    for kind in chosen:
        if kind == "vibration_rectification":
            shake(world, rng)
        if kind == "supply_voltage_bias":
            feed(world, rng)
        if kind == "cross_axis":
            sway(world, rng)
        found.append(kinds.draw(kind, gyro, case.strength, world, rng))
        gyro = int(rng.integers(1, 3))
    if case.group == "outside":
        sigma, _ = world.noise_seen(gyro)
        size = sigma * rng.uniform(0.6, 1.5)
        odd, label = [strangers.MAKERS[case.kind](gyro, size, rng)], {"name": case.kind, "gyro": gyro}
    if case.group == "decoy" and case.kind == "common":
        error = float(f"{rng.uniform(5e-4, 2e-3):.3g}")
        found = [
            {"kind": "scale_factor", "gyro": k, "parameters": {"error": error}, "t": 0.0} for k in (1, 2)
        ]
    if case.group == "decoy" and case.kind == "flat":
        draw = drive.draw_somehow if case.world == "drive" else kinds.draw
        hidden = draw("temperature_bias", gyro, None, world, rng)
        p, drift = hidden["parameters"], world.temperatures[gyro - 1]

        def add(_, which, t, __):
            on = p["coefficient_dps_k"] * (drift.value(t) - p["reference_c"])
            return on if which == gyro else np.zeros(len(t))

        odd, label = [add], {"name": "hidden temperature", "gyro": gyro}
    return found, odd, label


def recorded_temperatures(case, world, rng):
    """The values of the temperature signals; a decoy's are unrelated to the gyros."""
    end_s = world.motion.duration_s
    if case.group == "decoy" and case.kind == "flat":
        return [surroundings.Flat(26.0).value] * 2
    if case.group == "decoy" and case.kind == "reversed":
        return [lambda t, T=T: T.value(end_s - t) for T in world.temperatures]
    if case.group == "decoy" and case.kind == "shuffled":
        order, part_s = rng.permutation(8), end_s / 8

        def moved(t):
            return order[np.minimum((t / part_s).astype(int), 7)] * part_s + t % part_s

        return [lambda t, T=T: T.value(moved(t)) for T in world.temperatures]
    return [T.value for T in world.temperatures]
