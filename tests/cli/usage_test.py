#!/usr/bin/python3
"""Help texts and wrong usage, which a user meets first."""

import re
import subprocess
import unittest

import bench

COMMANDS = {
    "check": {"CONFIG", "--method", "--model"},
    "decode": {"--dbc", "--text", "LOG"},
    "allan": {"--config", "--axis", "--evidence", "--json", "--plot", "LOG"},
    "replay": {"--config", "--method", "--model", "--state", "-o", "--output", "--json", "--csv", "--plot", "--html", "--map", "--digits", "-q", "--quiet",
               "LOG"},
    "compare": {"--config", "--model", "--measured", "--axis", "--json", "--seed", "-q", "--quiet"},
    "gap": {"--config", "--model", "--measured", "--axis", "--out", "--accept", "--evidence", "--time-limit", "--seed", "-q", "--quiet"},
    "fleet": {"EVIDENCE", "--out", "--false-names", "-q", "--quiet"},
    "convert": {"-o", "--output", "--digits", "-q", "--quiet", "LOG"},
}


class Usage(bench.Bench):
    def help_of(self, *command):
        return self.good(*command, "--help").stdout.decode()

    def test_help_of_each_command_names_every_option(self):
        # Help names every option.
        for command, options in COMMANDS.items():
            text = self.help_of(command)
            for option in options:
                self.assertRegex(text, rf"(?<![\w-]){re.escape(option)}(?![\w-])", command)

    def test_help_hides_no_option_that_the_test_does_not_know(self):
        # Keeps the list above true.
        for command, options in COMMANDS.items():
            named = set(re.findall(r"(?:^|[\s,])(--?[a-z][\w-]*)", self.help_of(command).split("Example:")[0], re.MULTILINE))
            self.assertEqual(named - options - {"-h", "--help", "-L"}, set(), command)

    def test_help_fits_100_columns(self):
        # Lines wrapped by the terminal are hard to read.
        for command in ((), *((c,) for c in COMMANDS)):
            for line in self.help_of(*command).splitlines():
                self.assertLessEqual(len(line), 100, line)

    def test_help_names_every_command_and_exit_code(self):
        # The entry point for new users.
        text = self.help_of()
        for part in (*COMMANDS, "Exit codes", "0 done", "1 bad input", "2 wrong usage"):
            self.assertIn(part, text)

    def test_wrong_usage_is_code_2_and_says_what_is_missing(self):
        # Scripts distinguish wrong usage from bad data by the exit code.
        for arguments, part in (
            ((), "no command is given"),
            (("fly",), "fly"),
            (("check",), "CONFIG"),
            (("decode", "in.log"), "--dbc"),
            (("replay", "--config", "vgyro.toml"), "LOG"),
            (("replay", "in.log"), "--config"),
            (("allan", "in.log"), "--config"),
            (("allan", "--config", "vgyro.toml"), "LOG"),
            (("replay", "--config", "vgyro.toml", "--method", "median", "in.log"), "median"),
            (("replay", "--config", "vgyro.toml", "--colour", "in.log"), "--colour"),
            (("gap", "--config", "vgyro.toml", "--measured", "in.log", "--out", "o", "--accept", "gyro=3"), "gyro=1 or gyro=2"),
            (("gap", "--config", "vgyro.toml", "--measured", "in.log", "--out", "o", "--accept", "kind=dely"), 'mean "delay"'),
            (("gap", "--config", "vgyro.toml", "--measured", "in.log", "--out", "o", "--time-limit", "-1"), "--time-limit"),
        ):
            with self.subTest(arguments):
                complaint = self.bad(*arguments, code=2)
                self.assertIn(part, complaint)
                self.assertTrue(complaint.startswith("error: "), complaint)

    def test_a_mistyped_option_or_command_names_the_nearest(self):
        # The mistyped option is named, not the one that it leaves missing.
        for arguments, part in (
            (("replay", "--config", "c.toml", "--plto", "p.svg", "in.log"), "there is no option --plto; did you mean --plot?"),
            (("replay", "--confg=c.toml", "in.log"), "there is no option --confg; did you mean --config?"),
            (("gap", "--measurd", "in.log"), "did you mean --measured?"),
            (("replay", "--config", "c.toml", "--colouring", "in.log"), "`vgyro replay --help`"),
            (("repaly", "in.log"), 'there is no command "repaly"; did you mean "replay"?'),
            (("help", "repaly"), 'there is no command "repaly"; did you mean "replay"?'),
            (("model", "lits"), "`vgyro model --help`"),
        ):
            with self.subTest(arguments):
                self.assertIn(part, self.bad(*arguments, code=2))

    def test_the_daemon_names_the_nearest_option(self):
        done = subprocess.run([bench.BIN / "vgyrod", "--confg", "c.toml"], capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stderr),
                         (2, "error: vgyrod: there is no option --confg; did you mean --config?\n"))

    def test_help_of_a_command_is_its_help(self):
        for command in ((), *((c,) for c in COMMANDS), ("model", "list")):
            with self.subTest(command):
                self.assertEqual(self.good("help", *command).stdout, self.good(*command, "--help").stdout)

    def test_help_names_manual_pages_and_no_file_of_the_source_tree(self):
        # Users of the package have no docs/ folder.
        for command in ((), *((c,) for c in COMMANDS), ("init",), ("simulate",), ("status",), ("recalibrate",)):
            text = self.help_of(*command)
            self.assertNotIn("docs/", text, command)
            self.assertNotIn(".md", text, command)

    def test_a_model_file_names_gyros_as_the_configuration_does(self):
        self.write("vgyro.toml", bench.CONFIG)
        self.write("m.toml", 'format = 1\n[[effect]]\ngyro = "right"\nkind = "bias"\nvalue_dps = 0.25\n')
        self.assertRegex(self.good("check", "--model", "m.toml", "vgyro.toml").stdout.decode(), r"gyro right\n +takes back +bias")
        self.write("m.toml", 'format = 1\n[[effect]]\ngyro = "rihgt"\nkind = "bias"\nvalue_dps = 0.25\n')
        self.assertIn('m.toml:3: there is no gyro "rihgt"; did you mean "right"?',
                      self.bad("check", "--model", "m.toml", "vgyro.toml"))

    def test_accept_names_gyros_as_the_configuration_does(self):
        self.write("vgyro.toml", bench.CONFIG)
        call = ("gap", "--config", "vgyro.toml", "--measured", "none.log", "--out", "o", "--accept")
        self.assertIn('there is no gyro "rihgt"; did you mean "right"?', self.bad(*call, "gyro=rihgt,kind=bias", code=2))
        self.assertIn("none.log", self.bad(*call, "gyro=right,kind=bias"))

    def test_version_is_told(self):
        # The first question of any bug report.
        self.assertRegex(self.good("--version").stdout.decode(), r"^vgyro \d+\.\d+\.\d+\n$")


if __name__ == "__main__":
    unittest.main()
