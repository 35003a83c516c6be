#!/usr/bin/python3
"""The page of a replay (--html). Its data, read here without the product's code, against the table and the summary of the
same replay; what it shows in headless Chromium. Where there is no Chromium, only the data are judged, and the test counts
as skipped."""

import csv
import gzip
import json
import math
import random
import re
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import bench  # noqa: E402
import browser  # noqa: E402
import units_test  # noqa: E402
from replay_test import stops_and_turns  # noqa: E402

SKIPPED = 77
ROLES = ["virtual", "gyro_1", "gyro_2"]
HOSTILE = "</script><img src=x onerror=\"console.error('in')\">&amp; {{data}}"
CONFIG = bench.CONFIG.replace('"mutual"', '"optimal"').replace("rest_s = 1.0", "rest_s = 10.0")


def recording():
    """Stops and turns; the right gyro is silent from 17 to 21 s, both from 60 to 64 s."""
    lines = stops_and_turns(4)
    begin = float(lines[0].split(")")[0][1:])
    since = [float(line.split(")")[0][1:]) - begin for line in lines]
    return "".join(line for line, t in zip(lines, since) if not ("can1" in line and 17.0 < t < 21.0) and not 60.0 < t < 64.0)


class Page(bench.Bench):
    made = {}  # what a test of one recording need not make again

    def setUp(self):
        super().setUp()
        self.write("vgyro.toml", CONFIG)

    def pair(self):
        """Page, table, summary of a pair of gyros."""
        if "pair" not in self.made:
            self.write("in.log", recording())
            self.good("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "page.html", "--csv", "t.csv", "--json", "s.json", "in.log")
            self.made["pair"] = (self.read("page.html"), list(csv.DictReader(self.read("t.csv").splitlines())), json.loads(self.read("s.json")))
        return self.made["pair"]

    def units(self):
        if "units" not in self.made:
            print("seed 5")
            drive = units_test.Drive(200.0, 5)
            a = drive.unit(0.0, np.eye(3), units_test.BIAS_A)
            b = drive.unit(0.0043, units_test.TILTED, units_test.BIAS_B)
            self.write("units.dbc", units_test.DBC)
            self.write("u.toml", units_test.config())
            self.write("u.log", units_test.log_of(units_test.frames(*a, 0x101), units_test.frames(*b, 0x102)))
            self.good("replay", "-q", "--config", "u.toml", "-o", "out.log", "--html", "page.html", "--csv", "t.csv", "u.log")
            self.made["units"] = (self.read("page.html"), list(csv.DictReader(self.read("t.csv").splitlines())))
        return self.made["units"]


def by_bucket(course, rows, column):
    """{bucket: values} of a column of the table, in the page's buckets."""
    step_us, buckets = round(course["step_s"] * 1e6), {}
    for row in rows:
        if row[column] != "":
            bucket = (round(float(row["t_s"]) * 1e6) - course["begin_us"]) // step_us
            buckets.setdefault(bucket, []).append(float(row[column]))
    return buckets


def told_by(course, column):
    """{bucket: value}, of those that have one."""
    return {math.floor(t / course["step_s"]): value for t, value in zip(course["t_s"], course["columns"][column]) if isinstance(value, float | int)}


class Data(Page):
    def compare(self, course, rows, suffix=""):
        truth = by_bucket(course, [row for row in rows if row["valid" + suffix] == "1"], f"rate{suffix}_dps")
        self.assertGreater(len(truth), 1000)
        for name, of in (("rate_virtual", lambda values: sum(values) / len(values)), ("rate_virtual_least", min), ("rate_virtual_greatest", max)):
            told = told_by(course, name)
            self.assertEqual(set(told), set(truth), name)
            worst = max(abs(told[bucket] - of(values)) for bucket, values in truth.items())
            self.assertLess(worst, 7e-5, f"{name}: six digits of up to 28 deg/s, and a step of VG_Rate")

    def test_rates_are_those_of_the_table_and_their_envelope(self):
        page, rows, _ = self.pair()
        [course] = browser.data_of(page)["courses"]
        self.assertEqual(course["axis"], "")
        self.compare(course, rows)

    def test_every_axis_has_a_course_of_its_own(self):
        page, rows = self.units()
        courses = browser.data_of(page)["courses"]
        self.assertEqual([course["axis"] for course in courses], ["x", "y", "z"])
        for course in courses:
            self.compare(course, rows, "_" + course["axis"])

    def test_turn_and_drifts_are_those_of_table_and_summary(self):
        page, rows, summary = self.pair()
        data = browser.data_of(page)
        [course] = data["courses"]
        end = course["end"]
        heading = [float(row["heading_deg"]) for row in rows if row["heading_deg"] != ""]
        self.assertAlmostEqual(end["heading_virtual_deg"], heading[-1] - heading[0], delta=0.05)
        for which, bias_dps in ((1, 0.5), (2, -0.3)):
            last = [value for value in course["columns"][f"drift_{which}"] if isinstance(value, float)][-1]
            self.assertAlmostEqual(last, summary["gyros"][which - 1]["bias_dps"], delta=1e-6)
            if which == 2:
                continue  # its heading bridges its silence by a straight line
            off = end[f"heading_{which}_deg"] - end["heading_virtual_deg"]
            self.assertAlmostEqual(off / (end["valid_to_s"] - end["valid_from_s"]), bias_dps, delta=0.03)
        self.assertEqual(data["summary"], {key: value for key, value in summary.items() if key != "frames_by_id"})

    def test_stretches_are_where_they_were_made(self):
        page, _, summary = self.pair()
        [course] = browser.data_of(page)["courses"]
        spans = {one["shade"]: one["spans_s"] for one in course["stretches"]}
        self.assertEqual(set(spans), {"calibrating", "stop", "refused", "one_gyro", "fault_2"})
        self.assertAlmostEqual(spans["calibrating"][0][1], 10.0, delta=0.3)
        for begin, end in ((17.0, 21.0),):
            self.assertTrue(any(abs(a - begin) < 0.6 and abs(b - end) < 0.6 for a, b in spans["one_gyro"]), spans["one_gyro"])
        self.assertGreaterEqual(len(spans["refused"]), summary["stops"]["refused"] - 1)
        names = {one["shade"]: one["name"] for one in course["stretches"]}
        self.assertEqual(names["fault_2"], "right: silent")

    def test_no_curve_goes_on_across_a_hole(self):
        page, _, _ = self.pair()
        [course] = browser.data_of(page)["courses"]
        for name in ("heading_virtual", "rate_1", "drift_1"):
            column = course["columns"][name]
            breaks = [t for t, value in zip(course["t_s"], column) if value == "break"]
            self.assertTrue(any(59.9 < t < 64.1 for t in breaks), (name, breaks))
        for name in ("heading_2", "rate_2", "heading_mean"):
            self.assertTrue(any(17.0 < t < 17.5 for t, value in zip(course["t_s"], course["columns"][name]) if value == "break"), name)

    def test_the_same_input_gives_the_same_bytes(self):
        page, _, _ = self.pair()
        self.write("in.log", recording())
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "again.html", "in.log")
        self.assertEqual(self.read("again.html"), page)
        done = self.good("replay", "-q", "--config", "vgyro.toml", "--html", "-", "in.log")
        self.assertEqual(done.stdout.decode(), page)

    def test_a_picture_is_the_same_beside_a_page(self):
        self.write("in.log", recording())
        for more in ((), ("--html", "page.html")):
            self.good("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--plot", f"{len(more)}.svg", *more, "in.log")
        alone, beside = (set(self.read(name).splitlines()) for name in ("0.svg", "2.svg"))
        self.assertLess(len(alone ^ beside), 0.02 * len(alone), "sums in another order, and nothing else")

    def test_a_long_recording_is_a_few_megabytes(self):
        # As many buckets as a page ever has, nearly; an hour at 500 Hz has no more.
        print("seed 11")
        rng = random.Random(11)
        with gzip.open(self.folder / "long.log.gz", "wt", compresslevel=1) as log:
            noise = [(rng.gauss(0.0, 0.02), rng.gauss(0.0, 0.02)) for _ in range(5000)]
            for i in range(930 * 500):
                at, (a, b) = 1_700_000_000_000_000 + i * 2000, noise[i % len(noise)]
                log.write(bench.line_a(at, 0.5 + a, i))
                log.write(bench.line_b(at + 700, 0.3 + b))
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "/dev/null", "--html", "page.html", "long.log.gz")
        size = (self.folder / "page.html").stat().st_size
        self.assertLess(size, 3_000_000)
        [course] = browser.data_of(self.read("page.html"))["courses"]
        self.assertTrue(5500 < len(course["t_s"]) <= 6000, len(course["t_s"]))
        least, greatest = (told_by(course, f"rate_1_{end}") for end in ("least", "greatest"))
        self.assertGreater(min(greatest[bucket] - least[bucket] for bucket in list(least)[:-1]), 0.05, "noise of 0.02 deg/s shows")


