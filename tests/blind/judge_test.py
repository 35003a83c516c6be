#!/usr/bin/python3
"""Tests of the judge and of bench/blind, on answers and results made by hand."""

import json
import math
import os
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.append(str(Path(__file__).resolve().parents[2] / "bench"))
import blind_report  # noqa: E402
import judge  # noqa: E402

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))


def answer(*effects, group="single", reference=True, outside=None):
    made = [{"kind": k, "gyro": g, "parameters": dict(p), "t": 12.0} for k, g, p in effects]
    return {
        "group": group,
        "reference": reference,
        "outside": outside,
        "effects": made,
        "kind": "",
        "seed": 1,
        "strength": 12.0,
    }


def named(kind, gyro, rivals=(), parameters=None, sigma=None):
    return {
        "kind": kind, "gyro": gyro, "parameters": parameters or {}, "sigma": sigma or {},
        "ambiguous_with": [{"kind": k, "gyro": g} for k, g in rivals],
    }  # fmt: skip


def result(*effects):
    return {"verdict": "explained", "effects": list(effects), "gap": {}}


SCALE = ("scale_factor", 2, {"error": 4e-4})


class Judge(unittest.TestCase):
    def test_right_name(self):
        found = named("scale_factor", 2, parameters={"error": 4.1e-4}, sigma={"error": 1e-5})
        j = judge.judge(answer(SCALE), result(found))
        self.assertEqual(
            (j["wrong"], j["right_first"], j["found"], j["covered"], j["surplus"]),
            ([], True, [True], [True], 0),
        )
        [(kind, name, error, sigma)] = j["errors"]
        self.assertAlmostEqual(error, 1e-5)
        self.assertEqual((kind, name, sigma), ("scale_factor", "error", 1e-5))

    def test_wrong_name_is_confidently_wrong_unless_the_truth_is_its_rival(self):
        j = judge.judge(answer(SCALE), result(named("scale_factor_cubic", 2)))
        self.assertEqual(
            (j["wrong"], j["found"], j["covered"]), ([["scale_factor_cubic", 2]], [False], [False])
        )
        j = judge.judge(answer(SCALE), result(named("scale_factor_cubic", 2, [("scale_factor", 2)])))
        self.assertEqual(
            (j["wrong"], j["right_first"], j["found"], j["covered"]), ([], False, [False], [True])
        )
        j = judge.judge(answer(SCALE), result(named("scale_factor", 1, [("scale_factor", 2)])))
        self.assertEqual(
            (j["wrong"], j["right_first"]), ([], False), "beside a reference the gyros can be told apart"
        )

    def test_without_a_reference_the_other_gyro_is_right_if_it_says_so(self):
        told = judge.judge(
            answer(SCALE, reference=False), result(named("scale_factor", 1, [("scale_factor", 2)]))
        )
        self.assertEqual((told["wrong"], told["right_first"], told["found"]), ([], True, [True]))
        untold = judge.judge(answer(SCALE, reference=False), result(named("scale_factor", 1)))
        self.assertEqual((untold["wrong"], untold["right_first"]), ([["scale_factor", 1]], False))

    def test_every_name_is_wrong_where_nothing_of_the_catalogue_hides(self):
        common = answer(
            ("scale_factor", 1, {"error": 1e-3}), ("scale_factor", 2, {"error": 1e-3}), group="decoy"
        )
        for nothing in (
            answer(group="clean"),
            answer(group="outside", outside={"name": "chirp", "gyro": 1}),
            common,
        ):
            j = judge.judge(nothing, result(named("scale_factor", 1)))
            self.assertEqual(j["wrong"], [["scale_factor", 1]])
            self.assertFalse(judge.as_wished(nothing, j))
            self.assertTrue(judge.as_wished(nothing, judge.judge(nothing, result())))

    def test_a_name_given_twice_is_surplus(self):
        j = judge.judge(answer(SCALE), result(named(*SCALE[:2]), named(*SCALE[:2])))
        self.assertEqual((j["wrong"], j["surplus"]), ([], 1))
        self.assertFalse(judge.as_wished(answer(SCALE), j))

    def test_half_of_a_pair_is_not_the_pair(self):
        two = answer(SCALE, ("bias", 1, {"value_dps": 0.01}), group="pair")
        j = judge.judge(two, result(named("bias", 1)))
        self.assertEqual(
            (j["found"], j["covered"], judge.as_wished(two, j)), ([False, True], [False, True], False)
        )

    def test_a_tone_may_be_written_in_two_ways(self):
        true = {"frequency_hz": 7.0, "amplitude_dps": 0.003, "phase_rad": 1.0}
        found = {"frequency_hz": 7.0, "amplitude_dps": -0.003, "phase_rad": 1.0 + math.pi - 2 * math.pi}
        e = named("line", 1, parameters=found, sigma=dict.fromkeys(found, 1e-3))
        j = judge.judge(answer(("line", 1, true)), result(e))
        self.assertEqual(len(j["errors"]), 3)
        for _, name, error, _ in j["errors"]:
            self.assertAlmostEqual(error, 0.0, msg=name)

    def test_another_harmonic_misses_its_interval(self):
        true = {"harmonic": 4, "amplitude_dps": 0.003, "phase_rad": 1.0}
        j = judge.judge(
            answer(("angle_harmonic", 1, true)),
            result(named("angle_harmonic", 1, parameters={**true, "harmonic": 3})),
        )
        self.assertEqual([(name, error) for _, name, error, _ in j["errors"]], [("harmonic", math.inf)])

    def test_the_gap_is_closed_inside_the_band(self):
        for value, closed in ((0.006, True), (0.008, False), (-0.1, True)):
            compared = {"gap": {"value": value, "band95": [-0.006, 0.007]}}
            self.assertEqual(judge.judge(answer(SCALE), result(), compared)["closed"], closed)

    def test_wilson_interval_of_none_in_a_hundred(self):
        low, high = blind_report.interval95(0, 100)
        self.assertEqual(low, 0.0)
        self.assertAlmostEqual(high, 0.0370, places=4)


