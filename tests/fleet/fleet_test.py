#!/usr/bin/python3
"""`vgyro fleet` against fleets whose truth is known: the names, their σ, the units that stand apart; and merging in any
order and grouping gives the same bytes."""

import json
import os
import random
import re
import subprocess
import sys
import tempfile
import tomllib
import unittest
from pathlib import Path

import numpy as np

import made_fleet
from made_fleet import SHAPES, Unit

VGYRO = Path(os.environ["VGYRO_BIN"]) / "vgyro"
SEED = 20261130
SEEDS = int(os.environ.get("VGYRO_FLEET_SEEDS", "6"))
FLEETS = int(os.environ.get("VGYRO_FLEETS", "40"))


class FleetBench(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.folder = Path(self.scratch.name)
        self.addCleanup(self.scratch.cleanup)

    def run_fleet(self, *files, out="out", good=True):
        done = subprocess.run([VGYRO, "fleet", *files, "--out", out, "-q"], cwd=self.folder, capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 0 if good else 1, done.stderr)
        return done

    def fleet(self, lines, out="out"):
        (self.folder / "drives.json").write_text("".join(lines))
        self.run_fleet("drives.json", out=out)
        return json.loads((self.folder / out / "fleet.json").read_text())


def plain_pairs(rng, count, **first):
    return [(Unit(rng, "alpha", f"a{i}", **first), Unit(rng, "beta", f"b{i}")) for i in range(count)]


def told_figure(words, sentence):
    """Value and σ of "WORDS 0.0392 ± 0.0011" or "WORDS (392 ± 11)·10⁻⁶"."""
    value, sigma, power = re.search(rf"{words} \(?(\S+) ± ([\d.]+)(?:\)·10(\S+))?", sentence).groups()
    scale = 10.0 ** int((power or "0").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))
    return float(value) * scale, float(sigma) * scale


