#!/usr/bin/python3
"""The benchmarks' command lines follow the same rules as `vgyro`: numbers are numbers, names are names, and no input
is overwritten. No benchmark is run."""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(SOURCE / "bench"))
import command_line  # noqa: E402


class Benchmarks(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-benchmarks-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def said(self, script, *arguments):
        done = subprocess.run([sys.executable, SOURCE / "bench" / script, *arguments], cwd=self.folder, capture_output=True, text=True,
                              check=False, timeout=60)
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_a_picture_is_written_under_a_name_and_by_no_command(self):
        # gnuplot runs a name that begins with a bar as a command.
        before = os.getcwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, before)
        for name in ("|touch marker; .svg", "`touch marker`.svg"):
            command_line.draw("set terminal svg\nplot x\n", name)
            self.assertGreater(Path(name).stat().st_size, 1000)
        self.assertFalse(Path("marker").exists())
        self.assertEqual(command_line.file_name("-o"), self.folder.resolve() / "-o")

    def test_every_number_is_finite_and_in_its_range(self):
        # Every option of this kind of each benchmark.
        options = {"whiteness.py": ("--stretch", "--lags", "--cell", "--quiet-dps", "--gap"), "throughput.py": ("--rounds", "--core"),
                   "faults": ("--sequences", "--seed", "--kills", "--hours", "--seconds"), "paper_table.py": ("--seeds",),
                   "accuracy": ("--seeds", "--first-seed", "--jobs"), "blind": ("--first-seed", "--limit", "--jobs"),
                   "blind_units": ("--first-seed", "--limit", "--jobs"), "accuracy_axes": ("--seeds", "--first-seed", "--jobs"),
                   "fleet.py": ("--rounds", "--drives")}
        for script, names in options.items():
            positional = ("a.toml", "a.log") if script == "whiteness.py" else ()
            for name in names:
                for word in ("nan", "-1"):
                    with self.subTest((script, name, word)):
                        self.assertIn(name, self.said(script, *positional, f"{name}={word}"))

    def test_no_picture_is_drawn_over_the_recording(self):
        # Another name of an input is refused too.
        for name in ("a.toml", "a.log"):
            (self.folder / name).write_text(name)
        os.link(self.folder / "a.log", self.folder / "b.svg")
        for plot in ("a.log", "./a.toml", "b.svg"):
            self.assertIn("would be overwritten", self.said("whiteness.py", "a.toml", "a.log", "--plot", plot))
        self.assertEqual((self.folder / "a.log").read_text(), "a.log")


if __name__ == "__main__":
    unittest.main()