# Finds a scale factor in everything and counts its calls.
FAKE = """#!/usr/bin/python3
import json, pathlib, sys
if "--help" in sys.argv:
    sys.exit()
word = lambda name: pathlib.Path(sys.argv[sys.argv.index(name) + 1])
with open(pathlib.Path(__file__).parent / "calls", "a") as calls:
    calls.write(sys.argv[1] + "\\n")
if sys.argv[1] == "gap":
    if list(word("--config").parent.glob("*answer*")):
        sys.exit("the answer lies open")
    if "t8" in word("--config").parent.name:
        sys.exit("no idea")
    word("--out").mkdir(parents=True)
    (word("--out") / "model.toml").write_text("format = 1")
    effect = {"kind": "scale_factor", "gyro": 1, "parameters": {"error": 1e-3}, "sigma": {}, "ambiguous_with": []}
    whole = {"verdict": "explained", "gap": {"before": 1.0, "after": 0.0, "band95": [-0.01, 0.01]}, "effects": [effect], "unexplained": []}
    (word("--out") / "gap.json").write_text(json.dumps(whole))
else:
    word("--json").write_text(json.dumps({"gap": {"value": 0.1, "floor": 0.0, "band95": [-0.01, 0.01]}}))
"""


class Sets(unittest.TestCase):
    """An effect that was not applied is not a certain name."""

    @staticmethod
    def unapplied(*words, **more):
        return {**named(*words, **more), "applied": False}

    def test_the_truth_among_the_rivals_of_what_was_not_applied_is_covered(self):
        found = self.unapplied("scale_factor", 1, [("scale_factor", 2)])
        j = judge.judge(answer(SCALE, reference=False), result(found))
        self.assertEqual((j["wrong"], j["confident"], j["covered"], j["found"]), ([], [], [True], [True]))
        self.assertEqual(j["unapplied"], [["scale_factor", 1]])

    def test_a_set_without_the_truth_is_wrong_but_not_confidently(self):
        j = judge.judge(answer(SCALE), result(self.unapplied("bias", 1, [("warm_up", 1)])))
        self.assertEqual((j["wrong"], j["confident"], j["covered"]), ([["bias", 1]], [], [False]))

    def test_what_is_true_of_the_gyros_anyway_may_be_named_and_does_not_come_first(self):
        told = {**answer(SCALE), "benign": [["bias", 1], ["white_noise", 2]]}
        j = judge.judge(told, result(named("bias", 1), named("white_noise", 2), named("scale_factor", 2)))
        self.assertEqual((j["wrong"], j["right_first"], j["deterministic"]), ([], True, []))
        clean = {**answer(group="clean"), "benign": [["quantization", 1]]}
        self.assertEqual(judge.judge(clean, result(named("quantization", 1)))["wrong"], [])
        self.assertEqual(judge.judge(clean, result(named("quantization", 2)))["wrong"], [["quantization", 2]])

    def test_a_stranger_may_bear_the_name_that_a_later_catalogue_has_for_it(self):
        settling = answer(group="outside", outside={"name": "settling", "gyro": 2})
        self.assertEqual(judge.judge(settling, result(named("run_in", 2)))["wrong"], [])
        self.assertEqual(judge.judge(settling, result(named("warm_up", 2)))["wrong"], [["warm_up", 2]])

    def test_noise_beside_the_truth_is_told_from_a_false_cause(self):
        j = judge.judge(answer(SCALE), result(named("scale_factor", 2), named("rate_random_walk", 1)))
        self.assertEqual((j["confident"], j["deterministic"]), ([["rate_random_walk", 1]], []))


