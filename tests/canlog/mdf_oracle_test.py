#!/usr/bin/python3
"""Checks the MF4 reader with files that python-can and asammdf wrote (golden/README.md), and with the forms that loggers
write, made here block by block: each reads back equal to its candump twin.

usage: mdf_oracle_test.py LOG_TOOL VGYRO"""

import json
import os
import random
import struct
import subprocess
import sys
import time
import unittest
import zlib
from pathlib import Path

import forms_oracle_test as forms
from forms_oracle_test import LOG_TOOL, VGYRO, random_records, run

os.environ["TZ"] = "UTC"
time.tzset()

SEED = 20261202
GOLDEN = Path(__file__).resolve().parent / "golden"
LENGTHS = forms.FD_SIZES
UINT, FLOAT, BYTES = 0, 4, 10
FIXED, VARIABLE, MASTER, VIRTUAL = 0, 1, 2, 6


class Mdf:
    """Blocks in sequence; links are set once their targets exist."""

    def __init__(self, start_ns, unfinished=0, local=False):
        name = b"UnFinMF " if unfinished else b"MDF     "
        self.out = bytearray(name + b"4.11    vgyrotst" + bytes(4) + struct.pack("<H", 411) + bytes(30) + struct.pack("<HH", unfinished, 0))
        self.head = self.block("HD", [0] * 6, struct.pack("<QhhBBBBdd", start_ns, 0, 0, int(local), 0, 0, 0, 0.0, 0.0))

    def block(self, kind, links, data=b""):
        self.out += bytes(-len(self.out) % 8)
        at = len(self.out)
        self.out += struct.pack("<4sLQQ", b"##" + kind.encode(), 0, 24 + 8 * len(links) + len(data), len(links))
        self.out += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def link(self, block, index, target):
        struct.pack_into("<Q", self.out, block + 24 + 8 * index, target)

    def text(self, text):
        return self.block("TX", [], text.encode() + b"\0")

    def conversion(self, kind, values):
        return self.block("CC", [0] * 4, struct.pack("<BBHHHdd", kind, 0, 0, 0, len(values), 0, 0) + struct.pack(f"<{len(values)}d", *values))

    def channel(self, name, kind, data_type, byte, bits, bit=0, conversion=0, data=0, part=0):
        return self.block("CN", [0, part, self.text(name), 0, conversion, data, 0, 0],
                          struct.pack("<BBBBLLLLBBH6d", kind, kind == MASTER, data_type, bit, byte, bits, 0, 0, 0, 0, 0, *[0.0] * 6))

    def chain(self, blocks):
        for a, b in zip(blocks, blocks[1:]):
            self.link(a, 0, b)
        return blocks[0]

    def group(self, number, first, size, cycles, flags=6):
        source = self.block("SI", [0, 0, 0], struct.pack("<BBBxxxxx", 2, 2, 0)) if flags == 6 else 0  # a bus, CAN
        return self.block("CG", [0, first, 0, source, 0, 0], struct.pack("<QQHHLLL", number, cycles, flags, 0, 0, size, 0))

    def data_group(self, number_size, first, data):
        return self.block("DG", [0, first, data, 0], bytes([number_size]) + bytes(7))

    def packed(self, plain, kind="DT", width=0):
        rows = len(plain) // width if width else 0
        columns = b"".join(plain[i:rows * width:width] for i in range(width)) + plain[rows * width:] if width else plain
        held = zlib.compress(columns)
        return self.block("DZ", [], kind.encode() + struct.pack("<BBLQQ", bool(width), 0, width, len(plain), len(held)) + held)

    def in_lists(self, plain, size, width=0):
        """An HL, two DLs, and packed blocks."""
        parts = [self.packed(plain[at:at + size], width=width) for at in range(0, len(plain), size)]
        half = len(parts) // 2
        lists = [self.block("DL", [0, *some], struct.pack("<BxxxLQ", 1, len(some), size)) for some in (parts[:half], parts[half:])]
        return self.block("HL", [self.chain(lists)], struct.pack("<HBxxxxx", 1, 1))

    def save(self, path, groups):
        self.link(self.head, 0, self.chain(groups))
        path.write_bytes(bytes(self.out))
        return path


