#!/usr/bin/python3
"""`vgyro gap` and `vgyro compare` from the outside: the files and fields that other programs rely on, and the errors
for bad input. Whether the right effects are found is tested by the blind test."""

import hashlib
import json
import os
import re
import resource
import signal
import struct
import subprocess
import tomllib
import unittest

import numpy as np

import bench

SEED = 4711
KINDS = set("""
bias bias_ramp bias_step warm_up temperature_bias temperature_bias_quadratic temperature_rate_bias scale_factor
scale_factor_asymmetry scale_factor_quadratic scale_factor_cubic scale_factor_temperature g_sensitivity
vibration_rectification delay bandwidth angle_harmonic line saturation dead_band quantization white_noise rate_random_walk
gauss_markov rate_noise spikes stuck dropped_frames clock_skew timestamp_jitter
supply_voltage_bias run_in temperature_hysteresis bias_instability cross_axis
bandwidth_second_order""".split())

DBC = """\
VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ RateZ : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ RateZ : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG

BO_ 512 TABLE: 4 RIG
 SG_ TableRate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
"""

GYROS = """\
[[gyro]]
name = "left"
bus = "can0"
dbc = "bench.dbc"
message = "GYRO_A"
rate = "RateZ"
counter = "Counter"

[[gyro]]
name = "right"
bus = "can1"
dbc = "bench.dbc"
message = "GYRO_B"
rate = "RateZ"
counter = "Counter"

[calibration]
rest_s = 30.0
rate_dps = 0.0032

[output]
bus = "can0"
"""

REFERENCE = """
[reference]
bus = "can0"
dbc = "bench.dbc"
message = "TABLE"
rate = "TableRate"
"""

# With a comment, an odd order and no newline at the end, like a file written by hand.
MODEL = """\
format = 1   # my two gyros

[[effect]]
kind = "bias"
gyro = 1
value_dps = 0.031

[[effect]]
gyro = 2
kind = "bias"
value_dps = -0.012
[[effect]]
gyro = 1
kind = "white_noise"
density_dps_rthz = 2e-4
[[effect]]
gyro = 2
kind = "white_noise"
density_dps_rthz = 4e-4 # from the data sheet"""

SCALE_ERROR = 2e-3
BEGIN_US = 1_700_000_000_000_000


def true_rate(t, rest=True):
    """Rest, then turns to and fro with a little sway; without `rest` the turns begin at once."""
    since = np.maximum(t - 30.0, 0.0) if rest else t + 7.0
    return 0.0032 + 10.0 * np.sin(2 * np.pi * since / 23.0) + 1.0 * np.sin(2 * np.pi * 0.7 * since)


def recording(seconds=90.0, hz=50.0, rest=True, gyros=(1, 2), reference_until=1e9, scale_error=SCALE_ERROR):
    """A candump log: gyro 2 has a scale error that is not in the model."""
    rng = np.random.default_rng(SEED)
    frames = []
    for gyro, bus, can_id, offset_us, bias, density, error in ((1, "can0", 0x101, 0, 0.031, 2e-4, 0.0),
                                                               (2, "can1", 0x102, 3100, -0.012, 4e-4, scale_error)):
        t = np.arange(round(seconds * hz)) / hz
        noise = density * np.sqrt(hz) * rng.standard_normal(t.size)
        rate = bias + (1.0 + error) * true_rate(t + offset_us * 1e-6, rest) + noise
        if gyro in gyros:
            frames += [(BEGIN_US + round(s * 1e6) + offset_us, bus, can_id, struct.pack("<ihBB", round(r * 1e6), 0, i % 256, 0))
                       for i, (s, r) in enumerate(zip(t, rate))]
    t = np.arange(round(min(seconds, reference_until) * 100.0)) / 100.0
    table = true_rate(t, rest) + 1e-4 * rng.standard_normal(t.size)
    frames += [(BEGIN_US + round(s * 1e6), "can0", 0x200, struct.pack("<i", round(r * 1e6))) for s, r in zip(t, table)]
    frames.sort(key=lambda frame: frame[0])
    return "".join(f"{bench.stamp(us)} {bus} {can_id:03X}#{data.hex().upper()}\n" for us, bus, can_id, data in frames)


LOG = recording()