class Lines(unittest.TestCase):
    def line(self, told, found, after=0.0, verdict="explained"):
        judged = judge.judge(told, {**found, "verdict": verdict})
        gap = {"before": 1.0, "after": after, "band95": [-0.01, 0.01]}
        return {"answer": told, "judged": judged, "gap": gap, "seconds": 2.0, "memory_mb": 50.0}

    def test_outcomes(self):
        right = self.line(answer(SCALE), result(named("scale_factor", 2)))
        wrong = self.line(answer(SCALE), result(named("bias", 1)))
        noise = self.line(answer(SCALE), result(named("scale_factor", 2), named("rate_noise", 1)))
        missed = self.line(answer(SCALE), result(), after=0.5)
        told = [blind_report.outcome(line) for line in (right, wrong, noise, missed)]
        self.assertEqual(told, ["right", "CONFIDENTLY WRONG", "surplus noise", "missed"])
        self.assertIn(" OUT | 2.0 s, 50 MB", blind_report.one_line(missed))

    def test_what_must_be_reached_is_counted(self):
        lines = [self.line(answer(SCALE), result(named("scale_factor", 2)), after=a) for a in (0.0, 0.5)]
        lines += [self.line(answer(group="clean"), result(), verdict="no_gap")]
        lines += [self.line(answer(group="clean"), result(named("bias_step", 1)))]
        text = "\n".join(blind_report.must_reach(lines))
        for row in ("\"no gap\", inside the band | 1 of 2", "right name first | 2 of 2", "held-out gap inside the band | 1 of 2",
                    "deterministic named | 1 of 2", "confidently wrong, of all | 1 of 4"):  # fmt: skip
            self.assertIn(row, text)

    def test_a_run_that_was_ended_has_found_nothing(self):
        lines = [self.line(answer(SCALE), result(named("scale_factor", 2)))]
        lines += [{"case": "x", "answer": answer(SCALE), "failed": "ended after 60 s"}]
        text = "\n".join(blind_report.must_reach(lines))
        for row in ("right name first | 1 of 2", "inside the band | 1 of 2", "rivals, \\|t\\| ≥ 8 | 1 of 2",
                    "ended by the time limit | 1 of 2", "longer than 10 s | 1 of 2", "confidently wrong, of all | 0 of 1"):  # fmt: skip
            self.assertIn(row, text)

    def test_two_builds_are_held_against_each_other(self):
        old = {**self.line(answer(SCALE), result(), after=0.5), "case": "a", "seconds": 20.0}
        new = {**self.line(answer(SCALE), result(named("scale_factor", 2))), "case": "a"}
        text = "\n".join(blind_report.changes([new], [old, {**old, "case": "b"}]))
        self.assertIn("1 recordings in both, 1 changed, 10.0 times as fast", text)
        self.assertIn("| a | missed, OUT | right, in |", text)

    def test_p_of_clean_recordings_is_held_against_a_uniform_one(self):
        lines = [{**self.line(answer(group="clean"), result()), "null_p": (i + 0.5) / 50} for i in range(50)]
        self.assertIn("distance from uniform 0.01", blind_report.uniformity(lines)[0])
        self.assertEqual(blind_report.uniformity([self.line(answer(group="clean"), result())]), [])


class Bench(unittest.TestCase):
    def test_goes_on_where_it_was_cut_off_and_counts_false_names(self):
        with tempfile.TemporaryDirectory() as scratch:
            scratch = Path(scratch)
            fake = scratch / "vgyro"
            fake.write_text(FAKE)
            fake.chmod(fake.stat().st_mode | stat.S_IXUSR)

            def bench(limit):
                command = [
                    str(SOURCE / "bench/blind"),
                    "--quick",
                    "--only",
                    "scale_factor-",
                    "--first-seed",
                    "100",
                    "--limit",
                    limit,
                ]
                command += [
                    "--vgyro",
                    str(fake),
                    "--results",
                    str(scratch / "results.jsonl"),
                    "--table",
                    str(scratch / "table.md"),
                ]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                return (scratch / "table.md").read_text()

            bench("1")
            text = bench("4")
            calls = (scratch / "calls").read_text().split()
            self.assertEqual(calls.count("gap"), 4, "each recording once")
            lines = [json.loads(line) for line in (scratch / "results.jsonl").read_text().splitlines()]
            self.assertEqual(len(lines), 4)
            failed = [line for line in lines if "failed" in line]
            self.assertEqual(len(failed), 1)
            self.assertIn("no idea", failed[0]["failed"])
            self.assertIn("single-scale_factor-t8", text)
            right = sum(line["answer"]["effects"][0]["gyro"] == 1 for line in lines if "judged" in line)
            told = [line for line in lines if "judged" in line]
            self.assertEqual(sum(line["judged"]["right_first"] for line in told), right)
            self.assertIn(f"right name first | {right} of 3", text)


if __name__ == "__main__":
    unittest.main()
