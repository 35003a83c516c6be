#!/usr/bin/python3
"""Makes the initial corpora of the fuzzers from the project's own recordings and files: make_seeds.py FOLDER."""

import bz2
import gzip
import lzma
import re
import struct
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINE = re.compile(r"\((\d+)\.(\d{6})\) (\S+) ([0-9A-F]+)#([0-9A-F]*)")


def recording():
    return lzma.decompress((ROOT / "examples/twin.log.xz").read_bytes()).decode("ascii").splitlines(keepends=True)


def dbc_files():
    return [path.read_bytes() for path in sorted((ROOT / "dbc").rglob("*.dbc"))] + [(ROOT / "examples/twin.dbc").read_bytes()]


def candump_logs(lines):
    # The fuzzer's first four bytes are the sizes of the pieces in which a log arrives.
    forms = ["(0.000001) can0 123#R5\n", "(1.123456789) vcan12 12345678#1122334455667788_B T\n", "(2.5) can0 123##5AABB R\n",
             "DROPCOUNT: 5\n", "(3.000000)   can1 20000004#0000000000000000\n", "(4.1) can0 45123#81:00:12345678#AABB\n"]
    yield b"\x01\x07\x3f\xff" + "".join(forms).encode()
    yield b"\xff\xff\xff\xff" + "".join(lines[:200]).encode()
    yield b"\x00\x00\x00\x00" + "".join(lines[5000:5040] + forms).encode()
    # The usual form, with more interfaces than the quick comparison covers, all widths and successive seconds; then also
    # with slightly malformed lines.
    usual = [f"(17000000{i // 8:02}.{i * 111111 % 1000000:06}) {('can0', 'can1', 'c', 'vcan123', 'can01', 'vcan1234')[i % 6]} "
             f"{i * 37 % 2048:03X}#{'0123456789abcDEF'[: 2 * (i % 9)]}\n" for i in range(60)]
    yield b"\x40\x21\x05\xff" + "".join(usual).encode()
    yield b"\x17\xff\x40\x02" + "".join(usual[:20] + ["(1700000002.12345/) can0 123#11\n", "(170000000:.000000) can0 123#11\n",
                                                       "(1700000002.000000) can0 12G#11\n", "(1700000002.000000) can0 123#1\n"] + usual[20:]).encode()


def logs_of_all_forms(lines):
    """The fuzzer's first byte is the size of the pieces in which a log arrives; then comes a log from the test of the forms."""
    text = (ROOT / "tests/canlog/forms_test.cpp").read_text(encoding="utf-8")
    # Adjacent string literals of C++ are one text.
    for parts in re.findall(r'((?:"(?:[^"\\\n]|\\.)*"\s*)+)', text):
        literal = "".join(re.findall(r'"((?:[^"\\\n]|\\.)*)"', parts))
        log = literal.encode("utf-8").decode("unicode_escape").encode("latin-1", "replace")
        if b"\n" in log:
            yield b"\x10" + log
    golden = ROOT / "tests/canlog/golden"
    for path in sorted(golden.iterdir()):
        if path.suffix in (".blf", ".pcap", ".pcapng", ".mf4"):
            yield b"\x40" + path.read_bytes()
    plain = "".join(lines[:100]).encode()
    for packed in (gzip.compress(plain, mtime=0), bz2.compress(plain), lzma.compress(plain)):
        yield b"\x40" + packed