class Truth(FleetBench):
    def test_names_what_no_drive_can_name(self):
        """|t| = 2 in each of 60 drives, for each kind in turn: right kind and type, and the size inside its interval."""
        kinds = [name for name in SHAPES if not name.startswith("bandwidth")]
        right = inside = false = 0
        for number in range(FLEETS):
            rng = np.random.default_rng([SEED, 1, number])
            shape = kinds[number % len(kinds)]
            vehicles = (1, 6, 20, 60)[number % 4]
            # A drive's σ with all other shapes fitted, which is larger than its information alone implies.
            spread = np.mean([np.sqrt(1.0 / np.linalg.inv(np.linalg.inv(made_fleet.information(rng)))[i, i])
                              for i in [made_fleet.NAMES.index(shape)] for _ in range(20)])
            size = 2.0 * spread * (-1.0) ** number
            found = self.fleet(made_fleet.lines(rng, plain_pairs(rng, vehicles, effects={shape: size}), 60), f"out{number}")
            kind = shape.split(":")[0]
            named = [effect for effect in found["effects"] if (effect["kind"], effect["type"]) == (kind, "alpha")]
            false += len(found["effects"]) - len(named) + sum(unit["why"] != "" for unit in found["units"])
            right += len(named) == 1
            inside += len(named) == 1 and named[0]["interval95"][0] <= size <= named[0]["interval95"][1]
            if len(named) != 1 or len(found["effects"]) > 1:
                print(f"fleet {number} of {vehicles} vehicles, {shape}: {[e['kind'] for e in found['effects']]}")
        print(f"seed {SEED}: of {FLEETS} fleets {right} named, {inside} inside the interval, {false} other names")
        self.assertGreaterEqual(right, 0.95 * FLEETS)
        self.assertGreaterEqual(inside, 0.85 * FLEETS)
        self.assertLessEqual(false, 0.05 * FLEETS)

    def test_names_nothing_in_clean_fleets(self):
        false = 0
        for number in range(FLEETS):
            rng = np.random.default_rng([SEED, 2, number])
            found = self.fleet(made_fleet.lines(rng, plain_pairs(rng, 10), 60), f"out{number}")
            names = found["effects"] + [unit for unit in found["units"] if unit["why"]]
            false += bool(names)
            if names:
                print(f"fleet {number}: {names}")
        print(f"seed {SEED}: false names in {false} of {FLEETS} clean fleets")
        self.assertEqual(false, 0)

    def judge_found(self, found, expected, seed):
        """Number of `expected` units (unit → a word of its `why`) that are found; no other may be."""
        why = {unit["unit"]: unit for unit in found["units"] if unit["why"]}
        self.assertLessEqual(set(why), set(expected), f"seed {seed}")
        self.assertEqual([type_["trends"] for type_ in found["types"]], [[], []], f"seed {seed}")
        return sum(unit in why and word in why[unit]["why"] for unit, word in expected.items())

    def test_finds_the_bad_units_among_fifty(self):
        """A unit with three times the noise, one whose bias wanders from drive to drive, one within a drive, one with a scale
        factor of its own; ten drives each."""
        right = 0
        expected = {"loud": "white noise", "wanders": "scatters", "strays": "within a drive", "skewed": "scale_factor"}
        for number in range(SEEDS):
            rng = np.random.default_rng([SEED, 3, number])
            pairs = plain_pairs(rng, 50)
            pairs[7] = (Unit(rng, "alpha", "loud", noise=3.0), pairs[7][1])
            pairs[21] = (pairs[21][0], Unit(rng, "beta", "wanders", wander=8.0))
            pairs[28] = (pairs[28][0], Unit(rng, "beta", "strays", walk=8.0))
            pairs[33] = (Unit(rng, "alpha", "skewed", effects={"scale_factor": 4e-4}), pairs[33][1])
            found = self.fleet(made_fleet.lines(rng, pairs, 500), f"out{number}")
            right += self.judge_found(found, expected, number)
        print(f"seed {SEED}: {right} of {4 * SEEDS} bad units found, no other")
        self.assertGreaterEqual(right, 0.95 * 4 * SEEDS)

    def test_finds_the_unit_that_moves_over_the_months(self):
        """One of 50 units each has a trend of its bias, of a size that its type has, or of one that its type has not."""
        right = 0
        moves = {"drifts": ("its bias moves by", 0.04), "ages": ("scale_factor: changes by", 4e-4),
                 "loosens": ("g_sensitivity:x: changes by", 1.6e-2)}
        for number in range(SEEDS):
            rng = np.random.default_rng([SEED, 9, number])
            pairs = plain_pairs(rng, 50, effects={"scale_factor": 5e-4})
            pairs[11] = (Unit(rng, "alpha", "drifts", effects={"scale_factor": 5e-4}, bias_a_year_dps=0.04), pairs[11][1])
            # In the middle of the year their sizes equal those of their types.
            pairs[12] = (Unit(rng, "alpha", "ages", effects={"scale_factor": 3e-4}, effects_a_year={"scale_factor": 4e-4}), pairs[12][1])
            pairs[13] = (pairs[13][0], Unit(rng, "beta", "loosens", effects={"g_sensitivity:x": -8e-3},
                                            effects_a_year={"g_sensitivity:x": 1.6e-2}))
            found = self.fleet(made_fleet.lines(rng, pairs, 1000), f"out{number}")
            right += self.judge_found(found, {unit: words for unit, (words, _) in moves.items()}, number)
            for unit in found["units"]:
                words, true = moves.get(unit["unit"], ("", 0.0))
                if words and words in unit["why"]:
                    value, sigma = told_figure(words, unit["why"])
                    self.assertLess(abs(value - true), 5.0 * sigma, f"{unit['unit']}, seed {number}")
        print(f"seed {SEED}: {right} of {3 * SEEDS} moving units found, no other")
        self.assertGreaterEqual(right, 0.95 * 3 * SEEDS)

    def test_names_what_all_units_of_a_type_do_over_the_months(self):
        for number in range(SEEDS):
            rng = np.random.default_rng([SEED, 10, number])
            size = {"scale_factor": 5e-4}
            pairs = [(Unit(rng, "alpha", f"a{i}", bias_a_year_dps=-0.02, effects=size, effects_a_year={"scale_factor": 2e-4}),
                      Unit(rng, "beta", f"b{i}", bias_a_year_dps=0.05 * rng.standard_normal())) for i in range(30)]
            found = self.fleet(made_fleet.lines(rng, pairs, 600), f"out{number}")
            self.assertEqual([unit["why"] for unit in found["units"] if unit["why"]], [], f"seed {number}")
            trends = {type_["type"]: {trend["of"]: trend for trend in type_["trends"]} for type_ in found["types"]}
            self.assertEqual({name: sorted(of) for name, of in trends.items()},
                             {"alpha": ["bias_dps", "scale_factor"], "beta": ["bias_dps"]})
            for of, true in (("bias_dps", -0.02), ("scale_factor", 2e-4)):
                value, sigma = trends["alpha"][of]["per_year"]
                self.assertLess(abs(value - true), 4.0 * sigma, of)
                self.assertFalse(trends["alpha"][of]["varies"])
            self.assertTrue(trends["beta"]["bias_dps"]["varies"])

    def test_says_how_far_units_differ(self):
        rng = np.random.default_rng([SEED, 4])
        effects = {"scale_factor": 5e-4}
        pairs = [(Unit(rng, "alpha", f"a{i}", effects=effects, spread={"scale_factor": 2e-4}), Unit(rng, "beta", f"b{i}"))
                 for i in range(40)]
        found = self.fleet(made_fleet.lines(rng, pairs, 400))
        effect = next(e for e in found["effects"] if e["kind"] == "scale_factor")
        true = np.mean([pair[0].sizes[made_fleet.NAMES.index("scale_factor")] for pair in pairs])
        self.assertLess(abs(effect["parameters"]["error"] - true), 4 * effect["sigma"]["error"])
        self.assertLess(abs(effect["between_units"] - 2e-4), 4 * effect["between_units_sigma"])
        self.assertLess(effect["between_units_sigma"], 1e-4)

    def test_model_files_are_such_as_the_daemon_takes(self):
        rng = np.random.default_rng([SEED, 5])
        self.fleet(made_fleet.lines(rng, plain_pairs(rng, 6, effects={"scale_factor": 5e-4}), 60))
        models = self.folder / "out" / "models"
        model = tomllib.loads((models / "alpha.toml").read_text())
        self.assertEqual(model["format"], 1)
        error = next(effect["error"] for effect in model["effect"] if effect["kind"] == "scale_factor")
        self.assertLess(abs(error - 5e-4), 5e-5)
        self.assertIn("white_noise", {effect["kind"] for effect in model["effect"]})


