#!/usr/bin/python3
"""Twelve worlds that together contain every ingredient: a valid rate is as accurate as its sigma, and it
is available. `bench/honesty/run --seed N --plot` draws a world; the bench runs thousands."""

import importlib.machinery
import importlib.util
import sys
import tempfile
import unittest
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import outside  # noqa: E402
import judge  # noqa: E402
import report  # noqa: E402
import worlds  # noqa: E402

# A greedy cover of all ingredients among the seeds 5000 to 5999, chosen without regard to the results.
SEEDS = (5404, 5312, 5350, 5323, 5037, 5278, 5005, 5050, 5112, 5476, 5525, 5617)
LOOKED_AT = range(5000, 5300)


def bench():
    """bench/honesty/run is a program without a suffix."""
    loader = importlib.machinery.SourceFileLoader("honesty_run", str(outside.HONESTY / "run"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def judged(seed):
    with tempfile.TemporaryDirectory(prefix="vgyro-world-") as folder:
        return bench().run_world(seed, (), Path(folder))[0]


def ingredients(seed):
    return {(key, name) for key, names in worlds.draw(seed).tags.items() for name in names}


class TwelveWorlds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with Pool(2) as pool:
            cls.results = pool.map(judged, SEEDS)

    def none_fails(self, *kinds):
        failing = [r for r in self.results if any(kind in r["failed"] for kind in kinds)]
        if failing:
            self.fail(f"{len(failing)} of {len(SEEDS)} worlds\n" + "\n".join(map(report.one_world, failing)))

    def test_no_rate_is_beyond_six_sigma_for_two_seconds(self):
        self.none_fails("beyond 6 sigma")

    def test_no_rate_is_beyond_four_sigma_for_twenty_seconds(self):
        self.none_fails("beyond 4 sigma")

    def test_the_rate_is_valid_while_both_gyros_are_sound(self):
        self.none_fails("valid share")

    def test_sigma_is_neither_too_small_nor_too_large(self):
        self.none_fails("ratio high", "ratio low")

    def test_the_twelve_hold_every_ingredient(self):
        held = set().union(*map(ingredients, SEEDS))
        self.assertFalse(set().union(*map(ingredients, LOOKED_AT)) - held)

    def test_every_kind_of_failure_is_asked_for(self):
        self.assertEqual({kind for kinds in judge.ALLOWED for kind in kinds}, set(judge.KINDS))


if __name__ == "__main__":
    unittest.main()
