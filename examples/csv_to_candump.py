#!/usr/bin/python3
"""Turns two recordings of a gyro, as CSV files, into a candump log of the frames in examples/twin.dbc,
so that any public or own data can be replayed: vgyro replay --config examples/twin.toml OUT.log

Each CSV file has a header line and the columns t_s and rate (in deg/s, or rad/s with --rad), and
optionally temperature_c. Other columns are passed over."""

import argparse
import csv
import math
import struct
import sys


def read(path, scale):
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        missing = {"t_s", "rate"} - set(rows.fieldnames or [])
        if missing:
            sys.exit(f"{path}: the header has no column {', '.join(sorted(missing))}")
        for line, row in enumerate(rows, 2):
            try:
                yield float(row["t_s"]), float(row["rate"]) * scale, float(row.get("temperature_c") or 25.0)
            except ValueError as error:
                sys.exit(f"{path}:{line}: {error}")


def frames(path, scale, bus, can_id, byte_order):
    """As twin.dbc has them: rate 32 bits x 1e-6 deg/s, temperature 16 bits x 0.01 degC, counter 8 bits."""
    for counter, (t_s, rate, temperature) in enumerate(read(path, scale)):
        raw = max(-(2**31), min(2**31 - 1, round(rate * 1e6)))
        degrees = max(-(2**15), min(2**15 - 1, round(temperature * 100)))
        payload = struct.pack(byte_order + "ih", raw, degrees) + bytes((counter % 256, 0))
        yield t_s, f"{bus} {can_id:03X}#{payload.hex().upper()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gyro_a")
    parser.add_argument("gyro_b")
    parser.add_argument("-o", "--output", default="-", help="candump log; - is standard output")
    parser.add_argument("--rad", action="store_true", help="the rates are in rad/s")
    options = parser.parse_args()
    scale = math.degrees(1.0) if options.rad else 1.0
    both = list(frames(options.gyro_a, scale, "can0", 0x101, "<"))
    both += frames(options.gyro_b, scale, "can1", 0x102, ">")
    both.sort(key=lambda item: item[0])
    out = sys.stdout if options.output == "-" else open(options.output, "w", encoding="ascii")
    with out:
        out.writelines(f"({t_s:017.6f}) {text}\n" for t_s, text in both)


if __name__ == "__main__":
    main()
