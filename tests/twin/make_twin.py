#!/usr/bin/python3
"""Makes a recording of two vibratory gyros on a rate table, as in the paper's experiment: a candump
log of GYRO_A (can0) and GYRO_B (can1), frames as in examples/twin.dbc.

Each gyro reads rate + bias + random walk + white noise. N is the angle random walk coefficient (IEEE
952; two-sided spectral density N²): one sample of dt seconds has sigma N/sqrt(dt). K is the rate
random walk coefficient: the walk's step over dt has sigma K·sqrt(dt)."""

import argparse
import dataclasses
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402

EARTH_DPS = 0.0032
RATE_STEP_DPS = 1e-6
TEMPERATURE_STEP_K = 0.01
RAMP_S = 2.0
RUN_S = {"rest": 120.0, "turn": 900.0, "drive": 120.0}


@dataclasses.dataclass(frozen=True)
class Gyro:
    bus: str
    can_id: int
    motorola: bool
    bias_dps: float
    white_dps_rthz: float  # N
    walk_dps_rts: float  # K
    temperature_c: float


GYROS = (
    Gyro("can0", 0x101, False, 0.0330, 8e-5, 5e-7, 24.0),
    Gyro("can1", 0x102, True, -0.0074, 3e-4, 2e-6, 26.0),
)


@dataclasses.dataclass(frozen=True)
class Options:
    scenario: str = "rest"
    rest_s: float = 60.0  # rest before the run, for the calibration
    run_s: float | None = None
    rate_hz: float = 500.0
    turn_dps: float = 50.0
    phase_s: float = 0.3e-3
    jitter_s: float = 0.0
    start_s: int = 1_700_000_000
    seed: int = 1

    @property
    def length_s(self):
        run_s = RUN_S[self.scenario] if self.run_s is None else self.run_s
        return self.rest_s + run_s + (RAMP_S if self.scenario == "turn" else 0.0)


@dataclasses.dataclass(frozen=True)
class Twin:
    streams: list
    t_s: tuple  # per gyro: true instants of measurement, from the start
    rate_dps: tuple  # per gyro: true rate at these
    reading_dps: tuple  # per gyro: as in the frames


def smooth_step(x):
    """0 below 0, 1 above 1, and between them with continuous acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0)


def drive_rate(t, top_dps):
    """A repeated minute: a left turn, a right turn, and a slalom at a fifth of their rate."""
    u = np.mod(t, 60.0)

    def bump(begin, length):
        inside = (u >= begin) & (u < begin + length)
        return np.where(inside, np.sin(np.pi * (u - begin) / length) ** 2, 0.0)

    slalom = 0.2 * bump(45.0, 15.0) * np.sin(2.0 * np.pi * 0.4 * (u - 45.0))
    return np.where(t > 0.0, top_dps * (bump(0.0, 20.0) - bump(22.0, 20.0) + slalom), 0.0)


def true_rate(t, options):
    """The rate about the gyros' axis, including the Earth's, t seconds after the start."""
    after = t - options.rest_s
    if options.scenario == "rest":
        return np.full_like(t, EARTH_DPS)
    if options.scenario == "turn":
        return EARTH_DPS + options.turn_dps * smooth_step(after / RAMP_S)
    return EARTH_DPS + drive_rate(after, options.turn_dps)


def stamps(t, options, rng):
    """Stamps in µs: late by the jitter, never out of order on one bus."""
    late = np.abs(rng.standard_normal(len(t))) * options.jitter_s if options.jitter_s > 0 else 0.0
    us = np.rint((t + late) * 1e6).astype(np.int64)
    count = np.arange(len(us))
    return options.start_s * 1_000_000 + np.maximum.accumulate(us - count) + count


def payloads(rate_raw, temperature_raw, counter, motorola):
    out = np.zeros((len(rate_raw), 8), dtype=np.uint8)
    order = ">" if motorola else "<"
    out[:, 0:4] = rate_raw.astype(order + "i4").view(np.uint8).reshape(-1, 4)
    out[:, 4:6] = temperature_raw.astype(order + "i2").view(np.uint8).reshape(-1, 2)
    out[:, 6] = counter & 0xFF
    return out


def simulate(options, gyros=GYROS):
    dt = 1.0 / options.rate_hz
    count = int(round(options.length_s * options.rate_hz))
    streams, times, truths, readings = [], [], [], []
    for k, (gyro, seed) in enumerate(zip(gyros, np.random.SeedSequence(options.seed).spawn(len(gyros)))):
        rng = np.random.default_rng(seed)
        t = np.arange(count) * dt + k * options.phase_s
        truth = true_rate(t, options)
        white = rng.standard_normal(count) * (gyro.white_dps_rthz / np.sqrt(dt))
        walk = np.cumsum(rng.standard_normal(count)) * (gyro.walk_dps_rts * np.sqrt(dt))
        raw = np.rint((truth + gyro.bias_dps + walk + white) / RATE_STEP_DPS).astype(np.int64)
        temperature = gyro.temperature_c + 3.0 * (1.0 - np.exp(-t / 600.0))
        frames = payloads(raw, np.rint(temperature / TEMPERATURE_STEP_K), np.arange(count), gyro.motorola)
        streams.append(canlog.Stream(gyro.bus, gyro.can_id, stamps(t, options, rng), frames))
        times.append(t)
        truths.append(truth)
        readings.append(raw * RATE_STEP_DPS)
    return Twin(streams, tuple(times), tuple(truths), tuple(readings))


def write_truth(path, twin):
    """The true rate at gyro A's instants, in the form of a motion profile."""
    with open(path, "w", encoding="ascii") as file:
        file.write("t_s,rate_dps\n")
        np.savetxt(file, np.stack([twin.t_s[0], twin.rate_dps[0]], axis=1), fmt="%.6f,%.9f")


