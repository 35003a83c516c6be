#!/usr/bin/python3
"""Check values of input frames, computed here bit by bit and with binascii: which frames vgyro must accept and which
not."""

import binascii
import json
import lzma
import os
import pathlib
import random
import unittest

import bench

SEED = 20260101

DBC = """VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" RIG
 SG_ Counter : 8|4@1+ (1,0) [0|%d] "" RIG
 SG_ RateZ : 16|24@1- (0.0001,0) [-800|800] "deg/s" RIG
 SG_ Last : 63|8@0+ (1,0) [0|255] "" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ Crc : 0|16@1+ (1,0) [0|65535] "" RIG
 SG_ Counter : 16|8@1+ (1,0) [0|255] "" RIG
 SG_ RateZ : 32|32@1- (0.000001,0) [-2000|2000] "deg/s" RIG
"""

CONFIG = """[[gyro]]
name = "a"
bus = "can0"
dbc = "protected.dbc"
message = "GYRO_A"
rate = "RateZ"
counter = "Counter"
crc = "%(crc)s"
e2e = "%(kind)s"
%(data_id)s

[[gyro]]
name = "b"
bus = "can1"
dbc = "protected.dbc"
message = "GYRO_B"
rate = "RateZ"
counter = "Counter"
crc = "Crc"
e2e = "profile_5"
data_id = 0xBEEF

[calibration]
rest_s = 1.0

[output]
bus = "can0"
"""

IDS = [7, 19, 250, 3, 88, 121, 9, 201, 66, 5, 31, 144, 17, 90, 233, 12]


def crc8(octets, polynomial, value, final):
    for octet in octets:
        value ^= octet
        for _ in range(8):
            value = ((value << 1) ^ (polynomial if value & 0x80 else 0)) & 0xFF
    return value ^ final


def protect_a(kind, frame):
    """`frame` with its check value; it already contains the counter."""
    frame = bytearray(frame)
    if kind in ("profile_1c", "profile_11c"):
        frame[1] |= 0x20
    rest, counter = bytes(frame[1:]), frame[1] & 15
    if kind in ("profile_1a", "profile_11a"):
        frame[0] = crc8(b"\x34\x12" + rest, 0x1D, 0, 0)
    elif kind == "profile_1b":
        frame[0] = crc8((b"\x12" if counter % 2 else b"\x34") + rest, 0x1D, 0, 0)
    elif kind in ("profile_1c", "profile_11c"):
        frame[0] = crc8(b"\x34\x00" + rest, 0x1D, 0, 0)
    elif kind in ("profile_2", "profile_22"):
        frame[0] = crc8(rest + bytes([IDS[counter]]), 0x2F, 0xFF, 0xFF)
    elif kind == "crc8_j1850":
        frame[0] = crc8(rest, 0x1D, 0xFF, 0xFF)
    else:
        frame[7] = (0x101 // 256 + 0x101 % 256 + 8 + sum(frame[:7])) % 256
    return bytes(frame)


def protect_b(frame):
    value = binascii.crc_hqx(frame[2:] + b"\xEF\xBE", 0xFFFF)
    return value.to_bytes(2, "little") + frame[2:]


DATA_ID = {"profile_1a": "data_id = 0x1234", "profile_1b": "data_id = 0x1234", "profile_1c": "data_id = 0x234",
           "profile_2": f"data_id = {IDS}", "crc8_j1850": "", "toyota": ""}
DATA_ID |= {"profile_11a": DATA_ID["profile_1a"], "profile_11c": DATA_ID["profile_1c"],
            "profile_22": DATA_ID["profile_2"]}


def found(summary):
    """For each gyro: frames, samples, and the rejected frames by cause."""
    return [(gyro["frames"], gyro["samples"], {cause: n for cause, n in gyro["rejected"].items() if n})
            for gyro in summary["gyros"]]


def recording(kind, seconds=4, modulus=15, spoil=lambda gyro, number, frame: frame):
    lines = []
    for number in range(100 * seconds):
        a = bytes([0, number % modulus]) + (1500 + number % 7).to_bytes(3, "little") + bytes(3)
        b = bytes([0, 0, number % 256, 0]) + (170000 + number % 5).to_bytes(4, "little")
        for gyro, frame in enumerate((protect_a(kind, a), protect_b(b))):
            frame = spoil(gyro, number, frame)
            stamp = 1700000000 + number / 100 + 0.003 * gyro
            lines.append(f"({stamp:.6f}) can{gyro} {0x101 + gyro:03X}#{frame.hex().upper()}\n")
    return "".join(lines)


class InputProtection(bench.Bench):
    def configure(self, kind):
        modulus = 16 if kind in ("profile_2", "profile_22") else 15
        crc = "Last" if kind == "toyota" else "Crc"
        self.write("protected.dbc", DBC % (modulus - 1))
        self.write("vgyro.toml", CONFIG % {"crc": crc, "kind": kind, "data_id": DATA_ID[kind]})
        return modulus

    def summary(self, text):
        self.write("in.log", text)
        done = self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "-", "-q", "in.log")
        return json.loads(done.stdout)

    def test_what_a_sender_protects_is_taken(self):
        # Every kind by each of its names, with check values computed here.
        for kind in DATA_ID:
            with self.subTest(kind=kind):
                modulus = self.configure(kind)
                self.assertEqual(found(self.summary(recording(kind, modulus=modulus))), 2 * [(400, 400, {})])

    def test_a_wrong_bit_is_noticed_and_counted(self):
        # One frame in ten has one wrong bit at a random place.
        dice = random.Random(SEED)
        print("seed", SEED)
        for kind in DATA_ID:
            with self.subTest(kind=kind):
                modulus = self.configure(kind)
                spoilt = [0, 0]

                def spoil(gyro, number, frame):
                    if dice.randrange(10):
                        return frame
                    spoilt[gyro] += 1
                    bit = dice.randrange(64)
                    return (int.from_bytes(frame, "little") ^ 1 << bit).to_bytes(8, "little")

                summary = self.summary(recording(kind, modulus=modulus, spoil=spoil))
                self.assertGreater(min(spoilt), 20)
                self.assertEqual(found(summary), [(400, 400 - wrong, {"crc_wrong": wrong}) for wrong in spoilt])

    def test_check_says_what_is_asked_of_the_frames(self):
        self.configure("profile_1c")
        text = self.good("check", "vgyro.toml").stdout.decode()
        self.assertRegex(text, r"crc +Crc, profile_1c\n")
        self.assertRegex(text, r"crc +Crc, profile_5\n")

    def test_simulated_frames_carry_their_check_values(self):
        # replay accepts the frames of simulate.
        for kind in ("profile_11c", "profile_22", "toyota"):
            with self.subTest(kind=kind):
                self.configure(kind)
                self.write("turn.csv", "t_s,rate_dps\n0,0\n2,0\n3,10\n8,10\n")
                self.write("model.toml", "format = 1\n")
                self.good("simulate", "--config", "vgyro.toml", "--model", "model.toml", "--profile", "turn.csv",
                          "--seed", "7", "-o", "in.log")
                done = self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "-", "-q", "in.log")
                for frames, samples, rejected in found(json.loads(done.stdout)):
                    self.assertGreater(samples, 700)
                    self.assertEqual((samples, rejected), (frames, {}))