class Merging(FleetBench):
    def test_gives_the_same_bytes_in_any_order_and_grouping(self):
        rng = np.random.default_rng([SEED, 6])
        lines = made_fleet.lines(rng, plain_pairs(rng, 5, effects={"delay": 4e-5}), 40)
        self.fleet(lines)
        whole = (self.folder / "out" / "evidence.json").read_bytes()
        shuffle = random.Random(SEED)
        for turn in range(3):
            mixed = list(lines)
            shuffle.shuffle(mixed)
            cut = shuffle.randrange(1, 39)
            for name, part in (("first", mixed[:cut]), ("second", mixed[cut:])):
                (self.folder / f"{name}{turn}.json").write_text("".join(part))
                self.run_fleet(f"{name}{turn}.json", out=name + str(turn))
            merged = [f"second{turn}/evidence.json", f"first{turn}/evidence.json"]
            self.run_fleet(*merged, out=f"merged{turn}")
            for file in ("evidence.json", "fleet.json", "report.html"):
                self.assertEqual((self.folder / f"merged{turn}" / file).read_bytes(),
                                 (self.folder / "out" / file).read_bytes())
        self.assertEqual((self.folder / "merged0" / "evidence.json").read_bytes(), whole)

    def test_counts_no_drive_twice(self):
        rng = np.random.default_rng([SEED, 7])
        lines = made_fleet.lines(rng, plain_pairs(rng, 2), 6)
        once = self.fleet(lines)
        self.assertEqual(self.fleet(lines + lines[:3], "again"), once)
        done = self.run_fleet("out/evidence.json", "again/evidence.json", out="both", good=False)
        self.assertIn("is in two merged files", done.stderr)
        other = json.loads(lines[0])
        other["seconds"] = 299.0
        (self.folder / "other.json").write_text(lines[0] + json.dumps(other) + "\n")
        self.assertIn("has two different evidences", self.run_fleet("other.json", out="other", good=False).stderr)

    def test_tells_what_is_wrong_with_a_file(self):
        rng = np.random.default_rng([SEED, 8])
        good = made_fleet.lines(rng, plain_pairs(rng, 1), 1)[0]
        for bad, words in (("", "holds nothing"), ("{}", "no evidence"), (good[:500], "no evidence"), ("[1, 2]", "no evidence"),
                           (good.replace('"correlation": "', '"correlation": "AAAA'), "correlation"),
                           (good.replace('"format": 1', '"format": 7'), "format"),
                           (good.replace('"places"', '"place"'), '"places" is missing'),
                           (good.replace('"named": []', '"named": ["scale_facter"]', 1),
                            'not a known kind of effect; did you mean "scale_factor"?'),
                           (good.replace('"began_s": ', '"began_s": 1e999'), "not a line of JSON"),
                           (good.replace('"score": [', '"score": [null, '), '"score" is not a number'),
                           (good.replace('"score": [', '"score": [1, '), '"score" has 18 entries'),
                           (good.replace('"alpha"', '"\\u0007"'), '"type" is not a plain name'),
                           (good.replace('"alpha"', '"\xff"'), "not a line of JSON"),
                           ("[" * 100_000, "not a line of JSON"),
                           (good.replace('"white_dps_rthz": ', '"white_dps_rthz": -'), "white_dps_rthz")):
            (self.folder / "bad.json").write_bytes(bad.encode("latin-1"))
            done = self.run_fleet("bad.json", out="bad", good=False)
            self.assertIn(words, done.stderr)
            self.assertIn("bad.json", done.stderr)
            self.assertFalse((self.folder / "bad").exists())


