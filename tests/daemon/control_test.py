"""The gateway's D-Bus interface, `vgyro status` and the metrics, on a private bus with the installed policy file,
checked with busctl. The gateway is control_sample, whose figures are known."""

import contextlib
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

SOURCE = Path(os.environ["VGYRO_SOURCE"])
SAMPLE = sys.argv.pop(1)
VGYRO = str(Path(os.environ["VGYRO_BIN"]) / "vgyro")
NAME, OBJECT = "org.vgyro.Gateway1", "/org/vgyro/Gateway1"
NOBODY = 65534
GYRO = 'left "one" \\'
IS_ROOT = os.geteuid() == 0

# Like Debian's system bus, but this test's user may own the name too, which in production the policy file decides.
BUS_CONFIG = """<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>system</type>
  <listen>unix:path={folder}/bus</listen>
  <auth>EXTERNAL</auth>
  <policy context="default">
    <allow user="*"/>
    <deny own="*"/>
    <deny send_type="method_call"/>
    <allow send_type="signal"/>
    <allow send_requested_reply="true" send_type="method_return"/>
    <allow send_requested_reply="true" send_type="error"/>
    <allow receive_type="method_call"/>
    <allow receive_type="method_return"/>
    <allow receive_type="error"/>
    <allow receive_type="signal"/>
    <allow send_destination="org.freedesktop.DBus"/>
  </policy>
  <include>{policy}</include>
  <policy user="{uid}"><allow own="{name}"/></policy>
</busconfig>
"""


def until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


class Bench(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="vgyro-dbus-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.folder.chmod(0o755)
        self.address = f"unix:path={self.folder}/bus"
        self.environment = {**os.environ, "DBUS_SYSTEM_BUS_ADDRESS": self.address, "NO_COLOR": "1"}
        (self.folder / "bus.conf").write_text(BUS_CONFIG.format(
            folder=self.folder, policy=SOURCE / "dbus/org.vgyro.Gateway1.conf", uid=os.geteuid(), name=NAME))

    def end(self, process):
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()

    def start_bus(self):
        (self.folder / "bus").unlink(missing_ok=True)
        with open(self.folder / "bus.err", "ab") as errors:
            bus = subprocess.Popen(["dbus-daemon", f"--config-file={self.folder}/bus.conf", "--nofork", "--nopidfile"],
                                   stderr=errors)
        self.addCleanup(self.end, bus)
        self.assertTrue(until((self.folder / "bus").exists), (self.folder / "bus.err").read_text())
        return bus

    def start_sample(self, *arguments):
        with open(self.folder / "sample.out", "wb") as out, open(self.folder / "sample.err", "wb") as errors:
            sample = subprocess.Popen([SAMPLE, *arguments], stdout=out, stderr=errors, env=self.environment)
        self.addCleanup(self.end, sample)
        return sample

    def seconds_told(self):
        return (self.folder / "sample.out").read_text().count("second")

    def run_as(self, command, uid=None):
        def become():
            if uid is not None:
                os.setgroups([])
                os.setgid(uid)
                os.setuid(uid)
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60, check=False,
                              preexec_fn=become)

    def busctl(self, *arguments, uid=None):
        return self.run_as(["busctl", f"--address={self.address}", *arguments], uid)

    def vgyro(self, *arguments, uid=None):
        return self.run_as([VGYRO, *arguments], uid)

    def is_there(self):
        return self.busctl("get-property", NAME, OBJECT, NAME, "State").returncode == 0

    def get(self, name):
        got = self.busctl("--json=short", "get-property", NAME, OBJECT, NAME, name)
        self.assertEqual(got.returncode, 0, got.stderr)
        return json.loads(got.stdout)["data"]


