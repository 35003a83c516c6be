#!/usr/bin/python3
"""The virtual rate in the makers' own layouts: read back with python-can and canmatrix, by the makers' DBC files,
and compared with VG_Rate of the same instant."""

import collections
import contextlib
import io
import json
import logging
import math
import struct
import unittest
import warnings

import bench

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    import can
    import canmatrix.formats

PROFILES = bench.SOURCE / "dbc/profiles"
RATE_STEP_DPS = 5e-5  # of VG_Rate
DEG_PER_RAD = 180 / math.pi
# What the CRC of the Bosch MM7 and of "crc8_j1850" is made with, and the value that everybody publishes for it.
CRC_CHECK = (b"123456789", 0x4B)

RATE_OF_TURN = """VERSION ""
BU_: BOAT
BO_ 2314277886 RateOfTurn: 8 BOAT
 SG_ SID : 0|8@1+ (1,0) [0|252] "" BOAT
 SG_ Rate : 8|32@1- (0.00000003125,0) [-67.108863|67.108863] "rad/s" BOAT
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
"""

# message: file, keys, unit in deg/s, step in deg/s
LAYOUTS = {
    "MM7_Yaw": ("bosch_mm7.dbc", 'rate = "YawRate"\nvalid = "YawStatus == 0"\ncounter = "YawCounter"\n'
                                 'crc = "YawCrc"\ne2e = "crc8_j1850"', 1, 0.005),
    "ARI": ("j1939_ari.dbc", 'rate = "YawRate"\nvalid = "YawRateMerit == 0"\nsource_address = 0xE2', 1, 1 / 128),
    "RateOfTurn": ("n2k.dbc", 'rate = "Rate"\ncounter = "SID"\nsource_address = 35', DEG_PER_RAD, 3.125e-8 * DEG_PER_RAD),
    "RT_RateVehicle": ("oxts_rt.dbc", 'rate = "RateZ"\nsign = -1\nbus = "can7"', -1, 0.01),
    "ESP_02": ("vw_esp_02.dbc", 'rate = "YawRateMagnitude"\nsign_signal = "YawRateSign"\nid = 0x300', 1, 0.01),
    "Yaw_Data_FD1": ("ford_yaw.dbc", 'rate = "YawRate"\n', DEG_PER_RAD, 0.0002 * DEG_PER_RAD),
    "IMU04_YawAccX": ("racelogic_imu04.dbc", 'rate = "YawRate"\n', 1, 2**-15),
    "MTi_RateOfTurn": ("xsens_mti.dbc", 'rate = "RateZ"\nrate_not_available = 0x8000', DEG_PER_RAD, DEG_PER_RAD / 512),
}
IDS = {0x174: "MM7_Yaw", 0x0CF02AE2: "ARI", 0x09F11323: "RateOfTurn", 0x608: "RT_RateVehicle", 0x300: "ESP_02",
       0x091: "Yaw_Data_FD1", 0x600: "IMU04_YawAccX", 0x032: "MTi_RateOfTurn"}


def crc8_j1850(octets):
    value = 0xFF
    for octet in octets:
        value ^= octet
        for _ in range(8):
            value = (value << 1 ^ (0x1D if value & 0x80 else 0)) & 0xFF
    return value ^ 0xFF


def matrix_of(path):
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        return canmatrix.formats.loadp_flat(str(path))


def tables(names):
    parts = []
    for name in names:
        file, keys, _, _ = LAYOUTS[name]
        folder = "" if file == "n2k.dbc" else f"{PROFILES}/"
        parts.append(f'\n[[output.layout]]\ndbc = "{folder}{file}"\nmessage = "{name}"\n{keys}\n')
    return "".join(parts)


def turning(seconds=4):
    """At rest for a second and a half, then faster and faster to both sides; the last second beyond what cars' sensors
    carry."""
    lines = []
    for number in range(100 * seconds):
        us = 1_700_000_000_000_000 + number * 10_000
        t = number / 100
        rate = 0.0032 if t < 1.5 else 40 * (t - 1.5) * math.sin(9 * t) + (200 if t > 3 else 0)
        lines += [bench.line_a(us, rate + 0.01, number), bench.line_b(us + 3000, -(rate - 0.02))]
    return "".join(lines)


def is_valid(name, signals, data):
    """By the makers' own rules."""
    if name == "MM7_Yaw":
        return signals["YawStatus"].raw_value == 0
    if name == "ARI":
        return signals["YawRateMerit"].raw_value == 0 and struct.unpack_from("<H", data, 4)[0] <= 0xFAFF
    if name == "RateOfTurn":
        return struct.unpack_from("<i", data, 1)[0] < 0x7FFFFFFD
    if name == "MTi_RateOfTurn":
        return data[4:6] != b"\x80\x00"
    return True


def rate_dps(name, signals):
    value = {"ESP_02": lambda: float(signals["YawRateMagnitude"].phys_value) * (-1) ** signals["YawRateSign"].raw_value}
    for key in ("YawRate", "RateZ", "Rate"):
        if key in signals and name != "ESP_02":
            return float(signals[key].phys_value) * LAYOUTS[name][2]
    return value[name]()


