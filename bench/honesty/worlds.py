"""A world: one seed makes a pair of gyros, a vehicle's life, drifts, faults, the other frames on the bus, and the
configuration. Nothing in here depends on how the corrector works; the sizes are those of data sheets and of traffic.
A seed always makes the same bytes. Each part has its own random stream, so that leaving one out (wheels, say) leaves
the others unchanged."""

import math
from dataclasses import dataclass, field

import numpy as np

import candump
import gyros
import motion
from gyros import CLASSES, Drift, Fault, log_uniform

EARTH_DPS = 15.041 / 3600
COMMON_LAG_S = 240.0  # the longest time without a stop in worlds whose gyros drift together
# A motion without wheel speed or vibration differs from drift only by its suddenness: it must be this many times faster
# than the drift that both gyros share in that time, or it could not be recognized.
CLEAR_OF_DRIFT = 5.0
# Drift that both gyros share, that began after the first rest and does not show in their difference either, cannot be
# known before the next stop; nor can sigma always allow for it without being too large elsewhere. It is kept below this
# many sigma of a single sample of the pair.
HIDDEN_SIGMAS = 3.0
# A changing difference shows that something drifts; the shared drift may then be this many times as large.
SHOWN_BY_DIFFERENCE = 3.0
SOUND_AGAIN_S = 5.0  # after a fault ends

GYRO_IDS = (0x101, 0x182)
WHEEL_ID = 0x2A0


@dataclass
class World:
    seed: int
    duration_s: float
    rest_s: float  # duration of the first rest
    calibration_s: float
    rest_dps: float
    gyros: list
    thermal: object
    temperature_sent: bool
    wheels: object
    model: bool
    chapters: list
    tags: dict = field(default_factory=dict)

    def faults(self):
        return [(k, f) for k, g in enumerate(self.gyros) for f in g.faults]


@dataclass
class Wheels:
    rate_hz: float
    phase_s: float
    blind_below: float  # m/s: below it toothed wheels give no pulses
    broken: bool


def stream(seed, part):
    return np.random.default_rng([seed, part])


def draw_pair(rng):
    kinds = list(gyros.PAIRS[rng.choice(len(gyros.PAIRS), p=gyros.PAIR_SHARES)])
    rng.shuffle(kinds)
    rates = [rng.choice(gyros.RATES_HZ)] * 2 if rng.random() < 0.4 else rng.choice(gyros.RATES_HZ, 2)
    one = rng.random()
    coarse = [False, False]
    if one < 0.12:
        coarse[rng.integers(2)] = True
    if one < 0.02:
        coarse = [True, True]
    return [gyros.draw_gyro(rng, kind, hz, c and kind != "fog") for kind, hz, c in zip(kinds, rates, coarse)]


def draw_drifts(rng, pair, duration_s, rest_s):
    """Fills the gyros' drifts; returns the kinds and the temperature, if any."""
    kinds = ["none", "ramp", "warm-up", "thermal", "bias step", "two"]
    kind = kinds[rng.choice(6, p=[0.35, 0.15, 0.15, 0.15, 0.1, 0.1])]
    chosen = [] if kind == "none" else [kind]
    if kind == "two":
        chosen = sorted(rng.choice(kinds[1:5], 2, replace=False).tolist())
    both = rng.random() < 0.5
    first = int(rng.integers(2))
    thermal = None
    for name in chosen:
        if name == "thermal":
            thermal = gyros.Thermal(rng.uniform(10, 30) * rng.choice([-1, 1]), rng.uniform(300, 1800), 0.0, rng.uniform(-10, 50))
            thermal.phase_s = rng.uniform(0, 2) * thermal.half_s
        add_drift(rng, name, pair, first, both or name == "thermal", (duration_s, rest_s))
    return chosen, thermal


def add_drift(rng, name, pair, first, both, times):
    duration_s, rest_s = times
    begin_s = 0.0 if rng.random() < 0.5 else rng.uniform(rest_s, 0.6 * duration_s)
    tau_s = log_uniform(rng, 60, 600)
    alike = both and pair[0].kind == pair[1].kind and rng.random() < 0.4
    shared = None
    for k in ([first, 1 - first] if both and name != "bias step" else [first]):
        of = CLASSES[pair[k].kind]
        limits = {"ramp": of.ramp, "warm-up": of.warm_up, "bias step": of.step, "thermal": of.per_kelvin}[name]
        size = log_uniform(rng, *limits) * rng.choice([-1, 1])
        if alike and shared is not None:
            size = shared * rng.uniform(0.9, 1.1)
        shared = size
        at_s = rng.uniform(rest_s, 0.8 * duration_s) if name == "bias step" else begin_s
        pair[k].drifts.append(Drift(name, size, at_s, tau_s * rng.uniform(0.9, 1.1)))


