#!/usr/bin/python3
"""`vgyro decode`: one JSON object a line in the documented form, from any log, as a monitor too."""

import json
import os
import re
import select
import subprocess
import unittest

import bench

OTHER_DBC = """\
VERSION ""
BU_: RIG
BO_ 2364549694 ARI: 8 RIG
 SG_ YawRate : 32|16@1+ (0.0078125,-250) [-250|250.992] "deg/s" RIG
BO_ 400 PAGES: 8 RIG
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" RIG
 SG_ Volt m1 : 8|16@1+ (0.001,0) [0|65] "V" RIG
 SG_ Amp m2 : 8|16@1- (0.001,0) [-30|30] "A" RIG
BO_ 401 WIDE: 32 RIG
 SG_ Last : 248|8@1+ (1,0) [0|255] "\xb0C" RIG
BO_ 402 EDGES: 8 RIG
 SG_ Most : 0|64@1+ (1,0) [0|0] "" RIG
BO_ 403 DOUBLE: 8 RIG
 SG_ Exact : 0|64@1- (1,0) [0|0] "" RIG
SIG_VALTYPE_ 403 Exact : 2;
"""


class Decode(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("other.dbc", OTHER_DBC.encode("cp1252"))

    def decode(self, log, *arguments, dbc=("bench.dbc",)):
        self.write("in.log", log)
        done = self.good("decode", *[a for name in dbc for a in ("--dbc", name)], *arguments, "in.log")
        return done.stdout.decode()

    def objects(self, log, dbc=("bench.dbc",)):
        return [json.loads(line) for line in self.decode(log, dbc=dbc).splitlines()]

    def test_has_exactly_the_documented_form(self):
        # Other programs read this format; it must not change.
        text = self.decode("(1700000000.010000) can0 101#E8800000C409072F\n")
        self.assertEqual(text, '{"t": 1700000000.010000, "bus": "can0", "id": 257, "message": "GYRO_A", "signals": {'
                               '"RateZ": {"value": 0.033, "raw": 33000, "unit": "deg/s", "label": null}, '
                               '"Temp": {"value": 25, "raw": 2500, "unit": "degC", "label": null}, '
                               '"Counter": {"value": 7, "raw": 7, "unit": "", "label": null}, '
                               '"Status": {"value": 15, "raw": 15, "unit": "", "label": null}}}\n')

    def test_labels_come_from_the_dbc_file(self):
        # "warming up" is clearer than 1.
        one, = self.objects(bench.line_a(1, 0.0, 0, status=1))
        self.assertEqual(one["signals"]["Status"]["label"], "warming up")
        self.assertEqual(one["signals"]["Status"]["raw"], 1)

    def test_every_line_is_valid_json_whatever_the_payload(self):
        # Random bits are sometimes NaN or infinity, which JSON does not have.
        import random
        rng = random.Random(5)
        lines = [f"({i}.{rng.randrange(10**6):06d}) can{rng.randrange(3)} "
                 f"{rng.choice((0x101, 0x102, 0x190, 0x192, 0x193)):03X}#{rng.randbytes(8).hex()}\n" for i in range(2000)]
        lines += ["(1.5) can0 102#7FC00000\n", "(2.5) can0 102#FF800000\n"]
        found = self.objects("".join(lines), dbc=("bench.dbc", "other.dbc"))
        self.assertEqual(len(found), 2002, "seed 5")
        self.assertIsNone(found[-1]["signals"]["Rate"]["value"])
        self.assertIsNone(found[-2]["signals"]["Rate"]["value"])
        self.assertEqual(found[-2]["signals"]["Rate"]["raw"], 0x7FC00000)

    def test_odd_names_are_escaped(self):
        # A log's interface may hold anything but blanks.
        one, = self.objects('(1.000000) a"\\b 101#0000000000000000\n')
        self.assertEqual(one["bus"], 'a"\\b')
        self.write("in.log", b"(1.000000) c\xffn 101#0000000000000000\n")
        json.loads(self.good("decode", "--dbc", "bench.dbc", "in.log").stdout)

    def test_takes_several_dbc_files(self):
        # Gyros of two makers on one bus.
        found = self.objects("(1.0) can0 101#0000000000000000\n(2.0) can0 190#01E8030000000000\n",
                             dbc=("bench.dbc", "other.dbc"))
        self.assertEqual([f["message"] for f in found], ["GYRO_A", "PAGES"])

    def test_extended_ids_are_told_from_standard_ones(self):
        # 0x0CF02A3E with 29 bits; the identifier is given without flags.
        one, = self.objects("(1.0) can0 0CF02A3E#000000000080FFFF\n(2.0) can0 23E#0000000000000000\n", dbc=("other.dbc",))
        self.assertEqual((one["message"], one["id"]), ("ARI", 0x0CF02A3E))
        self.assertEqual(one["signals"]["YawRate"]["value"], 6.0)

    def test_multiplexed_signals_appear_on_their_page_only(self):
        # On another page the same bits have another meaning.
        found = self.objects("(1.0) can0 190#01E8030000000000\n(2.0) can0 190#0218FC0000000000\n"
                             "(3.0) can0 190#0318FC0000000000\n", dbc=("other.dbc",))
        self.assertEqual([sorted(f["signals"]) for f in found], [["Page", "Volt"], ["Amp", "Page"], ["Page"]])
        self.assertEqual(found[0]["signals"]["Volt"]["value"], 1.0)
        self.assertEqual(found[1]["signals"]["Amp"]["value"], -1.0)

    def test_fd_frames_and_units_outside_ascii(self):
        # The file is cp1252, the output UTF-8.
        one, = self.objects("(1.0) can0 191##1" + "00" * 31 + "2A\n", dbc=("other.dbc",))
        self.assertEqual(one["signals"]["Last"], {"value": 42, "raw": 42, "unit": "°C", "label": None})

    def test_numbers_keep_every_digit(self):
        # A 64-bit number is more than a double holds; raw keeps it.
        found = self.objects("(1.0) can0 192#FFFFFFFFFFFFFFFF\n(2.0) can0 193#9A9999999999B93F\n", dbc=("other.dbc",))
        self.assertEqual(found[0]["signals"]["Most"]["raw"], 2**64 - 1)
        self.assertEqual(found[1]["signals"]["Exact"]["value"], 0.1)

    def test_time_keeps_the_digits_of_the_log(self):
        # Nine digits if the log has them, else six.
        text = self.decode("(1700000000.123456789) can0 101#0000000000000000\n(5.000001) can0 101#0000000000000000\n")
        self.assertEqual(re.findall(r'"t": ([0-9.]+)', text), ["1700000000.123456789", "5.000001"])

    def test_truncated_frames_show_the_signals_that_they_hold(self):
        # Nothing is read beyond the end.
        one, = self.objects("(1.0) can0 101#01000000\n")
        self.assertEqual(sorted(one["signals"]), ["RateZ"])

    def test_remote_and_unknown_frames_are_passed_over(self):
        # These frames carry no signals.
        log = "(1.0) can0 101#R8\n(2.0) can0 555#00\n(3.0) can0 20000080#0000000000000000\n"
        self.assertEqual(self.decode(log), "")

    def test_text_is_for_people(self):
        # One line a frame, with labels instead of numbers if there are any.
        text = self.decode(bench.line_a(1_500_000, 0.033, 7), "--text")
        self.assertEqual(text, "1.500000  can0   101  GYRO_A  RateZ=0.033 deg/s  Temp=25 degC  Counter=7  Status=ok\n")

    def test_stdin_streams_line_by_line(self):
        # As a monitor behind candump: a frame is printed when it comes, not when the log ends.
        process = subprocess.Popen([bench.VGYRO, "decode", "--dbc", "bench.dbc", "-"], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=self.folder)
        try:
            for counter in range(3):
                process.stdin.write(bench.line_a(counter, 0.0, counter).encode())
                process.stdin.flush()
                readable, _, _ = select.select([process.stdout], [], [], 20)
                self.assertTrue(readable, "no line within 20 s")
                line = os.read(process.stdout.fileno(), 65536)
                self.assertEqual(json.loads(line)["signals"]["Counter"]["value"], counter)
        finally:
            process.stdin.close()
            code = process.wait(timeout=20)
            process.stdout.close()
        self.assertEqual(code, 0)

    def test_junk_lines_are_told_with_their_numbers(self):
        # Bad lines are counted and named, and the rest is decoded.
        self.write("in.log", bench.line_a(0, 0.0, 0) + "(1.0) can0 XYZ#00\nDROPCOUNT: 3\n" + bench.line_a(9, 0.0, 1))
        done = self.good("decode", "--dbc", "bench.dbc", "in.log")
        self.assertEqual(len(done.stdout.splitlines()), 2)
        self.assertIn("in.log:2: ", done.stderr.decode())
        self.assertIn("2 of 2 frames decoded, 1 line not understood", done.stderr.decode())

    def test_bad_input_is_told(self):
        # Each bad file is reported with its problem; exit code 1.
        self.write("empty.log", "")
        self.write("prose.log", "hello\n")
        self.write("no.dbc", "hello\n")
        self.assertIn("holds no CAN frame", self.bad("decode", "--dbc", "bench.dbc", "empty.log"))
        self.assertIn("not a known log of CAN frames", self.bad("decode", "--dbc", "bench.dbc", "prose.log"))
        self.assertIn("nowhere.log", self.bad("decode", "--dbc", "bench.dbc", "nowhere.log"))
        self.assertIn("nowhere.dbc", self.bad("decode", "--dbc", "nowhere.dbc", "empty.log"))
        self.assertIn("no.dbc", self.bad("decode", "--dbc", "no.dbc", "empty.log"))
        self.assertIn("directory", self.bad("decode", "--dbc", "bench.dbc", "."))

    def test_the_exact_identifier_goes_before_the_pgn(self):
        # Two senders of one parameter group, each with a layout of its own; a third sender is unknown.
        self.write("turn.dbc", """\
BO_ 2565876225 TURN_LEFT: 8 X
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" X
BO_ 2565876226 TURN_RIGHT: 8 X
 SG_ Rate : 16|16@1- (0.02,0) [-300|300] "deg/s" X
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
""")
        found = self.objects("".join(f"({i}.0) can0 {name}#6400C80000000000\n" for i, name in
                                     enumerate(("18F02A02", "18F02A01", "0CF02A02", "18F02A33"))), dbc=("turn.dbc",))
        self.assertEqual([(f["message"], f["signals"]["Rate"]["value"]) for f in found],
                         [("TURN_RIGHT", 4), ("TURN_LEFT", 1), ("TURN_RIGHT", 4), ("TURN_LEFT", 1)])

    def test_no_value_is_null(self):
        # Users integrate the printed value. raw and label stay.
        self.write("codes.dbc", """\
BO_ 2565868030 VDC2: 8 X
 SG_ Yaw : 24|16@1+ (0.0001220703125,-3.92) [0|0] "rad/s" X
 SG_ Count : 56|8@1+ (1,0) [0|255] "" X
BO_ 2314277886 TURN: 8 X
 SG_ Rate : 8|32@1- (0.00000003125,0) [0|0] "rad/s" X
BO_ 256 PLAIN: 8 X
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" X
 SG_ State : 16|2@1+ (1,0) [0|3] "" X
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
VAL_ 256 Rate -32768 "Signal ung\xfcltig" 0 "standing" ;
VAL_ 256 State 0 "valid" 1 "invalid" 3 "SNA" ;
""".encode("cp1252"))
        log = ("(1.0) can0 18F00901#000000FEFFFFFFFF\n(2.0) can0 18F00901#000000FFFAFFFF00\n"
               "(3.0) can0 09F11323#00FFFFFF7F\n(4.0) can0 09F11323#00FCFFFF7F\n(5.0) can0 09F11323#00FFFFFFFF\n"
               "(6.0) can0 100#008003\n(7.0) can0 100#000001\n")
        found = [f["signals"] for f in self.objects(log, dbc=("codes.dbc",))]
        self.assertEqual(found[0]["Yaw"], {"value": None, "raw": 0xFFFE, "unit": "rad/s", "label": None})
        self.assertEqual(found[0]["Count"]["value"], 255)
        self.assertAlmostEqual(found[1]["Yaw"]["value"], 0xFAFF / 8192 - 3.92, places=9)
        self.assertEqual([f["Rate"]["value"] for f in found[2:5]], [None, 67.108863875, -3.125e-08])
        self.assertEqual(found[5]["Rate"], {"value": None, "raw": -32768, "unit": "deg/s", "label": "Signal ungültig"})
        self.assertEqual(found[5]["State"], {"value": None, "raw": 3, "unit": "", "label": "SNA"})
        self.assertEqual(found[6]["Rate"], {"value": 0, "raw": 0, "unit": "deg/s", "label": "standing"})
        self.assertEqual(found[6]["State"], {"value": 1, "raw": 1, "unit": "", "label": "invalid"})
        text = self.decode(log, "--text", dbc=("codes.dbc",)).splitlines()
        self.assertIn("Yaw=not available (0xFFFE)", text[0])
        self.assertIn("Rate=not available (0x7FFFFFFF)", text[2])

    def test_the_virtual_gyro_says_when_it_has_no_rate(self):
        # Raw 0x800000 is not 419 deg/s to the left. VG_Valid's "invalid" is its value.
        self.write("vg.dbc", (bench.SOURCE / "dbc/vgyro.dbc").read_text())
        one, = self.objects("(1.0) can0 610#0000000080FFFFF0\n", dbc=("vg.dbc",))
        signals = one["signals"]
        self.assertEqual(signals["VG_Rate"], {"value": None, "raw": -8388608, "unit": "deg/s", "label": "invalid"})
        self.assertIsNone(signals["VG_Sigma"]["value"])
        self.write("valid.log", "(1.0) can0 610#0000000000000000\n")
        valid = json.loads(self.good("decode", "--dbc", "vg.dbc", "valid.log").stdout)["signals"]
        self.assertEqual(valid["VG_Valid"], {"value": 0, "raw": 0, "unit": "", "label": "invalid"})
        self.assertEqual(valid["VG_Rate"]["value"], 0)

    def test_a_file_that_decodes_nothing_is_told(self):
        # A frame that never comes: the wrong file of two, or the wrong log.
        self.write("in.log", "(1.0) can0 101#0000000000000000\n(2.0) can0 0CF02A3E#00\n")
        said = self.good("decode", "--dbc", "bench.dbc", "--dbc", "other.dbc", "in.log").stderr.decode()
        self.assertNotIn("none of its", said)
        self.write("in.log", "(1.0) can0 101#0000000000000000\n(2.0) can0 7A0#00\n")
        said = self.good("decode", "--dbc", "bench.dbc", "--dbc", "other.dbc", "in.log").stderr.decode()
        self.assertIn("warning: other.dbc: none of its 5 messages is in the log; the log's identifiers are: 101, 7A0", said)
        self.assertNotIn("bench.dbc", said)

    def test_a_missed_sender_is_told(self):
        # The file does not declare J1939, so that only its own address matches.
        self.write("silent.dbc", "VERSION \"\"\n\nBO_ 2565876225 TURN: 8 X\n SG_ Rate : 0|16@1- (0.01,0) [0|0] \"deg/s\" X\n")
        self.write("in.log", "(1.0) can0 18F02A13#0000000000000000\n(2.0) can0 0CF02A14#0000000000000000\n")
        said = self.good("decode", "--dbc", "silent.dbc", "in.log").stderr.decode()
        self.assertIn("silent.dbc:3: no frame 18F02A01 came (TURN), but the same PGN came from 0x13, 0x14", said)
        self.assertIn("VFrameFormat = J1939PG", said)

    def test_full_disk_is_an_error(self):
        # A truncated output that looks complete is worse than none.
        self.write("in.log", "".join(bench.two_gyros(1)))
        with open("/dev/full", "wb") as full:
            self.assertIn("standard output", self.bad("decode", "--dbc", "bench.dbc", "in.log", stdout=full))


if __name__ == "__main__":
    unittest.main()
