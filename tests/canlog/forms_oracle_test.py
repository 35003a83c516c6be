#!/usr/bin/python3
"""Compares the readers of text forms, and the ASC writer, with independent ones: python-can's writers and readers, and
log2asc, log2long and asc2log of can-utils. Each log reads back equal to its candump twin, to the resolution of its stamps.

usage: forms_oracle_test.py LOG_TOOL VGYRO"""

import json
import os
import random
import subprocess
import sys
import tempfile
import unittest
from datetime import datetime
from pathlib import Path
from unittest import mock

import can
from can.io.asc import ASCReader, ASCWriter
from can.io.csv import CSVWriter
from can.io.trc import TRCWriter

LOG_TOOL, VGYRO = sys.argv[1:3] if len(sys.argv) > 2 else ("", "")

SEED = 20261129
FRAMES = 2000
FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
START_NS = 1_700_000_000_250_000_000
FLAGS = ("extended", "remote", "fd", "brs", "esi")


def run(arguments, given=None, zone="UTC"):
    environment = {**os.environ, "TZ": zone, "LC_ALL": "C"}
    done = subprocess.run(list(map(str, arguments)), input=given, capture_output=True, check=False, env=environment)
    if done.returncode != 0:
        raise AssertionError(f"{arguments}: {done.stderr.decode()}")
    return done.stdout


def random_records(seed, fd=True, remote=True):
    print(f"seed {seed}")
    rng = random.Random(seed)
    ns, records = START_NS, []
    for _ in range(FRAMES):
        is_fd = fd and rng.random() < 0.3
        is_remote = remote and not is_fd and rng.random() < 0.1
        extended = rng.random() < 0.5
        length = rng.choice(FD_SIZES) if is_fd else rng.randrange(9)
        records.append({
            "ns": ns, "bus": rng.randrange(2), "id": rng.randrange(1 << (29 if extended else 11)), "extended": extended,
            "remote": is_remote, "fd": is_fd, "brs": is_fd and rng.random() < 0.5, "esi": is_fd and rng.random() < 0.5,
            "length": length, "data": b"" if is_remote else rng.randbytes(length), "rx": rng.random() < 0.7})
        ns += rng.choice((0, 1000, 250_000, 10_000_000, 1_000_000_000))
    return records


def candump_line(record, direction=True):
    head = f"({record['ns'] // 10**9}.{record['ns'] % 10**9 // 1000:06}) can{record['bus']} "
    head += f"{record['id']:08X}" if record["extended"] else f"{record['id']:03X}"
    tail = (" R" if record["rx"] else " T") if direction else ""
    if record["fd"]:
        return f"{head}##{record['brs'] + 2 * record['esi']:X}{record['data'].hex().upper()}{tail}\n"
    if record["remote"]:
        return f"{head}#R{record['length'] or ''}{tail}\n"
    return f"{head}#{record['data'].hex().upper()}{tail}\n"


def as_message(record):
    return can.Message(
        timestamp=record["ns"] / 1e9, channel=record["bus"], arbitration_id=record["id"], is_extended_id=record["extended"],
        is_remote_frame=record["remote"], is_fd=record["fd"], bitrate_switch=record["brs"],
        error_state_indicator=record["esi"], is_rx=record["rx"], dlc=record["length"],
        data=None if record["remote"] else record["data"], check=True)