def configurations():
    for path in (ROOT / "examples/twin.toml", ROOT / "systemd/vgyro.toml"):
        text = re.sub(r"^#(?=[a-z\[])", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        text = re.sub(r'^dbc = ".*?"', 'dbc = "201"', text, flags=re.MULTILINE)
        yield text.encode() + b"\0" + (ROOT / "examples/twin.dbc").read_bytes()
    # Every key of the manual, for messages with every signal.
    bench = (ROOT / "tests/fuzz/pipeline_fuzzer.cpp").read_text(encoding="utf-8").split('R"(')[1].split(')"')[0]
    yield EVERYTHING.encode() + b"\0" + bench.encode()
    # Whole units: axes in one message and in several, mounts in both forms, layouts of one axis and of several.
    for text in UNITS:
        yield text.encode() + b"\0" + UNITS_DBC.encode()


UNITS_DBC = "".join(f"""\
BO_ {can_id} {name}: 16 RIG
 SG_ X : 0|24@1- (1E-004,0) [-800|800] "deg/s" RIG
 SG_ Y : 24|24@1- (1E-004,0) [-800|800] "deg/s" RIG
 SG_ Z : 48|24@1- (1E-004,0) [-800|800] "deg/s" RIG
 SG_ Temp : 72|8@1- (1,0) [-40|125] "degC" RIG
 SG_ Counter : 80|4@1+ (1,0) [0|15] "" RIG
 SG_ Crc : 88|8@1+ (1,0) [0|255] "" RIG
 SG_ Good : 96|1@1+ (1,0) [0|1] "" RIG
""" for can_id, name in ((257, "A"), (258, "B"), (259, "BZ"), (260, "OUT")))
GUARD = 'counter = "Counter"\ncrc = "Crc"\ne2e = "crc8_j1850"\n'
UNIT_A = '[[gyro]]\nname = "a"\nbus = "can0"\ndbc = "201"\nmessage = "A"\nrate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\n' + GUARD
LAYOUT = '[[output.layout]]\ndbc = "201"\nmessage = "OUT"\n'
UNITS = [
    UNIT_A + 'temperature = "Temp"\nvalid = "Good == 1"\nmount = [10, -20.5, 90]\nmax_bias_dps = 3\n' +
    UNIT_A.replace('"a"', '"b"').replace('"A"', '"B"') + 'sign = -1\nmount = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]\n'
    '[calibration]\nrest_s = 2\nlatitude_deg = 50\nheading_deg = 120\n[output]\nbus = "can1"\nfd = true\n' + LAYOUT +
    'rate_x = "X"\nrate_y = "Y"\nrate_z = "Z"\nsign_y = -1\nrate_not_available = -8388608\nvalid_z = "Good == 1"\ninvalid_z = 0\n' + GUARD,
    UNIT_A.replace('rate_y = "Y"\n', '') + '[[gyro]]\nname = "b"\nbus = "can1"\ndbc = "201"\nmessage = "B"\nrate_x = "X"\n' + GUARD +
    '[[gyro.axis]]\naxis = "z"\nmessage = "BZ"\nrate = "Z"\nsign = -1\nunit = "rad/s"\n' + GUARD +
    '[calibration]\nrate_dps = [0.001, 0.003]\nwhen_moving = "accept"\n[corrector]\nmethod = "mean"\n[output]\nbus = "can0"\n' + LAYOUT +
    'rate = "Z"\naxis = "z"\nevery_ms = 20\n',
]

EVERYTHING = """\
[[gyro]]
name = "a"
bus = "can0"
dbc = "201"
message = "GYRO_A"
rate = "Rate"
unit = "deg/h"
sign = -1
temperature = "Temp"
counter = "Counter"
valid = "Status <= 9"
[[gyro]]
name = "b"
bus = "can1"
dbc = "201"
message = "GYRO_B"
rate = "Rate"
sign_signal = "Negative"
[reference]
bus = "can0"
dbc = "201"
message = "TABLE"
rate = "Rate"
[accelerometer]
bus = "can1"
dbc = "201"
message = "ACCEL"
x = "X"
y = "Y"
z = "Z"
[speed]
bus = "can0"
dbc = "201"
message = "WHEEL"
signal = "Speed"
[calibration]
rest_s = 1.0
latitude_deg = -50.45
source = "reference"
when_moving = "accept"
[corrector]
method = "mutual"
window_s = 10
order = 3
[output]
bus = "can0"
rate_id = 0x620
bias_id = 0x621
model_id = 0x622
fd = true
"""


def models():
    yield (ROOT / "examples/turns.toml").read_bytes()
    # Every kind of the catalogue, from the table in its document.
    text = (ROOT / "docs/model-file.md").read_text(encoding="utf-8")
    parts = ["format = 1\n"]
    for kind, parameters in re.findall(r"^\| `([a-z_]+)` \| (`[^|]*) \|", text, re.MULTILINE):
        parts.append(f'[[effect]]\ngyro = {1 + len(parts) % 2}\nkind = "{kind}"\n')
        for name in re.findall(r"`([a-z_0-9]+)`", parameters):
            if name in ("x", "y", "z"):
                continue
            parts.append(f'{name} = "x"\n' if name in ("axis", "from") else f"{name} = {2 if name == 'harmonic' else 0.01}\n")
    yield "".join(parts).encode()


def saved_states():
    """The state file as the gateway writes it, and as it did before it learned slopes, kinds and temperatures."""
    for name in ("state.toml", "older_state.toml"):
        text = (ROOT / "tests/fuzz" / name).read_bytes()
        yield text
        yield text.rpartition(b"\n[checksum]\n")[0]


def frames(lines):
    """The recording in the form of the pipeline fuzzer: the choice of the configuration, then for every frame its kind, the
    step of its stamp in microseconds, and its payload."""
    for choice in (0b000, 0b1000, 0b10, 0b100, 0b100000, 0b1000000, 0b1100000, 0b11000000, 0b11000001):
        out, last = [bytes([choice])], None
        for line in lines[:400]:
            seconds, micros, _, can_id, data = LINE.match(line).groups()
            now = int(seconds) * 1_000_000 + int(micros)
            step = min(now - last, 65535) if last is not None else 0
            last = now
            payload = bytes.fromhex(data).ljust(8, b"\0")[:8]
            if can_id == "102":
                rate = struct.unpack(">i", payload[:4])[0] * 1e-6
                payload = struct.pack(">f", rate) + b"\0\0\0\1"
            out.append(struct.pack("<BH", 0x10 if can_id == "102" else 0x00, step) + payload)
        yield b"".join(out)


def main():
    folder = Path(sys.argv[1])
    lines = recording()
    corpora = {"dbc": dbc_files(), "candump": candump_logs(lines), "forms": logs_of_all_forms(lines), "config": configurations(), "model": models(),
               "saved_state": saved_states(), "pipeline": frames(lines)}
    for name, seeds in corpora.items():
        to = folder / f"fuzz_{name}"
        to.mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(seeds):
            (to / f"seed-{number}").write_bytes(seed)


if __name__ == "__main__":
    main()
