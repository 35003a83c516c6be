"""Judges the results of the guest: exit codes and outputs of the scenario's steps, and the captured frames."""

import json
import math
import os
import re
import tomllib
import zlib
from pathlib import Path

import numpy as np
import verdicts
from verdicts import require

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIASES_DPS = (0.033, -0.0074)
NOISE_DPS_RTHZ = 2e-4
REST_S = 3.0
PLAY_S = 5.0
SHORT_S = 2.5
RATE_HZ = 100.0
# σ of the calibrated bias of both gyros, weighted equally: N / √(2 rest). The mean of half a second of rates adds its own
# noise.
BIAS_SIGMA_DPS = NOISE_DPS_RTHZ / math.sqrt(2 * REST_S)
ERROR_MOST_DPS = 6 * math.hypot(BIAS_SIGMA_DPS, NOISE_DPS_RTHZ / math.sqrt(2 * 0.5))
EXPOSURE_MOST = 1.3
# A gyro times out after 0.1 s without frames, and is used again with its next frames.
AFTER_STALL_US = 300_000


class Run:
    """The results in the folder that the guest wrote."""

    def __init__(self, out):
        self.out = out
        self.oracle = verdicts.Oracle(SOURCE / "dbc/vgyro.dbc")
        self.frames = verdicts.read_log(out / "capture.log")
        # Stalls of the whole guest: (begin, end).
        noted = (map(int, line.split()) for line in (out / "stalls.txt").read_text(encoding="ascii").splitlines())
        self.stalls_us = [(end - length, end) for end, length in noted]

    def text(self, name):
        path = self.out / f"{name}.txt"
        require(path.exists(), f"the step {name} did not run")
        return path.read_text(encoding="utf-8", errors="replace")

    def done(self, *names):
        for name in names:
            text, code = self.text(name), (self.out / f"{name}.exit").read_text().strip()
            require(code == "0", f"{name}: exit {code}\n{text}")

    def show(self, name):
        self.done(name)
        return dict(line.split("=", 1) for line in self.text(name).splitlines() if "=" in line)

    def require_shows(self, name, **expected):
        shown = self.show(name)
        wrong = {key: shown.get(key) for key, value in expected.items() if shown.get(key) != value}
        require(not wrong, f"{name}: {wrong}, not { {key: expected[key] for key in wrong} }")
        return shown

    def began_us(self, name):
        return int(float((self.out / f"{name}.at").read_text()) * 1e6)

    def sent(self, can_id, begin, end=None):
        """Frames between the beginnings of two steps."""
        until = self.began_us(end) if end else 1 << 62
        return [line for line in self.frames
                if int(line.name, 16) == can_id and self.began_us(begin) <= line.us < until]

    def kept_time(self, us):
        """Whether no stall could have caused a time-out of a gyro at this moment."""
        return not any(begin < us < end + AFTER_STALL_US for begin, end in self.stalls_us)

    def check_rates(self, begin, end, calibrated):
        """Rates are near the truth, 0, which neither gyro reads; valid from the first pair on if biases were known before."""
        lines = self.sent(0x610, begin, end)
        _, rate, state = verdicts.rates_of(lines, self.oracle)
        play_s = SHORT_S if calibrated else PLAY_S
        stood_s = sum(b - a for a, b in self.stalls_us if lines and lines[0].us < b < lines[0].us + play_s * 1e6) * 1e-6
        require(stood_s < play_s / 4, f"{begin}: the machine did not keep time: it stood still for {stood_s:.1f} s")
        require(len(rate) > (0.9 * play_s - stood_s) * RATE_HZ, f"{begin}: {len(rate)} rates")
        valid = np.isfinite(rate)
        if calibrated:
            require(valid.all(), f"{begin}: {(~valid).sum()} of {len(rate)} rates are not valid")
        else:
            require(not valid[: int(0.9 * REST_S * RATE_HZ)].any(), f"{begin}: valid before the calibration was complete")
        # After both gyros were lost, the first samples are of one gyro alone.
        kept = np.array([self.kept_time(line.us) for line in lines])
        judged = state[valid & kept][5:]
        require(set(judged) == {2}, f"{begin}: states {set(judged)}")
        error = rate[valid].mean()
        require(abs(error) < ERROR_MOST_DPS, f"{begin}: mean error {error:.2e} deg/s, more than {ERROR_MOST_DPS:.1e}")
        stood = f", {(~kept).sum()} of them while the machine stood still: state not judged" if not kept.all() else ""
        return f"{valid.sum()} valid rates, mean error {error * 3600:+.2f} deg/h{stood}"


