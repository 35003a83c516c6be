#!/usr/bin/python3
"""Compares the BLF reader and writer with python-can's: each log reads back equal to its candump twin, to the
resolution of its stamps.

usage: blf_oracle_test.py LOG_TOOL VGYRO"""

import datetime
import json
import os
import random
import struct
import sys
import time
import unittest
import zlib
from pathlib import Path

import can
from can.io.blf import BLFReader, BLFWriter

import forms_oracle_test as forms
from forms_oracle_test import LOG_TOOL, VGYRO, as_message, candump_line, random_records, run

# python-can 4.1 reads dates as local time, like Vector's tools.
os.environ["TZ"] = "UTC"
time.tzset()

SEED = 20261130
OBJECT_HEAD = struct.Struct("<4sHHLL")
FD_SIZES = forms.FD_SIZES


def objects_in(path):
    """The objects of a file in sequence, unpacked by zlib alone."""
    data, content = path.read_bytes(), b""
    at = struct.unpack_from("<L", data, 4)[0]
    while at < len(data):
        mark, head_size, _, size, kind = OBJECT_HEAD.unpack_from(data, at)
        assert mark == b"LOBJ" and kind == 10
        method, plain = struct.unpack_from("<H6xL", data, at + head_size)
        held = data[at + head_size + 16:at + size]
        held = zlib.decompress(held) if method == 2 else held
        assert len(held) == plain
        content += held
        at += size + size % 4
    return content


class Log:
    """A BLF file made by hand, in the variants that python-can reads but does not write."""

    def __init__(self, unit, head_version):
        self.unit = unit
        self.version = head_version
        self.content = b""
        self.count = 0

    def add(self, kind, ticks, fields):
        if self.version == 1:
            head = struct.pack("<LHHQ", self.unit, 0, 0, ticks)
        else:
            head = struct.pack("<LBxHQQ", self.unit, 0, 0, ticks, ticks)
        size = 16 + len(head) + len(fields)
        self.content += OBJECT_HEAD.pack(b"LOBJ", 16 + len(head), self.version, size, kind) + head + fields + b"\0" * (size % 4)
        self.count += 1

    def write(self, path, container_size, pack=True):
        body = b""
        for at in range(0, len(self.content), container_size):
            plain = self.content[at:at + container_size]
            held = zlib.compress(plain) if pack else plain
            size = 32 + len(held)
            body += OBJECT_HEAD.pack(b"LOBJ", 16, 1, size, 10) + struct.pack("<H6xL4x", 2 if pack else 0, len(plain)) + held
            body += b"\0" * (size % 4)
        begin = (2023, 11, 2, 14, 22, 13, 20, 250)
        head = struct.pack("<4sLBBBBBBBBQQLL8H8H", b"LOGG", 144, 0, 0, 0, 0, 2, 6, 8, 1, 144 + len(body),
                           144 + len(self.content), self.count, 0, *begin, *begin)
        path.write_bytes(head.ljust(144, b"\0") + body)


