"""Judges the frames captured on the buses without code of the product: with an E2E check of its own, and canmatrix as an
independent reader of the DBC files."""

import contextlib
import dataclasses
import io
import logging
import re
import warnings

import numpy as np

LINE = re.compile(r"\((\d+)\.(\d{6})\)\s+(\S+)\s+([0-9A-Fa-f]+)#(#[0-9A-Fa-f])?([0-9A-Fa-f]*)(?: [RT])*$")


class Failure(Exception):
    """A failed check; its text is for people."""


def require(condition, text):
    if not condition:
        raise Failure(text)


@dataclasses.dataclass(frozen=True)
class Line:
    us: int
    bus: str
    name: str  # the identifier as in the log: "610", "0CF02AE2"
    fd: bool
    data: bytes
    text: str

    @property
    def content(self):
        return self.bus, self.name, self.fd, self.data


def read_log(path):
    lines = []
    with open(path, encoding="ascii") as file:
        for number, text in enumerate(file, 1):
            match = LINE.match(text.rstrip("\n"))
            require(match, f"{path}:{number}: not a frame: {text!r}")
            seconds, micros, bus, name, fd, data = match.groups()
            lines.append(Line(int(seconds) * 1_000_000 + int(micros), bus, name, fd is not None,
                              bytes.fromhex(data), text))
    return lines


# --- AUTOSAR E2E, written from the specification's text -----------------------------------------

def crc(data, width, polynomial, start):
    register = start
    for byte in data:
        register ^= byte << (width - 8)
        for _ in range(8):
            carry = register >> (width - 1) & 1
            register = register << 1 & (1 << width) - 1
            if carry:
                register ^= polynomial
    return register


def profile_11c_crc(data_id, payload):
    return crc(bytes([data_id & 0xFF, 0]) + payload[1:], 8, 0x1D, 0)


def profile_5_crc(data_id, payload):
    return crc(payload[2:] + bytes([data_id & 0xFF, data_id >> 8]), 16, 0x1021, 0xFFFF)


def check_own_vectors():
    first, second = bytes([0, 0x10]) + bytes(6), bytes([0, 0x11]) + bytes(6)
    require(profile_11c_crc(0x123, first) == 0x2A and profile_11c_crc(0x123, second) == 0x77,
            "the harness' own E2E check is wrong")


def check_crc(line, can_id):
    data = line.data
    if line.fd:
        right = int.from_bytes(data[:2], "little") == profile_5_crc(can_id, data)
    else:
        right = data[0] == profile_11c_crc(can_id, data) and data[1] >> 4 == can_id >> 8
    require(right, f"wrong E2E checksum: {line.text}")


def check_protection(lines, can_id):
    """Checks the CRC of every frame, and that the counter runs from 0 without a gap."""
    for position, line in enumerate(lines):
        check_crc(line, can_id)
        counter, expected = (line.data[2], position % 256) if line.fd else (line.data[1] & 0x0F, position % 15)
        require(counter == expected, f"E2E counter {counter}, not {expected}: {line.text}")


def without_protection(line):
    if line.fd:
        return bytes(3) + line.data[3:]
    return bytes([0, line.data[1] & 0xF0]) + line.data[2:]


# --- live against replay --------------------------------------------------------------------------

def check_same_rates(live, replayed):
    """Compares byte for byte, from the first frame to the last."""
    for position, (a, b) in enumerate(zip(live, replayed)):
        require(a.data == b.data and a.fd == b.fd,
                f"VG_Rate {position} differs\n  live   {a.text}  replay {b.text}")
    require(len(live) == len(replayed), f"{len(live)} VG_Rate live, {len(replayed)} in the replay")


def check_same_sequence(live, replayed, rate_id):
    """Compares all output frames in their order, from 0.3 s after the first rate on. Unlike a replay, the live gateway sends
    heartbeats while no gyro is heard: they shift VG_Bias until both are on its grid of 0.1 s, and shift its counter and
    checksum for good."""
    rates = [line for line in live if int(line.name, 16) == rate_id]
    skipped = sum(line.us < rates[0].us + 300_000 for line in rates)
    live, replayed = after_rates(live, rate_id, skipped), after_rates(replayed, rate_id, skipped)
    for position, (a, b) in enumerate(zip(live, replayed)):
        require((a.name, without_protection(a)) == (b.name, without_protection(b)),
                f"output frame {position} after the start differs\n  live   {a.text}  replay {b.text}")
    require(len(live) >= len(replayed) > 0, f"{len(live)} output frames live, {len(replayed)} in the replay")


def after_rates(lines, rate_id, count):
    """The frames from rate number `count` on."""
    position = [i for i, line in enumerate(lines) if int(line.name, 16) == rate_id][count]
    return lines[position:]


def is_subsequence(some, whole):
    rest = iter(whole)
    return all(any(one == other for other in rest) for one in some)


# --- an independent reader ------------------------------------------------------------------------

class Oracle:
    """canmatrix on one of the product's DBC files."""

    def __init__(self, path):
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            logging.disable(logging.WARNING)
            import canmatrix.formats  # pylint: disable=import-outside-toplevel

            self.matrix = canmatrix.formats.loadp_flat(str(path))
            logging.disable(logging.NOTSET)

    def decode(self, line):
        import canmatrix  # pylint: disable=import-outside-toplevel

        frame = self.matrix.frame_by_id(canmatrix.ArbitrationId(int(line.name, 16), extended=False))
        return {name: float(signal.phys_value) for name, signal in frame.decode(line.data).items()}


def rates_of(lines, oracle):
    """Columns of VG_Rate as arrays: stamps (s), rate (deg/s, NaN if invalid), state."""
    decoded = [oracle.decode(line) for line in lines]
    valid = np.array([one["VG_Valid"] for one in decoded]) == 1
    rate = np.array([one["VG_Rate"] for one in decoded])
    return (np.array([line.us for line in lines]) * 1e-6, np.where(valid, rate, np.nan),
            np.array([int(one["VG_State"]) for one in decoded]))