def installs_and_waits(run):
    """Installed on a machine that is not configured: enabled, skipped, says why, sends nothing."""
    run.done("install", "unconfigured_said", "unconfigured_failed")
    run.require_shows("unconfigured", ActiveState="inactive", UnitFileState="enabled", NRestarts="0")
    require(not run.text("unconfigured_failed").strip(), f"failed units: {run.text('unconfigured_failed')}")
    require("names no gyros yet" in run.text("unconfigured_journal"), run.text("unconfigured_journal"))
    require(not (run.out / "unconfigured.log").read_text(), "frames before it was configured")


def starts(run):
    """A bad configuration fails once; with a good one it is active when `systemctl start` returns, at READY."""
    # A bad configuration is reported at once, and not tried again.
    run.require_shows("bad_started", ActiveState="failed", Result="exit-code", NRestarts="0", ExecMainStatus="1")
    run.done("start")
    run.require_shows("started", ActiveState="active", SubState="running", NRestarts="0", Result="success")


def sandbox(run):
    """No user of the host, no capability, filtered system calls, namespaces of its own, a read-only system."""
    run.done("process", "namespaces", "security")
    status = dict(line.split(":\t", 1) for line in run.text("process").splitlines() if ":\t" in line)
    require("0" not in status["Uid"].split(), f"Uid {status['Uid']}")
    for kind in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"):
        require(int(status[kind], 16) == 0, f"{kind} {status[kind]}")
    require((status["NoNewPrivs"], status["Seccomp"]) == ("1", "2"), f"{status['NoNewPrivs']}, {status['Seccomp']}")
    links = run.text("namespaces").split()
    require(len(links) == 6 and links[0] != links[3] and links[1] != links[4], f"namespaces {links}")
    options = {line.split()[4]: line.split()[5] for line in run.text("mounts").splitlines()}
    require(options["/"].split(",")[0] == "ro", f"mounts {options}")
    exposure = float(re.search(r"exposure level for \S+ ([0-9.]+)", run.text("security")).group(1))
    require(exposure <= EXPOSURE_MOST, f"exposure {exposure}")
    return f"exposure {exposure}"


def calibrates(run):
    """Recorded traffic in, a calibrated rate out."""
    run.done("play")
    return run.check_rates("play", "introspect", calibrated=False)


def speaks_on_dbus(run):
    """D-Bus: every user can introspect and read, only root can recalibrate."""
    run.done("introspect", "property", "status", "recalibrate", "recalibrate_play", "save")
    for member in (".State", ".RateDps", ".Recalibrate", ".SaveState"):
        require(re.search(rf"^\{member} ", run.text("introspect"), re.MULTILINE), f"no {member}\n{run.text('introspect')}")
    require(re.fullmatch(r's "(running|degraded|lost)"\n', run.text("property")), run.text("property"))
    said = run.text("status")
    status = json.loads(said[said.rindex("\n{\n") if "\n{\n" in said else said.index("{"):])
    require(status["state"] == "running" and status["valid"] and abs(status["rate_dps"]) < 0.05, run.text("status"))
    require((run.out / "refused.exit").read_text().strip() != "0" and "denied" in run.text("refused").lower(), run.text("refused"))
    return run.check_rates("recalibrate_play", "save", calibrated=False)


