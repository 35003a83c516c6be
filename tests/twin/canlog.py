"""candump logs as NumPy arrays: writes and reads a whole recording at a time, and extracts the bits of
the frames that the tests need. Shares nothing with the product, so that it can judge it."""

import dataclasses
import lzma

import numpy as np

CHUNK_FRAMES = 1 << 18

_DIGITS4 = np.array([list(b"%04d" % i) for i in range(10000)], dtype=np.uint8)
_HEX2 = np.array([list(b"%02X" % i) for i in range(256)], dtype=np.uint8)
_UNHEX = np.full(256, 255, dtype=np.uint8)
_UNHEX[np.frombuffer(b"0123456789", dtype=np.uint8)] = np.arange(10)
_UNHEX[np.frombuffer(b"ABCDEF", dtype=np.uint8)] = np.arange(10, 16)
_UNHEX[np.frombuffer(b"abcdef", dtype=np.uint8)] = np.arange(10, 16)


@dataclasses.dataclass(frozen=True)
class Stream:
    """Frames of one identifier on one bus, in the order in which they were sent."""

    bus: str
    can_id: int  # standard
    stamps_us: np.ndarray  # int64
    payloads: np.ndarray  # uint8, (n, 8)


def open_out(path):
    """A binary file to write to; compressed when the name ends in .xz."""
    return lzma.open(path, "wb", preset=9) if str(path).endswith(".xz") else open(path, "wb")


def read_bytes(path):
    with (lzma.open if str(path).endswith(".xz") else open)(path, "rb") as file:
        return file.read()


def write(file, streams):
    """Merges the streams by stamp (equal stamps: in the order given); returns the line count."""
    stamps = np.concatenate([s.stamps_us for s in streams])
    payloads = np.concatenate([s.payloads for s in streams])
    source = np.repeat(np.arange(len(streams)), [len(s.stamps_us) for s in streams])
    order = np.argsort(stamps, kind="stable")

    bus_width = max(len(s.bus) for s in streams)
    middles = np.array(
        [list(b" %s %03X#" % (s.bus.rjust(bus_width).encode(), s.can_id)) for s in streams],
        dtype=np.uint8,
    )
    hash_end = 19 + middles.shape[1]
    line_bytes = hash_end + 16 + 1
    for first in range(0, len(order), CHUNK_FRAMES):
        part = order[first : first + CHUNK_FRAMES]
        lines = np.empty((len(part), line_bytes), dtype=np.uint8)
        t = stamps[part]
        digits = np.empty((len(part), 16), dtype=np.uint8)
        for group in range(4):
            digits[:, 4 * group : 4 * group + 4] = _DIGITS4[t // 10 ** (12 - 4 * group) % 10000]
        lines[:, 0] = ord("(")
        lines[:, 1:11] = digits[:, :10]
        lines[:, 11] = ord(".")
        lines[:, 12:18] = digits[:, 10:]
        lines[:, 18] = ord(")")
        lines[:, 19:hash_end] = middles[source[part]]
        lines[:, hash_end:-1] = _HEX2[payloads[part]].reshape(len(part), 16)
        lines[:, -1] = ord("\n")
        file.write(lines.tobytes())
    return len(order)


@dataclasses.dataclass(frozen=True)
class Frames:
    """Standard data frames with eight bytes, in the order of the log."""

    stamps_us: np.ndarray  # int64
    ids: np.ndarray  # int32
    payloads: np.ndarray  # uint8, (n, 8)

    def with_id(self, can_id):
        mask = self.ids == can_id
        return Frames(self.stamps_us[mask], self.ids[mask], self.payloads[mask])

    def __len__(self):
        return len(self.ids)


def read(data):
    """Frames of a candump log (bytes). Stamps have ten digits of seconds and six of fraction, frames
    a standard identifier and eight bytes; any other line is an error."""
    text = np.frombuffer(data, dtype=np.uint8)
    ends = np.flatnonzero(text == ord("\n"))
    hashes = np.flatnonzero(text == ord("#"))
    if len(text) and (text[-1] != ord("\n") or len(hashes) != len(ends)):
        raise ValueError("not a log of whole lines with one classic frame each")
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    if len(ends):
        shape_ok = (
            (text[starts] == ord("("))
            & (text[starts + 11] == ord("."))
            & (text[starts + 18] == ord(")"))
            & (text[hashes - 4] == ord(" "))
            & (ends - hashes == 17)
        )
        if not shape_ok.all():
            line = int(np.flatnonzero(~shape_ok)[0])
            raise ValueError(f"line {line + 1}: {bytes(text[starts[line] : ends[line]])!r}")

    stamps = np.zeros(len(starts), dtype=np.int64)
    for column in [*range(1, 11), *range(12, 18)]:
        stamps = stamps * 10 + (text[starts + column] - ord("0"))
    ids = np.zeros(len(starts), dtype=np.int32)
    for column in range(-3, 0):
        ids = ids * 16 + _UNHEX[text[hashes + column]]
    payloads = np.empty((len(starts), 8), dtype=np.uint8)
    for byte in range(8):
        high = _UNHEX[text[hashes + 1 + 2 * byte]]
        low = _UNHEX[text[hashes + 2 + 2 * byte]]
        payloads[:, byte] = high << 4 | low
    return Frames(stamps, ids, payloads)


def intel(payloads, start_bit, bits, signed=False):
    """Raw values of an Intel signal of eight-byte payloads, as int64."""
    word = np.ascontiguousarray(payloads).view("<u8")[:, 0]
    raw = (word >> np.uint64(start_bit) & np.uint64((1 << bits) - 1)).astype(np.int64)
    return np.where(raw >= 1 << (bits - 1), raw - (1 << bits), raw) if signed else raw


def motorola_bytes(payloads, first_byte, count, signed=False):
    """Raw values of a Motorola signal that fills whole bytes, as int64."""
    raw = np.zeros(len(payloads), dtype=np.int64)
    for byte in range(first_byte, first_byte + count):
        raw = raw << 8 | payloads[:, byte]
    bits = 8 * count
    return np.where(raw >= 1 << (bits - 1), raw - (1 << bits), raw) if signed else raw


RATE_ID, BIAS_ID, MODEL_ID = 0x610, 0x611, 0x612
RATE_INVALID_RAW = -(1 << 23)
RATE_STEP_DPS = 5e-5
BIAS_STEP_DPS = 1e-5


@dataclasses.dataclass(frozen=True)
class VirtualRate:
    stamps_us: np.ndarray
    rate_dps: np.ndarray  # NaN where invalid
    valid: np.ndarray  # bool
    state: np.ndarray
    age_us: np.ndarray


def virtual_rate(frames):
    """VG_Rate of an output log."""
    f = frames.with_id(RATE_ID)
    raw = intel(f.payloads, 16, 24, signed=True)
    valid = intel(f.payloads, 55, 1).astype(bool)
    if not np.array_equal(valid, raw != RATE_INVALID_RAW):
        raise ValueError("VG_Valid and the invalid raw value of VG_Rate disagree")
    rate = np.where(valid, raw * RATE_STEP_DPS, np.nan)
    return VirtualRate(f.stamps_us, rate, valid, intel(f.payloads, 52, 3), intel(f.payloads, 60, 4) * 500)


def virtual_bias(frames):
    """Stamps (µs) and the two biases (deg/s, (n, 2)) of VG_Bias."""
    f = frames.with_id(BIAS_ID)
    raw = np.stack(
        [intel(f.payloads, 16, 20, signed=True), intel(f.payloads, 36, 20, signed=True)], axis=1
    )
    return f.stamps_us, raw * BIAS_STEP_DPS
