#!/usr/bin/python3
"""`vgyro replay`: its output, the counts of its summary, and its errors for bad input."""

import collections
import gzip
import html
import json
import lzma
import math
import os
import random
import re
import resource
import struct
import subprocess
import unittest
import zlib

import bench

RATE, BIAS, MODEL = "610", "611", "612"


def frames(text):
    """(stamp text, bus, id text, payload) of candump lines."""
    found = []
    for line in text.splitlines():
        match = re.fullmatch(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]+)#([0-9A-F]*)", line)
        assert match, line
        found.append((match[1], match[2], match[3], bytes.fromhex(match[4])))
    return found


def rate_of(payload):
    """deg/s of VG_Rate, None where invalid."""
    raw = int.from_bytes(payload[2:5], "little", signed=True)
    valid = payload[6] >> 7
    assert valid == (raw != -(1 << 23)), payload.hex()
    return raw * 5e-5 if valid else None


class Replay(bench.Bench):
    def setUp(self):
        super().setUp()
        self.lines = bench.two_gyros(4)
        self.write("in.log", "".join(self.lines))

    def replay(self, *arguments, **options):
        return self.good("replay", "--config", "vgyro.toml", *arguments, **options)

    def summary(self, *logs, lines=None, arguments=()):
        if lines is not None:
            self.write("in.log", "".join(lines))
        done = self.replay("--json", "-", "-q", *arguments, *(logs or ("in.log",)))
        return json.loads(done.stdout)

    def refuse(self, *arguments, **options):
        return self.bad("replay", "--config", "vgyro.toml", *arguments, **options)


