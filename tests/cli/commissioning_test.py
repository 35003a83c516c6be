#!/usr/bin/python3
"""Runs the commands of docs/commissioning.md, in their order, on the simulated recordings that it names."""

import re
import shutil
import subprocess
import unittest

import bench

NEEDS_A_BUS = ("candump", "vgyrod", "vgyro status", "systemctl", "vgyro check /etc")


def commands():
    text = (bench.SOURCE / "docs/commissioning.md").read_text(encoding="utf-8")
    return [line for line in re.findall(r"^    (\S.*)$", text, re.MULTILINE) if not line.startswith(NEEDS_A_BUS)]


@unittest.skipIf(bench.SANITIZED, "the gap workflow takes minutes there")
class Commissioning(bench.Bench):
    def test_every_command_of_the_guide_does_what_it_says(self):
        (self.folder / "vgyro.toml").unlink()  # the file of bench.py
        shutil.copytree(bench.SOURCE / "examples", self.folder / "examples")
        said = {}
        for line in commands():
            done = subprocess.run(["bash", "-c", f'vgyro() {{ "{bench.VGYRO}" "$@"; }}\n{line}'], cwd=self.folder,
                                  capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, f"{line}\n{done.stderr}")
            said[line] = done.stdout + done.stderr
        self.assertGreaterEqual(len(said), 11, "the guide has lost its commands")
        word = {name: next(text for line, text in said.items() if line.startswith(f"vgyro {name}")) for name in
                ("check", "replay", "compare")}
        self.assertIn("good", word["check"])
        self.assertIn("ended in state running", word["replay"])
        # The guide's sensors.toml: 0.3 % of gyro 2. The workflow's own sigma is 1.4e-5; seven of them.
        found = (self.folder / "found/model.toml").read_text()
        error = float(re.search(r'gyro = 2\nkind = "scale_factor"\nerror = (\S+)', found).group(1))
        self.assertAlmostEqual(error, 3.0e-3, delta=1e-4)
        self.assertIn("ambiguous = true", found)


if __name__ == "__main__":
    unittest.main()