def calm_hidden_heat(pair, thermal, sent):
    """Limits drift by heat: without a temperature on the bus as a ramp is limited, with one to twice that."""
    steepest_k_s = abs(thermal.swing_k) * 0.5 * math.pi / thermal.half_s
    for g in pair:
        limit = CLASSES[g.kind].hidden_slope * (2 if sent else 1)
        for d in g.drifts:
            if d.kind == "thermal":
                d.size *= min(1.0, limit / (abs(d.size) * steepest_k_s))


def draw_faults(rng, pair, duration_s, rest_s):
    if rng.random() >= 0.2:
        return "none"
    kind = ["blind", "reads zero", "reads a constant", "silent", "stuck", "spike"][rng.integers(6)]
    gyro = pair[rng.integers(2)]
    begin_s = rng.uniform(rest_s + 60, 0.7 * duration_s)
    if kind in ("reads zero", "reads a constant") and rng.random() < 0.4:
        begin_s = 0.0
    if kind in ("silent", "stuck"):
        for _ in range(rng.integers(1, 4)):
            end_s = begin_s + log_uniform(rng, 3, 120 if kind == "silent" else 30)
            gyro.faults.append(Fault(kind, begin_s, end_s))
            begin_s = end_s + rng.uniform(30, 200)
    elif kind == "spike":
        for at_s in np.sort(rng.uniform(begin_s, duration_s, max(1, rng.poisson((duration_s - begin_s) * log_uniform(rng, 0.01, 0.2))))):
            gyro.faults.append(Fault(kind, float(at_s), float(at_s) + 0.5, log_uniform(rng, 1, 50) * rng.choice([-1, 1])))
    else:
        gyro.faults.append(Fault(kind, begin_s, math.inf))
    return kind + (" from the start" if begin_s == 0.0 else "")


def spare_the_last(pair):
    """Removes steps of the only gyro that is left: they cannot be distinguished from turns."""
    for k, gyro in enumerate(pair):
        for fault in gyro.faults:
            if fault.end_s == math.inf:
                other = pair[1 - k]
                other.drifts = [d for d in other.drifts if d.kind != "bias step" or d.begin_s < fault.begin_s]


def sample_sigma_dps(pair):
    return sum(1 / (g.density**2 * g.rate_hz) for g in pair) ** -0.5


def changes_between_stops(world, drifts_of):
    """Drift of each gyro over the longest time without a stop, for every second."""
    t = np.arange(world.rest_s, world.duration_s, 1.0)
    lag = int(COMMON_LAG_S)
    for g in world.gyros:
        drift = gyros.drift_of(g, t, world.thermal, drifts_of(g))
        yield drift[lag:] - drift[:-lag]


def calm_hidden_drift(world):
    def hidden(g):
        return [d for d in g.drifts if d.kind == "thermal" or (d.kind == "ramp" and d.begin_s > 0)]

    a, b = changes_between_stops(world, hidden)
    together = np.where(np.sign(a) == np.sign(b), np.minimum(np.abs(a), np.abs(b)), 0)
    unseen = float((together - SHOWN_BY_DIFFERENCE * np.abs(a - b)).max())
    limit = HIDDEN_SIGMAS * sample_sigma_dps(world.gyros)
    for d in [d for g in world.gyros for d in hidden(g)] if unseen > limit else []:
        d.size *= limit / unseen


def shared_drift_dps(world):
    """Largest drift that both gyros share between two stops."""
    a, b = changes_between_stops(world, lambda g: g.drifts)
    together = np.where(np.sign(a) == np.sign(b), np.minimum(np.abs(a), np.abs(b)), 0)
    return float(together.max(initial=0.0))


def draw_chapters(rng):
    if rng.random() < 0.12:
        return ["rail"]
    names = list(motion.CAR_CHAPTERS)
    shares = np.array([5, 3, 2.5, 1.5, 2, 2, 1.5, 1.5])
    return rng.choice(names, rng.integers(2, 5), replace=False, p=shares / shares.sum()).tolist()