def parse_arguments():
    default = Options()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-o", "--output", required=True, help="candump log; .xz compresses; - is stdout")
    p.add_argument("--truth", help="CSV with the true rate: t_s,rate_dps")
    p.add_argument("--scenario", choices=sorted(RUN_S), default=default.scenario)
    p.add_argument("--rest", dest="rest_s", type=float, default=default.rest_s, metavar="SECONDS",
                   help="at rest before the run (default %(default)s)")
    p.add_argument("--run", dest="run_s", type=float, metavar="SECONDS",
                   help=f"the run itself (default {RUN_S})")
    p.add_argument("--rate", dest="rate_hz", type=float, default=default.rate_hz, metavar="HZ")
    p.add_argument("--turn", dest="turn_dps", type=float, default=default.turn_dps, metavar="DEG/S",
                   help="rate of `turn`, largest rate of `drive` (default %(default)s)")
    p.add_argument("--phase-ms", type=float, default=default.phase_s * 1e3,
                   help="gyro B measures this much after gyro A (default %(default)s)")
    p.add_argument("--jitter-us", type=float, default=default.jitter_s * 1e6,
                   help="sigma of the stamps' random lateness (default %(default)s)")
    p.add_argument("--start", dest="start_s", type=int, default=default.start_s,
                   help="stamp of the first frame, whole seconds (default %(default)s)")
    p.add_argument("--seed", type=int, default=default.seed)
    a = p.parse_args()
    options = Options(a.scenario, a.rest_s, a.run_s, a.rate_hz, a.turn_dps, a.phase_ms * 1e-3,
                      a.jitter_us * 1e-6, a.start_s, a.seed)
    if options.rate_hz <= 0 or options.length_s <= 0 or not 0 <= options.start_s < 10**10:
        p.error("rate and length must be positive, the start must have at most ten digits")
    return a, options


def main():
    arguments, options = parse_arguments()
    twin = simulate(options)
    if arguments.output == "-":
        lines = canlog.write(sys.stdout.buffer, twin.streams)
    else:
        with canlog.open_out(arguments.output) as file:
            lines = canlog.write(file, twin.streams)
    if arguments.truth:
        write_truth(arguments.truth, twin)
    print(f"{arguments.output}: {lines} frames, {options.scenario}, {options.length_s:g} s, "
          f"seed {options.seed}", file=sys.stderr)


if __name__ == "__main__":
    main()
