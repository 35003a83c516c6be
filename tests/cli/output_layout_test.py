#!/usr/bin/python3
"""The virtual rate in the makers' own layouts: decoded with python-can and canmatrix, by the makers' DBC files, and
compared with VG_Rate of the same instant."""

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
# The published check value of the CRC of the Bosch MM7 and of "crc8_j1850".
CRC_CHECK = (b"123456789", 0x4B)

# message: file, keys, unit in deg/s, step in deg/s; one for every file in dbc/profiles
LAYOUTS = {
    "MM7_Yaw": ("bosch_mm7.dbc", 'rate = "YawRate"\nvalid = "YawStatus == 0"\ncounter = "YawCounter"\n'
                                 'crc = "YawCrc"\ne2e = "crc8_j1850"', 1, 0.005),
    "ARI": ("j1939_ari.dbc", 'rate = "YawRate"\nvalid = "YawRateMerit == 0"\nsource_address = 0xE2', 1, 1 / 128),
    "RateOfTurn": ("nmea2000_rate_of_turn.dbc", 'rate = "Rate"\ncounter = "SID"\nsource_address = 35', DEG_PER_RAD,
                   3.125e-8 * DEG_PER_RAD),
    "RT_RateVehicle": ("oxts_rt.dbc", 'rate = "RateZ"\nsign = -1\nbus = "can7"', -1, 0.01),
    "ESP_02": ("vw_esp_02.dbc", 'rate = "YawRateMagnitude"\nsign_signal = "YawRateSign"\nid = 0x300', 1, 0.01),
    "Yaw_Data_FD1": ("ford_yaw.dbc", 'rate = "YawRate"\n', DEG_PER_RAD, 0.0002 * DEG_PER_RAD),
    "IMU04_YawAccX": ("racelogic_imu04.dbc", 'rate = "YawRate"\n', 1, 2**-15),
    "MTi_RateOfTurn": ("xsens_mti.dbc", 'rate = "RateZ"\nrate_not_available = 0x8000', DEG_PER_RAD, DEG_PER_RAD / 512),
    "SBG_ImuGyro": ("sbg_ellipse.dbc", 'rate = "RateZ"\nrate_not_available = -32768', DEG_PER_RAD, 1e-3 * DEG_PER_RAD),
    "HG1120_InertialZ": ("honeywell_hg1120.dbc", 'rate = "RateZ"', DEG_PER_RAD, 100 / 2**33 * DEG_PER_RAD),
}
LAYOUTS_MOST = 8
IDS = {0x174: "MM7_Yaw", 0x0CF02AE2: "ARI", 0x09F11323: "RateOfTurn", 0x608: "RT_RateVehicle", 0x300: "ESP_02",
       0x091: "Yaw_Data_FD1", 0x600: "IMU04_YawAccX", 0x032: "MTi_RateOfTurn", 0x122: "SBG_ImuGyro",
       0x125: "HG1120_InertialZ"}
# Layouts with a code for "no valid rate"; the others are not sent then.
SPEAKING = ("MM7_Yaw", "ARI", "RateOfTurn", "MTi_RateOfTurn", "SBG_ImuGyro")
# Full scale, in deg/s, where the test turns faster.
NARROW = {"MM7_Yaw": 163.84, "ESP_02": 163.84, "ARI": 252}