class Page(FleetBench):
    def page(self, units=8, odd="<b>&odd", **errors):
        rng = np.random.default_rng([SEED, 11])
        pairs = plain_pairs(rng, units)
        pairs[3] = (Unit(rng, "alpha", odd, **errors), pairs[3][1])
        self.fleet(made_fleet.lines(rng, pairs, 6 * units))
        return (self.folder / "out" / "report.html").read_text(encoding="utf-8")

    def test_begins_with_the_verdict_and_links_to_each_unit_that_is_odd(self):
        page = self.page(effects={"scale_factor": 4e-3})
        self.assertIn("1 of 16 gyros is not as its type", page)
        link = re.search(r'<a href="#(unit\d+)"><b>&lt;b&gt;&amp;odd</b></a>', page)
        self.assertIn(f'<details id="{link.group(1)}" open>', page)
        self.assertNotIn("<b>&odd", page)
        self.assertLess(page.index("What to do next"), page.index("At a glance"))

    def test_says_so_where_nothing_is_to_be_done(self):
        page = self.page(odd="like")
        self.assertIn("All 16 gyros are as their types", page)
        self.assertIn("Nothing: all units are as their types", page)

    def test_leaves_out_good_units_of_which_there_are_thousands(self):
        page = self.page(units=600, effects={"scale_factor": 4e-3})
        self.assertEqual(page.count("<details id="), 1001)
        self.assertIn("199 more units, with nothing to tell, are in fleet.json", page)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