class Reader(forms.Bench):
    def expect_python_can(self, path, records, resolution_ns=1000):
        # python-can rounds the file's date to a millisecond; its intervals have the rounding of floats.
        offset_ns = self.read(path)[0]["ns"] - records[0]["ns"]
        self.assertLessEqual(abs(offset_ns), 500_000)
        self.expect(path, records, offset_ns=offset_ns, resolution_ns=resolution_ns)

    def written(self, records, name="a.blf", **options):
        path = self.folder / name
        writer = BLFWriter(str(path), **options)
        for record in records:
            writer.on_message_received(as_message(record))
        writer.stop()
        return path

    def test_what_python_can_writes(self):
        records = random_records(SEED)
        for options in ({}, {"compression_level": 0}, {"compression_level": 9, "max_container_size": 1000}):
            with self.subTest(options):
                self.expect_python_can(self.written(records, **options), records)

    def test_a_golden_file(self):
        # Objects continue from container to container.
        golden = Path(__file__).resolve().parent / "golden"
        found, twin = self.read(golden / "python_can.blf"), self.read(golden / "python_can_mf4.log")
        self.assertEqual(len(found), len(twin))
        for ours, expected in zip(found, twin):
            self.assertLessEqual(abs(ours.pop("ns") - expected.pop("ns")), 1000)
            self.assertEqual({**ours, "digits": 6}, expected)

    def test_appended_files(self):
        records = random_records(SEED + 1)
        path = self.folder / "a.blf"
        self.written(records[:1000])
        writer = BLFWriter(str(path), append=True)
        for record in records[1000:]:
            writer.on_message_received(as_message(record))
        writer.stop()
        self.expect_python_can(path, records, resolution_ns=1_001_000)

    def test_error_frames_and_markers(self):
        path = self.folder / "a.blf"
        writer = BLFWriter(str(path))
        writer.on_message_received(can.Message(timestamp=1e9, channel=0, arbitration_id=1, is_extended_id=False, data=b"\1"))
        for length in range(1, 9):
            writer.log_event("x" * length, 1e9 + 0.25)  # objects of odd sizes, padded
        writer.on_message_received(can.Message(timestamp=1e9 + 0.5, channel=1, is_error_frame=True, dlc=8, data=bytes(8)))
        writer.stop()
        *records, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
        self.assertEqual((counts["frames"], counts["other"], counts["malformed"]), (2, 8, 0))
        self.assertEqual([r["error"] for r in records], [False, True])
        self.assertEqual(records[1]["interface"], "can1")
        self.assertEqual(records[1]["ns"], 1_000_000_000_500_000_000)

    def test_a_writer_that_was_killed(self):
        # Complete objects are read, and the place where the log ends is reported.
        records = random_records(SEED + 2)
        data = self.written(records, max_container_size=5000).read_bytes()
        rng = random.Random(SEED + 2)
        twins = self.read(self.twin(records))
        for _ in range(20):
            cut = rng.randrange(200, len(data))
            path = self.folder / "cut.blf"
            path.write_bytes(data[:cut])
            *found, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
            self.assertEqual(counts["malformed"], 0)
            self.assertEqual([r["data"] for r in found], [r["data"] for r in twins[:len(found)]])
            self.assertGreaterEqual(len(found), int((cut - 5000) / len(data) * len(twins)) - 200)

    def random_objects(self, rng, log):
        """Adds random objects of all kinds to the log."""
        ticks = 0
        for _ in range(2000):
            ticks += rng.choice((0, 1, 1000, 123_456))
            extended = rng.random() < 0.5
            identifier = rng.randrange(1 << (29 if extended else 11)) | extended << 31
            channel, sent, dlc = rng.randrange(1, 5), rng.random() < 0.5, rng.randrange(16)
            remote = rng.random() < 0.1
            classic = struct.pack("<HBBL8s", channel, sent | remote << 7, dlc % 9, identifier, bytes(8) if remote else rng.randbytes(8))
            kind = rng.choice((1, 86, 100, 101, 73, 99))
            if kind == 1:
                log.add(1, ticks, classic)
            elif kind == 86:
                log.add(86, ticks, classic + struct.pack("<LBBH", 240_000, 120, 0, 0))
            elif kind == 100:
                log.add(100, ticks, struct.pack("<HBBLLBBB5x64s4x", channel, sent, dlc, identifier, 0, 0, rng.choice((1, 3, 5, 7)),
                                                FD_SIZES[dlc], rng.randbytes(FD_SIZES[dlc])))
            elif kind == 101:
                log.add(101, ticks, struct.pack("<BBBBLLLLLLLHBBL", channel, dlc, FD_SIZES[dlc], 0, identifier, 0,
                                                0x1000 | rng.choice((0, 0x2000, 0x4000, 0x6000)), 0, 0, 0, 0, 0, sent, 0, 0)
                        + rng.randbytes(FD_SIZES[dlc]))
            elif kind == 73:
                log.add(73, ticks, struct.pack("<HHLBBBxLLH2x8s", channel, 0, 0, 0, 0, 8, 0, 0, 0, bytes(8)))
            else:
                log.add(99, ticks, rng.randbytes(rng.randrange(40)))

    def test_every_kind_of_object_head_and_unit(self):
        print(f"seed {SEED + 3}")
        for unit, head_version, pack in ((1, 1, True), (2, 1, False), (1, 2, False), (2, 2, True)):
            with self.subTest((unit, head_version)):
                rng = random.Random(SEED + 3)
                log = Log(unit, head_version)
                self.random_objects(rng, log)
                path = self.folder / "a.blf"
                log.write(path, 777, pack)
                judged = list(BLFReader(str(path)))
                found = self.read(path)
                self.assertEqual(len(found), len(judged))
                for ours, message in zip(found, judged):
                    self.assertLess(abs(ours["ns"] / 1e9 - message.timestamp), 1e-6)
                    self.assertEqual(ours["interface"], f"can{message.channel}")
                    self.assertEqual(ours["error"], message.is_error_frame)
                    if message.is_error_frame:
                        continue
                    self.assertEqual((ours["id"], ours["extended"], ours["remote"], ours["fd"], ours["brs"], ours["esi"]),
                                     (message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.is_fd,
                                      message.bitrate_switch, message.error_state_indicator))
                    self.assertEqual(ours["direction"], "R" if message.is_rx else "T")
                    self.assertEqual(ours["length"], message.dlc)
                    if not message.is_remote_frame:
                        self.assertEqual(bytes(ours["data"]), bytes(message.data))