# The frames of tests/gateway/output_layout_test.cpp, which were computed by hand: their values in the DBC file's unit.
GOLDEN = {
    "MM7_Yaw": {"C880000000000007": {"YawRate": 1, "YawStatus": 0, "YawCounter": 0},
                "C88000000000011A": {"YawRate": 1, "YawStatus": 0, "YawCounter": 1},
                "0080F00000000203": {"YawRate": 0, "YawStatus": 15, "YawCounter": 2},
                "C880004B000000B5": {"YawRate": 1, "Temperature": 25}},
    "ARI": {"FFFFFFFF007DCFFF": {"YawRate": 0, "YawRateMerit": 0, "PitchRateMerit": 3, "RollRateMerit": 3},
            "FFFFFFFF807DCFFF": {"YawRate": 1}, "FFFFFFFFFFFACFFF": {"YawRate": 251.9921875},
            "007D007D007DC0FF": {"PitchRate": 0, "RollRate": 0, "YawRate": 0, "PitchRateMerit": 0, "RollRateMerit": 0}},
    "RateOfTurn": {"7D0B7D0200FFFFFF": {"SID": 125, "Rate": 163083 * 3.125e-8}},
    "RT_RateVehicle": {"000000002EFB0000": {"RateZ": -12.34}},
    "ESP_02": {"00000000007B4000": {"YawRateMagnitude": 1.23, "YawRateSign": 1},
               "0000000000FF7F00": {"YawRateMagnitude": 163.83, "YawRateSign": 1}},
    "Yaw_Data_FD1": {"000080E800000000": {"YawRate": 0.1}},
    "IMU04_YawAccX": {"3FC0000000000000": {"YawRate": 1.5}},
    "MTi_RateOfTurn": {"000000000200": {"RateZ": 1}},
    "SBG_ImuGyro": {"00000000FA00": {"RateZ": 0.25}},
    "HG1120_InertialZ": {"52B81E0500000000": {"RateZ": 1}},
}


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
        parts.append(f'\n[[output.layout]]\ndbc = "{PROFILES}/{file}"\nmessage = "{name}"\n{keys}\n')
    return "".join(parts)


def turning(seconds=4):
    """At rest for a second and a half, then faster and faster to both sides; in the last second beyond the range of
    car sensors."""
    lines = []
    for number in range(100 * seconds):
        us = 1_700_000_000_000_000 + number * 10_000
        t = number / 100
        rate = 0.0032 if t < 1.5 else 40 * (t - 1.5) * math.sin(9 * t) + (200 if t > 3 else 0)
        lines += [bench.line_a(us, rate + 0.01, number), bench.line_b(us + 3000, -(rate - 0.02))]
    return "".join(lines)


def is_valid(name, signals, data):
    """Is the rate valid by the makers' own rules?"""
    if name == "MM7_Yaw":
        return signals["YawStatus"].raw_value == 0
    if name == "ARI":
        return signals["YawRateMerit"].raw_value == 0 and struct.unpack_from("<H", data, 4)[0] <= 0xFAFF
    if name == "RateOfTurn":
        return struct.unpack_from("<i", data, 1)[0] < 0x7FFFFFFD
    if name == "MTi_RateOfTurn":
        return data[4:6] != b"\x80\x00"
    if name == "SBG_ImuGyro":
        return data[4:6] != b"\x00\x80"
    return True


def rate_dps(name, signals):
    value = {"ESP_02": lambda: float(signals["YawRateMagnitude"].phys_value) * (-1) ** signals["YawRateSign"].raw_value}
    for key in ("YawRate", "RateZ", "Rate"):
        if key in signals and name != "ESP_02":
            return float(signals[key].phys_value) * LAYOUTS[name][2]
    return value[name]()


