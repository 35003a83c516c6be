#!/usr/bin/python3
"""Cost of three axes relative to one: `vgyro replay` on one log of two whole units, with all their axes and with one
of them as a pair of single gyros, alternating in the same run, each pinned to one core. Prints Markdown."""

import argparse
import os
import random
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import command_line

SOURCE = Path(__file__).resolve().parents[1]
SAMPLES = 600_000  # of each unit
RATE_HZ = 500
REST_S = 60
SEED = 5
START_US = 1_700_000_000_000_000
NOISE_DPS = 0.02
BIAS_DPS = ((0.1, -0.2, 0.3), (-0.07, 0.15, -0.25))
AXES_MOST = 3.2  # largest ratio to the CPU time of one axis

MESSAGE = """\
BO_ {id} {name}: 16 RIG
 SG_ X : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Y : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Z : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG
"""
DBC = 'VERSION ""\n\nBU_: RIG\n\n' + MESSAGE.format(id=257, name="IMU_A") + "\n" + MESSAGE.format(id=258, name="IMU_B")
THREE, ONE = 'rate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\n', 'rate = "Z"\n'
VARIANTS = {
    "one axis": (ONE, "", "0.0"),
    "three axes": (THREE, "", "[0.0, 0.0, 0.0]"),
    "three axes, one unit turned by 20 deg": (THREE, "mount = [20, 0, 0]\n", "[0.0, 0.0, 0.0]"),
    "three axes, `fd = true`": (THREE, "", "[0.0, 0.0, 0.0]"),
}


def config_of(name):
    axes, mount, rest = VARIANTS[name]
    gyros = "".join(f'[[gyro]]\nname = "{unit}"\nbus = "can0"\ndbc = "units.dbc"\nmessage = "IMU_{unit}"\n{axes}'
                    f'counter = "Counter"\n{mount if unit == "B" else ""}' for unit in "AB")
    fd = "fd = true\n" if "fd" in name else ""
    return f'{gyros}[calibration]\nrest_s = {REST_S}\nrate_dps = {rest}\n[output]\nbus = "can0"\n{fd}'


def make_log(path):
    """A rest, then turns about all axes. Cached: the same name always holds the same frames."""
    if path.exists():
        return
    print(f"making {path.name} …", file=sys.stderr)
    path.parent.mkdir(parents=True, exist_ok=True)
    draw = random.Random(SEED)
    part = path.with_suffix(".part")
    step_us = 1_000_000 // RATE_HZ
    with part.open("w", encoding="ascii") as log:
        rates = [0.0, 0.0, 0.0]
        for n in range(SAMPLES):
            if n > (REST_S + 5) * RATE_HZ:
                # Turns that begin and end within seconds.
                rates = [0.999 * rate + draw.gauss(0.0, size) for rate, size in zip(rates, (0.02, 0.02, 0.2))]
            for unit, (bias, late_us) in enumerate(zip(BIAS_DPS, (0, 700))):
                raw = [round((rate + b + draw.gauss(0.0, NOISE_DPS)) * 1e6) for rate, b in zip(rates, bias)]
                us = START_US + n * step_us + late_us
                data = struct.pack("<iiiB3x", *raw, n % 256).hex().upper()
                log.write(f"({us // 1_000_000}.{us % 1_000_000:06}) can0 {0x101 + unit:03X}##1{data}\n")
    part.rename(path)


def cpu_s(vgyro, config, log, core):
    process = subprocess.Popen(["taskset", "-c", str(core), str(vgyro), "replay", "--config", str(config), "-q", "-o", "/dev/null", str(log)])
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise RuntimeError(f"{config}: wait status {status}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=command_line.file_name, default=SOURCE / "build/release/bin", help="where the programs are")
    parser.add_argument("--cache", type=command_line.file_name, default=SOURCE / "build/bench", help="where the log is kept")
    parser.add_argument("--rounds", type=command_line.whole(1, 1000), default=5)
    parser.add_argument("--core", type=command_line.whole(0, 4095), help="default: the last one")
    a = parser.parse_args()
    core = sorted(os.sched_getaffinity(0))[-1] if a.core is None else a.core
    log = Path(a.cache) / "units.log"
    make_log(log)
    best, memory_kb = {}, {}
    with tempfile.TemporaryDirectory(prefix="vgyro-") as folder:
        (Path(folder) / "units.dbc").write_text(DBC, encoding="ascii")
        configs = {}
        for place, name in enumerate(VARIANTS):
            configs[name] = Path(folder) / f"{place}.toml"
            configs[name].write_text(config_of(name), encoding="ascii")
        for _ in range(a.rounds):
            for name, config in configs.items():
                seconds, kb = cpu_s(Path(a.bin) / "vgyro", config, log, core)
                best[name] = min(best.get(name, seconds), seconds)
                memory_kb[name] = max(memory_kb.get(name, kb), kb)
    one = best["one axis"]
    print(f"{2 * SAMPLES / 1e6:g} million frames of two units at {RATE_HZ} Hz, best of {a.rounds}.\n")
    print("| `vgyro replay -o /dev/null` | CPU, s | of one axis | peak memory, MB |\n|---|---:|---:|---:|")
    for name, seconds in best.items():
        print(f"| {name} | {seconds:.2f} | {seconds / one:.2f} | {memory_kb[name] / 1024:.1f} |")
    print(f"\nWanted: three axes below {AXES_MOST} times one.")


if __name__ == "__main__":
    main()
