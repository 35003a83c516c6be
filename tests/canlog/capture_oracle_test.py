#!/usr/bin/python3
"""Checks the readers of pcap and pcapng with files that tcpdump, dumpcap and tshark wrote (golden/README.md), and with
captures in all variants, made here from the formats' own documents: each reads back equal to its candump twin.

usage: capture_oracle_test.py LOG_TOOL VGYRO"""

import json
import random
import struct
import sys
import unittest
from pathlib import Path

import forms_oracle_test as forms
from forms_oracle_test import LOG_TOOL, VGYRO, random_records, run

SEED = 20261201
GOLDEN = Path(__file__).resolve().parent / "golden"
SOCKETCAN, COOKED, COOKED2 = 227, 113, 276

# As `candump -L` printed them, without the flags that libpcap lost on FD frames of the CAN interface itself.
ON_VCAN0 = ["123#DEADBEEF", "7FF#R5", "1FFFFFFF##{0}", "001#", "20000004#0001000000000000", "321#1122334455667788"]
ON_VCAN1 = ["12345678#1122334455667788", "123##{1}AABBCCDDEEFF00112233445566000000", "12345678##0112233"]
SENT = [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (0, 3), (1, 2), (0, 4), (0, 5)]  # bus, which of its frames
STAMPS = [.420899, .448052, .473628, .493229, .514752, .538656, .563088, .585262, .634684]


def golden_lines(names, flags, buses=(0, 1)):
    lines = []
    for (bus, which), stamp in zip(SENT, STAMPS):
        if bus in buses:
            frame = (ON_VCAN0, ON_VCAN1)[bus][which].format(*flags)
            lines.append(f"({1795938583 + stamp:.6f}) {names[bus]} {frame}")
    return lines


class Golden(forms.Bench):
    def lines(self, name):
        text = run([VGYRO, "convert", "-q", "--digits", "6", "-o", "-", GOLDEN / name]).decode()
        return text.splitlines()

    def test_tcpdump_on_a_can_interface(self):
        for name in ("tcpdump_can.pcap", "tcpdump_can_nano.pcap"):
            self.assertEqual(self.lines(name), golden_lines(("can0",), "00", buses=(0,)))
        nanos = self.read(GOLDEN / "tcpdump_can_nano.pcap")
        self.assertEqual((nanos[0]["ns"], nanos[0]["digits"]), (1795938583_420899932, 9))

    def test_tcpdump_on_all_interfaces(self):
        self.assertEqual(self.lines("tcpdump_cooked.pcap"), golden_lines(("can0", "can0"), "13"))
        self.assertEqual(self.lines("tcpdump_cooked2.pcap"), golden_lines(("can0", "can1"), "13"))

    def test_dumpcap(self):
        # dumpcap writes vcan0's fifth frame before vcan1's first.
        self.assertEqual(self.lines("dumpcap_two.pcapng"), golden_lines(("vcan0", "vcan1"), "00"))
        self.assertEqual(self.lines("dumpcap_any.pcapng"), golden_lines(("any", "any"), "13"))

    def test_tshark_on_a_candump_log(self):
        # The log held six of the frames; this form cannot hold its buses.
        lines = golden_lines(("can0", "can0"), "13")
        self.assertEqual(self.lines("tshark_from_candump.pcap"), lines[:5] + lines[7:8])

    def test_tshark_on_a_blf_file(self):
        # tshark drops error frames, the FD flags, and bytes after the payload.
        expected = [line + " T" for line in golden_lines(("CAN-1", "CAN-2"), "00") if "#0001" not in line]
        expected = [line.replace("1FFFFFFF##0", "1FFFFFFF#").replace("12345678##0", "12345678#") for line in expected]
        self.assertEqual(self.lines("tshark_from_blf.pcapng"), expected)


def socketcan(record, id_order, flags_kept=True):
    identifier = record["id"] | record["extended"] << 31 | record["remote"] << 30
    flags = record["brs"] + 2 * record["esi"] + 4 if record["fd"] else 0
    size = 64 if record["fd"] else 8
    data = bytes(record["data"]).ljust(size, b"\0")
    return struct.pack(id_order + "LBBBB", identifier, record["length"], flags if flags_kept else 0, 0, 0) + data


def packet(record, link, order):
    protocol = 0x0D if record["fd"] else 0x0C
    kind = 1 if record["rx"] else 4
    if link == COOKED:
        return struct.pack(">HHH8sH", kind, 280, 0, bytes(8), protocol) + socketcan(record, order)
    if link == COOKED2:
        return struct.pack(">HHLHBB8s", protocol, 0, 7 + record["bus"], 280, kind, 0, bytes(8)) + socketcan(record, order)
    return socketcan(record, ">")


