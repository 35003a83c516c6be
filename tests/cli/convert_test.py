#!/usr/bin/python3
"""`vgyro convert`: from every form into those that it writes, and its messages."""

import unittest

import bench

LOG = """\
(1700000000.250000) can0 123#11223344 R
(1700000000.260001) can1 12345678#1122334455667788 T
(1700000000.270002123) can0 123##3112233445566778899AABBCC R
"""


class Convert(bench.Bench):
    def setUp(self):
        super().setUp()
        self.write("in.log", LOG)

    def converted(self, *arguments, **options):
        return self.good("convert", "-q", "-o", "-", *arguments, **options).stdout.decode()

    def test_a_candump_log_stays_what_it_was(self):
        self.assertEqual(self.converted("in.log"), LOG)
        self.assertEqual(self.converted("-", stdin=LOG.encode()), LOG)

    def test_goes_through_asc_and_back(self):
        self.good("convert", "-q", "-o", "out.asc", "in.log")
        self.assertTrue(self.read("out.asc").startswith("date Tue Nov 14 "))
        self.assertEqual(self.converted("out.asc"), LOG)

    def test_goes_through_blf_and_back(self):
        self.good("convert", "-q", "-o", "out.blf", "in.log")
        self.assertEqual(self.converted("out.blf"), LOG)
        blf = (self.folder / "out.blf").read_bytes()
        self.assertEqual(self.converted("-", stdin=blf), LOG)
        self.assertIn("already compressed", self.bad("convert", "-o", "out.blf.gz", "in.log"))

    def test_the_pipeline_makes_the_same_of_a_blf_file(self):
        self.write("drive.log", "".join(bench.two_gyros(5)))
        self.good("convert", "-q", "-o", "drive.blf", "drive.log")
        of_log, of_blf = (self.good("replay", "--config", "vgyro.toml", "-o", "-", log).stdout for log in ("drive.log", "drive.blf"))
        self.assertIn(b" 610#", of_log)
        self.assertEqual(of_blf, of_log)

    def test_says_what_is_in_a_log_without_frames(self):
        self.good("convert", "-q", "-o", "out.blf", "in.log")
        blf = bytearray((self.folder / "out.blf").read_bytes())
        blf[156] = 11  # the container becomes a LIN object
        self.write("lin.blf", bytes(blf))
        said = self.bad("convert", "-o", "out.asc", "lin.blf")
        self.assertIn("lin.blf: 0 frames, 1 other object passed over\n", said)

    def test_digits_are_chosen(self):
        self.assertIn("(1700000000.270002) ", self.converted("--digits", "6", "in.log"))
        self.assertIn("(1700000000.250000000) ", self.converted("--digits", "9", "in.log"))
        self.assertIn("--digits", self.bad("convert", "--digits", "7", "-o", "-", "in.log", code=2))

    def test_logs_are_merged(self):
        first, second, third = LOG.splitlines(keepends=True)
        self.write("a.log", first + third)
        self.write("b.log", second)
        self.assertEqual(self.converted("a.log", "b.log"), LOG)

    def test_says_which_name_became_which_channel(self):
        # The form has channel numbers only.
        self.write("in.log", LOG.replace("can1", "vcan7"))
        said = self.good("convert", "-o", "out.asc", "in.log").stderr.decode()
        self.assertEqual(said, "in.log: 3 frames\nout.asc: Vector ASC; channel 1 is can0, channel 2 is vcan7\n")

    def test_says_what_the_form_does_not_hold(self):
        self.write("in.log", LOG + "(1700000001.000000) can0 45123#81:00:12345678#AA\n")
        said = self.good("convert", "-q", "-o", "out.asc", "in.log").stderr.decode()
        self.assertIn("warning: out.asc: 1 CAN XL frames are not in it", said)
        self.assertIn("45123#81:00:12345678#AA", self.converted("in.log"))

    def test_refuses_names_that_say_no_form_and_its_own_input(self):
        self.assertIn(".asc (Vector ASC)", self.bad("convert", "-o", "out.txt", "in.log"))
        self.assertIn("is also an input", self.bad("convert", "-o", "in.log", "in.log"))

    def test_nothing_is_written_of_a_log_without_frames(self):
        self.write("empty.log", "")
        self.assertIn("holds no CAN frame", self.bad("convert", "-o", "out.asc", "empty.log"))
        self.assertFalse((self.folder / "out.asc").exists())

    def test_what_came_before_damage_is_kept_and_told(self):
        self.good("convert", "-q", "-o", "whole.log.gz", "in.log")
        packed = (self.folder / "whole.log.gz").read_bytes()
        (self.folder / "cut.log.gz").write_bytes(packed[:-10])
        said = self.bad("convert", "-q", "-o", "out.log", "cut.log.gz")
        self.assertIn("cut.log.gz: ends in the middle of its packed data", said)
        self.assertTrue(LOG.startswith(self.read("out.log")))


if __name__ == "__main__":
    unittest.main()