def channels_of_one_layout(mdf, payload_in=None, prefix="CAN_DataFrame"):
    """Bits packed as by a CANedge, in 14 bytes including the time; the payload is elsewhere, or in 64 bytes after them."""
    def part(name, byte, bits, bit=0):
        return mdf.channel(f"{prefix}.{name}", FIXED, UINT, byte, bits, bit)
    parts = [part("BusChannel", 8, 2, 1), part("ID", 8, 29, 3), part("IDE", 8, 1), part("DLC", 13, 4, 4), part("DataLength", 12, 7, 1),
             part("Dir", 12, 1), part("EDL", 13, 1), part("ESI", 13, 1, 2), part("BRS", 13, 1, 1)]
    if payload_in is None:
        parts.append(mdf.channel(f"{prefix}.DataBytes", FIXED, BYTES, 14, 512))
    else:
        parts.append(mdf.channel(f"{prefix}.DataBytes", VARIABLE, BYTES, 14, 64, data=payload_in))
    stamp = mdf.channel("Timestamp", MASTER, FLOAT, 0, 64, conversion=mdf.conversion(1, [0.0, 1e-9]))
    return mdf.chain([stamp, mdf.channel(prefix, FIXED, BYTES, 8, 112, part=mdf.chain(parts))])


def packed_record(record, start_ns, payload):
    # The channel and the identifier overlap in byte 8: bit 0 is IDE, bits 1 and 2 the channel, the identifier is from
    # bit 3 on.
    head = int(record["extended"]) | record["bus"] << 1 | record["id"] << 3
    code = LENGTHS.index(record["length"]) if record["fd"] else record["length"]
    return (struct.pack("<d", record["ns"] - start_ns) + struct.pack("<L", head)
            + bytes([(not record["rx"]) | record["length"] << 1, record["fd"] | record["brs"] << 1 | record["esi"] << 2 | code << 4]) + payload)


class Golden(forms.Bench):
    def test_what_python_can_writes(self):
        # Stamps are differences of seconds since 1970, which doubles hold to a quarter of a microsecond.
        twin = self.read(GOLDEN / "python_can_mf4.log")
        for name in ("python_can_stored.mf4", "python_can_deflated.mf4", "python_can_columns.mf4"):
            with self.subTest(name):
                found = self.read(GOLDEN / name)
                self.assertEqual(len(found), len(twin))
                for ours, expected in zip(found, twin):
                    self.assertLessEqual(abs(ours.pop("ns") - expected["ns"]), 400)
                    ours.pop("digits")
                    self.assertEqual(ours, {key: expected[key] for key in ours})


    def test_what_asammdf_writes(self):
        # The log without its remote frames, made from an unfinalised file like those in Made.
        twin = [record for record in self.read(GOLDEN / "python_can_mf4.log") if not record["remote"]]
        self.assertEqual(self.read(GOLDEN / "asammdf_sorted.mf4"), twin)


