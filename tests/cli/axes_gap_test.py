#!/usr/bin/python3
"""The results of `vgyro gap` for two whole units: each name and size is compared with the injected effect. The
searches are long; test_gap covers the same code with the sanitizers."""

import json
import re
import unittest

import numpy as np

from axes_test import Axes, MOUNT, MOUNT_TEXT, Table, is_tilt
from units_test import AXES, TILTED


class Found(Axes):
    def test_the_tilt_between_two_units_is_named_about_every_axis_it_shows_on(self):
        self.record(340.0, 1, TILTED)
        found = self.gap("--accept", "gyro=2")
        self.assertEqual([axis["axis"] for axis in found["axes"]], list(AXES))
        named = {(one["axis"], one["parameters"]["from"]): one for one in found["effects"] if is_tilt(one)}
        # Roll and pitch feel the yaw, which is ten times as fast as they are.
        for pair in (("x", "z"), ("y", "z")):
            one = named[pair]
            truth = TILTED[AXES.index(pair[0]), AXES.index(pair[1])]
            self.assertLess(abs(one["parameters"]["coefficient"] - truth) / one["sigma"]["coefficient"], 4.0, one)
            self.assertLess(one["sigma"]["coefficient"], 2e-4)
            self.assertTrue(one["applied"])
        for axis in found["axes"]:
            self.assertLess(axis["gap"]["after"], max(1.5 * axis["gap"]["band95"][1], 0.2 * axis["gap"]["before"]), axis["axis"])
        # The effects of the axes together are all effects.
        self.assertEqual(found["effects"], [effect for axis in found["axes"] for effect in axis["effects"]])
        self.assertEqual(sorted(path.name for path in (self.folder / "found").iterdir()),
                         ["gap.json", "model.toml", "report-x.html", "report-y.html", "report-z.html", "report.html"])
        self.pages()
        # The model file is complete: with it the three axes have no gap.
        closed = self.compare(model="found/model.toml")
        for axis, before in zip(closed["axes"], found["axes"]):
            self.assertLess(axis["gap"]["value"], max(1.5 * axis["gap"]["band95"][1], 0.2 * before["gap"]["before"]))

    def pages(self):
        text = self.read("found/report.html")
        data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL).group(1))
        self.assertEqual([axis["report"] for axis in data["axes"]], [f"report-{axis}.html" for axis in AXES])
        for axis in AXES:
            page = self.read(f"found/report-{axis}.html")
            own = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL).group(1))
            self.assertEqual(own["axis"], axis)
            self.assertEqual([other["file"] for other in own["pages"]], [f"report-{other}.html" for other in AXES])

    def test_a_unit_upside_down_is_told_in_its_own_axes_and_signs(self):
        """The gateway corrects it too: the two agree except for the rest of the tilt."""
        # The sensor feels the vehicle's rate in its own axes, and is also tilted.
        felt = MOUNT.T @ TILTED
        drive = self.record(340.0, 2, felt, more_b=MOUNT_TEXT)
        own = felt @ MOUNT  # about the unit's own axes
        found = self.gap("--accept", "gyro=2")
        self.assertLess(abs(found["gap"]["after"]), 0.2 * found["gap"]["before"])
        tilts = [one for one in found["effects"] if is_tilt(one)]
        # The vehicle's x is the unit's y, and the reverse.
        self.assertGreaterEqual({(one["axis"], one["parameters"]["from"]) for one in tilts}, {("x", "z"), ("y", "z")})
        for one in tilts:
            truth = own[AXES.index(one["axis"]), AXES.index(one["parameters"]["from"])]
            self.assertLess(abs(one["parameters"]["coefficient"] - truth) / one["sigma"]["coefficient"], 4.0, one)
        self.good("replay", "--config", "u.toml", "--model", "found/model.toml", "-q", "-o", "out.log", "--json", "out.json",
                  "--csv", "out.csv", "in.log")
        left_deg = np.abs(json.loads(self.read("out.json"))["misalignment"]["angle_deg"])
        self.assertLess(np.max(left_deg[:2]), 0.05)
        self.assertEqual(drive.seconds, 340.0)

    def test_what_is_the_whole_units_is_named_once(self):
        """40 ms of delay: found about the axis that moves most, and used for the others."""
        self.record(300.0, 4, lag_s=0.04)
        found = self.gap("--accept", "gyro=2")
        delays = [one for one in found["effects"] if one["kind"] == "delay" and one["applied"]]
        self.assertEqual(len(delays), 1, found["effects"])
        self.assertNotIn("axis", delays[0])
        self.assertAlmostEqual(delays[0]["parameters"]["seconds"], 0.04, delta=0.001)
        self.assertIn(delays[0], found["axes"][2]["effects"])
        for axis in found["axes"][:2]:
            self.assertIn("delay of gyro right, found about z, is known here", axis["notes"])
        self.good("check", "--model", "found/model.toml", "u.toml")

    def test_one_axis_writes_the_result_of_one_pair(self):
        self.record(120.0, 6, TILTED)
        self.gap()
        found = self.gap("--axis", "x")  # replaces the result of all axes
        self.assertEqual(found["axis"], "x")
        self.assertNotIn("axes", found)
        self.assertEqual(sorted(path.name for path in (self.folder / "found").iterdir()), ["gap.json", "model.toml", "report.html"])
        first = [(self.folder / "found" / name).read_bytes() for name in ("gap.json", "model.toml", "report.html")]
        self.gap("--axis", "x")
        self.assertEqual(first, [(self.folder / "found" / name).read_bytes() for name in ("gap.json", "model.toml", "report.html")])


class FoundByTable(Table):
    def test_with_a_reference_of_all_axes_it_is_told_which_unit_is_tilted(self):
        self.with_table(240.0, 11)
        found = self.gap()
        for axis in found["axes"]:
            self.assertTrue(axis["recording"]["with_reference"], axis["axis"])
        named = {(one["axis"], one["parameters"]["from"]): one for one in found["effects"] if is_tilt(one)}
        for pair in (("x", "z"), ("y", "z")):
            one = named[pair]
            self.assertTrue(one["applied"])
            self.assertEqual(one["ambiguous_with"], [])
            truth = TILTED[AXES.index(pair[0]), AXES.index(pair[1])]
            self.assertLess(abs(one["parameters"]["coefficient"] - truth) / one["sigma"]["coefficient"], 4.0, one)


if __name__ == "__main__":
    unittest.main()
