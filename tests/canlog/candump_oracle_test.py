#!/usr/bin/python3
"""Compares the log reader and writer with independent ones: python-can's, and the parser and printer of can-utils
itself, which are in log2asc (log in) and asc2log (log out).

usage: candump_oracle_test.py LOG_TOOL"""

import io
import json
import random
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from can import Message
from can.io.canutils import CanutilsLogReader, CanutilsLogWriter

LOG_TOOL = sys.argv[1] if len(sys.argv) > 1 else ""

SEED = 20240605
FRAMES = 5000
FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
START_NS = 1_700_000_000_999_000_000
# python-can keeps seconds as a float, with a step of 0.24 µs at this date.
PYTHON_CAN_NS = 300


def run(arguments, given=None):
    done = subprocess.run(list(map(str, arguments)), input=given, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{arguments}: {done.stderr}")
    return done.stdout


def read_with_product(text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "read.log"
        path.write_text(text)
        *records, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
    return records, counts


def write_with_product(records):
    return run([LOG_TOOL, "write"], "".join(json.dumps(r) + "\n" for r in records))


def random_record(rng, ns, direction):
    fd = rng.random() < 0.3
    remote = not fd and rng.random() < 0.1
    extended = rng.random() < 0.5
    length = rng.choice(FD_SIZES) if fd else rng.randrange(9)
    return {
        "ns": ns,
        "interface": rng.choice(("can0", "can1")),
        "digits": 6,
        "direction": direction,
        "id": rng.randrange(1 << (29 if extended else 11)),
        "length": length,
        "raw_dlc": 0,
        "extended": extended,
        "remote": remote,
        "error": False,
        "fd": fd,
        "brs": fd and rng.random() < 0.5,
        "esi": fd and rng.random() < 0.5,
        "data": [] if remote else list(rng.randbytes(length)),
    }


def random_records(seed, directions=("R", "T")):
    print(f"seed {seed}")
    rng = random.Random(seed)
    ns, records = START_NS, []
    for _ in range(FRAMES):
        records.append(random_record(rng, ns, rng.choice(directions)))
        ns += rng.choice((0, 1000, 250_000, 10_000_000, 1_000_000_000))
    return records


def as_message(record):
    return Message(
        timestamp=record["ns"] / 1e9,
        channel=record["interface"],
        arbitration_id=record["id"],
        is_extended_id=record["extended"],
        is_remote_frame=record["remote"],
        is_fd=record["fd"],
        bitrate_switch=record["brs"],
        error_state_indicator=record["esi"],
        is_rx=record["direction"] != "T",
        dlc=record["length"],
        data=None if record["remote"] else bytes(record["data"]),
        check=True,
    )


def as_record(message):
    return {
        "ns": round(message.timestamp * 1e6) * 1000,
        "interface": message.channel,
        "digits": 6,
        "direction": "R" if message.is_rx else "T",
        "id": message.arbitration_id,
        "length": message.dlc,
        "raw_dlc": 0,
        "extended": message.is_extended_id,
        "remote": message.is_remote_frame,
        "error": message.is_error_frame,
        "fd": message.is_fd,
        "brs": message.bitrate_switch,
        "esi": message.error_state_indicator,
        "data": list(message.data),
    }


def written_by_python_can(messages):
    class Text(io.StringIO):
        def close(self):  # the writer closes its file, and the text with it
            pass

    text = Text()
    writer = CanutilsLogWriter(text)
    for message in messages:
        writer.on_message_received(message)
    writer.stop()
    return text.getvalue()


def read_by_python_can(text):
    return list(CanutilsLogReader(io.StringIO(text)))


class PythonCan(unittest.TestCase):
    def test_the_product_reads_what_python_can_writes(self):
        records = random_records(SEED)
        ours, counts = read_with_product(written_by_python_can(map(as_message, records)))
        self.assertEqual(counts, {"frames": FRAMES, "xl": 0, "other": 0, "malformed": 0})
        for record, read in zip(records, ours, strict=True):
            if record["remote"]:
                record["length"] = 0  # python-can writes "R" without the length, unlike can-utils
            self.assertEqual(read, record)

    def test_python_can_reads_what_the_product_writes(self):
        records = random_records(SEED + 1)
        theirs = read_by_python_can(write_with_product(records))
        self.assertEqual([as_record(m) for m in theirs], records)

    def test_python_can_reads_nine_digits(self):
        records = random_records(SEED + 2)
        for index, record in enumerate(records):
            record["ns"] += index % 1000
            record["digits"] = 9
        for record, message in zip(records, read_by_python_can(write_with_product(records)), strict=True):
            self.assertLess(abs(message.timestamp - record["ns"] / 1e9), PYTHON_CAN_NS * 1e-9)

    def test_the_product_reads_python_cans_error_frames_and_numbered_channels(self):
        # python-can keeps nothing of an error frame but its kind, and writes no direction for it.
        text = written_by_python_can([Message(timestamp=1.5, channel=2, is_error_frame=True)])
        self.assertEqual(text, "(1.500000) can2 20000080#\n")
        ours, _ = read_with_product(text)
        self.assertEqual(
            [(r["ns"], r["interface"], r["error"], r["extended"], r["id"], r["length"]) for r in ours],
            [(1_500_000_000, "can2", True, False, 0x80, 0)],
        )

    def test_both_read_error_frames_of_the_class_that_python_can_knows(self):
        record = random_record(random.Random(SEED), START_NS, "")
        record |= {"id": 0x80, "extended": False, "error": True, "fd": False, "remote": False, "length": 8}
        record |= {"data": [0, 0, 0, 0, 0, 0, 0, 0], "brs": False, "esi": False}
        text = write_with_product([record])
        self.assertTrue(read_by_python_can(text)[0].is_error_frame)
        self.assertEqual(read_with_product(text)[0], [record])
        # python-can turns error frames of every other class into data frames with an extended identifier; can-utils
        # and the product do not: an error frame must never reach a signal.
        text = write_with_product([record | {"id": 0x4}])
        self.assertFalse(read_by_python_can(text)[0].is_error_frame)
        self.assertTrue(read_with_product(text)[0][0]["error"])

    def test_the_product_reads_what_python_can_chokes_on(self):
        # Forms of newer can-utils that python-can 4.1 does not support.
        for text in ("(1.000000) can0 123#1122334455667788_B\n", "DROPCOUNT: dropped 1 CAN frame\n",
                     "(1.000000) can0 123##AAABB\n"):
            with self.subTest(text), self.assertRaises(ValueError):
                read_by_python_can(text)
            self.assertEqual(read_with_product(text)[1]["malformed"], 0, text)


def through_can_utils(text):
    """The log after log2asc and asc2log, which change its date but not its intervals."""
    with tempfile.TemporaryDirectory() as folder:
        log, asc, back = (Path(folder) / name for name in ("in.log", "mid.asc", "out.log"))
        log.write_text(text)
        run(["log2asc", "-I", log, "-O", asc, "can0", "can1"])
        run(["asc2log", "-I", asc, "-O", back])
        return back.read_text()


def without_stamp(line):
    return line.split(") ", 1)[1]


class CanUtils(unittest.TestCase):
    def test_can_utils_prints_the_same_text_for_what_the_product_wrote(self):
        text = write_with_product(random_records(SEED + 3))
        back = through_can_utils(text)
        self.assertEqual([without_stamp(line) for line in back.splitlines()],
                         [without_stamp(line) for line in text.splitlines()])

    def test_the_product_reads_what_can_utils_prints(self):
        records = random_records(SEED + 4)
        ours, counts = read_with_product(through_can_utils(write_with_product(records)))
        self.assertEqual(counts, {"frames": FRAMES, "xl": 0, "other": 0, "malformed": 0})
        shift = ours[0]["ns"] - records[0]["ns"]
        for record, read in zip(records, ours, strict=True):
            self.assertEqual(read, record | {"ns": record["ns"] + shift})

    def test_can_utils_reads_a_line_without_direction_as_received(self):
        records = random_records(SEED + 5, directions=("",))[:100]
        back = through_can_utils(write_with_product(records))
        self.assertEqual({line.split()[-1] for line in back.splitlines()}, {"R"})

    def test_can_utils_and_the_product_read_the_same_bytes_in_odd_spellings(self):
        odd = ("(1.000000) can0 12a#de.ad.BEEF R\n(1.100000) can0 00000123##5aabb R\n(1.200000) can0 123#r5 R\n"
               "(1.300000) can0 123#1122334455667788_B T\n(1.400000)  can1  7FF# R\n")
        theirs, _ = read_with_product(through_can_utils(odd))
        ours, counts = read_with_product(odd)
        self.assertEqual(counts["frames"], 5)
        self.assertEqual(ours[3]["raw_dlc"], 11)
        ours[3]["raw_dlc"] = 0  # the ASC format between the two tools cannot hold it
        shift = theirs[0]["ns"] - ours[0]["ns"]
        self.assertEqual(theirs, [r | {"ns": r["ns"] + shift} for r in ours])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]])
