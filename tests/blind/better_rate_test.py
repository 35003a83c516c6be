#!/usr/bin/python3
"""From a hidden effect to a better heading: the gateway processes a second recording with the given model and
with the model that the gap workflow wrote from the first one, and its rate is compared with the second
recording's reference."""

import lzma
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import canmatrix.formats
import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import injector  # noqa: E402
import runner  # noqa: E402
from cases import Case  # noqa: E402

CASES = [
    Case("single", 401, "scale_factor_asymmetry", short=True),
    Case("single", 402, "temperature_bias", short=True),
]
# Share of the effect's heading error that may remain: the rest is drift and noise. The gateway learns the effect of
# temperature by itself if it is not given, so that less can be gained.
REMAINS = {"scale_factor_asymmetry": 0.25, "temperature_bias": 0.5}


def decoded(log, frame, names):
    """Stamps, and one array for each name, of all frames of one kind in a candump log; Intel signals."""
    stamps, payloads = [], []
    for line in log.open():
        stamp, _, text = line.split()[:3]
        identifier, _, data = text.partition("#")
        if int(identifier, 16) == frame.arbitration_id.id:
            stamps.append(float(stamp[1:-1]))
            payloads.append(int.from_bytes(bytes.fromhex(data), "little"))
    bits = np.array(payloads, dtype=np.uint64)
    values = []
    for signal in (frame.signal_by_name(name) for name in names):
        raw = (bits >> np.uint64(signal.start_bit)) & np.uint64((1 << signal.size) - 1)
        raw = raw.astype(np.int64)
        if signal.is_signed:
            raw -= (raw >> (signal.size - 1)) << signal.size
        values.append(raw * float(signal.factor) + float(signal.offset))
    return np.array(stamps), *values


def frame_of(dbc, name):
    matrix = next(iter(canmatrix.formats.loadp(str(dbc)).values()))
    return matrix.frame_by_name(name)


def heading_error_deg(folder, model, scratch):
    """Heading error of the virtual gyro over the folder's second recording: the largest so far, after each
    second."""
    out = Path(scratch) / "out.log"
    subprocess.run(
        [runner.VGYRO, "replay", "--config", folder / "vgyro.toml", "--model", model]
        + ["-q", "-o", out, folder / "fresh.log.xz"],
        check=True,
    )
    plain = Path(scratch) / "fresh.log"
    plain.write_bytes(lzma.decompress((folder / "fresh.log.xz").read_bytes()))
    virtual = frame_of(runner.SOURCE / "dbc/vgyro.dbc", "VG_Rate")
    t_s, rate_dps, valid, age_ms = decoded(out, virtual, ["VG_Rate", "VG_Valid", "VG_Age"])
    good = valid == 1
    t_s, rate_dps = t_s[good] - 1e-3 * age_ms[good], rate_dps[good]
    reference = frame_of(folder / "bench.dbc", "RATE_TABLE")
    reference_s, reference_dps = decoded(plain, reference, ["Speed"])
    error = rate_dps - np.interp(t_s, reference_s, reference_dps)
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (error[1:] + error[:-1]) * np.diff(t_s))])
    return float(np.max(np.abs(heading)))


class BetterRate(unittest.TestCase):
    def test_heading_of_a_second_recording_is_better_with_the_model_that_was_found(self):
        for case in CASES:
            with self.subTest(case.name), tempfile.TemporaryDirectory(prefix="vgyro-better-") as scratch:
                folder, out = Path(scratch) / "case", Path(scratch) / "found"
                injector.make(case, folder, None)
                runner.gap(folder, out)
                before = heading_error_deg(folder, folder / "model.toml", scratch)
                after = heading_error_deg(folder, out / "model.toml", scratch)
                print(f"{case.name}: heading error {before:.3f} deg before, {after:.3f} deg after")
                self.assertLess(after, next(share for kind, share in REMAINS.items() if kind in case.name) * before)


if __name__ == "__main__":
    unittest.main(verbosity=2)
