"""A test bench for the command line: runs the built `vgyro` in a folder of its own, and makes logs line by
line. Takes the frames from the DBC text below and shares no code with the product."""

import os
import struct
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
VGYRO = str(BIN / "vgyro")
SANITIZED = b"__asan_init" in (BIN / "vgyro").read_bytes()

BENCH_DBC = """\
VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ RateZ : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temp : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG
 SG_ Status : 56|4@1+ (1,0) [0|15] "" RIG

BO_ 258 GYRO_B: 4 RIG
 SG_ Rate : 7|32@0- (1,0) [-1000|1000] "deg/s" RIG

VAL_ 257 Status 0 "ok" 1 "warming up" ;
SIG_VALTYPE_ 258 Rate : 1;
"""

CONFIG = """\
[[gyro]]
name = "left"
bus = "can0"
dbc = "bench.dbc"
message = "GYRO_A"
rate = "RateZ"
temperature = "Temp"
counter = "Counter"
valid = "Status == 0"

[[gyro]]
name = "right"
bus = "can1"
dbc = "bench.dbc"
message = "GYRO_B"
rate = "Rate"
sign = -1

[calibration]
rest_s = 1.0
rate_dps = 0.0032

[corrector]
method = "mutual"
window_s = 1.0
order = 1

[output]
bus = "can0"
"""


def stamp(us):
    return f"({us // 1_000_000:010d}.{us % 1_000_000:06d})"


def line_a(us, rate_dps, counter, status=0, temperature_c=25.0, bus="can0"):
    data = struct.pack("<ihBB", round(rate_dps * 1e6), round(temperature_c * 100), counter % 256, status)
    return f"{stamp(us)} {bus} 101#{data.hex().upper()}\n"


def line_b(us, rate_dps, bus="can1"):
    return f"{stamp(us)} {bus} 102#{struct.pack('>f', rate_dps).hex().upper()}\n"


def two_gyros(seconds, begin_us=1_700_000_000_000_000, turn_dps=0.0032):
    """Lines of gyro a and, 3 ms later and mounted upside down, gyro b; 100 Hz, biases 0.5 and -0.3."""
    lines = []
    for i in range(round(seconds * 100)):
        true_dps = 0.0032 if i < 120 else turn_dps
        lines.append(line_a(begin_us + i * 10_000, true_dps + 0.5, i))
        lines.append(line_b(begin_us + i * 10_000 + 3_000, -(true_dps - 0.3)))
    return lines


class Bench(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-cli-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.write("bench.dbc", BENCH_DBC)
        self.write("vgyro.toml", CONFIG)

    def write(self, name, text):
        data = text.encode() if isinstance(text, str) else text
        (self.folder / name).write_bytes(data)
        return str(self.folder / name)

    def read(self, name):
        return (self.folder / name).read_text()

    def run_vgyro(self, *arguments, stdin=b"", environment=None, stdout=subprocess.PIPE):
        return subprocess.run([VGYRO, *arguments], input=stdin, stdout=stdout, stderr=subprocess.PIPE, check=False,
                              cwd=self.folder, timeout=60, env={**os.environ, **(environment or {})})

    def good(self, *arguments, **options):
        done = self.run_vgyro(*arguments, **options)
        self.assertEqual(done.returncode, 0, done.stderr.decode(errors="replace"))
        return done

    def bad(self, *arguments, code=1, **options):
        """The text on stderr of a run that fails with this exit code."""
        done = self.run_vgyro(*arguments, **options)
        said = done.stderr.decode(errors="replace")
        self.assertEqual(done.returncode, code, said)
        self.assertTrue(said, "failed without a word")
        return said