def page_data(page):
    """The data that a report page draws."""
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page.decode(), re.DOTALL).group(1))


class GapBench(bench.Bench):
    found = None  # results of one run of the workflow: text, and files by name

    def setUp(self):
        super().setUp()
        self.write("bench.dbc", DBC)
        self.write("vgyro.toml", GYROS + REFERENCE)
        self.write("model.toml", MODEL)
        self.write("drive.log", LOG)

    def gap(self, *options, out="out"):
        done = self.good("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--out", out, *options)
        return done, {path.name: path.read_bytes() for path in (self.folder / out).iterdir()}

    def once(self):
        """The workflow takes seconds: it runs once, for all tests."""
        if GapBench.found is None:
            GapBench.found = self.gap("--model", "model.toml")
        return GapBench.found

    def names(self):
        return sorted(path.name for path in self.folder.iterdir())


class Fields:
    """The interface of docs/gap.md, checked field by field."""

    def __init__(self, test):
        self.test = test

    def number(self, value):
        self.test.assertIsInstance(value, (int, float))
        self.test.assertTrue(np.isfinite(value))

    def band(self, gap):
        self.test.assertEqual(gap["unit"], "nats_per_sample")
        self.number(gap["floor"])
        self.test.assertEqual(len(gap["band95"]), 2)
        self.test.assertLess(gap["band95"][0], gap["band95"][1])

    def where(self, where):
        self.test.assertLessEqual(where["from_s"], where["to_s"])
        self.test.assertEqual(len(where["band_hz"]), 2)
        for value in (where["from_s"], where["to_s"], *where["band_hz"]):
            self.number(value)

    def reading(self, reading):
        self.test.assertIn(reading["kind"], KINDS)
        self.test.assertIn(reading["gyro"], (1, 2))

    def effect(self, effect):
        self.reading(effect)
        self.test.assertTrue(effect["parameters"])
        self.test.assertLessEqual(set(effect["sigma"]), set(effect["parameters"]))
        for name in ("p_value", "gap_before", "gap_after"):
            self.number(effect[name])
        self.where(effect["where"])
        for reading in effect["ambiguous_with"]:
            self.reading(reading)
        self.test.assertIsInstance(effect["applied"], bool)
        self.test.assertIsInstance(effect["checked"], bool)

    def result(self, result):
        self.test.assertEqual(result["format"], 1)
        self.test.assertIn(result["verdict"], ("no_gap", "explained", "partly_explained", "unexplained"))
        self.band(result["gap"])
        self.number(result["gap"]["before"])
        self.number(result["gap"]["after"])
        for effect in result["effects"]:
            self.effect(effect)
        for rest in result["unexplained"]:
            self.test.assertTrue({"signature", "gyro", "from_s", "to_s"} <= set(rest))
        for kind in result["not_identifiable"]:
            self.reading(kind)
            self.test.assertTrue(kind["why"])
        self.number(result["gap"]["of_model"])
        self.test.assertEqual(result["complete"], not result["open"])
        self.test.assertEqual((result["model"], result["report"]), ("model.toml", "report.html"))

    def comparison(self, comparison):
        self.test.assertEqual(comparison["format"], 1)
        self.band(comparison["gap"])
        self.number(comparison["gap"]["value"])
        for where in comparison["where"]:
            self.test.assertIn(where["gyro"], (1, 2))
            self.test.assertTrue(where["against"])
            self.where(where)


