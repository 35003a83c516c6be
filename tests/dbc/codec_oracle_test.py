#!/usr/bin/python3
"""Compares what the product reads in DBC files and frames with what canmatrix, an independent implementation, reads:
random databases with random payloads, and every DBC file of the product.

usage: codec_oracle_test.py DECODE_TOOL DBC_FOLDER"""

import io
import json
import logging
import math
import random
import subprocess
import sys
import tempfile
import unittest
from contextlib import redirect_stdout
from pathlib import Path

logging.disable(logging.CRITICAL)
with redirect_stdout(io.StringIO()):  # canmatrix prints on stdout which other formats it lacks
    import canmatrix.formats

DECODE_TOOL = sys.argv[1] if len(sys.argv) > 2 else ""
DBC_FOLDER = Path(sys.argv[2]) if len(sys.argv) > 2 else Path()

SEED = 61482
DATABASES = 100
MESSAGES = 6
FRAMES = 40
SIZES = (1, 2, 3, 5, 6, 7, 8, 8, 8, 12, 16, 24, 32, 48, 64, 64)
SCALES = ("1", "0.5", ".25", "-1", "1E-006", "0.0078125", "-3.5e2", "5E-005", "1e+3", "+2")
OFFSETS = ("0", "-40", "1.5", "-163.84", "1E6", "-.5")

# raw * factor + offset in doubles against canmatrix's exact decimals: two roundings, each below one part in 2^53 of the
# largest term, and one in reading each decimal.
TOLERANCE = 5 * 2.0**-53


def run_tool(arguments, frames=None):
    done = subprocess.run([DECODE_TOOL, *map(str, arguments)], input=frames, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"decode_tool: {done.stderr}")
    return done.stdout


def load(path):
    with redirect_stdout(io.StringIO()) as said:
        database = canmatrix.formats.loadp_flat(str(path))
    if "error with line" in said.getvalue():
        raise AssertionError(f"canmatrix on {path}: {said.getvalue()}")
    return database


class RandomDatabase:
    def __init__(self, rng):
        self.rng = rng
        self.lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: ECU", ""]
        self.late = []
        self.sizes = {}

    def text(self):
        for number in range(MESSAGES):
            self.message(number)
        return "\n".join(self.lines + self.late) + "\n"

    def message(self, number):
        size = self.rng.choice(SIZES)
        if self.rng.random() < 0.5:
            file_id = 0x100 + number
        else:
            file_id = 0x80000000 | self.rng.randrange(0x800, 0x1FFFFFFF)
        self.sizes[file_id] = size
        self.lines += ["", f"BO_ {file_id} Message{number}: {size} ECU"]
        kind = self.rng.choice(("plain", "plain", "simple", "extended")) if size >= 5 else "plain"
        if kind == "plain":
            for index in range(self.rng.randrange(1, 9)):
                self.signal(file_id, size, f"Signal{index}", "")
        else:
            self.multiplexed(file_id, size, kind == "extended")

    def multiplexed(self, file_id, size, extended):
        self.lines.append(' SG_ Outer M : 0|3@1+ (1,0) [0|0] "" ECU')
        for value in range(0, 8, 2):
            self.signal(file_id, size, f"Outer{value}", f"m{value} ")
            if extended:
                self.late.append(f"SG_MUL_VAL_ {file_id} Outer{value} Outer {value}-{value + 1};")
        self.signal(file_id, size, "Always", "")
        if not extended:
            return
        # canmatrix supports one inner multiplexor for each value of the outer one, so there is only one.
        self.lines.append(' SG_ Inner m2M : 3|2@1+ (1,0) [0|0] "" ECU')
        self.late.append(f"SG_MUL_VAL_ {file_id} Inner Outer 2-3, 6-6;")
        for value in range(3):
            self.signal(file_id, size, f"Inner{value}", f"m{value} ")
            self.late.append(f"SG_MUL_VAL_ {file_id} Inner{value} Inner {value}-{value};")

    def signal(self, file_id, size, name, multiplex):
        bits = size * 8
        floats = [length for length in (32, 64) if length <= bits]
        is_float = bool(floats) and self.rng.random() < 0.2
        length = self.rng.choice(floats) if is_float else self.rng.randrange(1, min(bits, 64) + 1)
        place = self.rng.randrange(0, bits - length + 1)
        intel = self.rng.random() < 0.5
        start = place if intel else place // 8 * 8 + 7 - place % 8
        sign = "-" if is_float or self.rng.random() < 0.5 else "+"
        scale, offset = self.rng.choice(SCALES), self.rng.choice(OFFSETS)
        self.lines.append(f' SG_ {name} {multiplex}: {start}|{length}@{int(intel)}{sign} ({scale},{offset}) [-1|1] '
                          f'"{self.rng.choice(("", "deg/s", "°/s", "µg"))}" ECU')
        if is_float:
            self.late.append(f"SIG_VALTYPE_ {file_id} {name} : {1 if length == 32 else 2};")

    def frames(self):
        for file_id, size in self.sizes.items():
            for index in range(FRAMES):
                payload = bytes([(0x00, 0xFF)[index]]) * size if index < 2 else self.rng.randbytes(size)
                name = f"{file_id & 0x1FFFFFFF:08X}" if file_id & 0x80000000 else f"{file_id:03X}"
                yield file_id, payload, f"{name}#{payload.hex()}"


