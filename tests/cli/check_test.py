#!/usr/bin/python3
"""`vgyro check`: it prints the resolved configuration; and every bad input gives an error with its place and remedy."""

import unittest

import bench


class Check(bench.Bench):
    def check_replaced(self, old, new, file="vgyro.toml"):
        text = self.read(file)
        self.assertIn(old, text)
        self.write(file, text.replace(old, new, 1))
        return self.bad("check", "vgyro.toml")

    def test_names_bus_id_signal_unit_and_scale(self):
        # A user must see what the configuration means.
        text = self.good("check", "vgyro.toml").stdout.decode()
        self.assertIn("vgyro.toml: good", text)
        left = next(line for line in text.splitlines() if "gyro left" in line)
        for part in ("can0", "101", "GYRO_A.RateZ", "deg/s", "32 bits", "bit 0", "Intel", "signed", "1e-06"):
            self.assertIn(part, left)
        right = next(line for line in text.splitlines() if "gyro right" in line)
        for part in ("can1", "102", "GYRO_B.Rate", "deg/s", "Motorola", "float"):
            self.assertIn(part, right)
        for part in ("sign flipped", "Temp in degC", "Counter, runs 0 to 255", "Status == 0", "-2000 to 2000"):
            self.assertIn(part, text)

    def test_names_calibration_corrector_and_output(self):
        # The other settings that a run depends on.
        text = self.good("check", "vgyro.toml").stdout.decode()
        for part in ("first 1 s of rest", "0.0032 deg/s", "mutual", "window 1 s", "order 1", "VG_Rate 610",
                     "VG_Bias 611", "VG_Model 612", "classic CAN"):
            self.assertIn(part, text)

    def test_says_that_shadow_mode_sends_nothing(self):
        self.assertNotIn("shadow", self.good("check", "vgyro.toml").stdout.decode())
        self.write("vgyro.toml", bench.CONFIG.replace("[output]", "[output]\ntransmit = false", 1))
        text = self.good("check", "vgyro.toml").stdout.decode()
        self.assertRegex(text, r"(?m)^  shadow mode +the gateway sends none of these frames: transmit = false$")
        self.assertIn("[output] transmit must be true or false",
                      self.check_replaced("transmit = false", 'transmit = "no"'))

    def test_files_beside_it_go_over_it_in_the_order_of_their_names(self):
        alone = self.good("check", "vgyro.toml").stdout.decode()
        self.assertNotIn("as several files say", alone)
        (self.folder / "vgyro.d").mkdir()
        self.write("vgyro.d/20-car.toml", "[calibration]\nrest_s = 7\n[[gyro]]\n[[gyro]]\nmax_bias_dps = 0.25\n")
        self.write("vgyro.d/10-fleet.toml", "[calibration]\nrest_s = 5\nrate_dps = 0.004\n")
        for ignored in ("vgyro.d/30-note.txt", "vgyro.d/.40-swap.toml"):
            self.write(ignored, "[calibration]\nrest_s = 9\n")
        text = self.good("check", "vgyro.toml").stdout.decode()
        self.assertIn("the first 7 s of rest, true rate 0.004 deg/s", text)
        self.assertRegex(text, r"(?m)^    calibration\.rest_s +7\S* +vgyro\.d/20-car\.toml:2$")
        self.assertRegex(text, r"(?m)^    calibration\.rate_dps +0\.004 +vgyro\.d/10-fleet\.toml:3$")
        self.assertRegex(text, r"(?m)^    gyro\[1\]\.max_bias_dps +0\.25 +vgyro\.d/20-car\.toml:5$")
        self.assertRegex(text, r"(?m)^    gyro\[0\]\.name +[\"']left[\"'] +vgyro\.toml:\d+$")
        prints = [line.split()[1] for line in (alone + text).splitlines() if line.startswith("  fingerprint")]
        self.assertEqual(len(set(prints)), 2)
        # The error names the drop-in file, not the file that it overrides.
        self.write("vgyro.d/20-car.toml", "\n[calibration]\nresst_s = 7\n")
        self.assertIn('vgyro.d/20-car.toml:3: unknown key "resst_s" in [calibration]', self.bad("check", "vgyro.toml"))
        self.write("vgyro.d/20-car.toml", "[calibration]\nrest_s = \n")
        self.assertIn("vgyro.d/20-car.toml:2: ", self.bad("check", "vgyro.toml"))

    def test_the_fingerprint_is_of_what_it_means(self):
        def fingerprint():
            text = self.good("check", "vgyro.toml").stdout.decode()
            return next(line.split()[1] for line in text.splitlines() if line.startswith("  fingerprint"))
        first = fingerprint()
        self.assertRegex(first, r"^[0-9a-f]{16}$")
        config = self.read("vgyro.toml")
        self.write("vgyro.toml", "# A comment means nothing.\n\n" + config)
        self.assertEqual(fingerprint(), first)
        self.write("vgyro.toml", config.replace("rest_s = 1", "rest_s = 2"))
        self.assertNotEqual(fingerprint(), first)
        self.write("vgyro.toml", config)
        dbc = next(self.folder.glob("*.dbc")).name
        self.write(dbc, self.read(dbc) + "\n")
        self.assertNotEqual(fingerprint(), first)

    def test_names_the_largest_bias(self):
        # The limit decides what a stop may teach.
        self.assertNotIn("at most", self.good("check", "vgyro.toml").stdout.decode().split("corrector")[0])
        self.write("vgyro.toml", bench.CONFIG.replace('rate = "RateZ"', 'rate = "RateZ"\nmax_bias_dps = 0.5', 1))
        self.assertRegex(self.good("check", "vgyro.toml").stdout.decode(), r"bias +at most 0\.5 deg/s")

    def test_says_nothing_on_stderr_when_all_is_well(self):
        # Warnings must mean something.
        self.assertEqual(self.good("check", "vgyro.toml").stderr, b"")

    def test_lines_fit_a_terminal(self):
        # Wrapped tables are unreadable.
        for line in self.good("check", "vgyro.toml").stdout.decode().splitlines():
            self.assertLessEqual(len(line), 120, line)

    def test_bad_input_names_file_line_and_remedy(self):
        # Each mistake: its place, the problem and the remedy.
        cases = (
            ('temperature = "Temp"', 'temprature = "Temp"', 'vgyro.toml:7: ', 'did you mean "temperature"?'),
            ('message = "GYRO_A"', 'message = "GYRO_X"', 'vgyro.toml:5: ', 'did you mean "GYRO_A"?'),
            ('rate = "RateZ"', 'rate = "RateY"', 'vgyro.toml:6: ', 'did you mean "RateZ"?'),
            ('rate = "RateZ"', 'rate = "Temp"', 'vgyro.toml:6: ', 'deg/s, rad/s, deg/h'),
            ('sign = -1', 'sign = "up"', 'vgyro.toml:17: ', 'must be a whole number'),
            ('method = "mutual"', 'method = "optimum"', 'vgyro.toml:24: ', 'did you mean "optimal"?'),
            ('order = 1', 'order = ', 'vgyro.toml:26: ', ''),
            ('dbc = "bench.dbc"', 'dbc = "bank.dbc"', 'vgyro.toml:4: ', 'No such file'),
        )
        for old, new, place, remedy in cases:
            with self.subTest(new):
                self.write("vgyro.toml", bench.CONFIG)
                said = self.check_replaced(old, new)
                self.assertIn(place, said)
                self.assertIn(remedy, said)
                self.assertEqual(len(said.splitlines()), 1, said)

    def test_tells_all_mistakes_at_once(self):
        # All mistakes are reported in one run.
        text = bench.CONFIG.replace('"RateZ"', '"RateX"').replace("sign = -1", "sign = 5").replace("order = 1", "order = 7")
        self.write("vgyro.toml", text)
        said = self.bad("check", "vgyro.toml").splitlines()
        self.assertEqual(len(said), 3, said)
        self.assertTrue(all(line.startswith("error: vgyro.toml:") for line in said), said)

    def test_missing_config_is_named(self):
        # The most frequent mistake of all.
        self.assertIn("nowhere.toml: ", self.bad("check", "nowhere.toml"))
        self.assertIn("No such file", self.bad("check", "nowhere.toml"))

    def test_folder_is_no_config(self):
        # Tab completion stops at the folder.
        self.assertIn("directory", self.bad("check", "."))

    def test_odd_dbc_line_is_a_warning_with_its_place(self):
        # The gyro's own signals are fine, so the file is usable, with a warning.
        self.write("bench.dbc", bench.BENCH_DBC + "\nBO_ 300 HALF\n")
        done = self.good("check", "vgyro.toml")
        self.assertIn("warning: bench.dbc:", done.stderr.decode())


if __name__ == "__main__":
    unittest.main()