class Output(Replay):
    def test_frames_go_to_standard_output(self):
        # Without options it is a filter: log in, log out.
        out = frames(self.replay("in.log").stdout.decode())
        self.assertEqual({f[2] for f in out}, {RATE, BIAS, MODEL})
        self.assertEqual({f[1] for f in out}, {"can0"})
        rates = [rate_of(f[3]) for f in out if f[2] == RATE]
        self.assertGreater(len(rates), 390)
        self.assertIsNone(rates[0])
        self.assertAlmostEqual(rates[-1], 0.0032, delta=3e-5)

    def test_each_line_carries_the_stamp_of_the_frame_that_caused_it(self):
        # The input's stamps make an output log comparable with its input.
        stamps = {line[1:18] for line in self.lines}
        for frame in frames(self.replay("in.log").stdout.decode()):
            self.assertIn(frame[0], stamps)

    def test_the_same_input_gives_the_same_bytes(self):
        # The output is the same on every run, into a file or a pipe, from a file, a pipe or an archive.
        first = self.replay("in.log").stdout
        text = "".join(self.lines).encode()
        (self.folder / "in.log.xz").write_bytes(lzma.compress(text))
        self.replay("-o", "out.log", "in.log")
        self.assertEqual((self.folder / "out.log").read_bytes(), first)
        self.assertEqual(self.replay("in.log").stdout, first)
        self.assertEqual(self.replay("-", stdin=text).stdout, first)
        self.assertEqual(self.replay("in.log.xz").stdout, first)

    def test_several_logs_are_one_recording(self):
        # candump -l sometimes begins a new file.
        whole = self.replay("in.log").stdout
        self.write("first.log", "".join(self.lines[:301]))
        self.write("second.log", "".join(self.lines[301:]))
        self.assertEqual(self.replay("first.log", "second.log").stdout, whole)

    def test_logs_of_the_same_time_are_merged(self):
        # Users often have one `candump -l` per bus. One more begins later, one comes compressed from a pipe.
        whole = self.replay("in.log").stdout
        for bus in ("can0", "can1"):
            self.write(f"{bus}.log", "".join(line for line in self.lines if f" {bus} " in line))
        self.assertEqual(self.replay("can0.log", "can1.log").stdout, whole)
        self.assertEqual(self.replay("can1.log", "can0.log").stdout, whole)
        packed = gzip.compress((self.folder / "can1.log").read_bytes())
        self.assertEqual(self.replay("can0.log", "-", stdin=packed).stdout, whole)
        found = self.summary("can0.log", "can1.log")
        self.assertEqual([log["frames"] for log in found["logs"]], [len(self.lines) // 2] * 2)

    def test_logs_that_cannot_belong_together_are_refused(self):
        self.write("relative.log", bench.line_b(3_000_000, 0.3))
        self.assertIn("which frames were simultaneous is unknown", self.refuse("in.log", "relative.log"))
        self.assertIn("is named twice", self.refuse("in.log", "in.log"))

    def test_stamps_have_as_many_digits_as_asked_for(self):
        # canplayer does not accept nine digits.
        nine = [line.replace(") ", "000) ", 1) for line in self.lines]
        self.write("nine.log", "".join(nine))
        self.assertEqual(self.replay("--digits", "6", "nine.log").stdout, self.replay("in.log").stdout)
        self.assertEqual(self.replay("--digits", "9", "in.log").stdout, self.replay("nine.log").stdout)

    def test_what_was_passed_over_is_told(self):
        # A byte-order mark is skipped; NUL bytes of a power cut, and other lines, are counted.
        text = b"\xef\xbb\xbf" + "".join(self.lines[:400]).encode() + b"a remark\n" + bytes(4096)
        (self.folder / "odd.log").write_bytes(text + "".join(self.lines[400:]).encode())
        done = self.replay("odd.log")
        self.assertEqual(done.stdout, self.replay("in.log").stdout)
        self.assertIn("1 other line, 4096 stray bytes passed over", done.stderr.decode())
        self.assertEqual(self.summary("odd.log")["logs"][0]["skipped_bytes"], 4096)

    def test_method_may_be_chosen_on_the_command_line(self):
        # The plain mean keeps the gyros' own biases: 0.5 and -0.3 deg/s.
        out = frames(self.replay("--method", "mean", "in.log").stdout.decode())
        rates = [rate_of(f[3]) for f in out if f[2] == RATE]
        self.assertAlmostEqual(rates[-1], 0.1032, delta=3e-5)
        self.assertIsNotNone(rates[0])

    def test_map_takes_interfaces_of_the_log_for_those_of_the_config(self):
        # A foreign log has other interface names.
        renamed = "".join(self.lines).replace(" can0 ", " slcan7 ").replace(" can1 ", " can0 ")
        self.write("other.log", renamed)
        mapped = self.replay("--map", "slcan7=can0", "--map", "can0=can1", "other.log").stdout
        self.assertEqual(mapped, self.replay("in.log").stdout)

    def test_fd_output_is_written_as_fd_lines(self):
        # 32 bytes with a bit-rate switch.
        self.write("vgyro.toml", bench.CONFIG + "fd = true\n")
        lines = self.replay("in.log").stdout.decode().splitlines()
        rates = [line for line in lines if " 610#" in line]
        self.assertGreater(len(rates), 390)
        for line in rates:
            self.assertRegex(line, r"^\(\d+\.\d{6}\) can0 610##[0-9A-F][0-9A-F]{64}$")

    def test_nanosecond_logs_stay_nanosecond_logs(self):
        # Newer candumps write nine digits.
        self.write("in.log", "".join(self.lines).replace(") can", "789) can"))
        for line in self.replay("in.log").stdout.decode().splitlines():
            self.assertRegex(line, r"^\(\d+\.\d{6}789\)")

    def test_stdin_streams(self):
        # Live behind candump: frames are written before the input ends.
        import select
        process = subprocess.Popen([bench.VGYRO, "replay", "--config", "vgyro.toml", "-q", "-"], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=self.folder)
        try:
            process.stdin.write("".join(self.lines).encode())
            process.stdin.flush()
            readable, _, _ = select.select([process.stdout], [], [], 20)
            self.assertTrue(readable, "nothing came within 20 s")
        finally:
            process.stdin.close()
            process.stdout.read()
            code = process.wait(timeout=20)
            process.stdout.close()
        self.assertEqual(code, 0)

    def test_stderr_has_a_summary_and_no_progress_bar(self):
        # A log file must not contain escape sequences; --quiet prints nothing.
        said = self.replay("-o", "out.log", "in.log").stderr.decode()
        self.assertNotRegex(said, "[\r\x1b]")
        for part in ("in.log: 800 frames", "gyro left", "gyro right", "valid rates", "ended in state running"):
            self.assertIn(part, said)
        self.assertEqual(self.replay("-q", "-o", "out.log", "in.log").stderr, b"")


class Table(Replay):
    """Compares --csv with the frames of the same run, decoded with the DBC file's numbers."""
    HEADER = "t_s,rate_dps,sigma_dps,valid,state,bias1_dps,bias2_dps,heading_deg"

    def rows(self, lines, method):
        self.write("in.log", "".join(lines))
        self.replay("--method", method, "-o", "x.log", "--csv", "x.csv", "in.log")
        rates = [(float(line.split(")")[0][1:]), int.from_bytes(bytes.fromhex(line.split("#")[1]), "little"))
                 for line in self.read("x.log").splitlines() if " 610#" in line]
        header, *rows = self.read("x.csv").splitlines()
        self.assertEqual(header, self.HEADER)
        self.assertEqual(len(rows), len(rates))
        self.assertGreater(len(rows), 300)
        return [(row.split(","), stamp, word) for row, (stamp, word) in zip(rows, rates)]

    def test_a_row_says_what_its_frame_says(self):
        states = ("waiting", "calibrating", "running", "degraded", "lost", "contradicted")
        for method in ("optimal", "mutual", "mean"):
            with self.subTest(method):
                valid_rows = 0
                for row, stamp, word in self.rows(bench.two_gyros(6, turn_dps=3.0), method):
                    valid = word >> 55 & 1
                    self.assertEqual(row[3], str(valid))
                    self.assertEqual(row[4], states[word >> 52 & 7])
                    # VG_Age counts halves of a millisecond; the first pairs are older than its range.
                    if word >> 60 < 15:
                        self.assertAlmostEqual(float(row[0]), stamp - (word >> 60) * 0.0005, delta=0.000251)
                    self.assertRegex(row[0], r"^\d+\.\d{6}$")
                    if not valid:
                        self.assertEqual((row[1], row[2], row[7]), ("", "", ""))
                        continue
                    valid_rows += 1
                    raw = word >> 16 & 0xFFFFFF
                    rate_dps = (raw - (raw >> 23 << 24)) * 5e-5
                    self.assertAlmostEqual(float(row[1]), rate_dps, delta=2.6e-5)
                    if word >> 40 & 0xFFF != 0xFFF:
                        self.assertAlmostEqual(float(row[2]), (word >> 40 & 0xFFF) * 2e-5, delta=2.1e-5)
                self.assertGreater(valid_rows, 300)

    def test_heading_is_the_sum_of_the_rates_across_holes_too(self):
        lines = bench.two_gyros(8, turn_dps=3.0)
        del lines[800:1000]  # a second of nothing
        expected_deg, last = 0.0, None
        for row, _, _ in self.rows(lines, "mutual"):
            if row[3] == "0":
                continue
            now = float(row[0]), float(row[1])
            if last is not None:
                expected_deg += (now[0] - last[0]) * (now[1] + last[1]) / 2
            last = now
            # Each of some 700 rates is rounded to 1e-7 deg/s, each instant to 1e-6 s.
            self.assertAlmostEqual(float(row[7]), expected_deg, delta=1e-5)
        # 1.2 s at rest before, of which the first second is the calibration.
        self.assertAlmostEqual(expected_deg, 3.0 * 6.8, delta=0.05)

    def test_biases_are_those_of_the_drifts(self):
        row = self.rows(bench.two_gyros(6), "mutual")[-1][0]
        self.assertAlmostEqual(float(row[5]), 0.5, delta=1e-3)
        self.assertAlmostEqual(float(row[6]), -0.3, delta=1e-3)

    def test_on_standard_output_it_stands_alone(self):
        self.write("in.log", "".join(bench.two_gyros(6)))
        said = self.replay("--csv", "-", "in.log").stdout.decode()
        self.assertEqual(said.splitlines()[0], self.HEADER)
        self.assertNotIn("#", said)


class Summary(Replay):
    def test_counts_agree_with_a_count_of_the_log(self):
        # Frames by interface and id, counted here in one line of Python.
        junk = ["(1700000001.000000) can1 555#00\n", "(1700000001.000000) can2 00000101#00\n"]
        lines = self.lines[:200] + junk * 3 + self.lines[200:]
        counted = collections.Counter()
        for line in lines:
            _, bus, frame = line.split()
            counted[bus, int(frame.split("#")[0], 16), len(frame.split("#")[0]) == 8] += 1
        found = self.summary(lines=lines)
        self.assertEqual({(r["bus"], r["id"], r["extended"]): r["frames"] for r in found["frames_by_id"]}, dict(counted))
        self.assertEqual({r["id"]: r["gyro"] for r in found["frames_by_id"] if not r["extended"]},
                         {0x101: "left", 0x102: "right", 0x555: None})
        self.assertEqual(found["logs"][0]["frames"], len(lines))
        self.assertEqual([g["frames"] for g in found["gyros"]], [400, 400])
        self.assertEqual([g["samples"] for g in found["gyros"]], [400, 400])

    def test_counts_agree_with_the_frames_that_came_out(self):
        # The same run, both outputs.
        done = self.replay("-o", "out.log", "--json", "sum.json", "in.log")
        self.assertEqual(done.stdout, b"")
        found = json.loads(self.read("sum.json"))
        out = frames(self.read("out.log"))
        rates = [rate_of(f[3]) for f in out if f[2] == RATE]
        valid = [r for r in rates if r is not None]
        self.assertEqual(found["out"]["frames"], len(out))
        self.assertEqual(found["out"]["rates"], len(rates))
        self.assertEqual(found["out"]["rates_valid"], len(valid))
        self.assertEqual(found["out"]["biases"], sum(f[2] == BIAS for f in out))
        self.assertEqual(found["pairs"], len(rates))
        self.assertAlmostEqual(found["out"]["mean_rate_dps"], sum(valid) / len(valid), delta=2.5e-5)
        self.assertEqual(found["final_state"], "running")
        self.assertAlmostEqual(found["gyros"][0]["bias_dps"], 0.5, delta=1e-5)
        self.assertAlmostEqual(found["gyros"][1]["bias_dps"], -0.3, delta=1e-5)
        self.assertAlmostEqual(found["gyros"][0]["temperature_c"], 25.0)
        self.assertIsNone(found["gyros"][1]["temperature_c"])
        self.assertAlmostEqual(found["last_s"] - found["first_s"], 3.993, places=6)

    def test_several_logs_with_different_interfaces_are_kept_apart(self):
        # Each log numbers its interfaces by itself.
        self.write("a.log", "".join(l for l in self.lines if "can0" in l))
        self.write("b.log", "(1700000009.0) can7 001#00\n" + "".join(l for l in self.lines if "can1" in l))
        done = self.run_vgyro("replay", "--config", "vgyro.toml", "--json", "-", "-q", "a.log", "b.log")
        found = json.loads(done.stdout)
        self.assertEqual({(r["bus"], r["id"]): r["frames"] for r in found["frames_by_id"]},
                         {("can0", 0x101): 400, ("can1", 0x102): 400, ("can7", 1): 1})
        self.assertEqual([log["frames"] for log in found["logs"]], [400, 401])

    def test_every_cause_of_rejection_is_counted(self):
        # One bad frame of each kind among good ones; each is counted under its own cause.
        lines = list(self.lines)
        a = [i for i, line in enumerate(lines) if " 101#" in line]
        b = [i for i, line in enumerate(lines) if " 102#" in line]
        lines[b[200]] = lines[b[200]].split("#")[0] + "#3F80\n"
        lines[b[205]] = lines[b[205]].split("#")[0] + "#7FC00000\n"
        lines[b[210]] = lines[b[210]].split("#")[0] + "#7F800000\n"
        lines[b[215]] = lines[b[215]].split("#")[0] + "#7149F2CA\n"  # 1e30
        lines[b[220]] = lines[b[220]].split("#")[0] + "#R4\n"
        lines[b[225]] = lines[b[225]] * 2
        lines[a[230]] = lines[a[230]][:-3] + "01\n"  # Status 1
        lines[a[235]] = lines[a[235]][:-5] + lines[a[234]][-5:]  # the counter of the frame before
        lines[b[240]] = "(1700009999.000000)" + lines[b[240]][19:]
        found = self.summary(lines=lines)
        left, right = (g["rejected"] for g in found["gyros"])
        self.assertEqual({k: v for k, v in right.items() if v},
                         {"truncated": 1, "not_finite": 2, "out_of_range": 1, "not_data": 1, "stamp_repeated": 1,
                          "stamp_jump": 1})
        # Five good samples follow the invalid one before the gyro is used again.
        self.assertEqual({k: v for k, v in left.items() if v},
                         {"flagged_invalid": 1, "counter_repeated": 1, "recovering": 5})
        faults = found["gyros"][0]["faults"]
        self.assertEqual(set(faults), {"flagged_invalid"})
        self.assertEqual(faults["flagged_invalid"]["times"], 1)
        self.assertAlmostEqual(faults["flagged_invalid"]["last_s"], float(lines[a[230]][1:18]), delta=1e-6)
        self.assertEqual(found["gyros"][1]["faults"], {})
        for gyro in found["gyros"]:
            self.assertEqual(gyro["frames"], gyro["samples"] + sum(gyro["rejected"].values()))
        self.assertEqual(found["final_state"], "running")
        self.assertAlmostEqual(found["out"]["mean_rate_dps"], 0.0032, delta=1e-3)

    def test_lost_frames_and_gaps_are_told(self):
        # Two seconds of one gyro are missing; its counter shows how many frames that is, beside the silence.
        lines = [l for i, l in enumerate(self.lines) if not (" 101#" in l and 500 <= i < 508)]
        found = self.summary(lines=lines)
        self.assertEqual(found["gyros"][0]["missing_by_counter"], 4)
        self.assertNotIn("counter_turns_at", found["gyros"][0])
        lines = [l for l in bench.two_gyros(8) if not 1700000003.0 <= float(l[1:18]) < 1700000005.0]
        found = self.summary(lines=lines)
        self.assertEqual(found["gaps"]["count"], 1)
        # After such a long pause two samples only confirm the new time.
        self.assertAlmostEqual(found["gaps"]["longest"][0]["length_s"], 2.03, delta=0.02)
        self.assertAlmostEqual(found["gaps"]["longest"][0]["from_s"], 3.0, delta=0.05)

    def test_stamps_back_by_seconds_are_counted(self):
        # The host's clock was set while candump ran.
        lines = bench.two_gyros(3) + bench.two_gyros(6, begin_us=1_699_999_990_000_000)[600:]
        found = self.summary(lines=lines)
        self.assertEqual(found["clock_steps"], 1)
        self.assertEqual(found["final_state"], "running")

    def test_junk_lines_are_counted_with_their_numbers(self):
        # The line number lets the user find the line.
        lines = [*self.lines[:2], "(17) can0 nonsense\n", "DROPCOUNT: 5\n", *self.lines[2:]]
        log = self.summary(lines=lines)["logs"][0]
        self.assertEqual(log["malformed_lines"], 1)
        self.assertEqual(log["other_lines"], 1)
        self.assertEqual(log["first_malformed"][0]["line"], 3)
        said = self.replay("-o", "out.log", "in.log").stderr.decode()
        self.assertIn("line 3: ", said)

    def test_log_that_ends_inside_a_line_is_used_up_to_there(self):
        # The disk was full, or the power failed.
        lines = [*self.lines[:-1], self.lines[-1][:-6]]
        log = self.summary(lines=lines)["logs"][0]
        self.assertEqual((log["frames"], log["cut_off_lines"]), (799, 1))
        self.assertIn("ends inside line 800", self.replay("-o", "out.log", "in.log").stderr.decode())

    def test_json_is_valid_whatever_the_interfaces_are_called(self):
        # The interface name may contain any bytes.
        text = b"(1.0) c\xff\xfen 001#00\n" + "".join(self.lines).encode()
        self.write("in.log", text)
        json.loads(self.replay("--json", "-", "-q", "in.log").stdout)

    def test_json_on_standard_output_stands_alone(self):
        # With `--json -` the frames go only to the file of -o.
        found = self.replay("--json", "-", "-q", "-o", "out.log", "in.log")
        self.assertEqual(json.loads(found.stdout)["format"], 1)
        self.assertGreater(len(self.read("out.log")), 1000)

    def test_summary_does_not_depend_on_the_run(self):
        # The summary does not depend on the machine or the time.
        self.assertEqual(self.summary(), self.summary())


def stops_and_turns(turns, begin_us=1_700_000_000_000_000):
    """Lines of two gyros with noise: 15 s of rest, a stop of 10 s, and `turns` steady turns of 10 s at 20 deg/s,
    with bends between them."""
    rng = random.Random(20240917)
    stretches = [(15, 0.0)] + [(6, None), (10, 0.0)] + [(6, None), (10, 20.0)] * turns + [(6, None)]
    lines, i, offset = [], 0, 0.0
    for seconds, level in stretches:
        if level:
            offset = level
        for k in range(round(seconds * 100)):
            rate = 0.0032 + (offset + 8.0 * math.sin(2.0 * math.pi * k / 300) if level is None else level)
            at = begin_us + i * 10_000
            lines.append(bench.line_a(at, rate + 0.5 + rng.gauss(0.0, 0.01), i))
            lines.append(bench.line_b(at + 3_000, -(rate - 0.3 + rng.gauss(0.0, 0.01))))
            i += 1
    return lines


class Thoughts(Replay):
    """The corrector's findings appear in the text, in the JSON, and in the picture."""

    def setUp(self):
        super().setUp()
        self.write("vgyro.toml", bench.CONFIG.replace('"mutual"', '"optimal"').replace("rest_s = 1.0", "rest_s = 10.0"))

    def test_stops_learned_and_refused_are_counted_and_said_alike(self):
        self.write("in.log", "".join(stops_and_turns(4)))
        done = self.replay("--json", "sum.json", "-o", "out.log", "in.log")
        found = json.loads(self.read("sum.json"))
        stops, said = found["stops"], done.stderr.decode()
        self.assertEqual(set(stops), {"learned", "refused", "open"})
        self.assertGreaterEqual(stops["learned"], 1)
        self.assertGreaterEqual(stops["refused"], 3)
        number = stops["learned"]
        self.assertIn(f"{number + stops['refused']} stops: {number} learned, {stops['refused']} refused (moving together)", said)
        # Most stops were refused: there is a warning with the settings to check.
        warnings = [line for line in said.splitlines() if line.startswith("warning: stops: ")]
        self.assertEqual(len(warnings), 1, said)
        for part in ("rate_dps", "latitude_deg", "max_bias_dps"):
            self.assertIn(part, warnings[0])

    def test_no_warning_where_few_are_refused(self):
        self.write("in.log", "".join(stops_and_turns(1)))
        self.assertNotIn("warning", self.replay("-o", "out.log", "in.log").stderr.decode())

    def test_hypotheses_are_probabilities_with_a_name(self):
        # The log ends within its first stop: standing.
        found = self.summary(lines=stops_and_turns(0)[:2 * 3000])
        self.assertGreater(found["hypotheses"]["standing"], 0.9)
        for name, probability in found["hypotheses"].items():
            self.assertRegex(name, "^[a-z_0-9]+$")
            self.assertGreater(probability, 0.05)
            self.assertLessEqual(probability, 1.0 + 1e-9)
        self.assertIs(found["ambiguous"], False)
        self.assertEqual((found["estimate_restarts"], found["rates_too_far_apart"]), (0, False))
        self.assertRegex(self.replay("-o", "out.log", "in.log").stderr.decode(), r"(?m)^at the end +standing (9\d|100) %")

    def test_methods_that_think_nothing_say_nothing(self):
        self.write("in.log", "".join(stops_and_turns(0)))
        said = self.replay("--method", "mutual", "-o", "out.log", "in.log").stderr.decode()
        for words in ("steady stretch", "at the end", "drifts "):
            self.assertNotIn(words, said)
        self.assertEqual(self.summary(arguments=("--method", "mean"))["hypotheses"], {})

    def test_slopes_are_numbers_or_null(self):
        found = self.summary(lines=stops_and_turns(1))
        for gyro in found["gyros"]:
            self.assertEqual(gyro["slope_dps_s"] is None, gyro["slope_sigma_dps_s"] is None)
        found = self.summary(arguments=("--method", "mean"))
        self.assertEqual([g["slope_dps_s"] for g in found["gyros"]], [None, None])

    def test_picture_shades_what_was_learned_and_what_was_refused(self):
        self.write("in.log", "".join(stops_and_turns(4)))
        self.replay("-q", "-o", "out.log", "--plot", "a.svg", "in.log")
        svg = self.read("a.svg")
        self.assertIn("stop learned", svg)
        self.assertIn("stop refused: turning", svg)
        self.assertNotIn("ambiguous", svg, "nothing here is")
        for colour in ("rgb(204, 236, 227)", "rgb(247, 223, 204)"):
            self.assertGreaterEqual(svg.count(colour), 5, f"{colour} is in each panel with an axis of time")
        for colour in ("rgb(  0, 158, 115)", "rgb(213,  94,   0)"):
            self.assertGreaterEqual(svg.count(colour), 1, f"{colour} is in its lane")

    def test_picture_shows_what_the_heading_came_to(self):
        # The raw gyros read 0.5 and -0.3 deg/s too much; the legend shows that, integrated over the valid time.
        self.write("in.log", "".join(stops_and_turns(4)))
        self.replay("-q", "-o", "out.log", "--csv", "out.csv", "--plot", "a.svg", "in.log")
        rows = [line.split(",") for line in self.read("out.csv").splitlines()[1:]]
        valid = [float(row[0]) for row in rows if row[2 + 1] == "1"]
        span = valid[-1] - valid[0]
        text = html.unescape(re.sub(r"<[^>]*>", " ", self.read("a.svg")))
        ends = {name: float(end) for name, end in re.findall(r"(gyro left|gyro right|mean)\s+([+-][0-9.]+)°", text)}
        for name, rate in (("gyro left", 0.5), ("gyro right", -0.3), ("mean", 0.1)):
            self.assertAlmostEqual(ends[name] / span, rate, delta=0.02, msg=f"{name} over {span:.1f} s: {ends}")
        self.assertRegex(text, r"virtual gyro ±[0-9.]+°")

    def test_drift_is_told_with_its_sigma_and_two_digits_beyond(self):
        self.write("in.log", "".join(stops_and_turns(1)))
        said = self.replay("-o", "out.log", "--json", "s.json", "in.log").stderr.decode()
        gyros = json.loads(self.read("s.json"))["gyros"]
        told = re.findall(r"drift now ([+-][0-9.]+) ± ([0-9.]+) deg/s", said)
        self.assertEqual(len(told), 2, said)
        for gyro, (drift, sigma), truth in zip(gyros, told, (0.5, -0.3)):
            self.assertEqual(len(drift.split(".")[1]), len(sigma.split(".")[1]))
            self.assertRegex(sigma, r"^0\.0*[1-9][0-9]$")
            self.assertLess(abs(float(sigma) / gyro["bias_sigma_dps"] - 1.0), 0.06)
            self.assertLess(abs(gyro["bias_dps"] - truth), 5.0 * gyro["bias_sigma_dps"])

    def test_a_gyro_that_is_aside_most_of_the_time_is_warned_of(self):
        # The right gyro falls silent soon after the calibration and stays so.
        lines = stops_and_turns(4)
        begin = float(lines[0].split(")")[0][1:])
        self.write("in.log", "".join(line for line in lines if not ("can1" in line and float(line.split(")")[0][1:]) - begin > 17.0)))
        said = self.replay("-o", "out.log", "in.log").stderr.decode()
        self.assertRegex(said, r"warning: gyro right: was aside most of the time: it took part in \d+ of \d+ valid rates")
        self.write("in.log", "".join(lines))
        self.assertNotIn("was aside most", self.replay("-o", "out.log", "in.log").stderr.decode())

    def test_picture_names_a_stretch_of_one_gyro_and_its_fault(self):
        # The right gyro is silent for four seconds in the middle.
        lines = stops_and_turns(4)
        begin = float(lines[0].split(")")[0][1:])
        gone = [line for line in lines if not ("can1" in line and 17.0 < float(line.split(")")[0][1:]) - begin < 21.0)]
        self.assertLess(len(gone), len(lines))
        self.write("in.log", "".join(gone))
        self.replay("-q", "-o", "out.log", "--plot", "a.svg", "in.log")
        svg = self.read("a.svg")
        self.assertTrue("one gyro alone" in svg, "one gyro alone")
        self.assertTrue("right: silent" in svg, "right: silent")
        self.assertTrue("calibrating" in svg, "calibrating")

    def test_a_step_of_a_gyro_is_told_as_such_until_it_is_settled(self):
        # In motion it does not show which gyro stepped: either is likely, and σ covers both.
        rng, stepped = random.Random(3), []
        for k in range(3000):
            at, rate = 1_700_000_015_000_000 + k * 10_000, 8.0 * math.sin(2.0 * math.pi * k / 300)
            step = 0.3 if k >= 1500 else 0.0
            stepped.append(bench.line_a(at, rate + 0.5 + rng.gauss(0.0, 0.01), 1500 + k))
            stepped.append(bench.line_b(at + 3_000, -(rate - 0.3 + step + rng.gauss(0.0, 0.01))))
        found = self.summary(lines=stops_and_turns(0)[:2 * 1500] + stepped, arguments=("--plot", "a.svg"))
        self.assertIs(found["ambiguous"], True)
        self.assertGreater(found["hypotheses"]["gyro_1_stepped"], 0.05)
        self.assertGreater(found["hypotheses"]["gyro_2_stepped"], 0.05)
        self.assertIn("ambiguous", self.read("a.svg"))
        said = self.replay("-o", "out.log", "in.log").stderr.decode()
        self.assertRegex(said, r"can be read in two ways, and σ spans both: gyro left has stepped \d+ %; gyro right has stepped \d+ %")

    def test_no_curve_and_no_stop_goes_on_across_a_hole(self):
        lines = stops_and_turns(4)
        begin = float(lines[0].split(")")[0][1:])
        keep = [line for line in lines if not 0.3 < (float(line.split(")")[0][1:]) - begin) / (len(lines) / 200) < 0.7]
        self.assertLess(len(keep), 0.7 * len(lines))
        self.write("in.log", "".join(keep))
        self.replay("-o", "x.log", "--plot", "x.svg", "in.log")
        picture = self.read("x.svg")
        curves = 0
        for path in re.findall(r"<path stroke='rgb\([^']*\)'\s+d='([^']*)'", picture):
            points = [(kind, float(x)) for kind, x in re.findall(r"([ML])([0-9.]+),", path)]
            if len(points) < 400:
                continue  # the grid, the legend, the line at zero
            curves += 1
            drawn = [to - before for (_, before), (kind, to) in zip(points, points[1:]) if kind == "L"]
            width = max(x for _, x in points[2:]) - min(x for _, x in points[2:])
            self.assertLess(max(drawn[1:]), 0.05 * width)
        self.assertEqual(curves, 13, "four headings, three off the virtual gyro, four rates, two drifts")
        shades = [float(to) - float(begin) for begin, to in re.findall(r"<polygon fill = '[^']*' points = '([0-9.]+),[^ ]* ([0-9.]+),", picture)]
        self.assertGreater(len(shades), 8, "four pictures, each with its stops")
        self.assertLess(max(shades), 0.2 * width)

    def test_picture_without_stretches_has_no_legend_of_them(self):
        self.write("in.log", "".join(self.lines))
        self.replay("-q", "-o", "out.log", "--method", "mutual", "--plot", "a.svg", "in.log")
        self.assertNotIn("learned as a stop", self.read("a.svg"))


class BadInput(Replay):
    def test_missing_log(self):
        # Reported before anything is overwritten.
        self.write("out.log", "precious\n")
        self.assertIn("nowhere.log: cannot be opened: No such file", self.refuse("-o", "out.log", "nowhere.log"))
        self.assertEqual(self.read("out.log"), "precious\n")

    def test_second_log_missing(self):
        # Reported at once, not after an hour with the first log.
        self.write("out.log", "precious\n")
        self.assertIn("nowhere.log", self.refuse("-o", "out.log", "in.log", "nowhere.log"))
        self.assertEqual(self.read("out.log"), "precious\n")

    def test_empty_log_and_no_log_at_all(self):
        # A log without frames is an error.
        self.write("empty.log", "")
        self.write("prose.log", "Dear diary,\nno frames today.\n")
        for log, what in (("empty.log", "holds no CAN frame"), ("/dev/null", "holds no CAN frame"),
                          ("prose.log", "is text, but not a known log of CAN frames")):
            said = self.refuse("-q", log)
            self.assertIn(what, said)
            self.assertIn("candump -L", said)

    def test_directory(self):
        # Tab completion stops at the folder.
        self.assertIn("is a directory, not a log", self.refuse("-q", "."))

    def test_damaged_archive(self):
        # The part before the damage is used, and the damage is reported.
        packed = lzma.compress("".join(self.lines).encode())
        (self.folder / "cut.log.xz").write_bytes(packed[: len(packed) // 2])
        self.assertIn("cut.log.xz: ends in the middle", self.refuse("-q", "cut.log.xz"))

    def test_the_content_of_a_log_counts_and_not_its_name(self):
        # Users rename files, and some programs unpack them in transfer.
        self.write("plain.log.xz", "".join(self.lines))
        (self.folder / "packed.log").write_bytes(gzip.compress("".join(self.lines).encode()))
        expected = self.replay("in.log").stdout
        self.assertEqual(self.replay("plain.log.xz").stdout, expected)
        self.assertEqual(self.replay("packed.log").stdout, expected)
        self.write("drive.bag", "#ROSBAG V2.0\n")
        self.assertIn("is a ROS 1 bag", self.refuse("-q", "drive.bag"))

    def test_one_gyro_missing_lists_the_interfaces_of_the_log(self):
        # The usual cause is the name of the interface.
        self.write("in.log", "".join(self.lines).replace("can1", "vcan5"))
        said = self.refuse("-q", "in.log")
        for part in ("no frame of gyro right", "GYRO_B 102 on can1", "can0, vcan5", "--map LOGNAME=can1"):
            self.assertIn(part, said)

    def test_a_missed_sender_of_the_same_pgn_is_told(self):
        # The DBC file does not declare J1939, so that only its own address matches, and the address is another one.
        dbc = ('BO_ 2565876225 TURN: 8 X\n SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" X\n'
               'BO_ 512 REF: 8 X\n SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" X\n')
        config = "".join(f'[[gyro]]\nname = "{name}"\nbus = "can0"\ndbc = "t.dbc"\nmessage = "{message}"\nrate = "Rate"\n'
                         for name, message in (("ref", "REF"), ("turn", "TURN"))) + '[output]\nbus = "can1"\n'
        self.write("in.log", "(1.0) can0 200#0000000000000000\n(1.1) can0 18F02A13#0000000000000000\n"
                             "(1.2) can1 18F02A14#0000000000000000\n")
        self.write("t.dbc", dbc)
        self.write("vgyro.toml", config)
        said = self.refuse("in.log")
        self.assertIn("gyro turn: no frame 18F02A01 came (TURN), but the same PGN came from 0x13; ", said)
        self.assertIn("VFrameFormat = J1939PG", said)
        self.write("t.dbc", dbc + 'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\n')
        self.write("vgyro.toml", config.replace('"TURN"\n', '"TURN"\nsource_address = 5\n'))
        said = self.refuse("in.log")
        self.assertIn("no frame 18F02A05 came (TURN), but the same PGN came from 0x13; another source_address", said)

    def test_a_counter_is_followed_over_all_pages(self):
        # Four pages, and a counter of two bits that counts every frame: on one page it does not change.
        self.write("t.dbc", """\
BO_ 288 IMU: 8 X
 SG_ Page M : 0|2@1+ (1,0) [0|3] "" X
 SG_ Alive : 4|2@1+ (1,0) [0|3] "" X
 SG_ RateZ m2 : 8|16@1- (0.01,0) [-300|300] "deg/s" X
BO_ 512 REF: 8 X
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" X
""")
        self.write("vgyro.toml", """\
[[gyro]]
name = "imu"
bus = "can0"
dbc = "t.dbc"
message = "IMU"
rate = "RateZ"
counter = "Alive"
max_delta_counter = 1
[[gyro]]
name = "ref"
bus = "can0"
dbc = "t.dbc"
message = "REF"
rate = "Rate"
[calibration]
rest_s = 1
[output]
bus = "can1"
""")
        lines = []
        for i in range(1200):
            lines.append(f"({i // 400}.{i % 400 * 2500:06d}) can0 120#{i % 4 | i % 4 << 4:02X}{i % 7:02X}00\n")
            if i % 4 == 1:
                lines.append(f"({i // 400}.{i % 400 * 2500 + 100:06d}) can0 200#{i % 5:02X}00\n")
        imu = self.summary(lines=lines)["gyros"][0]
        causes = {cause: n for cause, n in imu["rejected"].items() if n > 0}
        self.assertEqual((imu["samples"], imu["missing_by_counter"], causes), (300, 0, {"other_page": 900}))
        without = [line for i, line in enumerate(lines) if i != 300]  # one frame of another page is lost
        lost = self.summary(lines=without)["gyros"][0]
        self.assertGreaterEqual(lost["samples"], 299)
        self.assertEqual(lost["samples"] + lost["rejected"]["wrong_sequence"], 300)

    def test_gyro_without_a_usable_frame_says_why(self):
        # All frames are present and none is usable: the DBC file is not that of this gyro.
        self.write("in.log", "".join(l[:-5] + "\n" if " 102#" in l else l for l in self.lines))
        said = self.refuse("-q", "in.log")
        for part in ("no frame of gyro right could be used", "400 truncated"):
            self.assertIn(part, said)

    def test_gyros_that_never_meet_say_so(self):
        # Two logs of two days.
        later = bench.two_gyros(4, begin_us=1_700_009_000_000_000)
        self.write("in.log", "".join([l for l in self.lines if "can0" in l] + [l for l in later if "can1" in l]))
        self.assertIn("never spoke at the same time", self.refuse("-q", "in.log"))

    def test_gyros_of_rates_too_far_apart_say_so(self):
        # 5 kHz beside a frame every 1.5 s: the samples between two slow ones do not fit the buffer.
        begin_us = 1_700_000_000_000_000
        lines = [(i * 200, bench.line_a(begin_us + i * 200, 0.5, i)) for i in range(125_000)]
        lines += [(i * 1_500_000, bench.line_b(begin_us + i * 1_500_000, 0.3)) for i in range(16)]
        self.write("in.log", "".join(line for _, line in sorted(lines)))
        said = self.refuse("-q", "in.log")
        for part in ("gyro left sends so much more often than gyro right", "no pairs", "2000 times"):
            self.assertIn(part, said)

    def test_saved_state_that_cannot_be_used(self):
        whole = b"format = 3\n"
        whole += b'\n[checksum]\ncrc32 = "%08x"\n' % zlib.crc32(whole)
        for text, said in (None, "cannot be read"), (b"format = 1\n", "is damaged"), (whole, "only format 1"):
            if text is not None:
                (self.folder / "state.toml").write_bytes(text)
            message = self.refuse("--state", "state.toml", "-o", "out.log", "in.log")
            self.assertIn("state.toml: ", message)
            self.assertIn(said, message)
            self.assertFalse((self.folder / "out.log").exists())

    def test_unwritable_output(self):
        # /dev/full is a full disk; a missing folder cannot be written to.
        self.assertIn("/dev/full: cannot be written: No space left", self.refuse("-q", "-o", "/dev/full", "in.log"))
        self.assertIn("/dev/full: cannot be written", self.refuse("-q", "-o", "out.log", "--json", "/dev/full", "in.log"))
        self.assertIn("nowhere/out.log: cannot be written: No such file", self.refuse("-o", "nowhere/out.log", "in.log"))
        with open("/dev/full", "wb") as full:
            self.assertIn("standard output: cannot be written", self.refuse("-q", "in.log", stdout=full))

    def test_output_over_the_input_is_refused(self):
        # A typing mistake that would destroy the recording.
        before = self.read("in.log")
        os.link(self.folder / "in.log", self.folder / "other_name.log")
        for arguments in (("-o", "in.log", "in.log"), ("-o", "other_name.log", "in.log"), ("--json", "in.log", "in.log"),
                          ("-o", "./in.log", "in.log")):
            self.assertIn("is also an input", self.refuse(*arguments))
            self.assertEqual(self.read("in.log"), before)

    def test_bad_map(self):
        # The three possible mistakes.
        self.assertIn("is not LOGNAME=CONFIGNAME", self.refuse("--map", "can0", "in.log"))
        self.assertIn("is not LOGNAME=CONFIGNAME", self.refuse("--map", "=can0", "in.log"))
        self.assertIn('did you mean "can1"?', self.refuse("--map", "x=cann1", "in.log"))

    def test_bad_config_is_told_as_by_check(self):
        # The message is the same in both commands.
        self.write("vgyro.toml", bench.CONFIG.replace("order = 1", "order = 8"))
        self.assertEqual(self.refuse("in.log"), self.bad("check", "vgyro.toml"))

    def test_uncalibrated_log_warns(self):
        # Shorter than the configured rest: frames are sent, none is valid.
        self.write("vgyro.toml", bench.CONFIG.replace("rest_s = 1.0", "rest_s = 10.0"))
        done = self.replay("-o", "out.log", "in.log")
        self.assertRegex(done.stderr.decode(), r"warning: calibration: not complete: [34]\.\d of 10 s")
        self.assertTrue(all(rate_of(f[3]) is None for f in frames(self.read("out.log")) if f[2] == RATE))


class Plot(Replay):
    def test_svg_and_png_are_drawn(self):
        # A picture that is not empty, and a valid PNG.
        self.replay("-q", "-o", "out.log", "--plot", "a.svg", "in.log")
        self.replay("-q", "-o", "out.log", "--plot", "a.png", "in.log")
        svg = self.read("a.svg")
        self.assertIn("<svg", svg)
        for part in ("virtual gyro", "gyro left", "gyro right"):
            self.assertIn(part, svg)
        self.assertGreater(len(svg), 20_000)
        png = (self.folder / "a.png").read_bytes()
        self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", png[16:24])
        self.assertGreater(min(width, height), 500)

    def test_unknown_ending_is_refused_before_the_work(self):
        # Reported at once, not after an hour of replay.
        for name in ("a.jpg", "a", "svg"):
            said = self.refuse("-o", "out.log", "--plot", name, "in.log")
            self.assertIn(".svg, .png or .pdf", said)
            self.assertFalse((self.folder / "out.log").exists())

    def test_picture_that_cannot_be_written_is_refused_before_the_work(self):
        # Reported at once too.
        said = self.refuse("-q", "-o", "out.log", "--plot", "nowhere/a.svg", "in.log")
        self.assertIn("nowhere/a.svg: cannot be written: No such file", said)
        self.assertFalse((self.folder / "out.log").exists())

    def test_missing_gnuplot_is_an_error_that_says_what_to_install(self):
        # No crash by a broken pipe, however much there is to draw.
        self.write("in.log", "".join(bench.two_gyros(30)))
        said = self.refuse("-q", "-o", "out.log", "--plot", "a.svg", "in.log", environment={"PATH": str(self.folder)})
        self.assertIn("gnuplot", said)
        self.assertIn("apt-get install gnuplot-nox", said)

    def test_names_with_quotes_draw(self):
        # Names may contain gnuplot's syntax, and must not be run as such.
        self.write("vgyro.toml", bench.CONFIG.replace('"left"', "\"it's `left`\""))
        self.replay("-q", "-o", "out.log", "--plot", "it's.svg", "in.log")
        self.assertGreater((self.folder / "it's.svg").stat().st_size, 1000)


class Memory(Replay):
    def peak_kb(self, repeats):
        """Peak resident memory of a replay from stdin of the same recording, repeated."""
        read_end, write_end = os.pipe()
        with open(self.folder / "out.log", "wb") as out:
            process = subprocess.Popen([bench.VGYRO, "replay", "--config", "vgyro.toml", "-q", "-"], stdin=read_end,
                                       stdout=out, cwd=self.folder)
        os.close(read_end)
        with os.fdopen(write_end, "wb") as pipe:
            for i in range(repeats):
                pipe.write("".join(bench.two_gyros(20, begin_us=(1_700_000_000 + 20 * i) * 1_000_000)).encode())
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(process.returncode, 0)
        return usage.ru_maxrss

    @unittest.skipIf(bench.SANITIZED, "a sanitizer keeps freed memory")
    def test_does_not_grow_with_the_log(self):
        # Days of traffic through a pipe must not fill the memory.
        self.peak_kb(1)
        self.assertLessEqual(abs(self.peak_kb(30) - self.peak_kb(3)), 1024)


if __name__ == "__main__":
    unittest.main()