class CodecOracle(unittest.TestCase):
    def compare_value(self, ours, decoded, what):
        raw, value = ours[0], float(ours[1])
        signal = decoded.signal
        if signal.is_float:
            theirs = decoded.raw_value * float(signal.factor) + float(signal.offset)
        else:
            theirs = float(decoded.phys_value)
            bits = decoded.raw_value
            self.assertEqual(raw, bits - (1 << 64) if bits >= 1 << 63 else bits, what)
        if not math.isfinite(theirs):
            self.assertEqual(repr(value).lstrip("-"), repr(theirs).lstrip("-"), what)
            return
        largest = max(abs(float(decoded.raw_value) * float(signal.factor)), abs(float(signal.offset)))
        self.assertLessEqual(abs(value - theirs), TOLERANCE * largest, what)

    def compare_layout(self, path):
        ours = json.loads(run_tool([path, "--layout"]))
        theirs = load(path)
        self.assertEqual(sorted(ours["messages"]), sorted(frame.name for frame in theirs.frames))
        for frame in theirs.frames:
            message = ours["messages"][frame.name]
            self.assertEqual(message["id"], frame.arbitration_id.id)
            self.assertEqual(message["extended"], frame.arbitration_id.extended)
            self.assertEqual(message["size"], frame.size)
            self.assertEqual(message["j1939"], bool(frame.is_j1939))
            self.assertEqual(message["comment"], frame.comment or "")
            self.assertEqual(sorted(message["signals"]), sorted(signal.name for signal in frame.signals))
            for signal in frame.signals:
                self.compare_signal(message["signals"][signal.name], signal, f"{path} {frame.name} {signal.name}")
        return ours, theirs

    def compare_signal(self, ours, signal, what):
        start = signal.get_startbit(bit_numbering=1)
        self.assertEqual(ours["start_bit"], start, what)
        self.assertEqual(ours["length"], signal.size, what)
        self.assertEqual(ours["intel"], signal.is_little_endian, what)
        self.assertEqual(ours["float"], signal.is_float, what)
        if not signal.is_float:
            self.assertEqual(ours["signed"], signal.is_signed, what)
        self.assertEqual(ours["factor"], float(signal.factor), what)
        self.assertEqual(ours["offset"], float(signal.offset), what)
        self.assertEqual(ours["minimum"], float(signal.min), what)
        self.assertEqual(ours["maximum"], float(signal.max), what)
        self.assertEqual(ours["unit"], signal.unit, what)
        self.assertEqual(ours["comment"], signal.comment or "", what)
        self.assertEqual(ours["labels"], {str(raw): text for raw, text in signal.values.items()}, what)

    def test_random_databases_read_and_decode_as_canmatrix_does(self):
        print(f"seed {SEED}")
        rng = random.Random(SEED)
        compared = 0
        with tempfile.TemporaryDirectory() as folder:
            for number in range(DATABASES):
                database = RandomDatabase(rng)
                path = Path(folder) / f"random{number}.dbc"
                path.write_bytes(database.text().encode("cp1252"))
                _, theirs = self.compare_layout(path)
                compared += self.compare_frames(path, theirs, list(database.frames()))
        print(f"{compared} values compared")
        self.assertGreater(compared, DATABASES * MESSAGES * FRAMES)

    def compare_frames(self, path, theirs, frames):
        compared = 0
        answers = run_tool([path], "".join(line + "\n" for _, _, line in frames)).splitlines()
        for (file_id, payload, line), answer in zip(frames, answers, strict=True):
            ours = json.loads(answer)
            frame = theirs.frame_by_id(canmatrix.ArbitrationId.from_compound_integer(file_id))
            decoded = frame.decode(payload)
            self.assertEqual(sorted(ours), sorted(decoded), f"{path.read_text('cp1252')}\n{line}")
            for name, value in decoded.items():
                self.compare_value(ours[name], value, f"{path.name} {line} {name}")
                compared += 1
        return compared

    def test_canmatrix_reads_the_products_own_files_in_the_same_way(self):
        files = sorted(DBC_FOLDER.rglob("*.dbc"))
        self.assertGreaterEqual(len(files), 12)
        for path in files:
            with self.subTest(path.name):
                ours, _ = self.compare_layout(path)
                self.assertEqual(ours["diagnostics"], [])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]])