class Shown(Page):
    seen = {}

    def look(self, width=1200, *options, which="pair"):
        if not browser.CHROMIUM:
            self.skipTest("chromium is not installed")
        key = (which, width, options)
        if key not in self.seen:
            self.seen[key] = browser.visit(getattr(self, which)()[0], ROLES, width, *options)
        return self.seen[key]

    def test_holds_everything_itself(self):
        browser.needs_nothing_else(self, self.pair()[0])

    def test_draws_every_curve_and_complains_of_nothing(self):
        for which, plots in (("pair", 6), ("units", 15)):
            seen = self.look(which=which)
            self.assertEqual(seen["problems"], [])
            self.assertEqual(len(seen["painted"]), plots)
            for heading, off in ((seen["painted"][0], seen["painted"][1]),):
                self.assertGreater(min(heading + off), 40)

    def test_begins_with_degrees(self):
        page, _, _ = self.pair()
        end = browser.data_of(page)["courses"][0]["end"]
        text = self.look()["text"]
        self.assertRegex(text, rf"In 91\.0 s the platform turned by {end['heading_virtual_deg']:.2f}° ± 0\.\d\d°\.")
        self.assertRegex(text, r"off: by \+45° with left alone, by −3\d° with right alone, by [+−]0\.\d+° with their mean")
        text = self.look(which="units")["text"]
        self.assertIn("axis by axis", text)
        self.assertEqual(self.look(which="units")["links"], ["#axis-x", "#axis-y", "#axis-z"])

    def test_names_what_went_on(self):
        text = self.look()["text"]
        for part in ("calibrating", "stop learned", "stop refused: turning", "one gyro alone", "right: silent", "right has a fault", "Drift of left, deg/s",
                     "Temperature, °C", "What the words mean"):
            self.assertIn(part, text)
        self.assertNotIn("contradicted", text.split("What the words mean")[0])

    def test_all_plots_follow_the_one_that_is_zoomed(self):
        seen = self.look()
        whole, near, moved, back = seen["ranges"]
        self.assertAlmostEqual((near[1] - near[0]) / (whole[1] - whole[0]), 0.5, places=2)
        self.assertGreater(moved[0], near[0])
        self.assertEqual(back, whole)
        for followed, range_ in zip(seen["followed"], (near, moved, back)):
            self.assertEqual(followed, [range_] * 6)

    def test_fits_every_window_in_light_and_dark(self):
        for which in ("pair", "units"):
            for width in (500, 800, 1300) if which == "pair" else (500,):  # no narrower: a headless window has a least width
                self.assertLessEqual(self.look(width, which=which)["overflow"], 0, width)
                self.assertEqual(self.look(width, which=which)["cut"], [], width)
        dark = self.look(1200, "--blink-settings=preferredColorScheme=0")
        self.assertLess(sum(map(int, re.findall(r"\d+", dark["background"])[:3])), 3 * 60)
        self.assertGreater(min(dark["painted"][0]), 40)

    def test_prints_on_three_pages(self):
        if not browser.CHROMIUM:
            self.skipTest("chromium is not installed")
        self.assertLessEqual(browser.pages_printed(self.pair()[0]), 3)

    def test_takes_no_name_for_markup(self):
        self.write("vgyro.toml", CONFIG.replace('"left"', "'''" + HOSTILE + "'''"))
        self.write("in.log", "".join(bench.two_gyros(20)))
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "page.html", "in.log")
        page = self.read("page.html")
        self.assertEqual(browser.data_of(page)["gyros"][0], HOSTILE)
        if not browser.CHROMIUM:
            self.skipTest("chromium is not installed")
        seen = browser.visit(page, ROLES, 1200)
        self.assertEqual((seen["problems"], seen["images"]), ([], 0))
        self.assertIn(HOSTILE, seen["text"])

    def test_without_a_valid_rate_the_page_says_why(self):
        self.write("in.log", "".join(bench.two_gyros(4)))
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "page.html", "in.log")
        if not browser.CHROMIUM:
            self.skipTest("chromium is not installed")
        seen = browser.visit(self.read("page.html"), ROLES, 1200)
        self.assertEqual(seen["problems"], [])
        self.assertRegex(seen["text"], r"No valid virtual rate: the calibration was not complete \([34](\.\d+)? s\)")


class BadOutput(Page):
    def test_a_page_that_cannot_be_written_is_refused_before_the_work(self):
        self.write("in.log", "".join(bench.two_gyros(4)))
        said = self.bad("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "nowhere/a.html", "in.log")
        self.assertIn("nowhere/a.html: cannot be written: No such file", said)
        self.assertFalse((self.folder / "out.log").exists())
        said = self.bad("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "/dev/full", "in.log")
        self.assertIn("/dev/full: cannot be written: No space left", said)

    def test_nothing_to_draw_is_an_error(self):
        self.write("in.log", "(1700000000.000000) can0 555#00\n")
        said = self.bad("replay", "-q", "--config", "vgyro.toml", "-o", "out.log", "--html", "a.html", "in.log")
        self.assertIn("a.html: there is nothing to draw: no pair of samples was formed", said)
        self.assertIn("no frame of gyro left", said)
        self.assertFalse((self.folder / "a.html").exists())


if __name__ == "__main__":
    outcome = unittest.main(exit=False).result
    if not outcome.wasSuccessful():
        sys.exit(1)
    sys.exit(SKIPPED if outcome.skipped else 0)
