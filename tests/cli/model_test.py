#!/usr/bin/python3
"""`vgyro model list` and the model file on the command line."""

import unittest

import bench


class ModelList(bench.Bench):
    def test_lists_every_kind_with_its_limits(self):
        # The file is written by hand, from this list.
        text = self.good("model", "list").stdout.decode()
        for kind in ("scale_factor ", "angle_harmonic ", "gauss_markov ", "timestamp_jitter "):
            self.assertIn("\n  " + kind, text)
        for part in ("reference_c", "25 unless given", '"x", "y" or "z"', "above 0 and up to", "takes it back"):
            self.assertIn(part, text)

    def test_lines_fit_a_terminal(self):
        for line in self.good("model", "list").stdout.decode().splitlines():
            self.assertLessEqual(len(line), 100, line)

    def test_model_alone_is_wrong_usage(self):
        self.bad("model", code=2)


if __name__ == "__main__":
    unittest.main()
