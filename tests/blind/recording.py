"""A world as files: vgyro.toml, bench.dbc, model.toml and candump logs."""

import lzma
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "twin"))
import canlog  # noqa: E402

import motion  # noqa: E402
import world as truth  # noqa: E402

START_US = 1_700_000_000_000_000
LEFT_ID, RIGHT_ID, TABLE_ID, CUBE_ID = 0x121, 0x122, 0x1A0, 0x1B0
WHEEL_ID = 0x1C0
RATE_STEP_DPS, ACCELERATION_STEP_G, SPEED_STEP_KMH = 1e-6, 5e-4, 0.01
SPEED_HZ = 20.0

_DBC = """\
VERSION "blind"

NS_ :

BS_:

BU_: STAND

BO_ 289 LEFT_GYRO: 8 STAND
 SG_ YawRate : 0|32@1- (@RATE1,0) [-2000|2000] "deg/s" STAND
 SG_ Celsius : 32|16@1- (@CELSIUS1,0) [-60|150] "degC" STAND
 SG_ Alive : 48|8@1+ (1,0) [0|255] "" STAND
 SG_ Vcc : 56|8@1+ (0.02,0) [0|5.1] "V" STAND
 SG_ Roll : 48|16@1- (0.004,0) [-131|131] "deg/s" STAND

BO_ 290 RIGHT_GYRO: 8 STAND
 SG_ YawRate : 7|32@0- (@RATE2,0) [-2000|2000] "deg/s" STAND
 SG_ Celsius : 39|16@0- (@CELSIUS2,0) [-60|150] "degC" STAND
 SG_ Alive : 48|8@1+ (1,0) [0|255] "" STAND
 SG_ Vcc : 56|8@1+ (0.02,0) [0|5.1] "V" STAND
 SG_ Roll : 55|16@0- (0.004,0) [-131|131] "deg/s" STAND

BO_ 416 RATE_TABLE: 8 STAND
 SG_ Speed : 0|32@1- (1E-06,0) [-2000|2000] "deg/s" STAND

BO_ 432 CUBE: 8 STAND
 SG_ Ax : 0|16@1- (0.0005,0) [-16|16] "g" STAND
 SG_ Ay : 16|16@1- (0.0005,0) [-16|16] "g" STAND
 SG_ Az : 32|16@1- (0.0005,0) [-16|16] "g" STAND
"""


WHEEL = """
BO_ 448 WHEEL: 8 STAND
 SG_ Speed : 0|16@1+ (0.01,0) [0|400] "km/h" STAND
"""


def dbc_text(world):
    """The DBC file's text, with each gyro's own steps."""
    text = _DBC
    for number, g in enumerate(world.gyros, 1):
        text = text.replace(f"@RATE{number}", f"{g.rate_step:G}")
        text = text.replace(f"@CELSIUS{number}", f"{g.temperature_step:g}")
    return text + (WHEEL if world.speed else "")


def config_text(world):
    gyro = '[[gyro]]\nname = "{0}"\nbus = "{1}"\ndbc = "bench.dbc"\nmessage = "{2}_GYRO"\nrate = "YawRate"\n'
    # If a unit sends its roll rate, its frame has no room for a counter.
    gyro += 'temperature = "Celsius"\n' + ('rate_x = "Roll"\n' if world.roll else 'counter = "Alive"\n')
    gyro += 'supply_voltage = "Vcc"\n\n' if world.supplies else "\n"
    reference = '[reference]\nbus = "can0"\ndbc = "bench.dbc"\nmessage = "RATE_TABLE"\nrate = "Speed"\n\n'
    cube = '[accelerometer]\nbus = "can0"\ndbc = "bench.dbc"\nmessage = "CUBE"\nx = "Ax"\ny = "Ay"\nz = "Az"\n\n'
    wheel = '[speed]\nbus = "can0"\ndbc = "bench.dbc"\nmessage = "WHEEL"\nsignal = "Speed"\n\n'
    return (
        gyro.format("left", "can0", "LEFT")
        + gyro.format("right", "can1", "RIGHT")
        + (reference if world.reference else "")
        + (cube if world.accelerometer else "")
        + (wheel if world.speed else "")
        + f"[calibration]\nrest_s = {world.motion.rest_s - 2.0:.1f}\nrate_dps = {motion.EARTH_DPS}\n\n"
        + '[corrector]\nmethod = "optimal"\nwindow_s = 10.0\norder = 1\n\n[output]\nbus = "can0"\n'
    )


