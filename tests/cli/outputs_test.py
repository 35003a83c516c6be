#!/usr/bin/python3
"""The outputs of `vgyro`: they never overwrite an input, never reach another program's syntax, and are never lost
silently."""

import json
import os
import resource
import signal
import subprocess
import time
import unittest
from pathlib import Path

import bench

MODEL = """\
format = 1

[[effect]]
gyro = 1
kind = "white_noise"
density_dps_rthz = 0.002

[[effect]]
gyro = 2
kind = "white_noise"
density_dps_rthz = 0.004
"""
PROFILE = "t_s,rate_dps\n0,0\n40,0\n60,20\n"


class Outputs(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("model.toml", MODEL)
        self.write("profile.csv", PROFILE)
        self.good("simulate", "-q", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "profile.csv", "-o", "in.log")

    def everything(self):
        return {path.name: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}

    def calls(self, output):
        """Every option of every command that names an output file, with the command's inputs."""
        config = ("--config", "vgyro.toml")
        replay = ("replay", "-q", *config, "--model", "model.toml")
        return (
            (*replay, "-o", output, "in.log"), (*replay, "--json", output, "-o", "x.log", "in.log"),
            (*replay, "--plot", output, "-o", "x.log", "in.log"), (*replay, "--csv", output, "-o", "x.log", "in.log"),
            (*replay, "--html", output, "-o", "x.log", "in.log"),
            ("allan", *config, "--json", output, "in.log"), ("allan", *config, "--plot", output, "in.log"),
            ("compare", "-q", *config, "--model", "model.toml", "--measured", "in.log", "--json", output),
            ("simulate", "-q", *config, "--model", "model.toml", "--profile", "profile.csv", "-o", output),
        )

    def test_no_output_is_written_over_an_input(self):
        # Under any name: a recording of a drive cannot be repeated. A picture is only drawn to a picture's name.
        for name in ("vgyro.toml", "bench.dbc", "model.toml", "in.log", "profile.csv"):
            os.link(self.folder / name, self.folder / f"{name}.svg")
            (self.folder / f"link_{name}.svg").symlink_to(name)
        before = self.everything()
        for name in ("vgyro.toml", "bench.dbc", "model.toml"):
            for output in (name, f"./{name}", f"{name}.svg", f"link_{name}.svg"):
                for call in self.calls(output):
                    if ("--plot" in call and not output.endswith(".svg")) or (call[0] == "allan" and "model" in output):
                        continue
                    with self.subTest(call):
                        self.assertRegex(self.bad(*call), "is also an input.*would be overwritten; choose another name")
                        self.assertEqual(self.everything(), before)
        for output in ("in.log", "in.log.svg", "link_in.log.svg"):
            for call in self.calls(output):
                if "simulate" in call or ("--plot" in call and not output.endswith(".svg")):
                    continue
                with self.subTest(call):
                    self.assertIn("is also an input", self.bad(*call))
                    self.assertEqual(self.everything(), before)

    def test_no_input_is_overwritten_through_standard_input_or_output(self):
        # The same holds for a file that the shell has opened.
        before = self.everything()
        with open(self.folder / "in.log", "rb") as log:
            done = subprocess.run([bench.VGYRO, "replay", "-q", "--config", "vgyro.toml", "-o", "in.log", "-"], stdin=log,
                                  stderr=subprocess.PIPE, cwd=self.folder, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"in.log: is also an input, standard input,", done.stderr)
        with open(self.folder / "in.log", "ab") as log:
            done = self.run_vgyro("replay", "-q", "--config", "vgyro.toml", "-o", "-", "in.log", stdout=log)
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"standard output: is also an input, in.log,", done.stderr)
        self.assertEqual(self.everything(), before)

    def test_two_outputs_are_not_one_file(self):
        # Whether the file exists already or not.
        for first, second in (("a.svg", "a.svg"), ("a.svg", "./a.svg"), ("b.svg", "b.svg")):
            for call in (("replay", "-q", "-o", first, "--plot", second, "in.log"), ("replay", "-o", first, "--json", second, "in.log"),
                         ("replay", "-q", "-o", first, "--html", second, "in.log"),
                         ("allan", "--json", first, "--plot", second, "in.log")):
                with self.subTest(call):
                    self.assertIn("is also another output", self.bad(call[0], "--config", "vgyro.toml", *call[1:]))
            self.write("b.svg", "earlier")
        self.assertEqual(self.read("b.svg"), "earlier")
        self.assertFalse((self.folder / "a.svg").exists())

    def test_a_result_folder_takes_no_input_away(self):
        # An earlier result is replaced, but not while it is read.
        (self.folder / "found").mkdir()
        self.write("found/model.toml", MODEL)
        said = self.bad("gap", "--config", "vgyro.toml", "--model", "found/model.toml", "--measured", "in.log", "--out", "found")
        self.assertIn("found/model.toml: is also an input", said)
        self.assertEqual(self.read("found/model.toml"), MODEL)

    def test_devices_may_be_named_twice(self):
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "/dev/null", "--json", "/dev/null", "in.log")

    def test_a_picture_has_a_name_and_never_a_command(self):
        # gnuplot runs a name that begins with a bar as a command.
        for name in ("|touch marker; .svg", "| touch marker #.png", "`touch marker`.svg", "'; system 'touch marker' #.svg"):
            for call in (("replay", "-q", "-o", "x.log"), ("allan",)):
                with self.subTest((call, name)):
                    self.good(call[0], "--config", "vgyro.toml", *call[1:], "--plot", name, "in.log")
                    self.assertGreater((self.folder / name).stat().st_size, 1000)
                    (self.folder / name).unlink()
        self.assertFalse((self.folder / "marker").exists())

    def test_names_in_a_picture_are_text(self):
        # A configuration may come from an untrusted source.
        name = "`touch marker` @x '; system 'touch marker' #"
        self.write("vgyro.toml", bench.CONFIG.replace('"left"', f'"{name}"'))
        self.write("`touch marker`.log", self.read("in.log"))
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "x.log", "--plot", "a.svg", "`touch marker`.log")
        self.good("allan", "--config", "vgyro.toml", "--plot", "b.svg", "`touch marker`.log")
        for picture in ("a.svg", "b.svg"):
            self.assertIn("touch marker", self.read(picture))
        self.assertFalse((self.folder / "marker").exists())

    def test_what_cannot_be_written_is_told(self):
        # A full disk, on which a script's output is lost unnoticed.
        config = ("--config", "vgyro.toml")
        model = ("--model", "model.toml")
        for call in (
            ("--help",), ("--version",), ("replay", "--help"), ("check", "vgyro.toml"), ("model", "list"),
            ("decode", "--dbc", "bench.dbc", "in.log"), ("decode", "--text", "--dbc", "bench.dbc", "in.log"),
            ("replay", "-q", *config, "in.log"), ("replay", "-q", *config, "-o", "x.log", "--json", "-", "in.log"),
            ("allan", *config, "in.log"), ("allan", *config, "--json", "-", "in.log"),
            ("compare", *config, *model, "--measured", "in.log"),
            ("compare", "-q", *config, *model, "--measured", "in.log", "--json", "-"),
            ("simulate", "-q", *config, *model, "--profile", "profile.csv", "-o", "-"),
            ("gap", *config, "--measured", "in.log", "--out", "found"),
        ):
            with self.subTest(call), open("/dev/full", "wb") as full:
                self.assertEqual(self.bad(*call, stdout=full).splitlines()[-1],
                                 "error: standard output: cannot be written: No space left on device")

    def test_files_that_cannot_be_written_are_told(self):
        (self.folder / "full.svg").symlink_to("/dev/full")
        for call in self.calls("full.svg"):
            with self.subTest(call):
                self.assertIn("full.svg: cannot be written: No space left on device", self.bad(*call))

    def limited(self, *call):
        """The messages when no file may become larger than 2 KB, like on a disk that fills up."""
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
        done = subprocess.run([bench.VGYRO, *call], stderr=subprocess.PIPE, stdout=subprocess.PIPE, cwd=self.folder, check=False,
                              preexec_fn=limit)
        self.assertEqual(done.returncode, 1, done.stderr)
        return done.stderr.decode()

    def test_a_disk_that_is_full_in_the_middle_of_a_file_is_told(self):
        for call in (*self.calls("x.svg"), ("gap", "--config", "vgyro.toml", "--measured", "in.log", "--out", "found")):
            if "compare" in call:
                continue  # its JSON is shorter
            with self.subTest(call):
                self.assertRegex(self.limited(*call), "(cannot be written|no script for gnuplot): File too large")
        self.assertFalse((self.folder / "found").exists())
        self.assertEqual([path for path in self.folder.iterdir() if path.name.startswith(".")], [])

    def hidden(self):
        return [path.name for path in self.folder.iterdir() if path.name.startswith(".")]

    def test_a_failure_leaves_the_earlier_file(self):
        for call in self.calls("x.svg"):
            if "compare" in call:
                continue
            with self.subTest(call):
                self.write("x.svg", "earlier")
                self.limited(*call)
                self.assertEqual(self.read("x.svg"), "earlier")
        self.assertEqual(self.hidden(), [])

    def test_a_file_keeps_its_permissions_and_its_links(self):
        self.write("real.log", "earlier")
        (self.folder / "real.log").chmod(0o640)
        (self.folder / "link.log").symlink_to("real.log")
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "link.log", "in.log")
        self.assertTrue((self.folder / "link.log").is_symlink())
        self.assertIn("610#", self.read("real.log"))
        self.assertEqual((self.folder / "real.log").stat().st_mode & 0o7777, 0o640)
        before = os.umask(0o027)
        self.addCleanup(os.umask, before)
        self.good("replay", "-q", "--config", "vgyro.toml", "-o", "new.log", "in.log")
        self.assertEqual((self.folder / "new.log").stat().st_mode & 0o7777, 0o640)

    def test_an_open_file_by_another_name_is_written_to_as_it_is(self):
        self.write("out.log", "first\n")
        with open(self.folder / "out.log", "ab") as out:
            self.run_vgyro("replay", "-q", "--config", "vgyro.toml", "-o", "/dev/stdout", "in.log", stdout=out)
            self.assertEqual(os.fstat(out.fileno()).st_ino, (self.folder / "out.log").stat().st_ino)

    def start_replay(self, log):
        """A replay that has read `log` from a pipe that stays open; its output is being written to x.log."""
        self.write("x.log", "earlier")
        running = subprocess.Popen([bench.VGYRO, "replay", "--config", "vgyro.toml", "-o", "x.log", "-"], stdin=subprocess.PIPE,
                                   stderr=subprocess.PIPE, cwd=self.folder)
        self.addCleanup(running.stderr.close)
        running.stdin.write(log)
        running.stdin.flush()
        # It flushes before it waits for more.
        for _ in range(6000):
            if any((self.folder / name).stat().st_size > 0 for name in self.hidden()):
                return running
            time.sleep(0.01)
        self.fail("nothing was written")

    def test_a_signal_leaves_the_earlier_file_and_says_so(self):
        log = (self.folder / "in.log").read_bytes()
        for number in (signal.SIGTERM, signal.SIGHUP):
            with self.subTest(number):
                running = self.start_replay(log)
                running.send_signal(number)
                said = running.communicate()[1].decode()
                self.assertEqual(running.returncode, -number)
                self.assertIn("interrupted: x.log was not written\n", said)
                self.assertEqual((self.read("x.log"), self.hidden()), ("earlier", []))

    def test_an_interrupted_pipe_is_finished_and_a_second_interrupt_ends_at_once(self):
        log = (self.folder / "in.log").read_bytes()
        whole = self.good("replay", "-q", "--config", "vgyro.toml", "in.log").stdout.decode()
        running = self.start_replay(log)
        running.send_signal(signal.SIGINT)
        said = running.communicate()[1].decode()
        self.assertEqual(running.returncode, 0, said)
        self.assertIn("interrupted: finishing with what has arrived", said)
        self.assertEqual(self.read("x.log"), whole)

        running = self.start_replay(log)
        running.send_signal(signal.SIGINT)
        running.stderr.readline()
        self.assertIn(b"finishing", running.stderr.readline())
        running.send_signal(signal.SIGINT)
        said = running.communicate()[1].decode()
        self.assertEqual(running.returncode, -signal.SIGINT)
        self.assertIn("interrupted: x.log was not written", said)
        self.assertEqual((self.read("x.log"), self.hidden()), ("earlier", []))

    def test_a_closed_standard_output_is_no_place_for_a_file(self):
        # The next opened file would get the number of the closed stderr, and would receive its texts.
        done = subprocess.run([bench.VGYRO, "allan", "--config", "vgyro.toml", "--json", "a.json", "in.log"], stderr=subprocess.PIPE,
                              cwd=self.folder, check=False, preexec_fn=lambda: os.close(1))
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.decode().splitlines()[-1], "error: standard output: cannot be written: Bad file descriptor")
        json.loads(self.read("a.json"))

    def test_a_full_stderr_ends_nothing(self):
        # The summary is lost, the result is not.
        with open("/dev/full", "wb") as full:
            done = subprocess.run([bench.VGYRO, "replay", "--config", "vgyro.toml", "-o", "x.log", "in.log"], stderr=full,
                                  cwd=self.folder, check=False)
        self.assertEqual(done.returncode, 0)
        self.assertGreater(Path(self.folder / "x.log").stat().st_size, 1000)


