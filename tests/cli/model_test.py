#!/usr/bin/python3
"""`vgyro model list` and the model file on the command line."""

import json
import re
import unittest

import bench


class ModelList(bench.Bench):
    def test_lists_every_kind_with_its_limits(self):
        # Users write the file by hand from this list.
        text = self.good("model", "list").stdout.decode()
        for kind in ("scale_factor ", "angle_harmonic ", "gauss_markov ", "timestamp_jitter "):
            self.assertIn("\n  " + kind, text)
        for part in ("reference_c", "25 unless given", '"x", "y" or "z"', "0.001 to 1e+09 s", "0, or 1e-12 to 100 deg/s", "the gateway subtracts it"):
            self.assertIn(part, text)

    def test_says_of_every_kind_what_shows_it_and_names_only_kinds_it_may_be_taken_for(self):
        lines = self.good("model", "list").stdout.decode().splitlines()
        kinds = {line.split()[0] for line in lines if re.match(r"  \S", line)}
        self.assertEqual(len(kinds), 36)
        self.assertEqual(sum(line.startswith("    shown by ") for line in lines), len(kinds))
        kind = ""
        for line in lines:
            kind = line.split()[0] if re.match(r"  \S", line) else kind
            if line.startswith("    may be confused with "):
                others = set(line.removeprefix("    may be confused with ").strip().split(", "))
                self.assertLessEqual(others, kinds - {kind})

    def test_every_kind_is_told_and_has_equations_of_its_own(self):
        """Every kind of the catalogue appears in the documentation's tables, in the tests of the simulator, and
        among the kinds hidden from the gap workflow."""
        lines = self.good("model", "list").stdout.decode().splitlines()
        kinds = {line.split()[0] for line in lines if re.match(r"  \S", line)}
        source = lambda name: (bench.SOURCE / name).read_text(encoding="utf-8")
        self.assertEqual(set(re.findall(r"^\| `(\w+)` \| `", source("docs/model-file.md"), re.MULTILINE)), kinds)
        blind = source("tests/blind/effects.py").split("SIZE = {")[1].split("\n}")[0]
        self.assertEqual(set(re.findall(r'^    "(\w+)": \(', blind, re.MULTILINE)), kinds)
        judged = set(re.findall(r'effect\("(\w+)"', source("tests/simulation/effects_test.py")))
        self.assertEqual(kinds - judged, set(), "nobody plays it against its equation")

    def test_lines_fit_a_terminal(self):
        for line in self.good("model", "list").stdout.decode().splitlines():
            self.assertLessEqual(len(line), 100, line)

    def test_model_alone_is_wrong_usage(self):
        self.bad("model", code=2)


MODEL = """\
format = 1

[[effect]]
gyro = 1
kind = "bias"
value_dps = 0.5

[[effect]]
gyro = 2
kind = "white_noise"
density_dps_rthz = 1e-3

[[effect]]
gyro = 2
kind = "stuck"
from_s = 5
to_s = 6
"""


class ModelOfAConfig(bench.Bench):
    def test_check_says_what_becomes_of_each_effect(self):
        # A user can check the model before trusting it.
        self.write("known.toml", MODEL)
        text = self.good("check", "--model", "known.toml", "vgyro.toml").stdout.decode()
        for pattern in (r"known.toml, 3 effects", r"takes back +bias +value_dps 0.5",
                        r"as noise +white_noise +density_dps_rthz 0.001", r"cannot undo +stuck"):
            self.assertRegex(text, pattern)

    def test_config_names_it_relative_to_itself(self):
        (self.folder / "sub").mkdir()
        self.write("sub/known.toml", MODEL)
        self.write("vgyro.toml", bench.CONFIG.replace("[corrector]", '[corrector]\nmodel = "sub/known.toml"'))
        self.assertIn("sub/known.toml", self.good("check", "vgyro.toml").stdout.decode())

    def test_file_that_is_not_there_is_a_mistake_of_the_line_that_names_it(self):
        text = bench.CONFIG.replace("[corrector]", '[corrector]\nmodel = "known.toml"')
        self.write("vgyro.toml", text)
        line = text.splitlines().index('model = "known.toml"') + 1
        self.assertIn(f"vgyro.toml:{line}: ", self.bad("check", "vgyro.toml"))

    def test_input_that_the_config_lacks_is_named_at_the_models_line(self):
        self.write("known.toml", MODEL + '\n[[effect]]\ngyro = 2\nkind = "temperature_bias"\ncoefficient_dps_k = 1e-3\n')
        said = self.bad("check", "--model", "known.toml", "vgyro.toml")
        self.assertIn("known.toml:19: ", said)
        self.assertIn("temperature of gyro right", said)

    def test_replay_takes_it_off_and_says_so(self):
        # The bias of gyro a is 0.5: with the model, the plain mean has only the other gyro's error.
        self.write("known.toml", MODEL)
        self.write("in.log", "".join(bench.two_gyros(5)))
        summaries = []
        for extra in ((), ("--model", "known.toml")):
            done = self.good("replay", "--config", "vgyro.toml", "--method", "mean", "-q", *extra, "--json", "-", "in.log")
            summaries.append(json.loads(done.stdout))
        self.assertIsNone(summaries[0]["model"])
        self.assertEqual(summaries[1]["model"]["file"], "known.toml")
        self.assertEqual([e["treatment"] for e in summaries[1]["model"]["effects"]],
                         ["takes back", "as noise", "cannot undo"])
        change = summaries[0]["out"]["mean_rate_dps"] - summaries[1]["out"]["mean_rate_dps"]
        self.assertAlmostEqual(change, 0.25, delta=1e-4)


if __name__ == "__main__":
    unittest.main()