def effect_text(gyro, kind, parameters):
    quoted = lambda v: f'"{v}"' if isinstance(v, str) else repr(v)
    lines = "".join(f"{name} = {quoted(value)}\n" for name, value in parameters.items())
    return f'\n[[effect]]\ngyro = {gyro}\nkind = "{kind}"\n{lines}'


def model_text(world):
    """The model before: the known properties of the gyros."""
    text = "format = 1\n"
    for number, g in enumerate(world.gyros, 1):
        text += effect_text(number, "bias", {"value_dps": g.bias})
        text += effect_text(number, "white_noise", {"density_dps_rthz": g.density})
        text += effect_text(number, "rate_random_walk", {"density_dps_rts": g.walk})
        if g.markov_sigma > 0:
            text += effect_text(number, "gauss_markov", {"sigma_dps": g.markov_sigma, "tau_s": g.markov_tau})
        for sigma, tau_s in g.flicker_terms:
            text += effect_text(number, "gauss_markov", {"sigma_dps": sigma, "tau_s": tau_s})
        for cutoff_hz in g.filters_hz:
            text += effect_text(number, "bandwidth", {"cutoff_hz": cutoff_hz})
        if g.rate_step > RATE_STEP_DPS:
            text += effect_text(number, "quantization", {"step_dps": g.rate_step})
    return text


def _integers(values, step, kind):
    limits = np.iinfo(np.dtype(kind))
    return np.clip(np.round(values / step), limits.min, limits.max).astype(kind)


def _payloads(*columns):
    """Eight bytes a frame out of integer columns in their own byte order."""
    count = len(columns[0])
    whole = np.zeros((count, 8), dtype=np.uint8)
    used = 0
    for column in columns:
        width = column.dtype.itemsize
        whole[:, used : used + width] = column.view(np.uint8).reshape(count, width)
        used += width
    return whole


def _stream(bus, can_id, seconds, payloads):
    return canlog.Stream(bus, can_id, START_US + np.round(seconds * 1e6).astype(np.int64), payloads)


def streams(world, effects, strangers, recorded_temperatures, rng):
    out = []
    for gyro, can_id, order in ((1, LEFT_ID, "<"), (2, RIGHT_ID, ">")):
        t, stamps, counter, rate = truth.reading(world, gyro, effects, strangers, rng)
        columns = [
            _integers(rate, world.gyros[gyro - 1].rate_step, order + "i4"),
            _integers(recorded_temperatures[gyro - 1](t), world.gyros[gyro - 1].temperature_step, order + "i2"),
            (counter % 256).astype(np.uint8),
        ]
        if world.roll:
            roll = world.roll.value(t) + rng.standard_normal(len(t)) * world.roll.SIGMA_DPS
            columns[2] = _integers(roll, world.roll.STEP_DPS, order + "i2")
        if world.supplies:
            columns.append(_integers(world.supplies[gyro - 1].value(t), truth.surroundings.Supply.STEP_V, "u1"))
        payloads = _payloads(*columns)
        out.append(_stream(f"can{gyro - 1}", can_id, stamps, payloads))
    if world.reference:
        t = np.arange(int(world.motion.duration_s * world.reference_hz)) / world.reference_hz
        rate = world.motion.rate(t) + rng.standard_normal(len(t)) * world.reference_sigma
        out.append(_stream("can0", TABLE_ID, t, _payloads(_integers(rate, RATE_STEP_DPS, "<i4"))))
    if world.accelerometer:
        out.append(_acceleration(world, rng))
    if world.speed:
        t = 1e-4 + np.arange(int((world.motion.duration_s - 0.01) * SPEED_HZ)) / SPEED_HZ
        kmh = _integers(3.6 * world.motion.course.speed(t), SPEED_STEP_KMH, "<u2")
        out.append(_stream("can0", WHEEL_ID, t, _payloads(kmh)))
    return out


def _acceleration(world, rng):
    t = (
        2e-4
        + np.arange(int((world.motion.duration_s - 0.01) * truth.ACCELEROMETER_HZ)) / truth.ACCELEROMETER_HZ
    )
    a = world.acceleration.value(t) + rng.standard_normal((len(t), 3)) * truth.ACCELEROMETER_SIGMA_G
    axes = [np.ascontiguousarray(_integers(a[:, i], ACCELERATION_STEP_G, "<i2")) for i in range(3)]
    return _stream("can0", CUBE_ID, t, _payloads(*axes))


def write_log(path, recorded):
    with lzma.open(path, "wb", preset=0) as file:
        canlog.write(file, recorded)
