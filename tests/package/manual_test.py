#!/usr/bin/python3
"""The manual pages name exactly the options of --help and the keys that the gateway reads, and groff has no complaints
about them."""

import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
PAGES = ("vgyro.1", "vgyro.toml.5", "vgyrod.8")


def page(name):
    return (SOURCE / f"docs/man/{name}.scd").read_text(encoding="utf-8")


def sections(text):
    parts = re.split(r"^# (.+)\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2]))


def terms(section):
    """The lines above an indented explanation."""
    return [above for above, below in zip(section.splitlines(), section.splitlines()[1:])
            if above.startswith("*") and below.startswith("\t")]


def documented_options(section):
    return {option for term in terms(section) for option in re.findall(r"\*(-[-a-zA-Z]+)\*", term)}


def help_text(program, *command):
    done = subprocess.run([BIN / program, *command, "--help"], capture_output=True, text=True, check=True)
    return done.stdout


def offered_options(text):
    return {option for line in re.findall(r"^  (-\S+)", text, re.MULTILINE) for option in line.split(",") if option}


def commands():
    listed = help_text("vgyro").split("Subcommands:\n")[1]
    return re.findall(r"^  ([a-z]+)", listed, re.MULTILINE)


def keys_of_manual():
    """Table → keys, from vgyro.toml(5)."""
    found = {}
    for title, section in sections(page("vgyro.toml.5")).items():
        if title.startswith("["):
            table = title.strip("[]")
            found[table] = {key for term in terms(section) for key in re.findall(r"\*([a-z_0-9]+)\*", term)}
    return found


def value_for(table, key):
    heads = {"gyro": "[[gyro]]", "output.layout": '[output]\nbus = "can0"\n[[output.layout]]'}
    return heads.get(table, f"[{table}]") + f"\n{key} = false\n"


def check(config):
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
        file.write(config)
        file.flush()
        done = subprocess.run([BIN / "vgyro", "check", file.name], capture_output=True, text=True, check=False)
        return done.stderr


class Manual(unittest.TestCase):
    def test_vgyrod_8_has_the_options_of_help(self):
        self.assertEqual(documented_options(sections(page("vgyrod.8"))["OPTIONS"]), offered_options(help_text("vgyrod")))

    def test_vgyro_1_has_every_command_and_its_options(self):
        parts = sections(page("vgyro.1"))
        told = {title.split()[1].lower() for title in parts if title.startswith("VGYRO ")}
        self.assertEqual(told, set(commands()))
        self.assertEqual(documented_options(parts["DESCRIPTION"]), offered_options(help_text("vgyro")))
        for command in commands():
            with self.subTest(command=command):
                offered = offered_options(help_text("vgyro", command)) - {"-h", "--help"}
                self.assertEqual(documented_options(parts[f"VGYRO {command.upper()}"]), offered)

    def test_vgyro_toml_5_has_the_keys_of_the_reference(self):
        reference = (SOURCE / "docs/configuration.md").read_text(encoding="utf-8")
        backticked = set(re.findall(r"`([a-z_0-9]+)`", reference))
        for table, keys in keys_of_manual().items():
            with self.subTest(table=table):
                self.assertEqual({key for key in keys if key not in backticked and key != "fd"}, set())
        told = set().union(*keys_of_manual().values())
        rows = set(re.findall(r"`([a-z_0-9]+)`", " ".join(re.findall(r"^\| (`[^|]*) \|", reference, re.MULTILINE))))
        self.assertEqual(rows - told, set(), "in docs/configuration.md, not in the manual")

    def test_every_key_that_the_gateway_asks_for_is_told(self):
        """Finds the keys in the sources that read them, because the program lists no keys."""
        told = set().union(*keys_of_manual().values())
        asked = set()
        for name in ("config.cpp", "e2e_config.cpp", "output_layout_config.cpp", "signal_resolver.cpp", "valid_config.cpp",
                     "gyro_config.cpp", "mount.cpp"):
            text = (SOURCE / "gateway" / name).read_text(encoding="utf-8")
            asked |= set(re.findall(r'(?:(?:text|number|integer|boolean|signal|reader_\.table)\(|number_within\(reader, )"([a-z_0-9]+)"', text))
        self.assertLess({"rate", "temperature", "rest_s", "counter", "bus"}, asked, "this test could not fail")
        self.assertEqual(asked - told, set())

    def test_the_columns_of_a_profile_are_told_everywhere(self):
        """Takes the columns from the program's message about a wrong header."""
        with tempfile.TemporaryDirectory() as folder:
            profile, model = Path(folder) / "p.csv", Path(folder) / "m.toml"
            profile.write_text("0,1\n1,1\n")
            model.write_text("format = 1\n")
            done = subprocess.run([BIN / "vgyro", "simulate", "--config", SOURCE / "examples/twin.toml", "--model", model,
                                   "--profile", profile], capture_output=True, text=True, check=False)
        form = re.search(r"t_s,rate_dps\S*", done.stderr).group()
        self.assertIn(form, "".join(help_text("vgyro", "simulate").split()))
        self.assertIn(f"_{form}_", page("vgyro.1"))
        columns = set(re.findall(r"\w+", form))
        rows = re.findall(r"^\| (`[^|]*) \|", (SOURCE / "docs/simulate.md").read_text(encoding="utf-8"), re.MULTILINE)
        self.assertEqual(columns - set(re.findall(r"`(\w+)`", " ".join(rows))), set(), "not in docs/simulate.md")

    def test_the_gateway_knows_every_key_of_vgyro_toml_5(self):
        for table in ("gyro", "output.layout"):
            self.assertIn("unknown key", check(value_for(table, "nosuchkey") * (2 if table == "gyro" else 1)),
                          "this test could not fail")
        for table, keys in keys_of_manual().items():
            self.assertTrue(keys, table)
            for key in keys:
                with self.subTest(table=table, key=key):
                    self.assertNotIn("unknown key", check(value_for(table, key) * (2 if table == "gyro" else 1)))

    def test_groff_finds_nothing_wrong(self):
        for name in PAGES:
            with self.subTest(page=name), tempfile.TemporaryDirectory() as folder:
                made = Path(folder) / name
                made.write_bytes(subprocess.run(["scdoc"], input=page(name).encode(), capture_output=True, check=True).stdout)
                done = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z", str(made)],
                                      capture_output=True, text=True, check=False, env=dict(os.environ, MANROFFSEQ="", MANWIDTH="100"))
                self.assertEqual((done.returncode, done.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main()