def records(run):
    """What came in is written where the service may write, for root alone."""
    run.done("capture", "capture_read", "capture_lines", "capture_said", "capture_modes")
    require((run.out / "capture_refused.exit").read_text().strip() != "0" and "only root" in run.text("capture_refused"),
            run.text("capture_refused"))
    require(re.fullmatch(r"/var/lib/vgyro/captures/\d{8}T\d{6}Z-asked\n", run.text("capture")), run.text("capture"))
    said = json.loads(run.text("capture_said"))
    require(said["frames"] > 1000 and said["frames_dropped"] == 0 and len(said["inputs"]) == 2, f"{said}")
    require(run.text("capture_lines").splitlines() == ["vcan0 101", "vcan1 102"], run.text("capture_lines"))
    for line in run.text("capture_modes").splitlines():
        require(line.split()[0] in ("600", "644", "700"), line)
    return f"{said['frames']} frames"


def kill_nine(run):
    """Killed: started again, and valid from the first pair with the saved biases."""
    run.done("killed", "killed_play")
    run.require_shows("killed_show", ActiveState="active", NRestarts="1")
    require("restored the biases" in run.text("killed_journal"), run.text("killed_journal"))
    return run.check_rates("killed_play", "reload_bad", calibrated=True)


def reloads(run):
    """SIGHUP: a bad configuration is refused with its line, a good one is used; the process and the biases stay."""
    run.done("reload_bad", "reload_bad_said", "reload_good", "reload_good_said", "reload_play", "reload_back", "reload_back_said")
    pid = run.show("killed_show")["MainPID"]
    run.require_shows("reload_bad_show", ActiveState="active", MainPID=pid)
    run.require_shows("reload_show", ActiveState="active", MainPID=pid, NRestarts="1")
    require(re.search(r"vgyro\.toml:\d+: .*resst_s", run.text("reload_journal")), run.text("reload_journal"))
    require(not run.sent(0x613, "play", "reload_good"), "the other identifier before the reload")
    require(len(run.sent(0x613, "reload_play", "reload_back")) >= 10, "not the identifier of the new configuration")
    require(len(run.sent(0x611, "reload_show")) > 0 and not run.sent(0x613, "reload_show"), "not the first identifier again")
    return run.check_rates("reload_play", "reload_back", calibrated=True)


def watchdog(run):
    """A stopped process: ended by the watchdog, started again with its biases."""
    run.done("watchdog", "watchdog_play")
    run.require_shows("watchdog_show", ActiveState="active", NRestarts="2")
    require("watchdog" in run.text("watchdog_journal").lower(), run.text("watchdog_journal"))
    return run.check_rates("watchdog_play", "link_play", calibrated=True)


def link_faults(run):
    """Link down and up: the same process goes on, and sends no burst of old frames."""
    run.done("link_down", "link_up", "link_play")
    shown = run.require_shows("link_show", ActiveState="active")
    require(shown["MainPID"] == run.text("link_main").strip(), "another process")
    for text in ("vcan0: link went down", "vcan0: link is up again"):
        require(text in run.text("link_journal"), f"not logged: {text}\n{run.text('link_journal')}")
    quiet = [line for line in run.sent(0x611, "link_play") if line.us < run.began_us("link_play") + 100_000]
    require(len(quiet) < 10, f"{len(quiet)} heartbeats in a tenth of a second")
    return run.check_rates("link_play", "upgrade", calibrated=True)


def upgrades(run):
    """A newer package: another process, the same configuration, the same biases."""
    run.done("upgrade", "upgraded_config", "upgraded_play")
    shown = run.require_shows("upgraded", ActiveState="active", SubState="running", UnitFileState="enabled")
    require(shown["MainPID"] != run.text("link_main").strip(), "the old process still runs")
    require("restored the biases" in run.text("upgraded_journal"), run.text("upgraded_journal"))
    return run.check_rates("upgraded_play", "downgrade", calibrated=True)


def downgrades(run):
    """The older package again: the same biases, valid from the first pair."""
    run.done("downgrade", "downgraded_play")
    run.require_shows("downgraded", ActiveState="active", SubState="running", UnitFileState="enabled")
    require("restored the biases" in run.text("downgraded_journal"), run.text("downgraded_journal"))
    return run.check_rates("downgraded_play", "later_start", calibrated=True)