class Made(forms.Bench):
    def records(self, seed, remote=False):
        records = random_records(seed, remote=remote)
        ns = records[0]["ns"]
        rng = random.Random(seed)
        for record in records:  # no two at once, and no more seconds than a double holds nanoseconds of
            record["ns"] = ns
            record["bus"] = rng.randrange(4)
            ns += rng.choice((1000, 250_000, 10_000_000))
        return records

    def start(self, records):
        return records[0]["ns"] - 250_000_000

    def test_one_group_in_every_kind_of_data(self):
        for kind in ("DT", "DZ", "columns", "lists", "lists of columns"):
            with self.subTest(kind):
                records = self.records(SEED)
                mdf = Mdf(self.start(records))
                held = b"".join(packed_record(r, self.start(records), r["data"].ljust(64, b"\0")) for r in records)
                data = {"DT": lambda: mdf.block("DT", [], held), "DZ": lambda: mdf.packed(held), "columns": lambda: mdf.packed(held, width=78),
                        "lists": lambda: mdf.in_lists(held, 7800), "lists of columns": lambda: mdf.in_lists(held, 10_000, width=78)}[kind]()
                group = mdf.group(0, channels_of_one_layout(mdf), 78, len(records))
                self.expect(mdf.save(self.folder / "a.mf4", [mdf.data_group(0, group, data)]), records)

    def test_payloads_in_data_of_their_own(self):
        records = self.records(SEED + 1)
        for kind in ("SD", "packed"):
            mdf = Mdf(self.start(records))
            held, payloads = b"", b""
            for record in records:
                held += packed_record(record, self.start(records), struct.pack("<Q", len(payloads)))
                payloads += struct.pack("<L", record["length"]) + record["data"]
            place = mdf.block("SD", [], payloads) if kind == "SD" else mdf.packed(payloads, "SD")
            group = mdf.group(0, channels_of_one_layout(mdf, place), 22, len(records))
            self.expect(mdf.save(self.folder / "a.mf4", [mdf.data_group(0, group, mdf.block("DT", [], held))]), records)

    def unfinished(self, records, payload_first, cut=0):
        """A file as a CANedge leaves it: numbered records, payloads among them, no counts, and data without a size."""
        mdf = Mdf(self.start(records), unfinished=0x25)
        payload_group = mdf.group(2, 0, 0, 0, flags=1)
        frames = mdf.group(1, channels_of_one_layout(mdf, payload_group), 22, 0)
        others = mdf.group(3, mdf.channel("Timestamp", MASTER, FLOAT, 0, 64), 19, 0)
        group = mdf.data_group(1, mdf.chain([frames, payload_group, others]), 0)
        held, offset = b"", 0
        for i, record in enumerate(records):
            parts = [b"\1" + packed_record(record, self.start(records), struct.pack("<Q", offset)),
                     b"\2" + struct.pack("<L", record["length"]) + record["data"]]
            held += b"".join(reversed(parts) if payload_first else parts)
            offset += 4 + record["length"]
            if i % 100 == 0:
                held += b"\3" + bytes(19)
        mdf.link(group, 2, mdf.block("DT", []))
        mdf.out += held[:len(held) - cut]
        return mdf.save(self.folder / "a.mf4", [group])

    def test_an_unfinalised_log(self):
        records = self.records(SEED + 2)
        for payload_first in (False, True):
            path = self.unfinished(records, payload_first)
            self.expect(path, records)
            *_, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
            self.assertEqual(counts["other"], 20)

    def test_an_unfinalised_log_whose_last_block_was_not_written(self):
        records = self.records(SEED + 3)
        twin = self.read(self.twin(records))
        for cut in (1, 10, 30, 77, 1000):
            path = self.unfinished(records, False, cut)
            *found, counts = map(json.loads, run([LOG_TOOL, "read", path]).splitlines())
            self.assertGreaterEqual(len(found), len(records) - 2 - cut // 27)
            self.assertEqual([r["data"] for r in found], [r["data"] for r in twin[:len(found)]])
            self.assertLessEqual(counts["malformed"], 1)

    def test_groups_of_kinds_come_by_stamp(self):
        # As from a CANedge with firmware 1.7: constant fields of a group are not stored, and groups are flushed
        # separately.
        records = self.records(SEED + 4, remote=True)
        start = self.start(records)
        mdf = Mdf(start, unfinished=0x25)
        tick = mdf.conversion(1, [0.0, 1e-6])
        table = mdf.conversion(5, [x for code, length in enumerate(LENGTHS) for x in (code, length)])
        groups, numbers = [], {}

        def constant(name, value):
            return mdf.channel(name, VIRTUAL, UINT, 0, 0, conversion=mdf.conversion(1, [float(value), 0.0]))

        for key in sorted({(r["bus"], r["extended"], r["remote"], r["fd"], r["rx"]) for r in records}):
            bus, extended, remote, fd, rx = key
            prefix = "CAN_RemoteFrame" if remote else "CAN_DataFrame"
            parts = [constant(prefix + ".BusChannel", bus), mdf.channel(prefix + ".ID", FIXED, UINT, 6, 29 if extended else 11),
                     constant(prefix + ".IDE", extended), mdf.channel(prefix + ".DLC", FIXED, UINT, 10, 4),
                     mdf.channel(prefix + ".DataLength", FIXED, UINT, 10, 4, conversion=table), constant(prefix + ".Dir", not rx)]
            payloads = mdf.group(100 + 2 * len(numbers), 0, 0, 0, flags=1)
            if not remote:
                parts.append(mdf.channel(prefix + ".DataBytes", VARIABLE, BYTES, 11, 32, data=payloads))
            if fd:
                parts += [constant(prefix + ".EDL", 1), mdf.channel(prefix + ".ESI", FIXED, UINT, 10, 1, 7), mdf.channel(prefix + ".BRS", FIXED, UINT, 10, 1, 6)]
            stamp = mdf.channel("Timestamp", MASTER, UINT, 0, 48, conversion=tick)
            numbers[key] = 101 + 2 * len(numbers)
            groups += [mdf.group(numbers[key], mdf.chain([stamp, mdf.channel(prefix, FIXED, BYTES, 6, 72, part=mdf.chain(parts))]), 15, 0), payloads]
        group = mdf.data_group(1, mdf.chain(groups), 0)
        mdf.link(group, 2, mdf.block("DT", []))
        offsets = dict.fromkeys(numbers, 0)
        at = 0
        while at < len(records):
            batch = [r for r in records[at:] if r["ns"] - records[at]["ns"] < 900_000_000]
            at += len(batch)
            for key, number in numbers.items():
                for r in batch:
                    if (r["bus"], r["extended"], r["remote"], r["fd"], r["rx"]) != key:
                        continue
                    code = LENGTHS.index(r["length"]) if r["fd"] else r["length"]
                    ticks = (r["ns"] - start) // 1000
                    mdf.out += bytes([number]) + ticks.to_bytes(6, "little") + struct.pack("<LBL", r["id"], code | r["brs"] << 6 | r["esi"] << 7, offsets[key])
                    mdf.out += bytes([number - 1]) + struct.pack("<L", len(r["data"])) + r["data"]
                    offsets[key] += 4 + len(r["data"])
        self.expect(mdf.save(self.folder / "a.mf4", [group]), records)

    def test_a_beginning_in_local_time(self):
        records = self.records(SEED + 5)
        start = self.start(records)
        mdf = Mdf(start + 9 * 3600 * 10**9, local=True)  # Tokyo's clock
        held = b"".join(packed_record(r, start, r["data"].ljust(64, b"\0")) for r in records)
        group = mdf.group(0, channels_of_one_layout(mdf), 78, len(records))
        path = mdf.save(self.folder / "a.mf4", [mdf.data_group(0, group, mdf.block("DT", [], held))])
        back = run([VGYRO, "convert", "-q", "-o", "-", path], zone="Asia/Tokyo")
        self.assertEqual(back.decode(), "".join(map(forms.candump_line, records)))

    def refused(self, path):
        done = subprocess.run([LOG_TOOL, "read", path], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1)
        return done.stderr

    def test_what_is_not_read_is_named(self):
        records = self.records(SEED + 6)
        mdf = Mdf(self.start(records))
        signals = mdf.group(0, mdf.chain([mdf.channel("t", MASTER, FLOAT, 0, 64), mdf.channel("YawRate", FIXED, FLOAT, 8, 64)]), 16, 0)
        path = mdf.save(self.folder / "a.mf4", [mdf.data_group(0, signals, 0)])
        self.assertIn("CAN_DataFrame", self.refused(path))
        older = bytearray(path.read_bytes())
        struct.pack_into("<H", older, 28, 330)
        path.write_bytes(older)
        self.assertIn("version 3.30", self.refused(path))
        mdf = Mdf(self.start(records))
        group = mdf.group(0, channels_of_one_layout(mdf), 78, 1)
        path = mdf.save(self.folder / "a.mf4", [mdf.data_group(0, group, mdf.block("LD", [0]))])
        done = subprocess.run([VGYRO, "convert", "-o", "-", path], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("can_logconvert", done.stderr)

    def test_no_damage_makes_it_read_on_for_ever(self):
        records = self.records(SEED + 7)[:50]
        data = self.unfinished(records, False).read_bytes()
        rng = random.Random(SEED + 7)
        print(f"seed {SEED + 7}")
        for _ in range(60):
            broken = bytearray(data)
            for _ in range(rng.randrange(1, 6)):
                broken[rng.randrange(len(broken))] = rng.randrange(256)
            path = self.folder / "broken.mf4"
            path.write_bytes(broken)
            done = subprocess.run([LOG_TOOL, "read", path], capture_output=True, check=False, timeout=60)
            self.assertIn(done.returncode, (0, 1))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