class Bench(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def read(self, path):
        *records, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
        self.assertEqual(counts["malformed"], 0)
        return records

    def written_by(self, writer_class, name, records):
        path = self.folder / name
        # python-can's ASCWriter dates the file by the clock and cuts the microseconds with replace(): where their last
        # digits also stand in the year, it loses these too (python-can 4.1.0), and the date is not readable.
        with mock.patch("can.io.asc.datetime", wraps=datetime) as clock:
            clock.now.return_value = datetime(2026, 1, 2, 3, 4, 5, 123456)
            writer = writer_class(str(path))
        for record in records:
            writer.on_message_received(as_message(record))
        writer.stop()
        return path

    def twin(self, records):
        path = self.folder / "twin.log"
        path.write_text("".join(map(candump_line, records)))
        return path

    def expect(self, path, records, but=(), offset_ns=0, resolution_ns=0):
        """Expects the product to read the same in `path` as in the candump twin, except for the fields in `but`."""
        ours, twins = self.read(path), self.read(self.twin(records))
        self.assertEqual(len(ours), len(twins))
        for found, expected in zip(ours, twins):
            self.assertLessEqual(abs(found["ns"] - offset_ns - expected["ns"]), resolution_ns)
            for field in ("ns", "digits", *but):
                found.pop(field)
                expected.pop(field)
            self.assertEqual(found, expected)


class Readers(Bench):
    def test_asc_of_python_can(self):
        # python-can cuts the date of the first frame to a millisecond; later stamps count from there in microseconds.
        records = random_records(SEED)
        path = self.written_by(ASCWriter, "a.asc", records)
        offset_ns = self.read(path)[0]["ns"] - records[0]["ns"]
        self.assertLessEqual(abs(offset_ns), 1_000_000)
        self.expect(path, records, offset_ns=offset_ns, resolution_ns=1000)

    def test_csv_of_python_can(self):
        # This form has neither buses nor directions, and does not mark FD; stamps are floats with a step of 0.24 µs.
        records = random_records(SEED + 1)
        for record in records:
            record["bus"] = 0
            if record["length"] <= 8:
                record["fd"] = False
            record["brs"] = record["esi"] = False
        self.expect(self.written_by(CSVWriter, "a.csv", records), records, ("direction",), resolution_ns=300)

    def test_trc_of_python_can(self):
        # Version 4.1 writes classic data frames only, and a date that is decades ahead.
        records = random_records(SEED + 2, fd=False, remote=False)
        path = self.written_by(TRCWriter, "a.trc", records)
        offset_ns = self.read(path)[0]["ns"] - records[0]["ns"]
        self.expect(path, records, offset_ns=offset_ns, resolution_ns=600)

    def test_asc_of_log2asc_in_all_its_variants(self):
        # log2asc drops the part of the first stamp below a second: START_NS less 0.25 s.
        records = random_records(SEED + 3)
        for record in records:
            record["rx"] = True  # it has no other direction
        log = self.folder / "in.log"
        log.write_text("".join(candump_line(r, direction=False) for r in records))
        for options, resolution_ns in (((), 0), (("-4",), 100_000), (("-n",), 0), (("-f",), 0)):
            with self.subTest(options):
                path = self.folder / "a.asc"
                run(["log2asc", *options, "-I", log, "-O", path, "can0", "can1"])
                self.expect(path, records, offset_ns=-250_000_000, resolution_ns=resolution_ns)

    def test_screen_text_of_log2long(self):
        # log2long prints frames with the function that makes candump's screen text.
        records = random_records(SEED + 4)
        for record in records:
            record["brs"] = record["esi"] = False  # only candump -x shows them
        text = "".join(candump_line(r, direction=False) for r in records)
        path = self.folder / "screen.txt"
        path.write_bytes(run(["log2long"], text.encode()))
        self.expect(path, records, ("direction",))


class Writer(Bench):
    def converted(self, records, name, *options, zone="UTC"):
        path = self.folder / name
        run([VGYRO, "convert", "-q", *options, "-o", path, self.twin(records)], zone=zone)
        return path

    def test_python_can_reads_our_asc(self):
        records = random_records(SEED + 5)
        messages = list(ASCReader(str(self.converted(records, "a.asc")), relative_timestamp=False))
        self.assertEqual(len(messages), len(records))
        for message, record in zip(messages, records):
            expected = as_message(record)
            self.assertLess(abs(message.timestamp - record["ns"] / 1e9), 0.6e-6)
            # python-can 4.1 reads FD frames without bytes as remote frames.
            if record["fd"] and record["length"] == 0:
                continue
            message.timestamp = expected.timestamp
            self.assertTrue(message.equals(expected), f"{message} is not {expected}")

    def test_asc2log_reads_our_asc(self):
        # Without an English locale asc2log uses the present date; intervals are kept.
        records = random_records(SEED + 6)
        path, back = self.converted(records, "a.asc"), self.folder / "back.log"
        run(["asc2log", "-I", path, "-O", back])
        ours = self.read(back)
        offset_ns = ours[0]["ns"] - records[0]["ns"]
        self.expect(back, records, offset_ns=offset_ns)

    def test_we_read_our_asc_in_every_zone(self):
        records = random_records(SEED + 7)
        for zone in ("UTC", "America/St_Johns", "Asia/Kathmandu"):
            with self.subTest(zone):
                path = self.converted(records, "a.asc", zone=zone)
                back = run([VGYRO, "convert", "-q", "-o", "-", path], zone=zone)
                self.assertEqual(back.decode(), "".join(map(candump_line, records)))

    def test_programs_unpack_what_we_pack(self):
        records = random_records(SEED + 8)
        plain = self.twin(records).read_bytes()
        for ending, command in ((".gz", "gzip"), (".xz", "xz")):
            packed = self.converted(records, "a.log" + ending)
            self.assertEqual(run([command, "-dc", packed]), plain)
            self.assertEqual(run([VGYRO, "convert", "-q", "-o", "-", packed]), plain)
        packed = self.converted(records, "a.log.zst")
        self.assertEqual(run([VGYRO, "convert", "-q", "-o", "-", packed]), plain)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