def keeps_a_later_state(run):
    """A state of a later format: refused with a line that says so, kept byte by byte, and the gateway calibrates."""
    run.done("later_start", "later_play", "later_said", "later_kept")
    run.require_shows("later_show", ActiveState="active", NRestarts="0")
    require("newer release" in run.text("later_journal") and "state.toml.refused" in run.text("later_journal"), run.text("later_journal"))
    _, rate, _ = verdicts.rates_of(run.sent(0x610, "later_play", "stop"), run.oracle)
    require(len(rate) > 0 and not np.isfinite(rate).any(), "a valid rate without a calibration")


def stops(run):
    """Stopped: a clean end, and the state is on the disk, readable by its own user only."""
    run.done("stop", "state")
    run.require_shows("stopped", ActiveState="inactive", Result="success", ExecMainStatus="0")
    directory, file = run.text("state").splitlines()
    require(directory.startswith("700 ") and file == "600 vgyro regular file", run.text("state"))
    data = (run.out / "state.toml").read_bytes()
    content, _, _ = data.rpartition(b"\n[checksum]\n")
    kept = tomllib.loads(data.decode("ascii"))
    require(kept["checksum"]["crc32"] == f"{zlib.crc32(content):08x}", "the state's checksum is wrong")
    sigma = NOISE_DPS_RTHZ / math.sqrt(REST_S)
    biases = kept["drift"]["bias_dps"]
    require(np.allclose(biases, BIASES_DPS, rtol=0, atol=6 * sigma), f"biases {biases}")
    return f"biases {biases[0]:.5f}, {biases[1]:.5f} deg/s"


def goes_away(run):
    """Removed: stopped, configuration and state stay. Purged: nothing is left."""
    run.done("remove", "removed_left", "purge", "purged_failed")
    run.require_shows("removed", ActiveState="inactive", LoadState="not-found")
    require("vgyrod" not in run.text("removed_processes"), "it still runs")
    require(not run.text("purged_left").strip(), f"left behind:\n{run.text('purged_left')}")
    require(not run.text("purged_failed").strip(), f"failed units: {run.text('purged_failed')}")


def network_examples(run):
    """systemd-networkd and udev accept the example units; the length of the queue is set."""
    run.done("links", "networkd")
    told = [line for line in run.text("networkd").splitlines() if re.search(r"[78]0-can\d\.(network|link)", line)
            and re.search(r"Unknown|Failed|Invalid|ignoring|not supported", line, re.IGNORECASE)]
    require(not told, "\n".join(told))
    require("Enumeration completed" in run.text("networkd"), f"systemd-networkd did not run\n{run.text('networkd')}")
    require(re.search(r"\bqlen 128\b", run.text("links")), run.text("links"))


def protection(run):
    """Every sent frame has a right E2E header."""
    require(len(run.frames) > 1000, f"{len(run.frames)} frames")
    for line in run.frames:
        verdicts.check_crc(line, int(line.name, 16))
    return f"{len(run.frames)} frames"


CHECKS = (network_examples, installs_and_waits, starts, sandbox, calibrates, speaks_on_dbus, records, kill_nine, reloads, watchdog, link_faults, upgrades, downgrades, keeps_a_later_state, stops,
          goes_away, protection)


def judge(out):
    """The number of checks that failed."""
    verdicts.check_own_vectors()
    if not (out / "capture.log").exists():
        left = sorted(path.name for path in out.iterdir())
        print(f"systemd: the scenario did not end; it left: {' '.join(left)}")
        return 1
    run = Run(out)
    failed = 0
    for check in CHECKS:
        try:
            text, passed = check(run) or "", True
        except (verdicts.Failure, KeyError, IndexError, ValueError, OSError, AttributeError) as failure:
            text, passed = f"{type(failure).__name__}: {failure}", False
        failed += not passed
        print(f"  {'pass' if passed else 'FAIL'}  {check.__name__}: {check.__doc__}" + (f"\n        {text}" if text else ""))
    if failed:
        print(f"systemd: {failed} of {len(CHECKS)} checks FAILED inside User Mode Linux")
    else:
        print(f"systemd: {len(CHECKS)} checks passed inside User Mode Linux, with the package installed in a booted Debian")
    return failed