class Gap(GapBench):
    def test_finds_names_adds_and_shows_the_gap_shrink(self):
        # The complete result: three files and their contents.
        done, files = self.once()
        self.assertEqual(sorted(files), ["gap.json", "model.toml", "report.html"])
        result = json.loads(files["gap.json"])
        Fields(self).result(result)
        self.assertEqual([(effect["kind"], effect["gyro"]) for effect in result["effects"]], [("scale_factor", 2)], f"seed {SEED}")
        effect = result["effects"][0]
        self.assertLess(abs(effect["parameters"]["error"] - SCALE_ERROR), 4 * effect["sigma"]["error"])
        self.assertEqual(result["verdict"], "explained")
        self.assertLessEqual(result["gap"]["after"], result["gap"]["band95"][1])
        self.assertGreater(result["gap"]["before"], result["gap"]["band95"][1])
        text = done.stdout.decode()
        self.assertRegex(text, r"1 +\S+ +\S+ +right +scale_factor +error 0\.00\d+ ± ")
        self.assertLessEqual(len(text.splitlines()), 25)
        self.assertEqual(done.stderr, b"", "no progress where there is no terminal")

    def test_model_keeps_what_the_user_wrote_and_gains_one_table(self):
        files = self.once()[1]
        text = files["model.toml"].decode()
        self.assertTrue(text.startswith(MODEL))
        before, after = tomllib.loads(MODEL)["effect"], tomllib.loads(text)["effect"]
        self.assertEqual(after[:-1], before)
        self.assertEqual((after[-1]["gyro"], after[-1]["kind"]), (2, "scale_factor"))
        self.assertEqual(after[-1]["error"], json.loads(files["gap.json"])["effects"][0]["parameters"]["error"])
        self.assertRegex(text[len(MODEL):], r"# named by vgyro gap: error 0\.00\d+ ± ")
        # The gateway accepts the model.
        self.write("found.toml", text)
        self.assertIn("scale_factor", self.good("check", "--model", "found.toml", "vgyro.toml").stdout.decode())
        self.assertEqual(self.read("model.toml"), MODEL)

    def test_same_input_gives_the_same_bytes_and_replaces_an_earlier_result(self):
        # The same if the configuration names the model: raw rates are evaluated, otherwise there would be no bias to
        # find. -q prints nothing.
        first = self.once()[1]
        self.write("vgyro.toml", GYROS + REFERENCE + '\n[corrector]\nmodel = "model.toml"\n')
        (self.folder / "out").mkdir()
        self.write("out/gap.json", "{}")
        done, second = self.gap("-q")
        self.assertEqual((done.stdout, done.stderr), (b"", b""))
        self.assertEqual(sorted(second), sorted(first))
        for name in ("gap.json", "model.toml"):
            self.assertEqual(second[name], first[name], name)
        # The page contains the command, and the names of its input files as given.
        pages = [page_data(files["report.html"]) for files in (first, second)]
        for page in pages:
            origin = page.pop("provenance")
            # The configuration of the first run is no longer there.
            for file in (file for file in origin["files"] if not file["path"].endswith("vgyro.toml")):
                self.assertEqual(file["sha256"], hashlib.sha256((self.folder / file["path"]).read_bytes()).hexdigest(), file)
            self.assertTrue(origin["command"].startswith("vgyro gap "), origin)
            self.assertRegex(origin["files"][-1]["began"], r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC$|^no date: the stamps begin at ")
        self.assertEqual(json.loads(json.dumps(pages[1]).replace(str(self.folder) + "/", "")), pages[0])

    def test_keeps_a_folder_that_holds_anything_else(self):
        (self.folder / "out").mkdir()
        self.write("out/notes.txt", "mine")
        said = self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--out", "out")
        self.assertIn("notes.txt", said)
        self.assertEqual([path.name for path in (self.folder / "out").iterdir()], ["notes.txt"])

    def test_without_rest_and_reference_the_difference_is_judged_and_said_so(self):
        self.write("vgyro.toml", GYROS)
        self.write("drive.log", recording(rest=False))
        done, files = self.gap()
        result = json.loads(files["gap.json"])
        Fields(self).result(result)
        self.assertTrue(any(note.startswith("the recording holds no rest") for note in result["notes"]), result["notes"])
        self.assertIn("note: the recording holds no rest", done.stdout.decode())
        # It cannot be determined which gyro has the scale error.
        scale = [effect for effect in result["effects"] if effect["kind"] == "scale_factor"]
        self.assertEqual(len(scale), 1)
        readings = [(reading["kind"], reading["gyro"]) for reading in scale[0]["ambiguous_with"]]
        self.assertEqual(readings, [("scale_factor", 3 - scale[0]["gyro"])])


class Ambiguous(GapBench):
    """Without a reference a scale factor of one gyro may as well be one of the other."""

    kept = {}  # one run for each choice: they take seconds

    def setUp(self):
        super().setUp()
        self.write("vgyro.toml", GYROS)

    def run_with(self, *accept):
        if accept not in Ambiguous.kept:
            options = [word for choice in accept for word in ("--accept", choice)]
            Ambiguous.kept[accept] = self.gap("--model", "model.toml", *options)
        done, files = Ambiguous.kept[accept]
        return done.stdout.decode(), json.loads(files["gap.json"]), files["model.toml"].decode()

    def test_is_kept_in_the_account_and_stands_in_the_model_as_comments(self):
        text, result, model = self.run_with()
        Fields(self).result(result)
        (effect,) = result["effects"]
        self.assertEqual(effect["kind"], "scale_factor")
        self.assertEqual(len(effect["ambiguous_with"]), 1)
        self.assertIs(effect["applied"], False)
        self.assertLessEqual(result["gap"]["after"], result["gap"]["band95"][1], "the gap counts it, or it could not close")
        self.assertGreater(result["gap"]["of_model"], result["gap"]["band95"][1], "model.toml leaves it")
        self.assertTrue(model.startswith(MODEL))
        self.assertEqual(tomllib.loads(model), tomllib.loads(MODEL), "nothing is applied")
        for part in ("not applied", "to tell: ", "# gyro = 1", "# gyro = 2", "# ambiguous = true"):
            self.assertIn(part, model)
        self.assertRegex(text, r"scale_factor .* no +(left|right) scale_factor")
        self.assertIn("not applied", text)
        self.assertTrue(any("--accept" in note for note in result["notes"]))

    def test_either_reading_may_be_taken_out_of_its_comment(self):
        added = self.run_with()[2][len(MODEL):]
        lines = [line[2:] for line in added.splitlines() if line.startswith("# ")]
        begins = [i for i, line in enumerate(lines) if line == "[[effect]]"]
        self.assertEqual(len(begins), 2)
        gyros = set()
        for begin in begins:
            table = "\n".join(line for line in lines[begin:begin + 6] if line == "[[effect]]" or " = " in line)
            effect = tomllib.loads(table)["effect"][0]
            gyros.add(effect["gyro"])
            truth = SCALE_ERROR if effect["gyro"] == 2 else -SCALE_ERROR
            self.assertAlmostEqual(effect["error"], truth, delta=0.2 * SCALE_ERROR)
            self.write("taken.toml", MODEL + "\n\n" + table + "\n")
            self.assertIn("ambiguous", self.good("check", "--model", "taken.toml", "vgyro.toml").stdout.decode())
        self.assertEqual(gyros, {1, 2})

    def test_accept_applies_the_reading_of_that_gyro_with_its_doubt(self):
        for choice, gyro in (("gyro=1", 1), ("gyro=2", 2), ("kind=scale_factor,gyro=1", 1)):
            text, result, model = self.run_with(choice)
            (effect,) = result["effects"]
            self.assertEqual((effect["gyro"], effect["applied"]), (gyro, True), choice)
            self.assertEqual([reading["gyro"] for reading in effect["ambiguous_with"]], [3 - gyro])
            self.assertEqual(result["gap"]["of_model"], result["gap"]["after"])
            written = tomllib.loads(model)["effect"][-1]
            self.assertEqual((written["gyro"], written["error"]), (gyro, effect["parameters"]["error"]))
            self.assertEqual(written["sigma"], effect["sigma"]["error"])
            self.assertIs(written["ambiguous"], True)
            self.assertLess(abs(effect["parameters"]["error"] - (SCALE_ERROR if gyro == 2 else -SCALE_ERROR)), 4 * written["sigma"])
            self.assertRegex(text, r"scale_factor .* yes +(left|right) scale_factor")

    def test_accept_of_a_kind_that_is_no_reading_applies_nothing(self):
        self.assertIs(self.run_with("kind=delay")[1]["effects"][0]["applied"], False)


class Several(GapBench):
    """Two recordings of one pair, one model."""

    def setUp(self):
        super().setUp()
        self.write("other.log", recording(seconds=70.0, hz=50.0))

    def test_one_model_is_fitted_over_all(self):
        files = self.gap("--model", "model.toml", "--measured", "other.log")[1]
        result = json.loads(files["gap.json"])
        Fields(self).result(result)
        self.assertEqual([(effect["kind"], effect["gyro"]) for effect in result["effects"]], [("scale_factor", 2)])
        first, second = result["recording"]["parts"]
        self.assertEqual(first["from_s"], 0.0)
        self.assertGreater(second["from_s"], first["to_s"])
        self.assertAlmostEqual(second["to_s"] - second["from_s"], 70.0, delta=0.1)
        self.assertLess(result["effects"][0]["sigma"]["error"], json.loads(self.once()[1]["gap.json"])["effects"][0]["sigma"]["error"])
        self.assertLessEqual(result["gap"]["after"], result["gap"]["band95"][1])

    def test_compare_takes_several_too(self):
        done = self.good("compare", "--config", "vgyro.toml", "--model", "model.toml", "--measured", "drive.log", "--measured", "other.log",
                         "--json", "-")
        comparison = json.loads(done.stdout)
        Fields(self).comparison(comparison)
        self.assertEqual(len(comparison["recording"]["parts"]), 2)
        self.assertGreater(comparison["gap"]["value"], comparison["gap"]["band95"][1])

    def test_one_that_cannot_be_judged_is_named_by_its_number(self):
        self.write("short.log", recording(seconds=4.0))
        said = self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--measured", "short.log", "--out", "out")
        self.assertRegex(said, r"short\.log: recording 2: the recording is too short")
        self.assertNotIn("out", self.names())

    def test_none_of_them_is_written_over(self):
        (self.folder / "out").mkdir()
        (self.folder / "out" / "model.toml").symlink_to("../other.log")
        self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--measured", "other.log", "--out", "out")
        self.assertEqual(self.read("other.log"), recording(seconds=70.0, hz=50.0))


class Bounded(GapBench):
    def test_what_is_certain_in_time_is_written_and_the_rest_is_open(self):
        done, files = self.gap("--model", "model.toml", "--time-limit", "0.001")
        self.assertEqual(sorted(files), ["gap.json", "model.toml", "report.html"])
        result = json.loads(files["gap.json"])
        Fields(self).result(result)
        self.assertIs(result["complete"], False)
        self.assertTrue(result["open"])
        self.assertEqual(result["effects"], [])
        self.assertEqual(files["model.toml"].decode(), MODEL)
        self.assertIn("the time limit was reached", done.stdout.decode())

    def test_time_enough_changes_nothing(self):
        files = self.gap("--model", "model.toml", "--time-limit", "100000")[1]
        for name in ("gap.json", "model.toml"):
            self.assertEqual(files[name], self.once()[1][name], name)

    def interrupted(self, write):
        """A run that reads from a pipe until `write` has finished, and is then interrupted."""
        os.mkfifo(self.folder / "pipe.log")
        with subprocess.Popen([bench.VGYRO, "gap", "--config", "vgyro.toml", "--model", "model.toml", "--measured", "pipe.log", "--out", "out"],
                              cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            with open(self.folder / "pipe.log", "w", encoding="ascii") as pipe:
                write(pipe, lambda: process.send_signal(signal.SIGINT))
            process.communicate()
        (self.folder / "pipe.log").unlink()
        return process.returncode

    def test_interrupt_leaves_no_half_written_folder(self):
        before = self.names()

        def while_reading(pipe, interrupt):
            pipe.write(LOG[:len(LOG) // 2])
            pipe.flush()
            interrupt()

        def at_work(pipe, interrupt):
            pipe.write(LOG)
            pipe.close()
            interrupt()

        self.assertEqual(self.interrupted(while_reading), -signal.SIGINT)
        self.assertEqual(self.names(), before)
        if self.interrupted(at_work) == -signal.SIGINT:
            self.assertEqual(self.names(), before)

    def test_interrupt_keeps_the_earlier_result(self):
        (self.folder / "out").mkdir()
        self.write("out/gap.json", "{}")
        self.assertEqual(self.interrupted(lambda pipe, interrupt: (pipe.write(LOG[:1000]), pipe.flush(), interrupt())), -signal.SIGINT)
        self.assertEqual(self.read("out/gap.json"), "{}")
        self.assertEqual([path.name for path in (self.folder / "out").iterdir()], ["gap.json"])


class Compare(GapBench):
    def compare(self, model, *options):
        return self.good("compare", "--config", "vgyro.toml", "--model", model, "--measured", "drive.log", *options)

    def test_number_falls_into_the_band_with_what_gap_added(self):
        self.write("found.toml", self.once()[1]["model.toml"])
        names = self.names()
        before = json.loads(self.compare("model.toml", "--json", "-").stdout)
        after = self.compare("found.toml")
        self.assertEqual(self.names(), names, "it changes nothing")
        Fields(self).comparison(before)
        self.assertGreater(before["gap"]["value"], before["gap"]["band95"][1])
        self.assertRegex(after.stdout.decode(), r"gap \S+ nats per sample, within")


class BadInput(GapBench):
    def refused(self, *parts, log="drive.log", model="model.toml"):
        """Expects a clear message, exit code 1, and nothing written: neither the folder nor a part of it."""
        names = self.names()
        for command, options in (("gap", ("--out", "out")), ("compare", ())):
            said = self.bad(command, "--config", "vgyro.toml", "--model", model, "--measured", log, *options)
            for part in parts:
                self.assertRegex(said, part)
            self.assertEqual(self.names(), names)

    def test_recording_that_is_too_short(self):
        self.write("short.log", recording(seconds=4.0))
        self.refused(r"short\.log: .*too short", r"at least", log="short.log")

    def test_gyro_that_is_missing(self):
        self.write("one.log", recording(seconds=60.0, gyros=(1,)))
        self.refused(r"one\.log: no frame of gyro right \(GYRO_B 102 on can1\)", r"interfaces are: can0", log="one.log")

    def test_one_gyro_whose_clock_is_years_off(self):
        # Both spans are reported, and no memory is used for the years between.
        for years in (1, -1, 10, 100):
            off_s = years * 365 * 86_400
            lines = (line if " can1 " not in line else bench.stamp(int(line[1:11]) * 1_000_000 + int(line[12:18]) + off_s * 1_000_000)
                     + line[19:] for line in LOG.splitlines(keepends=True))
            self.write("off.log", "".join(lines))
            self.refused(r"off\.log: .*(at the same time.*left from .* right from|never)", log="off.log")
            used_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
            self.assertLess(used_kb, 300_000 if not bench.SANITIZED else 3_000_000, years)

    def test_reference_that_stops_halfway(self):
        self.write("half.log", recording(reference_until=45.0))
        self.refused(r"half\.log: .*reference", r"45|44\.9", log="half.log")

    def test_reference_that_never_speaks(self):
        self.write("silent.log", recording(reference_until=0.0))
        self.refused(r"silent\.log: .*reference", log="silent.log")

    def test_log_that_is_not_there_or_empty(self):
        self.refused(r"nowhere\.log", log="nowhere.log")
        self.write("empty.log", "")
        self.refused(r"empty\.log: .*no CAN frame", log="empty.log")

    def test_model_with_an_unknown_kind_parameter_or_value(self):
        # The error has the line, and the name that was meant.
        for text, parts in ((MODEL.replace('"white_noise"', '"white_nois"', 1), (r"model\.toml:14", r'did you mean "white_noise"\?')),
                            (MODEL.replace("value_dps", "value_dbs", 1), (r"model\.toml:6", r'did you mean "value_dps"\?')),
                            (MODEL.replace("gyro = 2", "gyro = 3", 1), (r"model\.toml:9", r"gyro = 1 or 2")),
                            (MODEL.replace("format = 1", "format = ", 1), (r"model\.toml:1",))):
            self.write("model.toml", text)
            self.refused(*parts)

    def test_model_that_nothing_can_be_added_to(self):
        # Reported at once, not after the work.
        self.write("model.toml", 'format = 1\neffect = [ {gyro = 1, kind = "bias", value_dps = 0.03} ]\n')
        names = self.names()
        said = self.bad("gap", "--config", "vgyro.toml", "--model", "model.toml", "--measured", "drive.log", "--out", "out")
        self.assertRegex(said, r"model\.toml:2: .*\[\[effect\]\]")
        self.assertEqual(self.names(), names)

    def test_folder_that_cannot_be(self):
        said = self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--out", "drive.log")
        self.assertRegex(said, r"drive\.log.*no folder")
        said = self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--out", "drive.log/below")
        self.assertIn("drive.log/below", said)


if __name__ == "__main__":
    unittest.main()