def pcap(records, link, order, nano):
    out = struct.pack(order + "LHHlLLL", 0xA1B23C4D if nano else 0xA1B2C3D4, 2, 4, 0, 0, 65535, link)
    for record in records:
        held = packet(record, link, order)
        second, fraction = divmod(record["ns"], 10**9)
        out += struct.pack(order + "LLLL", second, fraction if nano else fraction // 1000, len(held), len(held)) + held
    return out


class Pcapng:
    def __init__(self, order):
        self.order = order
        self.out = b""

    def block(self, kind, content):
        content += b"\0" * (-len(content) % 4)
        size = struct.pack(self.order + "L", len(content) + 12)
        self.out += struct.pack(self.order + "L", kind) + size + content + size

    def option(self, code, value):
        return struct.pack(self.order + "HH", code, len(value)) + value + b"\0" * (-len(value) % 4)

    def section(self):
        self.block(0x0A0D0D0A, struct.pack(self.order + "LHHq", 0x1A2B3C4D, 1, 0, -1) + self.option(4, b"test") + bytes(4))

    def interface(self, link, *options):
        self.block(1, struct.pack(self.order + "HHL", link, 0, 0) + b"".join(self.option(*o) for o in options) + bytes(4))

    def enhanced(self, interface, ticks, held, *options):
        self.block(6, struct.pack(self.order + "LLLLL", interface, ticks >> 32, ticks & 0xFFFFFFFF, len(held), len(held)) + held
                   + b"\0" * (-len(held) % 4) + b"".join(self.option(*o) for o in options) + bytes(4))


class Made(forms.Bench):
    def put(self, data, name="a.cap"):
        path = self.folder / name
        path.write_bytes(data)
        return path

    def test_every_kind_of_pcap(self):
        for link in (SOCKETCAN, COOKED, COOKED2):
            for order in "<>":
                for nano in (False, True):
                    with self.subTest((link, order, nano)):
                        records = random_records(SEED + link)
                        seen = []
                        for record in records:
                            if record["bus"] not in seen:
                                seen.append(record["bus"])
                        path = self.put(pcap(records, link, order, nano))
                        if link == COOKED2:  # numbered in order of appearance
                            for record in records:
                                record["bus"] = seen.index(record["bus"])
                            path = self.put(pcap(records, link, order, nano))
                        else:
                            for record in records:
                                record["bus"] = 0
                        self.expect(path, records, ("direction",))
                        if link != SOCKETCAN:
                            self.assertEqual([r["direction"] == "T" for r in self.read(path)], [not r["rx"] for r in records])

    def test_every_kind_of_pcapng(self):
        # Resolutions that hold microseconds exactly; the remainder of a binary one is below its step.
        for order, resolution, per_s, named in (("<", None, 10**6, True), (">", b"\x09", 10**9, False),
                                                ("<", b"\x0c", 10**12, True), (">", b"\xa0", 2**32, True)):
            with self.subTest((order, resolution)):
                records = random_records(SEED)
                file = Pcapng(order)
                offset_s = 1_695_000_000 if per_s > 10**9 else 0
                for part in (records[:700], records[700:]):  # two sections
                    file.section()
                    file.block(4, b"names that nobody needs")
                    for bus in (0, 1):
                        options = [(2, f"can{bus}".encode())] if named else []
                        if resolution:
                            options.append((9, resolution))
                        if offset_s:
                            options.append((14, struct.pack(order + "q", offset_s)))
                        file.interface(SOCKETCAN, *options)
                    for record in part:
                        ticks = -(-(record["ns"] - offset_s * 10**9) * per_s // 10**9)
                        file.enhanced(record["bus"], ticks, socketcan(record, ">"), (2, struct.pack(order + "L", 1 if record["rx"] else 2)))
                path = self.put(file.out)
                self.expect(path, records, resolution_ns=1 if resolution == b"\xa0" else 0)
                # From a file that is cut off, the reader has returned all earlier packets.
                *found, counts = map(json.loads, run([LOG_TOOL, "read", self.put(file.out[:-100])]).splitlines())
                self.assertGreater(len(found), len(records) - 4)
                self.assertEqual(counts["malformed"], 0)

    def test_buses_that_were_written_one_after_the_other_come_by_stamp(self):
        records = random_records(SEED + 1)
        rng = random.Random(SEED + 1)
        print(f"seed {SEED + 1}")
        file = Pcapng("<")
        file.section()
        for bus in (0, 1):
            file.interface(SOCKETCAN, (2, f"can{bus}".encode()), (9, b"\x09"))
        at = 0
        ns = records[0]["ns"]
        for record in records:  # no two at once: their order would be anybody's guess
            ns += rng.choice((1000, 250_000, 1_000_000))
            record["ns"] = ns
        while at < len(records):
            # The frames of half a second: one bus, then the other.
            batch = [r for r in records[at:] if r["ns"] - records[at]["ns"] < 500_000_000]
            for bus in rng.sample((0, 1), 2):
                for record in batch:
                    if record["bus"] == bus:
                        file.enhanced(bus, record["ns"], socketcan(record, ">"))
            at += len(batch)
        self.expect(self.put(file.out), records, ("direction",))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