class OutputLayouts(bench.Bench):
    def replay(self, names, more=""):
        self.write("vgyro.toml", bench.CONFIG + more + tables(names))
        self.write("in.log", turning())
        done = self.good("replay", "--config", "vgyro.toml", "-o", "out.log", "--json", "-", "-q", "in.log")
        # python-can's reader closes its file after the last frame.
        return list(can.LogReader(str((self.folder / "out.log")))), json.loads(done.stdout)

    def test_the_oracle_has_the_published_crc(self):
        self.assertEqual(crc8_j1850(CRC_CHECK[0]), CRC_CHECK[1])

    def test_golden_frames_are_what_canmatrix_reads(self):
        source = (bench.SOURCE / "tests/gateway/output_layout_test.cpp").read_text(encoding="utf-8")
        self.assertEqual(set(GOLDEN), set(LAYOUTS))
        for name, frames in GOLDEN.items():
            matrix = matrix_of(PROFILES / LAYOUTS[name][0]).frame_by_name(name)
            for data, wanted in frames.items():
                self.assertIn(f"#{data}\"", source, "not a frame of the other test")
                signals = matrix.decode(bytes.fromhex(data))
                for signal, value in wanted.items():
                    with self.subTest(frame=name, signal=signal):
                        self.assertAlmostEqual(float(signals[signal].phys_value), value, 8)

    def test_no_profile_is_left_out(self):
        self.assertEqual({file for file, _, _, _ in LAYOUTS.values()}, {path.name for path in PROFILES.glob("*.dbc")})

    def test_every_layout_says_what_vg_rate_says(self):
        names = list(LAYOUTS)
        for first in range(0, len(names), LAYOUTS_MOST):
            self.judge(names[first:first + LAYOUTS_MOST])

    def judge(self, names):
        messages, summary = self.replay(names)
        own = matrix_of(bench.SOURCE / "dbc/vgyro.dbc").frame_by_name("VG_Rate")
        truth, seen = {}, {name: {} for name in names}
        before = collections.Counter()  # a frame may cause several rates: the first pairs are sent together
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
        for name in names:
            with self.subTest(layout=name):
                file, _, _, step_dps = LAYOUTS[name]
                self.compare(name, matrix_of(PROFILES / file).frame_by_name(name), truth, seen[name], step_dps)
        told = {row["message"]: row for row in summary["out"]["layouts"]}
        for name, row in told.items():
            self.assertEqual(row["frames"], len(seen[name]))
            self.assertEqual(row["frames"] + row["withheld"], len(truth), name)
            if name in NARROW:
                self.assertGreater(row["out_of_range"], 5, name)
            else:
                self.assertEqual(row["out_of_range"], 0, name)

    def compare(self, name, frame, truth, seen, step_dps):
        valid_frames = 0
        for stamp, true_dps in truth.items():
            if stamp not in seen:
                self.assertNotIn(name, SPEAKING, "it can say invalid")
                continue
            signals = frame.decode(seen[stamp])
            if not is_valid(name, signals, seen[stamp]):
                continue
            valid_frames += 1
            self.assertIsNotNone(true_dps, f"{name} at {stamp} while VG_Rate is invalid")
            self.assertLessEqual(abs(rate_dps(name, signals) - true_dps), 0.5 * (step_dps + RATE_STEP_DPS) * 1.0001)
        self.assertGreater(valid_frames, 180)
        if name in NARROW:
            beyond = [t for t, true_dps in truth.items() if true_dps is not None and abs(true_dps) > NARROW[name]]
            self.assertGreater(len(beyond), 5)
            wrong = [t for t in beyond if t in seen and is_valid(name, frame.decode(seen[t]), seen[t])]
            self.assertEqual(wrong, [], f"beyond {NARROW[name]} deg/s it is not valid")

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
        self.replay(list(LAYOUTS)[:LAYOUTS_MOST])
        own = [line for line in (self.folder / "out.log").read_text().splitlines() if line.split()[2][:3] in ("610", "611", "612")]
        self.assertEqual("\n".join(own) + "\n", alone)
        messages, _ = self.replay(["ARI"], "vgyro_frames = false\n")
        self.assertEqual({message.arbitration_id for message in messages}, {0x0CF02AE2})

    def test_check_shows_what_goes_out(self):
        self.write("vgyro.toml", bench.CONFIG + tables(["MM7_Yaw", "RateOfTurn", "Yaw_Data_FD1"]))
        text = self.good("check", "vgyro.toml").stdout.decode()
        for part in ("174       MM7_Yaw.YawRate", "YawStatus == 0: 0x0, and 0xF when no rate is valid",
                     "YawCrc, crc8_j1850", "YawCounter, runs 0 to 15", "Temperature: 0", "09F11323  RateOfTurn.Rate",
                     "0x7FFFFFFF, not available", "0x7FFFFFFE, out of range", "SID, runs 0 to 252", "silence"):
            self.assertIn(part, text)

    def test_a_layout_that_would_be_read_back_is_refused(self):
        """The gateway's own frames must not be received as a sensor's, not by their PGN either."""
        gyro = bench.CONFIG.replace('bus = "can1"\ndbc = "bench.dbc"\nmessage = "GYRO_B"\nrate = "Rate"',
                                    f'bus = "can1"\ndbc = "{PROFILES}/j1939_ari.dbc"\nmessage = "ARI"\nrate = "YawRate"')
        self.assertNotEqual(gyro, bench.CONFIG)
        layout = tables(["ARI"]).replace("[[output.layout]]", '[[output.layout]]\nbus = "can1"')
        self.write("vgyro.toml", gyro + layout)
        done = self.run_vgyro("check", "vgyro.toml")
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"0x0cf02ae2 is also an input on can1", done.stderr)
        self.write("vgyro.toml", gyro.replace('message = "ARI"', 'message = "ARI"\nsource_address = 0x80') + layout)
        self.good("check", "vgyro.toml")
        self.write("vgyro.toml", bench.CONFIG + tables(["ARI", "ARI"]))
        done = self.run_vgyro("check", "vgyro.toml")
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"two output frames have the same identifier", done.stderr)