class Writer(forms.Bench):
    def converted(self, records, *options, zone="UTC"):
        path = self.folder / "a.blf"
        run([VGYRO, "convert", "-q", *options, "-o", path, self.twin(records)], zone=zone)
        return path

    def test_python_can_reads_it(self):
        records = random_records(SEED + 4)
        messages = list(BLFReader(str(self.converted(records))))
        self.assertEqual(len(messages), len(records))
        for message, record in zip(messages, records):
            expected = as_message(record)
            self.assertLess(abs(message.timestamp - record["ns"] / 1e9), 0.6e-6)
            message.timestamp = expected.timestamp
            self.assertTrue(message.equals(expected), f"{message} is not {expected}")

    def test_python_can_reads_error_frames(self):
        log, path = self.folder / "a.log", self.folder / "a.blf"
        log.write_text("(1700000000.000000) can3 20000004#0001000000000000 R\n")
        run([VGYRO, "convert", "-q", "-o", path, log])
        message, = BLFReader(str(path))
        self.assertEqual((message.is_error_frame, message.channel, message.timestamp), (True, 3, 1700000000))

    def test_the_head_is_complete(self):
        records = random_records(SEED + 5)
        path = self.converted(records)
        head = struct.unpack("<4sLBBBBBBBBQQLL8H8H", path.read_bytes()[:72])
        content = objects_in(path)
        self.assertEqual(head[10], path.stat().st_size)
        self.assertEqual(head[11], len(content) + 144 + 32 * -(-len(content) // 131072))
        self.assertEqual(head[12], content.count(b"LOBJ"))
        for at, ns in ((14, records[0]["ns"] // 10**9 * 10**9), (22, records[-1]["ns"])):
            date = datetime.datetime.fromtimestamp(ns // 10**9, datetime.timezone.utc)
            self.assertEqual(head[at:at + 8], (date.year, date.month, date.isoweekday() % 7, date.day, date.hour, date.minute,
                                               date.second, ns % 10**9 // 10**6))

    def test_we_read_it_in_every_zone(self):
        records = random_records(SEED + 6)
        for zone in ("UTC", "America/St_Johns", "Asia/Kathmandu"):
            with self.subTest(zone):
                path = self.converted(records, zone=zone)
                back = run([VGYRO, "convert", "-q", "-o", "-", path], zone=zone)
                self.assertEqual(back.decode(), "".join(map(candump_line, records)))

    def test_stamps_without_a_date_keep_their_nanoseconds(self):
        log = self.folder / "zero.log"
        log.write_text("(0.000000001) can0 123#11 R\n(5.123456789) can7 12345678#1122334455667788_F T\n(6.000000000) can0 123#R5 R\n")
        path = self.folder / "zero.blf"
        run([VGYRO, "convert", "-q", "-o", path, log], zone="America/New_York")
        back = run([VGYRO, "convert", "-q", "--digits", "9", "-o", "-", path], zone="Asia/Tokyo").decode()
        self.assertEqual(back, "(0000000000.000000001) can0 123#11 R\n(0000000005.123456789) can7 12345678#1122334455667788_F T\n"
                               "(0000000006.000000000) can0 123#R5 R\n")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