class Numbers(bench.Bench):
    WRONG = ("nan", "inf", "-inf", "NaN", "1e999", "", " ", "1x", "0x10", "1,5", "-1")
    OPTIONS = (("simulate", "--gyro-rate", "0.1 to 10000"), ("simulate", "--reference-rate", "0.1 to 10000"),
               ("simulate", "--accelerometer-rate", "0.1 to 10000"), ("simulate", "--jitter", "0 to 1"),
               ("simulate", "--start", "0 to 4000000000"), ("status", "--interval", "0.1 to 3600"),
               ("simulate", "--seed", "0 to 18446744073709551615"), ("compare", "--seed", "0 to 18446744073709551615"),
               ("gap", "--seed", "0 to 18446744073709551615"))

    def test_every_number_is_finite_whole_and_in_its_range(self):
        # A word that is no number is wrong usage, reported with option, word and range before anything is done.
        for command, option, allowed in self.OPTIONS:
            for word in (*self.WRONG, *(("1.5", "1e3", "18446744073709551616") if option == "--seed" else ())):
                if (option, word) == ("--gyro-rate", "1,5"):
                    continue
                with self.subTest((command, option, word)):
                    said = self.bad(command, f"{option}={word}", code=2)
                    self.assertIn(option, said)
                    if word.strip() and word != "1,5":
                        self.assertIn(f'"{word}" is not a ', said)
                        self.assertIn(f" from {allowed}", said)

    def test_a_seed_is_decimal(self):
        # 010 is ten, not eight.
        self.write("model.toml", MODEL)
        self.write("profile.csv", PROFILE)
        logs = [self.good("simulate", "-q", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "profile.csv", "--seed",
                          seed).stdout for seed in ("10", "010", "8")]
        self.assertEqual(logs[0], logs[1])
        self.assertNotEqual(logs[0], logs[2])