class OnTheBus(Bench):
    def setUp(self):
        super().setUp()
        self.bus = self.start_bus()
        self.sample = self.start_sample()
        self.assertTrue(until(self.is_there), (self.folder / "sample.err").read_text())

    def test_introspection_lists_every_property_and_method(self):
        listed = self.busctl("introspect", NAME, OBJECT, NAME)
        self.assertEqual(listed.returncode, 0, listed.stderr)
        members = {line.split()[0]: line.split()[1:3] for line in listed.stdout.splitlines() if line.startswith(".")}
        expected = {".Recalibrate": ["method", "-"], ".SaveState": ["method", "-"], ".Counters": ["property", "a{st}"],
                    ".Gyros": ["property", "aa{sv}"], ".Axes": ["property", "aa{sv}"], ".Capture": ["method", "-"], ".Captures": ["property", "a{sv}"], ".Buses": ["property", "aa{sv}"]}
        expected |= {f".{name}": ["property", "s"] for name in ("Version", "Instance", "Method", "Fingerprint", "State", "Quality", "Restored", "Contradiction",
                                                                "ContradictionText")}
        expected |= {f".{name}": ["property", "b"] for name in ("Valid", "Disagree", "Ambiguous", "RatesTooFarApart",
                                                                "ConfigRefused", "Transmit")}
        expected |= {".Hypotheses": ["property", "a{sd}"]}
        expected |= {f".{name}": ["property", "d"] for name in ("RateDps", "SigmaDps", "BiasSigmaDps", "CalibratedS", "LastStopAgeS", "NormalizedInnovation",
                                                                "RestS", "UptimeS")}
        self.assertEqual(members, expected)

    def test_properties_hold_what_the_gateway_knows(self):
        self.assertEqual(self.get("State"), "running")
        self.assertEqual(self.get("Fingerprint"), "0123456789abcdef")
        self.assertEqual(self.get("LastStopAgeS"), 75.0)
        self.assertEqual(self.get("NormalizedInnovation"), 4.5)
        self.assertEqual(self.get("Quality"), "two_gyros")
        self.assertIs(self.get("Valid"), True)
        self.assertEqual((self.get("RateDps") - 50.25) % 0.5, 0.0)
        left, right = self.get("Gyros")
        self.assertEqual(left["name"]["data"], GYRO)
        self.assertEqual(left["bias_dps"]["data"], 0.033)
        self.assertEqual(left["health"]["data"], "ok")
        self.assertEqual(left["rejected"]["data"]["counter_repeated"], 10)
        self.assertEqual(right["health"]["data"], "stuck")
        self.assertEqual(right["faults"]["data"]["stuck"], 2)
        can0, can1 = self.get("Buses")
        self.assertEqual(can0["errors"]["data"]["bus_off"], 3)
        self.assertEqual((can0["foreign"]["data"], can0["contested"]["data"]), (17, True))
        self.assertEqual(can0["restamped"]["data"], 23)
        self.assertIs(can1["present"]["data"], False)
        counters = self.get("Counters")
        self.assertEqual(counters["pairs"], 1 << 40)
        self.assertEqual((counters["log_lines_lost"], counters["service_messages_lost"]), (41, 3))

    def test_properties_hold_what_the_corrector_thinks(self):
        self.assertIs(self.get("Ambiguous"), True)
        self.assertIs(self.get("RatesTooFarApart"), True)
        self.assertEqual(self.get("Hypotheses"), {"standing": 0.75, "turning": 0.25, "warming_up": 0.5})
        counters = self.get("Counters")
        self.assertEqual([counters[name] for name in ("stops", "stops_refused", "stops_open", "estimate_restarts")],
                         [2, 5, 1, 3])
        left, right = self.get("Gyros")
        self.assertEqual((left["slope_dps_s"]["data"], left["slope_sigma_dps_s"]["data"]), (1e-6, 2e-7))
        self.assertNotIsInstance(right["slope_dps_s"]["data"], (int, bool))

    def test_properties_say_how_the_pair_contradicts_itself(self):
        self.assertEqual(self.get("Contradiction"), "sign")
        said = f"right moves -1.00 times {GYRO}: sign = -1?"
        self.assertEqual(self.get("ContradictionText"), said)
        self.assertEqual(self.get("Counters")["contradictions"], 6)
        seen = json.loads(self.vgyro("status", "--json").stdout)
        self.assertEqual((seen["contradiction"], seen["contradiction_text"]), ("sign", said))
        shown = self.vgyro("status").stdout
        self.assertIn("moves -1.00 times", shown)
        self.assertIn("no rate is valid until they move together", shown)

    def test_changes_are_told_once_a_second(self):
        with subprocess.Popen(["busctl", f"--address={self.address}", "--json=short", "monitor", NAME],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=self.environment) as monitor:
            before = self.seconds_told()
            self.assertTrue(until(lambda: self.seconds_told() >= before + 5))
            passed = self.seconds_told() - before
            monitor.terminate()
            messages = [json.loads(line) for line in monitor.stdout.read().splitlines()]
        told = [m["payload"]["data"] for m in messages if m.get("member") == "PropertiesChanged"]
        self.assertGreaterEqual(len(told), 2)
        self.assertLessEqual(len(told), passed + 1)
        rates = [changed["RateDps"]["data"] for _, changed, _ in told]
        self.assertEqual([round(b - a, 9) for a, b in zip(rates, rates[1:])], [0.5] * (len(rates) - 1))
        self.assertEqual(set(told[0][2]), {"Buses", "Captures", "Counters"})

    def test_methods_are_for_root_and_properties_for_all(self):
        stranger = NOBODY if IS_ROOT else None
        for method in ("Recalibrate", "SaveState", "Capture"):
            refused = self.busctl("call", NAME, OBJECT, NAME, method, uid=stranger)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("denied", refused.stderr.lower())
        wants = self.vgyro("recalibrate", uid=stranger)
        self.assertEqual(wants.returncode, 1)
        self.assertIn("only root may do this; try it again with sudo", wants.stderr)
        self.assertEqual(self.get("State"), "running")
        seen = self.vgyro("status", "--json", uid=stranger)
        self.assertEqual(seen.returncode, 0, seen.stderr)
        written = self.busctl("set-property", NAME, OBJECT, NAME, "State", "s", "lost", uid=stranger)
        self.assertNotEqual(written.returncode, 0)
        # Another user must not take the name either.
        if IS_ROOT:
            thief = self.busctl("call", "org.freedesktop.DBus", "/org/freedesktop/DBus", "org.freedesktop.DBus",
                                "RequestName", "su", NAME, "2", uid=NOBODY)
            self.assertIn("denied", thief.stderr.lower())

    @unittest.skipUnless(IS_ROOT, "the policy lets only root do this; the refusal is tested")
    def test_recalibrate_and_save_state_do_what_they_say(self):
        self.assertEqual(self.busctl("call", NAME, OBJECT, NAME, "SaveState").returncode, 0)
        done = self.vgyro("recalibrate")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.get("State"), "calibrating")
        self.assertIs(self.get("Valid"), False)
        refused = self.busctl("call", NAME, OBJECT, NAME, "SaveState")
        self.assertIn("nothing was learned yet", refused.stderr)

    @unittest.skipUnless(IS_ROOT, "the policy lets only root do this; the refusal is tested")
    def test_capture_is_answered_when_it_is_written_and_the_loop_goes_on(self):
        before = self.seconds_told()
        done = self.vgyro("capture")
        self.assertEqual((done.returncode, done.stdout), (0, "/captures/20261130T205000Z-asked\n"), done.stderr)
        self.assertGreater(self.seconds_told(), before)
        self.assertEqual(self.get("Captures")["written"]["data"]["asked"], 1)

    @unittest.skipUnless(IS_ROOT, "the policy lets only root do this; the refusal is tested")
    def test_a_gateway_that_records_nothing_says_how_to_begin(self):
        self.end(self.sample)
        self.start_sample(str(self.folder / "vgyro.prom"), "shadow")
        self.assertTrue(until(self.is_there))
        done = self.vgyro("capture")
        self.assertEqual(done.returncode, 1)
        self.assertIn("keeps no recording; start it with --capture", done.stderr)
        self.assertEqual(self.get("Captures"), {})
        self.assertNotIn("recorded", self.vgyro("status").stdout)

    def test_captures_are_told_wherever_one_looks(self):
        captures = {key: value["data"] for key, value in self.get("Captures").items()}
        self.assertEqual(captures, {
            "directory": "/captures", "held_s": 600.0, "held_frames": 600000, "held_bytes": 4000000, "frames_dropped": 8,
            "is_writing": False, "written": {"contradicted": 2, "disagree": 0, "stops_refused": 1, "asked": 0},
            "failed": 1, "held_back": 5, "last": "/captures/20261130T204835Z-contradicted"})
        shown = self.vgyro("status").stdout
        self.assertIn("recorded: 10 min 0 s of the inputs, 600000 frames, 4.0 MB; 3 written, the last one is "
                      "/captures/20261130T204835Z-contradicted\n", shown)
        self.assertIn("1 recordings could not be written; journalctl", shown)
        self.assertIn("8 frames are missing in the recording", shown)
        seen = json.loads(self.vgyro("status", "--json").stdout)["captures"]
        self.assertEqual((seen["held_s"], seen["written"]["contradicted"]), (600.0, 2))

    def test_status_as_json_says_the_same_as_the_bus(self):
        done = self.vgyro("status", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        status = json.loads(done.stdout)
        self.assertEqual(status["format"], 1)
        self.assertEqual((status["state"], status["quality"], status["valid"]), ("running", "two_gyros", True))
        self.assertEqual(status["sigma_dps"], 0.0005)
        self.assertEqual([g["name"] for g in status["gyros"]], [GYRO, "right"])
        self.assertEqual(status["gyros"][0]["bias_sigma_dps"], 0.0002)
        self.assertIsNone(status["gyros"][1]["bias_dps"])
        self.assertEqual(status["counters"]["frames_sent"], 12345)
        self.assertEqual(status["buses"][0]["errors"]["bus_off"], 3)
        self.assertEqual(status["hypotheses"], {"standing": 0.75, "turning": 0.25, "warming_up": 0.5})
        self.assertIs(status["ambiguous"], True)
        self.assertEqual([g["slope_dps_s"] for g in status["gyros"]], [1e-6, None])

    def test_the_configuration_is_told_by_its_fingerprint(self):
        self.assertIn(", configuration 0123456789abcdef, up ", self.vgyro("status").stdout)
        self.assertEqual(json.loads(self.vgyro("status", "--json").stdout)["fingerprint"], "0123456789abcdef")
        self.end(self.sample)
        metrics = self.folder / "vgyro.prom"
        self.start_sample(str(metrics))
        self.assertTrue(until(metrics.exists))
        text = metrics.read_text(encoding="utf-8")
        self.assertRegex(text, r'(?m)^vgyro_build_info\{version="[0-9.]+[^"]*",fingerprint="0123456789abcdef",method="[a-z]+"\} 1$')
        self.assertIn("\nvgyro_last_stop_age_seconds 75\n", text)
        self.assertIn("\nvgyro_normalized_innovation 4.5\n", text)

    def test_a_scatter_beyond_what_is_expected_is_said(self):
        self.assertIn("scatter 2.1 times more than expected (normalised innovation 4.5, expected 1)", self.vgyro("status").stdout)
        self.assertEqual(json.loads(self.vgyro("status", "--json").stdout)["normalized_innovation"], 4.5)

    def test_shadow_mode_is_said_wherever_one_looks(self):
        self.assertIs(self.get("Transmit"), True)
        self.assertNotIn("shadow", self.vgyro("status").stdout)
        self.end(self.sample)
        metrics = self.folder / "vgyro.prom"
        self.start_sample(str(metrics), "shadow")
        self.assertTrue(until(lambda: self.is_there() and metrics.exists()))
        self.assertIs(self.get("Transmit"), False)
        self.assertEqual(self.get("Counters")["frames_shadowed"], 99)
        self.assertIn("shadow mode: nothing is sent ([output] transmit = false)\n", self.vgyro("status").stdout)
        self.assertIs(json.loads(self.vgyro("status", "--json").stdout)["transmit"], False)
        samples = parse_metrics(metrics.read_text())[1]
        self.assertEqual((samples["vgyro_transmit", ()], samples["vgyro_shadowed_frames_total", ()]), (0, 99))

    def test_instances_are_told_apart_and_asked_together(self):
        front = self.folder / "front.prom"
        self.start_sample(str(front), "loud", "front")
        self.start_sample(str(self.folder / "rear.prom"), "shadow", "rear_2")
        names = [NAME, f"{NAME}.front", f"{NAME}.rear_2"]
        self.assertTrue(until(lambda: all(name in self.busctl("list", "--acquired").stdout for name in names)))
        stranger = NOBODY if IS_ROOT else None
        seen = json.loads(self.vgyro("status", "--instance", "rear_2", "--json", uid=stranger).stdout)
        self.assertEqual((seen["instance"], seen["transmit"]), ("rear_2", False))
        seen = json.loads(self.vgyro("status", "--all", "--json").stdout)
        self.assertEqual([one["instance"] for one in seen["gateways"]], ["", "front", "rear_2"])
        shown = self.vgyro("status", "--all").stdout
        self.assertEqual([line for line in shown.splitlines() if line.startswith("vgyrod") and "," not in line],
                         ["vgyrod", "vgyrod@front", "vgyrod@rear_2"])
        refused = self.busctl("call", names[1], OBJECT, NAME, "Recalibrate", uid=stranger)
        self.assertIn("denied", refused.stderr.lower())
        if IS_ROOT:
            self.assertEqual(self.vgyro("recalibrate", "--instance", "front").returncode, 0)
            states = [one["state"] for one in json.loads(self.vgyro("status", "--all", "--json").stdout)["gateways"]]
            self.assertEqual(states, ["running", "calibrating", "running"])
            self.assertEqual(self.vgyro("recalibrate", "--all").stdout.count("discarded its biases"), 3)
        # node_exporter merges all files, so no two samples may have the same name and labels.
        self.assertTrue(until(front.exists))
        samples = parse_metrics(front.read_text())[1]
        self.assertEqual({labels[:1] for _, labels in samples}, {(("gateway", "front"),)})
        missing = self.vgyro("status", "--instance", "nobody")
        self.assertEqual(missing.returncode, 1)
        self.assertIn("`systemctl status vgyrod@nobody` says whether it runs", missing.stderr)
        wrong = self.vgyro("status", "--instance", "a-b")
        self.assertEqual(wrong.returncode, 2)
        self.assertIn("is not a name for an instance", wrong.stderr)

    def test_status_as_a_table(self):
        done = self.vgyro("status")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("another sender uses our identifiers on can0\n", done.stdout)
        self.assertIn("41 lines of its log are lost: nothing reads the log\n", done.stdout)
        self.assertNotIn("\x1b", done.stdout)
        self.assertRegex(done.stdout, r"(?m)^running  \+5\d\.\d{5} ± 0\.00050 deg/s  two_gyros$")
        self.assertRegex(done.stdout, r'(?m)^left "one" \\  can0 +ok +\+118\.80 ± 0\.72 +\+50\.28300 +21\.5 +1000 +99\.0 % +0  counter repeated 10, crc wrong 7$')
        self.assertRegex(done.stdout, r"(?m)^right +can1 +stuck +– ")
        self.assertRegex(done.stdout, r"(?m)^can0 +up +active +4321 +0 +0  bus off 3$")
        self.assertRegex(done.stdout, r"(?m)^can1 +not there ")
        self.assertIn("layouts: 1000 frames, 900 with a valid rate, 3 rates beyond what they can carry, "
                      "5 withheld while no rate was valid\n", done.stdout)
        self.assertRegex(done.stdout, r"(?m)^frames not used: accelerometer 4, speed 2$")
        # Columns are aligned, even after characters of several bytes.
        lines = done.stdout.splitlines()
        at = next(i for i, line in enumerate(lines) if line.startswith("gyro "))
        column = lines[at].index("bus")
        self.assertEqual({lines[at + 1][column:column + 4], lines[at + 2][column:column + 4]}, {"can0", "can1"})

    def test_status_says_what_the_corrector_thinks_in_plain_words(self):
        said = self.vgyro("status").stdout.splitlines()
        for line in ("what the gyros show can be read in two ways, and σ spans both: standing 75 %, turning steadily 25 %",
                     "the drifts: warming up 50 %, random walk 50 %",
                     f"the biases move by {GYRO} +13.0 ± 2.6 deg/h an hour",
                     "7 steady stretches: 2 stops learned, 5 refused: turning together; "
                     "1 of these left open: stop and turn could not be distinguished"):
            self.assertIn(line, said)
        for beginning in ("little was learned from most of them: ", "one gyro sends so much more often than the other",
                          "the estimate was not finite and was restarted 3 times: a fault of vgyro itself"):
            self.assertEqual(sum(line.startswith(beginning) for line in said), 1, said)

    def test_watch_writes_lines_into_a_pipe(self):
        with subprocess.Popen([VGYRO, "status", "--watch", "--interval", "0.2"], stdout=subprocess.PIPE,
                              env=self.environment, text=True) as watch:
            lines = [watch.stdout.readline() for _ in range(3)]
            watch.send_signal(signal.SIGINT)
            self.assertEqual(watch.wait(20), 0)
        for line in lines:
            self.assertRegex(line, r'^\d\d:\d\d:\d\d running \+5\d\.\d+ ± 0\.00050 deg/s, two_gyros; left "one" \\ ok, '
                                   r"bias \+118\.80 deg/h; right stuck, bias – deg/h$")

    def test_watch_ends_with_its_reader(self):
        with subprocess.Popen([VGYRO, "status", "--watch", "--interval", "0.1"], stdout=subprocess.PIPE,
                              env=self.environment) as watch:
            watch.stdout.readline()
            watch.stdout.close()
            watch.wait(20)

    def test_watch_draws_on_a_terminal_and_gives_the_cursor_back(self):
        reader, writer = pty.openpty()
        environment = {key: value for key, value in self.environment.items() if key != "NO_COLOR"}
        watch = subprocess.Popen([VGYRO, "status", "--watch", "--interval", "0.2"], stdout=writer, env=environment)
        self.addCleanup(self.end, watch)
        os.close(writer)
        seen = ""

        def read_some():
            nonlocal seen
            if select.select([reader], [], [], 0.1)[0]:
                with contextlib.suppress(OSError):
                    seen += os.read(reader, 65536).decode("utf-8", "replace")
        self.assertTrue(until(lambda: read_some() or seen.count("\x1b[H") >= 15))
        self.assertIn("\x1b[32mrunning\x1b[0m", seen)
        self.assertRegex(seen, "[▁▂▃▄▅▆▇█]{5}", "no picture of the rate")
        # The gateway goes away: the view says so and goes on.
        self.end(self.sample)
        self.assertTrue(until(lambda: read_some() or "no gateway answers" in seen))
        watch.send_signal(signal.SIGINT)
        self.assertEqual(watch.wait(20), 0)
        read_some()
        self.assertTrue(seen.rstrip().endswith("\x1b[?25h"), repr(seen[-40:]))
        os.close(reader)

    def test_a_bus_that_hangs_does_not_stop_the_gateway(self):
        self.bus.send_signal(signal.SIGSTOP)
        before = self.seconds_told()
        self.assertTrue(until(lambda: self.seconds_told() >= before + 4, 60), "the loop waits for the bus")
        self.bus.send_signal(signal.SIGCONT)
        self.assertTrue(until(self.is_there))

    def test_a_second_gateway_waits_for_the_name(self):
        with open(self.folder / "second.err", "wb") as errors:
            second = subprocess.Popen([SAMPLE], stdout=subprocess.DEVNULL, stderr=errors, env=self.environment)
        self.addCleanup(self.end, second)
        said = (self.folder / "second.err").read_text
        self.assertTrue(until(lambda: "another gateway has it" in said()), said())
        self.end(self.sample)
        self.assertTrue(until(self.is_there), said())
        self.assertEqual(said().count("another gateway has it"), 1, said())
        self.assertTrue(until(lambda: "on D-Bus as org.vgyro.Gateway1" in said()), said())

    def test_a_bus_that_ends_and_comes_again_is_found(self):
        self.end(self.bus)
        before = self.seconds_told()
        self.assertTrue(until(lambda: self.seconds_told() >= before + 2), "the loop ended with the bus")
        self.start_bus()
        self.assertTrue(until(self.is_there, 60), (self.folder / "sample.err").read_text())
        said = (self.folder / "sample.err").read_text
        # The bus assigns the name a moment before the gateway receives the reply.
        self.assertTrue(until(lambda: "on D-Bus as org.vgyro.Gateway1" in said()), said())
        self.assertEqual(said().count("no D-Bus: "), 1, said())


class WithoutAnything(Bench):
    def test_status_says_what_is_missing(self):
        done = self.vgyro("status")
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^error: D-Bus: there is no system bus: .*; `apt install dbus`")
        self.start_bus()
        for command in (["status"], ["status", "--json"]):
            done = self.vgyro(*command)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertIn("no gateway answers on D-Bus; `systemctl status vgyrod` says whether it runs", done.stderr)

    def test_the_gateway_may_be_there_before_the_bus(self):
        self.start_sample()
        self.assertTrue(until(lambda: self.seconds_told() >= 1))
        self.start_bus()
        self.assertTrue(until(self.is_there, 60), (self.folder / "sample.err").read_text())


# Prometheus' text format by its specification: https://prometheus.io/docs/instrumenting/exposition_formats/
LABEL = r'[a-zA-Z_][a-zA-Z0-9_]*="(?:[^"\\\n]|\\\\|\\"|\\n)*"'
SAMPLE_LINE = re.compile(rf"([a-zA-Z_:][a-zA-Z0-9_:]*)(?:\{{({LABEL}(?:,{LABEL})*)\}})? (NaN|[+-]?Inf|[+-]?[0-9.]+(?:e[+-]?[0-9]+)?)")


def parse_metrics(text):
    types, samples = {}, {}
    family = None
    if not text.endswith("\n"):
        raise ValueError("no end of the last line")
    for line in text.splitlines():
        if line.startswith("# HELP "):
            family = line.split(" ", 3)[2]
            if family in types:
                raise ValueError(f"{family} twice")
        elif line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            if name != family or kind not in ("gauge", "counter"):
                raise ValueError(line)
            types[name] = kind
        else:
            match = SAMPLE_LINE.fullmatch(line)
            if not match or match.group(1) != family or family not in types:
                raise ValueError(f"no sample: {line!r}")
            labels = re.findall(r'([a-zA-Z_]+)="((?:[^"\\]|\\.)*)"', match.group(2) or "")
            key = family, tuple((k, v.replace('\\"', '"').replace("\\n", "\n").replace("\\\\", "\\")) for k, v in labels)
            if key in samples:
                raise ValueError(f"{key} twice")
            samples[key] = float(match.group(3))
    return types, samples


class Metrics(Bench):
    def test_the_parser_refuses_what_is_no_metric(self):
        head = "# HELP a b\n# TYPE a gauge\n"
        self.assertEqual(parse_metrics(head + 'a{x="\\"\\\\"} 1\n')[1], {("a", (("x", '"\\'),)): 1.0})
        for bad in ("a 1", head + "a  1\n", head + 'a{x="y} 1\n', head + "b 1\n", head + "a 1\na 1\n", head + "a nan\n",
                    head + 'a{x="\n"} 1\n', "a 1\n"):
            with self.assertRaises(ValueError, msg=bad):
                parse_metrics(bad)

    def test_the_file_is_whole_and_true(self):
        path = self.folder / "vgyro.prom"
        old_umask = os.umask(0o077)
        self.addCleanup(os.umask, old_umask)
        self.start_sample(str(path))
        self.assertTrue(until(path.exists))
        types, samples = parse_metrics(path.read_text(encoding="utf-8"))
        self.assertTrue(all(name.startswith("vgyro_") for name in types))
        self.assertTrue(all((kind == "counter") == name.endswith("_total") for name, kind in types.items()), types)
        self.assertEqual({labels[0][1]: value for (name, labels), value in samples.items() if name == "vgyro_state"},
                         {"waiting": 0, "calibrating": 0, "running": 1, "degraded": 0, "lost": 0, "contradicted": 0})
        self.assertEqual({labels[0][1]: value for (name, labels), value in samples.items() if name == "vgyro_pair_contradicted"},
                         {"sign": 1, "scale": 0, "lag": 0, "unrelated": 0, "erratic": 0})
        self.assertEqual(samples["vgyro_gyro_bias_degrees_per_second", (("gyro", GYRO),)], 0.033)
        rate = samples["vgyro_gyro_bias_degrees_per_second", (("gyro", "right"),)]
        self.assertNotEqual(rate, rate, "not NaN")
        self.assertEqual(samples["vgyro_pairs_total", ()], float(1 << 40))
        self.assertEqual(samples["vgyro_ambiguous", ()], 1)
        self.assertEqual(samples["vgyro_rates_too_far_apart", ()], 1)
        self.assertEqual(samples["vgyro_hypothesis_probability", (("hypothesis", "standing"),)], 0.75)
        self.assertEqual(sum(name == "vgyro_hypothesis_probability" for name, _ in samples), 9)
        self.assertEqual({labels[0][1]: value for (name, labels), value in samples.items() if name == "vgyro_stops"},
                         {"learned": 2, "refused": 5, "open": 1})
        self.assertEqual(samples["vgyro_estimate_restarts_total", ()], 3)
        self.assertEqual(samples["vgyro_gyro_bias_slope_degrees_per_second_squared", (("gyro", GYRO),)], 1e-6)
        self.assertEqual(samples["vgyro_gyro_bias_slope_sigma_degrees_per_second_squared", (("gyro", GYRO),)], 2e-7)
        self.assertEqual(samples["vgyro_dropped_frames_total", (("cause", "stale"),)], 7)
        self.assertEqual(samples["vgyro_log_lines_lost_total", ()], 41)
        self.assertEqual(samples["vgyro_service_messages_lost_total", ()], 3)
        self.assertEqual({labels[0][1]: value for (name, labels), value in samples.items() if name == "vgyro_captures_total"},
                         {"contradicted": 2, "disagree": 0, "stops_refused": 1, "asked": 0})
        self.assertEqual([samples[f"vgyro_capture{name}", ()] for name in ("s_failed_total", "s_held_back_total", "_held_seconds",
                                                                          "_held_bytes", "_dropped_frames_total")],
                         [1, 5, 600, 4e6, 8])
        self.assertEqual(samples["vgyro_bus_foreign_frames_total", (("bus", "can0"),)], 17)
        self.assertEqual(samples["vgyro_bus_restamped_frames_total", (("bus", "can0"),)], 23)
        self.assertEqual(samples["vgyro_bus_errors_total", (("bus", "can0"), ("cause", "bus_off"))], 3)
        self.assertEqual(samples["vgyro_gyro_rejected_frames_total", (("gyro", GYRO), ("cause", "counter_repeated"))], 10)
        self.assertEqual(path.stat().st_mode & 0o777, 0o644)

    def test_a_reader_never_sees_half_a_file(self):
        path = self.folder / "vgyro.prom"
        self.start_sample(str(path))
        self.assertTrue(until(path.exists))
        first = path.stat().st_ino
        self.assertTrue(until(lambda: path.exists() and (parse_metrics(path.read_text()), path.stat().st_ino != first)[1]),
                        "not written again")
        self.assertEqual([p.name for p in self.folder.glob("vgyro.prom*")], ["vgyro.prom"])

    def test_a_file_that_cannot_be_written_is_told_once(self):
        self.start_sample(str(self.folder / "nosuch" / "vgyro.prom"))
        self.assertTrue(until(lambda: self.seconds_told() >= 8, 60))
        said = (self.folder / "sample.err").read_text()
        self.assertEqual(said.count("metrics cannot be written: No such file or directory"), 1, said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