def draw(seed, without=()):
    """The plan of a world; cheap to make. `without` holds any of wheels, model, temperature, drift, scale, faults."""
    rng = stream(seed, 0)
    duration_s, rest_s = rng.uniform(900, 1500), rng.uniform(45, 90)
    rest_dps = 0.0 if rng.random() < 0.3 else float(f"{EARTH_DPS * rng.uniform(-1, 1):.5f}")
    pair = draw_pair(stream(seed, 1))
    drift_kinds, thermal = draw_drifts(stream(seed, 2), pair, duration_s, rest_s)
    fault = draw_faults(stream(seed, 3), pair, duration_s, rest_s)
    if "drift" in without:
        drift_kinds, thermal = [], None
    if "faults" in without:
        fault = "none"
    for g in pair:
        g.drifts = [] if "drift" in without else g.drifts
        g.faults = [] if "faults" in without else g.faults
        g.scale = 0.0 if "scale" in without else g.scale
    spare_the_last(pair)
    rng = stream(seed, 4)
    wheels = Wheels(rng.choice([10.0, 20.0, 50.0]), rng.uniform(0, 0.02), rng.uniform(0.05, 0.4), rng.random() < 0.03)
    wheels = wheels if rng.random() < 0.6 and "wheels" not in without else None
    model = rng.random() < 0.25 and "model" not in without
    sent = rng.random() < (0.5 if thermal else 0.1) and "temperature" not in without
    if thermal:
        calm_hidden_heat(pair, thermal, sent)
    world = World(seed, duration_s, rest_s, math.floor(rest_s - rng.uniform(4, 10)), rest_dps, pair, thermal, sent, wheels, model,
                  draw_chapters(stream(seed, 5)))
    calm_hidden_drift(world)
    drift_words = [name + (" of both" if all(any(d.kind == name for d in g.drifts) for g in pair) else " of one") for name in drift_kinds]
    world.tags = {
        "motion": world.chapters, "drift": drift_words or ["none"], "fault": [fault],
        "pair": [" + ".join(sorted((g.kind for g in pair), key=list(CLASSES).index))],
        "bus": ["no wheel speed" if not wheels else "wheel speed, broken" if wheels.broken else "wheel speed"],
        "knowledge": ["model file" if model else "no model file"]
        + (["temperature"] if sent else []) + (["coarse frame"] if any(g.step_dps >= 0.06 for g in pair) else []),
    }
    return world


def limits_of(world):
    drifting = [bool(g.drifts) for g in world.gyros]
    longest = math.inf
    if any(drifting):
        rng = stream(world.seed, 6)
        longest = rng.uniform(120, COMMON_LAG_S) if all(drifting) else rng.uniform(180, 360)
    return motion.Limits(longest, CLEAR_OF_DRIFT * shared_drift_dps(world))