class Terminal(bench.Bench):
    EVIL = "\x1b]0;evil\x07\x9b31m"

    def test_names_do_not_command_a_terminal(self):
        # Units and labels of a DBC file, bytes of a log.
        self.write("bench.dbc", bench.BENCH_DBC.replace('"degC"', f'"d{self.EVIL}"').replace('"ok"', f'"o{self.EVIL}k"'))
        self.write("vgyro.toml", bench.CONFIG.replace('temperature = "Temp"\n', ""))
        self.write("in.log", "".join(bench.two_gyros(2)))
        said = self.good("decode", "--text", "--dbc", "bench.dbc", "in.log").stdout
        self.assertIn(b"Status=o\\x1b]0;evil\\x07\\xc2\\x9b31mk", said)
        everything = said + self.run_vgyro("check", "vgyro.toml").stdout + self.run_vgyro("decode", "--dbc", "bench.dbc", "in.log").stdout
        self.assertEqual([byte for byte in (b"\x1b", b"\x07", b"\x9b3") if byte in said], [])
        self.assertNotIn(b"\x1b", everything)
        self.assertNotIn(b"\xc2\x9b", everything)

    def test_file_names_and_words_add_no_lines(self):
        for call in (("check", "no\nerror: such\x1b[2Jfile"), ("fly\x1b[2J\nhigh",), ("replay", "--method", "a\x1b[2J", "x"),
                     ("status", "--interval", "\x1b[2J")):
            done = self.run_vgyro(*call)
            self.assertNotEqual(done.returncode, 0)
            self.assertNotIn(b"\x1b", done.stderr)
        self.assertEqual(len(self.bad("check", "no\nerror: such").splitlines()), 1)

    def test_names_of_a_configuration_are_printable(self):
        for key in ("name", "bus"):
            self.write("vgyro.toml", bench.CONFIG.replace(f'{key} = "', f'{key} = "\\u001b[2J', 1))
            said = self.bad("check", "vgyro.toml")
            self.assertIn("vgyro.toml:", said)
            self.assertNotIn("\x1b", said)


if __name__ == "__main__":
    unittest.main()
