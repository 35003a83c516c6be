"""Lines of candump -L, written and read as arrays: every frame has 8 bytes, so all
lines have the same length."""

import numpy as np

START_S = 1_700_000_000
_HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_HEX_PAIRS = np.stack([_HEX.repeat(16), np.tile(_HEX, 16)], axis=1)
_THOUSANDS = np.array([list(b"%03d" % i) for i in range(1000)], np.uint8)
_TEMPLATE = np.frombuffer(b"(0000000000.000000) can0 000#0000000000000000\n", np.uint8)
_SECONDS = slice(1, 11)
_MICROSECONDS = slice(12, 18)
_BUS, _ID, _DATA = 23, slice(25, 28), slice(29, 45)

_NIBBLE = np.zeros(256, np.uint8)
_NIBBLE[_HEX] = np.arange(16)


def lines(stamps_us, bus, can_id, payloads):
    """Rows of text; stamps_us counts from START_S."""
    text = np.empty((len(stamps_us), len(_TEMPLATE)), np.uint8)
    text[:] = _TEMPLATE
    seconds = START_S + stamps_us // 1_000_000
    below = stamps_us % 1_000_000
    text[:, 1] = 48 + seconds[:1] // 1_000_000_000
    for place, value in ((2, seconds // 1_000_000 % 1000), (5, seconds // 1000 % 1000), (8, seconds % 1000),
                         (12, below // 1000), (15, below % 1000)):
        text[:, place:place + 3] = _THOUSANDS[value]
    text[:, _BUS] = 48 + bus
    text[:, _ID] = np.frombuffer(b"%03X" % can_id, np.uint8)
    text[:, _DATA] = _HEX_PAIRS[payloads].reshape(len(payloads), 16)
    return text


def write(path, streams):
    """streams: (stamps_us, bus, can_id, payloads); frames are written in the order of their stamps."""
    order = np.argsort(np.concatenate([s[0] for s in streams]), kind="stable")
    with open(path, "wb") as file:
        file.write(np.concatenate([lines(*s) for s in streams])[order].data)


def _number(text):
    value = np.zeros(len(text), np.int64)
    for column in range(text.shape[1]):
        value = value * 10 + (text[:, column] - 48)
    return value


def read(path, can_id):
    """stamps_us from START_S and 8-byte payloads of one identifier, as arrays."""
    raw = np.fromfile(path, np.uint8)
    width = len(_TEMPLATE)
    if len(raw) % width or (len(raw) and not np.all(raw[width - 1::width] == 10)):
        raise ValueError(f"{path}: lines are not all {width} bytes long")
    text = raw.reshape(-1, width)
    text = text[np.all(text[:, _ID] == np.frombuffer(b"%03X" % can_id, np.uint8), axis=1)]
    stamps_us = (_number(text[:, _SECONDS]) - START_S) * 1_000_000 + _number(text[:, _MICROSECONDS])
    nibbles = _NIBBLE[text[:, _DATA]]
    return stamps_us, nibbles[:, 0::2] << 4 | nibbles[:, 1::2]