class RealCar(bench.Bench):
    def test_the_check_value_of_a_real_cars_frames_is_right(self):
        # Recorded traffic of a Toyota; a wrong byte in one frame of a hundred is found.
        folder = os.environ.get("VGYRO_RECORDINGS")
        if not folder:
            self.skipTest("VGYRO_RECORDINGS is not set to a folder with car_rav4")
        log = lzma.open(pathlib.Path(folder) / "car_rav4" / "measured.log.xz", "rt").readlines()
        self.write("car.dbc", 'VERSION ""\n\nBU_: CAR\n\nBO_ 36 KINEMATICS: 8 CAR\n'
                   ' SG_ Yaw : 1|10@0+ (0.244,-125) [-125|125] "deg/s" CAR\n SG_ Sum : 63|8@0+ (1,0) [0|255] "" CAR\n\n'
                   'BO_ 769 PHONE: 8 CAR\n SG_ RateZ : 0|32@1- (0.000001,0) [-2000|2000] "deg/s" CAR\n')
        gyro = '[[gyro]]\nname = "%s"\nbus = "%s"\ndbc = "car.dbc"\nmessage = "%s"\nrate = "%s"\n%s\n'
        self.write("vgyro.toml", gyro % ("car", "can0", "KINEMATICS", "Yaw", 'crc = "Sum"\ne2e = "toyota"')
                   + gyro % ("phone", "can2", "PHONE", "RateZ", "") + '[output]\nbus = "can0"\n')

        def rejected(lines):
            self.write("in.log", "".join(lines))
            done = self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "-", "-q", "in.log")
            gyro = json.loads(done.stdout)["gyros"][0]
            return gyro["frames"], gyro["rejected"]["crc_wrong"]

        self.assertEqual(rejected(log), (4974, 0))
        own = [i for i, line in enumerate(log) if " can0 024#" in line]
        for i in own[::100]:
            at = log[i].index("#") + 1 + 3
            log[i] = log[i][:at] + ("0" if log[i][at] != "0" else "1") + log[i][at + 1:]
        self.assertEqual(rejected(log), (4974, len(own[::100])))


if __name__ == "__main__":
    unittest.main()
