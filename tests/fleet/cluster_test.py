#!/usr/bin/python3
"""vgyro-fleet over real recordings: on this machine, and on a Dask cluster that the test starts and of which it kills a
worker in the middle. Every drive counts once, and the bytes are the same."""

import json
import lzma
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

ROOT = Path(os.environ["VGYRO_SOURCE"])
sys.path.insert(0, str(ROOT / "tests" / "cli"))
import gap_test  # noqa: E402  its bench and its recording

VGYRO = Path(os.environ["VGYRO_BIN"]).resolve() / "vgyro"
TOOL = ROOT / "cli" / "fleet" / "vgyro-fleet"
DRIVES = 8


class Cluster:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self, folder):
        self.folder, self.processes = folder, []
        file = folder / "scheduler.json"
        self.scheduler = self.start("distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1",
                                    "--scheduler-file", file)
        self.wait(file.exists)
        self.address = json.loads(file.read_text())["address"]
        self.workers = [self.start("distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
                                   "--host", "127.0.0.1", "--local-directory", folder) for _ in range(2)]

    def start(self, module, *words):
        process = subprocess.Popen([sys.executable, "-m", module, *map(str, words)], cwd=self.folder,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.processes.append(process)
        return process

    @staticmethod
    def wait(happened, limit_s=120):
        end = time.monotonic() + limit_s
        while not happened():
            if time.monotonic() > end:
                raise TimeoutError("the cluster did not come up")
            time.sleep(0.05)

    def stop(self):
        for process in reversed(self.processes):
            process.kill()
            process.wait()


class VgyroFleet(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.scratch.name)
        logs = cls.folder / "logs"
        logs.mkdir()
        (cls.folder / "bench.dbc").write_text(gap_test.DBC)
        (cls.folder / "vgyro.toml").write_text(gap_test.GYROS + gap_test.REFERENCE)
        (cls.folder / "model.toml").write_text(gap_test.MODEL)
        for number in range(DRIVES):
            gap_test.SEED = 100 + number
            (logs / f"drive{number}.log").write_text(gap_test.recording(seconds=70.0))
        (logs / "broken.log").write_text("(1700000000.000000) can0 101#00\n")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def command(self, out, *options):
        return [TOOL, "--vgyro", VGYRO, "--config", "vgyro.toml", "--model", "model.toml", "--out", out, *options, "logs"]

    def run_tool(self, out, *options):
        done = subprocess.run(self.command(out, *options), cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def result(self, out):
        return {name: (self.folder / out / "fleet" / name).read_bytes() for name in ("fleet.json", "evidence.json", "report.html")}

    def kept(self, out):
        return sorted((self.folder / out / "drives").glob("*.json"))

    def test_a_killed_worker_loses_nothing(self):
        alone = self.run_tool("alone")
        self.assertIn("broken.log", alone.stderr)
        self.assertEqual(json.loads(self.result("alone")["fleet.json"])["drives"], DRIVES)
        cluster = Cluster(self.folder)
        self.addCleanup(cluster.stop)
        tool = subprocess.Popen(self.command("cluster", "--scheduler", cluster.address), cwd=self.folder,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        cluster.wait(lambda: len(self.kept("cluster")) >= 2 or tool.poll() is not None)
        self.assertLess(len(self.kept("cluster")), DRIVES, "the worker is to die in the middle")
        cluster.workers[0].send_signal(signal.SIGKILL)
        said, _ = tool.communicate(timeout=240)
        self.assertEqual(tool.returncode, 0, said)
        self.assertEqual(self.result("cluster"), self.result("alone"))
        self.assertEqual(len(self.kept("cluster")), DRIVES)

    def test_goes_on_where_it_was_cut_off(self):
        self.run_tool("resumed")
        whole = self.result("resumed")
        before = {path: path.stat().st_mtime_ns for path in self.kept("resumed")}
        lost = self.kept("resumed")[3]
        lost.unlink()
        again = self.run_tool("resumed")
        self.assertIn(f"{DRIVES} of {DRIVES + 1} drives were done in an earlier run", again.stderr)
        self.assertEqual(self.result("resumed"), whole)
        for path, stamp in before.items():
            if path != lost:
                self.assertEqual(path.stat().st_mtime_ns, stamp)

    def test_no_frame_of_captures_counts_twice(self):
        log = (self.folder / "logs/drive0.log").read_bytes()
        for vehicle, name, first, last in (("car1", "20261130T200000Z-asked", 0.0, 600.0), ("car1", "20261130T200500Z-disagree", 300.0, 900.0),
                                           ("car1", "20261130T200900Z-asked", 601.0, 1200.0), ("car2", "20261130T200500Z-asked", 300.0, 900.0)):
            capture = self.folder / "vehicles" / vehicle / "captures" / name
            capture.mkdir(parents=True)
            (capture / "recording.log.xz").write_bytes(lzma.compress(log))
            (capture / "capture.json").write_text(json.dumps(
                {"recording": "recording.log.xz", "first_stamp_s": first, "last_stamp_s": last}))
        done = subprocess.run([*self.command("captures", "--time-limit", "0.001")[:-1], "vehicles"], cwd=self.folder,
                              capture_output=True, text=True, check=False)
        self.assertIn("1 captures are left out", done.stderr)
        tried = sorted(json.loads(path.read_text())["recording"] for path in (self.folder / "captures/failed").glob("*.json"))
        self.assertEqual([Path(path).relative_to(self.folder.resolve() / "vehicles").parts[0::2] for path in tried],
                         [("car1", "20261130T200000Z-asked"), ("car1", "20261130T200900Z-asked"), ("car2", "20261130T200500Z-asked")])

    def test_a_drive_that_takes_too_long_is_listed(self):
        done = subprocess.run(self.command("hurried", "--time-limit", "0.001"), cwd=self.folder, capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("took longer than 0.001 s", done.stderr)
        self.assertIn("drive7.log", done.stderr)


class WeakEffect(unittest.TestCase):
    """Whole drives, through decoding, search and pooling: the pool names an effect that no drive names, and no other."""

    def pooled(self, scale_error, drives=24):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            (folder / "logs").mkdir()
            (folder / "bench.dbc").write_text(gap_test.DBC)
            (folder / "vgyro.toml").write_text(gap_test.GYROS + gap_test.REFERENCE)
            (folder / "model.toml").write_text(gap_test.MODEL)
            for number in range(drives):
                gap_test.SEED = 1000 + number
                (folder / "logs" / f"drive{number}.log").write_text(gap_test.recording(scale_error=scale_error))
            subprocess.run([TOOL, "--vgyro", VGYRO, "--config", "vgyro.toml", "--model", "model.toml", "--out", "out", "logs"],
                           cwd=folder, capture_output=True, check=True)
            alone = [json.loads(line) for line in (folder / "out" / "drives.json").read_text().splitlines()]
            self.assertEqual(len(alone), drives)
            self.assertFalse(any(gyro["named"] for drive in alone for gyro in drive["gyros"]))
            for size in (len(json.dumps(drive)) for drive in alone):
                self.assertLess(size, 50_000)
            return json.loads((folder / "out" / "fleet" / "fleet.json").read_text())

    def test_is_named_by_the_pool_alone(self):
        weak = 1.4e-5  # two standard errors of one drive
        found = self.pooled(weak)
        self.assertEqual([(e["kind"], e["type"]) for e in found["effects"]], [("scale_factor", "right")])
        low, high = found["effects"][0]["interval95"]
        self.assertLess(low - 1e-6, weak)
        self.assertGreater(high + 1e-6, weak)

    def test_is_not_named_where_there_is_none(self):
        found = self.pooled(0.0)
        self.assertEqual(found["effects"], [])
        self.assertFalse(any(unit["why"] for unit in found["units"]))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