class OutputLayouts(bench.Bench):
    def replay(self, names, more=""):
        self.write("n2k.dbc", RATE_OF_TURN)
        self.write("vgyro.toml", bench.CONFIG + more + tables(names))
        self.write("in.log", turning())
        done = self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "-", "-q", "in.log")
        # Iterated to its end, python-can's reader closes its file.
        return list(can.LogReader(str((self.folder / "out.log")))), json.loads(done.stdout)

    def test_the_oracle_has_the_published_crc(self):
        self.assertEqual(crc8_j1850(CRC_CHECK[0]), CRC_CHECK[1])

    def test_every_layout_says_what_vg_rate_says(self):
        messages, summary = self.replay(LAYOUTS)
        own = matrix_of(bench.SOURCE / "dbc/vgyro.dbc").frame_by_name("VG_Rate")
        frames = {name: matrix_of(self.folder / file if file == "n2k.dbc" else PROFILES / file).frame_by_name(name)
                  for name, (file, _, _, _) in LAYOUTS.items()}
        truth, seen = {}, {name: {} for name in LAYOUTS}
        before = collections.Counter()  # a frame may cause several rates: the first pairs go out together
        for message in messages:
            instant = (message.timestamp, before[message.arbitration_id, message.timestamp])
            before[message.arbitration_id, message.timestamp] += 1
            if message.arbitration_id == 0x610:
                signals = own.decode(bytes(message.data))
                valid = signals["VG_Valid"].raw_value == 1
                truth[instant] = float(signals["VG_Rate"].phys_value) if valid else None
            elif message.arbitration_id in IDS:
                name = IDS[message.arbitration_id]
                self.assertEqual(message.is_extended_id, name in ("ARI", "RateOfTurn"))
                self.assertEqual(message.channel, "can7" if name == "RT_RateVehicle" else "can0")
                seen[name][instant] = bytes(message.data)
        self.assertGreater(len(truth), 350)
        for name, (_, _, _, step_dps) in LAYOUTS.items():
            with self.subTest(layout=name):
                self.compare(name, frames[name], truth, seen[name], step_dps)
        told = {row["message"]: row for row in summary["out"]["layouts"]}
        for name, row in told.items():
            self.assertEqual(row["frames"], len(seen[name]))
            self.assertEqual(row["frames"] + row["withheld"], len(truth), name)
        self.assertGreater(told["MM7_Yaw"]["out_of_range"], 50)
        self.assertEqual(told["IMU04_YawAccX"]["out_of_range"], 0)

    def compare(self, name, frame, truth, seen, step_dps):
        valid_frames = 0
        for stamp, true_dps in truth.items():
            if stamp not in seen:
                self.assertNotIn(name, ("MM7_Yaw", "ARI", "RateOfTurn", "MTi_RateOfTurn"), "it can say invalid")
                continue
            signals = frame.decode(seen[stamp])
            if not is_valid(name, signals, seen[stamp]):
                continue
            valid_frames += 1
            self.assertIsNotNone(true_dps, f"{name} at {stamp} while VG_Rate is invalid")
            self.assertLessEqual(abs(rate_dps(name, signals) - true_dps), 0.5 * (step_dps + RATE_STEP_DPS) * 1.0001)
        self.assertGreater(valid_frames, 180)
        beyond = [t for t, true_dps in truth.items() if true_dps is not None and abs(true_dps) > 165]
        self.assertGreater(len(beyond), 50)
        if name in ("MM7_Yaw", "ESP_02"):
            wrong = [t for t in beyond if t in seen and is_valid(name, frame.decode(seen[t]), seen[t])]
            self.assertEqual(wrong, [], "beyond 163.84 deg/s it is not valid")

    def test_counters_and_check_values_are_the_makers(self):
        messages, _ = self.replay(["MM7_Yaw", "RateOfTurn"])
        mm7 = [bytes(message.data) for message in messages if message.arbitration_id == 0x174]
        boat = [bytes(message.data) for message in messages if message.arbitration_id == 0x09F11323]
        self.assertEqual([data[6] & 15 for data in mm7], [number % 16 for number in range(len(mm7))])
        self.assertEqual([data[7] for data in mm7], [crc8_j1850(data[:7]) for data in mm7])
        self.assertEqual([data[0] for data in boat], [number % 253 for number in range(len(boat))])
        self.assertTrue(all(data[5:] == b"\xFF\xFF\xFF" for data in boat))

    def test_layouts_leave_the_own_frames_as_they_are(self):
        self.replay([])
        alone = (self.folder / "out.log").read_text()
        self.replay(LAYOUTS)
        own = [line for line in (self.folder / "out.log").read_text().splitlines() if line.split()[2][:3] in ("610", "611", "612")]
        self.assertEqual("\n".join(own) + "\n", alone)
        messages, _ = self.replay(["ARI"], "vgyro_frames = false\n")
        self.assertEqual({message.arbitration_id for message in messages}, {0x0CF02AE2})

    def test_check_shows_what_goes_out(self):
        self.write("n2k.dbc", RATE_OF_TURN)
        self.write("vgyro.toml", bench.CONFIG + tables(["MM7_Yaw", "RateOfTurn", "Yaw_Data_FD1"]))
        text = self.good("check", "vgyro.toml").stdout.decode()
        for part in ("174       MM7_Yaw.YawRate", "YawStatus == 0: 0x0, and 0xF when no rate is valid",
                     "YawCrc, crc8_j1850", "YawCounter, runs 0 to 15", "Temperature: 0", "09F11323  RateOfTurn.Rate",
                     "0x7FFFFFFF, not available", "0x7FFFFFFE, out of range", "SID, runs 0 to 252", "silence"):
            self.assertIn(part, text)


if __name__ == "__main__":
    unittest.main()