class Example(bench.Bench):
    """examples/layouts.toml on the recording beside it, as in examples/README.md."""

    FRAMES = {  # bus, identifier: file, message, signal, deg/s a unit, step in deg/s, ms between frames
        ("can2", 0x174): ("bosch_mm7.dbc", "MM7_Yaw", "YawRate", 1, 0.005, 10),
        ("can3", 0x0CF02A31): ("j1939_ari.dbc", "ARI", "YawRate", 1, 1 / 128, 10),
        ("can4", 0x09F11332): ("nmea2000_rate_of_turn.dbc", "RateOfTurn", "Rate", -DEG_PER_RAD, 1.8e-6, 100)}

    def test_it_sends_what_it_says(self):
        config = str(bench.SOURCE / "examples/layouts.toml")
        check = self.good("check", config)
        self.assertEqual(check.stderr, b"", "an example is free of warnings")
        self.good("replay", "--config", config, "-o", "out.log", "-q", str(bench.SOURCE / "examples/twin.log.xz"))
        own = matrix_of(bench.SOURCE / "dbc/vgyro.dbc").frame_by_name("VG_Rate")
        lines = [line.split() for line in (self.folder / "out.log").read_text().splitlines()]
        truth, seen = {}, {key: {} for key in self.FRAMES}
        for stamp, bus, frame in lines:
            name, data = frame.split("#")
            key = (bus, int(name, 16))
            if key in seen or name == "610":
                (seen[key] if key in seen else truth)[float(stamp[1:-1])] = bytes.fromhex(data)
        for key, (file, message, signal, unit, step_dps, every_ms) in self.FRAMES.items():
            frame = matrix_of(PROFILES / file).frame_by_name(message)
            stamps = sorted(seen[key])
            distances = [round(1000 * (b - a), 3) for a, b in zip(stamps, stamps[1:])]
            self.assertLess(max(abs(distance - every_ms) for distance in distances), 3, message)
            self.assertAlmostEqual(sum(distances) / len(distances), every_ms, 2)
            checked = 0
            for stamp in stamps[-300:]:
                virtual = own.decode(truth[stamp])
                self.assertEqual(virtual["VG_Valid"].raw_value, 1)
                rate = float(frame.decode(seen[key][stamp])[signal].phys_value) * unit
                self.assertLessEqual(abs(rate - float(virtual["VG_Rate"].phys_value)), 0.5 * (step_dps + RATE_STEP_DPS) * 1.0001)
                checked += 1
            self.assertEqual(checked, 300)


if __name__ == "__main__":
    unittest.main()