class Recording:
    """The recording of a world: the truth and the frames."""

    def __init__(self, world):
        self.world = world
        life = motion.live(stream(world.seed, 7), world.duration_s, world.rest_s, world.chapters, limits_of(world))
        self.told = life.told
        self.grid, self.rate, self.speed = life.finish()
        self.rate += world.rest_dps
        self.samples = [gyros.sample(g, stream(world.seed, 8 + k), world.duration_s, self.grid, self.rate, world.thermal)
                        for k, g in enumerate(world.gyros)]

    def truth(self, t):
        return np.interp(t, self.grid, self.rate)

    def sound(self):
        """Stretches in which both gyros are sound, from the end of the first rest on."""
        stretches = [(self.world.rest_s, self.world.duration_s)]
        for _, fault in self.world.faults():
            end = fault.end_s + (0.0 if fault.kind == "spike" else SOUND_AGAIN_S)
            stretches = [part for a, b in stretches for part in ((a, min(b, fault.begin_s)), (max(a, end), b)) if part[1] > part[0]]
        return stretches

    def description(self):
        w = self.world
        words = [f"{w.duration_s / 60:.0f} min: {w.rest_s:.0f} s of rest, {', '.join(w.chapters)}"] + self.told
        for k, g in enumerate(w.gyros, 1):
            words.append(f"gyro {k}: " + "; ".join([g.words()] + [d.words() for d in g.drifts] + fault_words(g.faults)))
        if w.thermal:
            words.append(f"temperature swings by {abs(w.thermal.swing_k):.0f} K in {w.thermal.half_s / 60:.0f} min")
        return words + w.tags["bus"] + w.tags["knowledge"]

    def frames(self):
        w = self.world
        for k, (t, raw) in enumerate(self.samples):
            payload = np.zeros((len(t), 8), np.uint8)
            payload[:, 0:4] = raw.astype("<i4").view(np.uint8).reshape(-1, 4)
            if w.temperature_sent:
                celsius = w.thermal.housing_c(t) if w.thermal else np.full(len(t), 31.0)
                steps = np.rint(celsius / w.gyros[k].temperature_step_k).astype("<i2")
                payload[:, 4:6] = steps.view(np.uint8).reshape(-1, 2)
            payload[:, 6] = np.arange(len(t)) & 255
            yield to_us(t), k, GYRO_IDS[k], payload
        if w.wheels:
            t = np.arange(w.wheels.phase_s, w.duration_s, 1 / w.wheels.rate_hz)
            speed = np.interp(t, self.grid, self.speed)
            speed[(speed < w.wheels.blind_below) | w.wheels.broken] = 0.0
            payload = np.zeros((len(t), 8), np.uint8)
            payload[:, 2:4] = np.rint(speed * 360).astype(">u2").view(np.uint8).reshape(-1, 2)
            yield to_us(t), 0, WHEEL_ID, payload

    def write(self, folder):
        """Writes vgyro.toml and the files that it names; returns the paths of configuration and log."""
        candump.write(folder / "in.log", list(self.frames()))
        (folder / "world.dbc").write_text(dbc_text(self.world))
        (folder / "vgyro.toml").write_text(config_text(self.world))
        if self.world.model:
            (folder / "model.toml").write_text(model_text(self.world))
        return folder / "vgyro.toml", folder / "in.log"


def to_us(t):
    return np.rint(t * 1e6).astype(np.int64)


def fault_words(faults):
    if len(faults) > 3:
        return [f"{len(faults)} times {faults[0].kind}, the first at {faults[0].begin_s:.0f} s"]
    return [f.words() for f in faults]


def dbc_text(world):
    text = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: SENSORS\n'
    for k, g in enumerate(world.gyros):
        text += (f"\nBO_ {GYRO_IDS[k]} YAW{k + 1}: 8 SENSORS\n"
                 f' SG_ Rate : 0|32@1- ({g.step_dps!r},0) [0|0] "deg/s" Vector__XXX\n'
                 f' SG_ Housing : 32|16@1- ({g.temperature_step_k!r},0) [-3000|3000] "degC" Vector__XXX\n'
                 f' SG_ Alive : 48|8@1+ (1,0) [0|255] "" Vector__XXX\n')
    return text + f'\nBO_ {WHEEL_ID} WHEELS: 8 SENSORS\n SG_ Speed : 23|16@0+ (0.01,0) [0|655.35] "km/h" Vector__XXX\n'


def config_text(world):
    text = ""
    for k in range(2):
        text += f'[[gyro]]\nname = "g{k + 1}"\nbus = "can{k}"\ndbc = "world.dbc"\nmessage = "YAW{k + 1}"\nrate = "Rate"\ncounter = "Alive"\n'
        text += 'temperature = "Housing"\n\n' if world.temperature_sent else "\n"
    if world.wheels:
        text += '[speed]\nbus = "can0"\ndbc = "world.dbc"\nmessage = "WHEELS"\nsignal = "Speed"\n\n'
    text += f"[calibration]\nrest_s = {float(world.calibration_s)!r}\nrate_dps = {float(world.rest_dps)!r}\n\n"
    text += '[corrector]\nmethod = "optimal"\n' + ('model = "model.toml"\n' if world.model else "")
    return text + '\n[output]\nbus = "can0"\n'


def model_text(world):
    text = "format = 1\n"
    for k, g in enumerate(world.gyros, 1):
        text += f'\n[[effect]]\ngyro = {k}\nkind = "white_noise"\ndensity_dps_rthz = {g.density!r}\n'
        text += f'\n[[effect]]\ngyro = {k}\nkind = "rate_random_walk"\ndensity_dps_rts = {g.walk!r}\n'
    return text
