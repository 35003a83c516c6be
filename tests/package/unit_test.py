#!/usr/bin/python3
"""Checks the service's unit with systemd itself, and the configuration in the package."""

import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
UNIT = SOURCE / "systemd/vgyrod.service"
TEMPLATE = SOURCE / "systemd/vgyrod@.service"
# Lower is better. The network is 0.5 of it: without it the gateway would have no bus.
EXPOSURE_MOST = 1.3


class Unit(unittest.TestCase):
    def test_systemd_finds_nothing_wrong(self):
        for unit, name in ((UNIT, UNIT.name), (TEMPLATE, "vgyrod@front.service")):
            with self.subTest(unit=unit.name), tempfile.TemporaryDirectory() as folder:
                # systemd-analyze needs the program at the unit's path, and the manual pages, which are not installed.
                copy = Path(folder) / name
                text = unit.read_text(encoding="utf-8").replace("/usr/bin/vgyrod", str(BIN / "vgyrod"))
                copy.write_text(text.replace("Documentation=man:", "#"), encoding="utf-8")
                done = subprocess.run(["systemd-analyze", "verify", "--recursive-errors=no", "--man=no", copy],
                                      capture_output=True, text=True, check=False)
                self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_an_instance_differs_from_the_service_only_in_what_is_its_own(self):
        one, many = (unit.read_text(encoding="utf-8") for unit in (UNIT, TEMPLATE))
        for own, common in (("/etc/vgyro/%i.", "/etc/vgyro/vgyro."), (", instance %i", ""), (" --instance %i", ""),
                            ("/run/vgyro-%i/", "/run/vgyro/"), ("Directory=vgyro-%i", "Directory=vgyro"),
                            ("vgyrod@%i", "vgyrod"), ("EnvironmentFile=-/etc/default/vgyrod-%i\n", "")):
            self.assertIn(own, many)
            many = many.replace(own, common)
        self.assertEqual(many, one)

    def test_exposure_stays_low_and_no_capability_is_left(self):
        done = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", UNIT],
                              capture_output=True, text=True, check=True)
        exposure = float(re.search(r"Overall exposure level for \S+ ([0-9.]+)", done.stdout).group(1))
        print(f"exposure {exposure}")
        self.assertLessEqual(exposure, EXPOSURE_MOST)
        self.assertNotRegex(done.stdout, r"✗ CapabilityBoundingSet")
        self.assertNotRegex(done.stdout, r"✗ (User=/DynamicUser=|NoNewPrivileges=|ProtectSystem=|SystemCallFilter=)")

    def condition(self, config):
        """Result of the unit's condition for this configuration."""
        line = re.search(r"^ExecCondition=/bin/sh -c '(.*)'$", UNIT.read_text(encoding="utf-8"), re.MULTILINE).group(1)
        return subprocess.run(["sh", "-c", line.replace("/etc/vgyro/vgyro.toml", str(config))], capture_output=True,
                              text=True, check=False)

    def test_the_packaged_configuration_starts_nothing(self):
        done = self.condition(SOURCE / "systemd/vgyro.toml")
        self.assertEqual(done.returncode, 1)
        self.assertIn("names no gyros yet", done.stdout)
        self.assertEqual(self.condition("/nonexistent").returncode, 1)
        self.assertEqual(self.condition(SOURCE / "examples/twin.toml").returncode, 0)

    def test_the_packaged_configuration_is_right_when_its_hashes_go(self):
        text = (SOURCE / "systemd/vgyro.toml").read_text(encoding="utf-8")
        text = re.sub(r"^#(?=[a-z\[])", "", text, flags=re.MULTILINE)
        text = text.replace("/usr/share/vgyro/profiles", str(SOURCE / "dbc/profiles"))
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "vgyro.toml").write_text(text, encoding="utf-8")
            (Path(folder) / "sensors.dbc").write_text(
                'BO_ 257 FOG: 8 X\n SG_ RateZ : 0|32@1- (1E-006,0) [0|0] "deg/s" X\n'
                ' SG_ Temp : 32|16@1- (0.01,0) [0|0] "degC" X\n SG_ Alive : 48|4@1+ (1,0) [0|14] "" X\n'
                ' SG_ Status : 52|4@1+ (1,0) [0|15] "" X\n', encoding="utf-8")
            done = subprocess.run([BIN / "vgyro", "check", f"{folder}/vgyro.toml"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")


if __name__ == "__main__":
    unittest.main()
