#!/usr/bin/python3
"""`vgyro gap` and `vgyro compare` from the outside: the files and fields that other programs rely on, and what bad input
gets. Whether the right effects are found is the blind test's business."""

import json
import resource
import struct
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
supply_voltage_bias""".split())

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

# With a comment, an odd order and no newline at the end: it is a person's file.
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
    """Rest, then turns to and fro with a little sway; or all of it from the beginning."""
    since = np.maximum(t - 30.0, 0.0) if rest else t + 7.0
    return 0.0032 + 10.0 * np.sin(2 * np.pi * since / 23.0) + 1.0 * np.sin(2 * np.pi * 0.7 * since)


def recording(seconds=90.0, hz=50.0, rest=True, gyros=(1, 2), reference_until=1e9, scale_error=SCALE_ERROR):
    """A candump log: gyro 2 has a scale error that the model does not know."""
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


class GapBench(bench.Bench):
    found = None  # what one run of the workflow gave: text, and files by name

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
        """The workflow takes seconds: run once, looked at by all tests."""
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
        # The whole of it: three files, and what is in them.
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
        # The gateway takes it back.
        self.write("found.toml", text)
        self.assertIn("scale_factor", self.good("check", "--model", "found.toml", "vgyro.toml").stdout.decode())
        self.assertEqual(self.read("model.toml"), MODEL)

    def test_same_input_gives_the_same_bytes_and_replaces_an_earlier_result(self):
        # Also where the configuration names the model: raw rates are judged, or there would be no bias to see. -q is silent.
        first = self.once()[1]
        self.write("vgyro.toml", GYROS + REFERENCE + '\n[corrector]\nmodel = "model.toml"\n')
        (self.folder / "out").mkdir()
        self.write("out/gap.json", "{}")
        done, second = self.gap("-q")
        self.assertEqual((done.stdout, done.stderr), (b"", b""))
        self.assertEqual(sorted(second), sorted(first))
        for name in ("gap.json", "model.toml"):
            self.assertEqual(second[name], first[name], name)
        # The page names the files that it was made from, as they were given.
        self.assertEqual(second["report.html"].replace(str(self.folder).encode() + b"/", b""), first["report.html"])

    def test_keeps_a_folder_that_holds_anything_else(self):
        (self.folder / "out").mkdir()
        self.write("out/notes.txt", "mine")
        said = self.bad("gap", "--config", "vgyro.toml", "--measured", "drive.log", "--out", "out")
        self.assertIn("notes.txt", said)
        self.assertEqual([path.name for path in (self.folder / "out").iterdir()], ["notes.txt"])


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
        """Clear words, exit 1, and nothing written: neither the folder nor a part of it."""
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
        # Both spans are told, and no memory is taken for the years between.
        for years in (1, -1, 10, 100):
            off_s = years * 365 * 86_400
            lines = (line if " can1 " not in line else bench.stamp(int(line[1:11]) * 1_000_000 + int(line[12:18]) + off_s * 1_000_000)
                     + line[19:] for line in LOG.splitlines(keepends=True))
            self.write("off.log", "".join(lines))
            self.refused(r"off\.log: .*(at the same time.*left from .* right from|never)", log="off.log")
            used_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
            self.assertLess(used_kb, 300_000 if not bench.SANITIZED else 3_000_000, years)

    def test_no_rest_and_no_reference(self):
        self.write("vgyro.toml", GYROS)
        self.write("restless.log", recording(rest=False))
        self.refused(r"restless\.log: .*no rest", r"reference", log="restless.log")

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
        # With the line, and the name that was meant.
        for text, parts in ((MODEL.replace('"white_noise"', '"white_nois"', 1), (r"model\.toml:14", r'did you mean "white_noise"\?')),
                            (MODEL.replace("value_dps", "value_dbs", 1), (r"model\.toml:6", r'did you mean "value_dps"\?')),
                            (MODEL.replace("gyro = 2", "gyro = 3", 1), (r"model\.toml:9", r"gyro = 1 or 2")),
                            (MODEL.replace("format = 1", "format = ", 1), (r"model\.toml:1",))):
            self.write("model.toml", text)
            self.refused(*parts)

    def test_model_that_nothing_can_be_added_to(self):
        # Told at once, not after the work.
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
