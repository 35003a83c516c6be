#!/usr/bin/python3
"""The completions that bash itself offers after <Tab>, with the completion file loaded."""

import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))

ASK = """\
source "$1"; shift
spec=$(complete -p "${1##*/}") || exit 3
[[ $spec =~ -F\\ ([a-z_]+) ]] || exit 3
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}
"${BASH_REMATCH[1]}" "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}" 2>&1
printf '%s\\n' "${COMPREPLY[@]}"
"""


def offered(*words, folder=None):
    words = [str(BIN / words[0]), *words[1:]]
    done = subprocess.run(["bash", "--norc", "-c", ASK, "ask", str(SOURCE / "completion/vgyro"), *words],
                          capture_output=True, text=True, check=True, cwd=folder)
    return set(done.stdout.split())


def long_options(program, *command):
    text = subprocess.run([BIN / program, *command, "--help"], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"--[a-z-]+", " ".join(re.findall(r"^  (-\S+)", text, re.MULTILINE))))


class Completion(unittest.TestCase):
    def test_offers_the_commands(self):
        listed = subprocess.run([BIN / "vgyro", "--help"], capture_output=True, text=True, check=True).stdout
        commands = set(re.findall(r"^  ([a-z]+) ", listed.split("Subcommands:\n")[1], re.MULTILINE))
        self.assertGreaterEqual(commands, {"check", "replay", "gap"})
        self.assertEqual(offered("vgyro", ""), commands | {"help"})
        self.assertEqual(offered("vgyro", "help", ""), commands)
        self.assertEqual(offered("vgyro", "rep"), {"replay"})

    def test_offers_the_options_of_each_command(self):
        for command in offered("vgyro", "") - {"help"}:
            with self.subTest(command=command):
                self.assertEqual(offered("vgyro", command, "--"), long_options("vgyro", command))
        self.assertEqual(offered("vgyrod", "--"), long_options("vgyrod"))
        self.assertEqual(offered("vgyro", "replay", "--js"), {"--json"})

    def test_offers_methods_and_files_that_fit(self):
        self.assertEqual(offered("vgyrod", "--method", ""), {"optimal", "mutual", "mean"})
        with tempfile.TemporaryDirectory() as folder:
            for name in ("vgyro.toml", "drive.log", "drive.log.xz", "bench.dbc", "profile.csv", "notes.txt"):
                (Path(folder) / name).touch()
            (Path(folder) / "deeper").mkdir()
            expected = {"--config": "vgyro.toml", "--dbc": "bench.dbc", "--profile": "profile.csv"}
            for option, name in expected.items():
                with self.subTest(option=option):
                    self.assertEqual(offered("vgyro", "replay", option, "", folder=folder), {name, "deeper"})
            (Path(folder) / "named.toml").write_text('[[gyro]]\nname = "fog"\n[[gyro]]\nname = "mems"\n[output]\nname = "x"\n')
            self.assertEqual(offered("vgyro", "gap", "--config", "named.toml", "--accept", "gyro=", folder=folder),
                             {"gyro=1", "gyro=2", "gyro=fog", "gyro=mems"})
            (Path(folder) / "named.toml").unlink()
            self.assertEqual(offered("vgyro", "check", "vg", folder=folder), {"vgyro.toml"})
            self.assertEqual(offered("vgyro", "replay", "--config", "vgyro.toml", "dr", folder=folder),
                             {"drive.log", "drive.log.xz"})


if __name__ == "__main__":
    unittest.main()
