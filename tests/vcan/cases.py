"""The cases of the vcan tests. A case prepares its folder (config, DBC, log to play), lists the steps for the guest, and
judges the result."""

import dataclasses
import json
import lzma
import math
import os
import re
import struct
import subprocess
import sys
import tomllib
import zlib
from pathlib import Path

import numpy as np
import timekeeping
import verdicts
from verdicts import require

HERE = Path(__file__).resolve().parent
SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin")).resolve()
sys.path.insert(0, str(SOURCE / "tests/twin"))
import make_twin  # noqa: E402

RSS_MOST_KB = 12 * 1024
# The blocks, the packer's memory while it packs, and the packed frames of a short case.
CAPTURE_RSS_MOST_KB = 10 * 1024
REST_S, RUN_S, RAMP_S = 2.0, 3.0, make_twin.RAMP_S
# A player that stalls may shorten the rest as received: no motion may reach into the calibration.
STILL_S = REST_S + 1.0
TURN_DPS = 50.0

CONFIG = """\
[[gyro]]
name = "quiet"
bus = "{bus_a}"
dbc = "twin.dbc"
message = "GYRO_A"
rate = "Rate"
temperature = "Temperature"
counter = "Counter"

[[gyro]]
name = "noisy"
bus = "{bus_b}"
dbc = "twin.dbc"
message = "GYRO_B"
rate = "Rate"
temperature = "Temperature"
counter = "Counter"

[calibration]
rest_s = {rest_s}
rate_dps = {rate_dps}

[corrector]
method = "mutual"
window_s = 2.0
order = 0

[output]
bus = "{bus_out}"
fd = {fd}
"""


@dataclasses.dataclass
class Twin:
    """A short version of the paper's experiment: at rest, then turning at a constant rate."""

    bus_a: str = "can0"
    bus_b: str = "can0"
    bus_out: str = "can0"
    fd: bool = False
    still_s: float = STILL_S
    run_s: float = RUN_S
    turn_dps: float = TURN_DPS
    silent_s: tuple = ()  # from, to: gyro B sends nothing

    def prepare(self, folder):
        dbc = (SOURCE / "examples/twin.dbc").read_text(encoding="utf-8")
        if self.fd:
            dbc = dbc.replace("GYRO_A: 8", "GYRO_A: 12")
        (folder / "twin.dbc").write_text(dbc, encoding="utf-8")
        (folder / "vgyro.toml").write_text(CONFIG.format(
            bus_a=self.bus_a, bus_b=self.bus_b, bus_out=self.bus_out, fd=str(self.fd).lower(),
            rest_s=REST_S, rate_dps=make_twin.EARTH_DPS), encoding="utf-8")
        options = make_twin.Options(scenario="turn", rest_s=self.still_s, run_s=self.run_s, turn_dps=self.turn_dps)
        twin = make_twin.simulate(options)
        lines = []
        for stream, bus, fd in zip(twin.streams, (self.bus_a, self.bus_b), (self.fd, False)):
            head, tail = ("##1", "00000000") if fd else ("#", "")
            for us, payload in zip(stream.stamps_us.tolist(), stream.payloads):
                seconds = us * 1e-6 - options.start_s
                if stream.can_id == 0x102 and self.silent_s and self.silent_s[0] <= seconds < self.silent_s[1]:
                    continue
                lines.append((us, f"({us // 1_000_000}.{us % 1_000_000:06}) {bus} {stream.can_id:03X}"
                                  f"{head}{payload.tobytes().hex().upper()}{tail}\n"))
        (folder / "played.log").write_text("".join(text for _, text in sorted(lines)), encoding="ascii")

    def links(self):
        mtu = 72 if self.fd else 16
        return [{"name": name, "mtu": mtu} for name in sorted({self.bus_a, self.bus_b, self.bus_out})]


@dataclasses.dataclass
class Run:
    """The result of a case that the guest has run: the files of its folder, parsed."""

    folder: Path
    result: dict
    inputs: list
    outputs: list
    said: str  # the daemon's log
    ids: tuple = (0x610, 0x611, 0x612)

    def of(self, can_id):
        return [line for line in self.outputs if int(line.name, 16) == can_id]

    def replay(self, *options):
        """Output frames of `vgyro replay` over the captured input frames."""
        log, out = self.folder / "inputs.log", self.folder / "replayed.log"
        log.write_text("".join(line.text for line in self.inputs), encoding="ascii")
        done = subprocess.run([str(BIN / "vgyro"), "replay", "--config", str(self.folder / "vgyro.toml"), *options,
                               "-o", str(out), "--json", str(self.folder / "replay.json"), str(log)],
                              capture_output=True, text=True, check=False)
        require(done.returncode == 0, f"replay failed: {done.stderr.strip()}")
        return verdicts.read_log(out)


def read_run(folder, result, ids=(0x610, 0x611, 0x612)):
    require("failure" not in result, result.get("failure"))
    said = (folder / "vgyrod.err").read_text(encoding="utf-8", errors="replace")
    require(result["ready"], f"not READY within the time; it said: {said.strip()}")
    config = tomllib.loads((folder / "vgyro.toml").read_text(encoding="utf-8"))
    output_bus = config["output"]["bus"]
    inputs, outputs = [], []
    for line in verdicts.read_log(folder / "capture.log"):
        own = line.bus == output_bus and len(line.name) == 3 and int(line.name, 16) in ids
        (outputs if own else inputs).append(line)
    return Run(folder, result, inputs, outputs, said, ids)


def check_life(run):
    """READY, STOPPING, exit code, and the watchdog fed throughout."""
    texts = [text for _, text in run.result["notices"]]
    require(texts[0].startswith("READY=1"), f"first notice: {texts[0]!r}")
    require(texts[-1].startswith("STOPPING=1"), f"last notice: {texts[-1]!r}")
    require(run.result["exit"] == 0, f"exit {run.result['exit']!r}; it said: {run.said.strip()}")
    lived_s = run.result["notices"][-1][0] - run.result["notices"][0][0]
    require(texts.count("WATCHDOG=1") >= int(lived_s / 2), f"watchdog fed {texts.count('WATCHDOG=1')} times in {lived_s:.1f} s")


def check_service(run):
    """check_life(), the daemon's log, and its memory."""
    check_life(run)
    require("stopped: " in run.said, f"no summary; it said: {run.said.strip()}")
    require("with our identifiers" not in run.said, f"heard itself: {run.said.strip()}")
    resident = run.result["resources"]["rss_most_kb"]
    require(resident <= RSS_MOST_KB, f"{resident} kB resident, more than {RSS_MOST_KB}")


def check_played(run):
    """The capture holds every frame that was played, in order; otherwise nothing can be compared."""
    played = verdicts.read_log(run.folder / "played.log")
    for bus in {line.bus for line in played}:
        sent = [line.content for line in played if line.bus == bus]
        seen = [line.content for line in run.inputs if line.bus == bus]
        require(sent == seen, f"{bus}: {len(sent)} frames played, {len(seen)} captured, or changed on the way")


def check_against_replay(run, *options):
    rate_id = run.ids[0]
    replayed = run.replay(*options)
    replayed_rates = [line for line in replayed if int(line.name, 16) == rate_id]
    require(len(replayed_rates) > 0, "the replay sends no rates")
    verdicts.check_same_rates(run.of(rate_id), replayed_rates)
    verdicts.check_same_sequence(run.outputs, replayed, rate_id)
    for can_id in run.ids:
        verdicts.check_protection(run.of(can_id), can_id)
    return len(replayed_rates)


def check_truth(run, oracle):
    """The decoded rate against the known truth, wherever that is constant."""
    t, rate, state = verdicts.rates_of(run.of(0x610), oracle)
    since = t - run.inputs[0].us * 1e-6
    resting = (since > 1.0) & (since < REST_S - 0.2)
    turning = (since > STILL_S + RAMP_S + 0.5) & (since < STILL_S + RAMP_S + RUN_S - 0.5)
    require(np.isnan(rate[resting]).all() and set(state[resting]) == {1}, "valid rates while calibrating")
    require(np.isfinite(rate[turning]).all() and set(state[turning]) == {2}, "not running while turning")
    error = rate[turning] - (TURN_DPS + make_twin.EARTH_DPS)
    # The noise of the mean of both gyros at 500 Hz is 3.5e-3 deg/s; the mean of the uncorrected biases is 1.3e-2 deg/s.
    require(abs(error.mean()) < 1e-3, f"mean error {error.mean():.5f} deg/s")
    require(2.5e-3 < error.std() < 5e-3, f"noise {error.std():.5f} deg/s")
    return f"mean error {error.mean() * 3600:+.1f} deg/h"


class TwinCase:
    def __init__(self, name, says, twin, dbc="dbc/vgyro.dbc", check_more=None):
        self.name, self.says, self.twin, self.dbc = name, says, twin, dbc
        self.check_more = check_more or (lambda run, oracle: check_truth(run, oracle))

    def prepare(self, folder):
        self.twin.prepare(folder)
        return {"links": self.twin.links(), "steps": [["play", str(folder / "played.log")]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        rates = check_against_replay(run)
        require("running" in " ".join(text for _, text in result["notices"]), "STATUS never said running")
        more = self.check_more(run, verdicts.Oracle(SOURCE / self.dbc))
        return f"{rates} rates as in the replay, {more}, {describe(run)}"


def describe(run):
    used = run.result["resources"]
    return f"{used['rss_most_kb'] / 1024:.1f} MB, {used['cpu_s']:.2f} s CPU"


def check_silent(run, oracle):
    """Degraded while gyro B is silent, running again afterwards, valid throughout."""
    _, rate, state = verdicts.rates_of(run.of(0x610), oracle)
    order = [int(s) for i, s in enumerate(state) if i == 0 or s != state[i - 1]]
    require(order == [1, 2, 3, 2], f"states {order}")
    require(np.isfinite(rate[state > 1]).all(), "invalid rates after the calibration")
    require("degraded" in run.said, "the silence was not logged")
    return f"{int((state == 3).sum())} of them from one gyro alone"


def check_fd(run, oracle):
    require(all(line.fd and len(line.data) == 32 for line in run.of(0x610)), "VG_Rate is not FD")
    require(any(line.fd for line in run.inputs), "no FD input was played")
    return check_truth(run, oracle)


class SlowBusCase:
    """The output bus takes less than the gateway sends: with tbf, send() fails with ENOBUFS while poll reports writable."""

    name = "slow_bus"
    says = "output bus behind a token bucket: survives, sends in time or not at all"
    patience_us = 20_000

    def __init__(self):
        self.twin = Twin(bus_out="can1", run_s=0.0)

    def prepare(self, folder):
        self.twin.prepare(folder)
        qdisc = "tc qdisc add dev can1 root tbf rate 24kbit burst 200 limit 64".split()
        return {"links": self.twin.links(), "after_links": [qdisc], "steps": [["play", str(folder / "played.log")]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        counts = {name: int(count) for count, name in re.findall(r"(\d+) (frames out|stale|overflowed|retries)", run.said)}
        require(counts["frames out"] == len(run.outputs), f"says {counts}, captured {len(run.outputs)}")
        require(counts["stale"] > 500 and counts["retries"] > 100, f"the bus was not slow: {counts}")
        require("did not take them in time" in run.said, "the loss was not logged")
        live = [verdicts.without_protection(line) for line in run.of(0x610)]
        whole = [verdicts.without_protection(line) for line in run.replay() if line.name == "610"]
        require(len(live) > 200, f"only {len(live)} rates got through")
        require(verdicts.is_subsequence(live, whole), "rates out of order, or not those of the replay")
        self.check_lateness(run)
        return f"{len(live)} of {len(whole)} rates sent, {counts['stale']} dropped as stale, {describe(run)}"

    def check_lateness(self, run):
        replayed = verdicts.read_log(run.folder / "replayed.log")
        cause = {line.data: line.us for line in replayed if line.name == "610"}
        late = [line.us - cause[line.data] for line in run.of(0x610) if line.data in cause]
        require(len(late) > 200, "too few rates to judge")
        # The guest has one processor for canplayer, candump and the gateway: 30 ms of grace.
        late_most = np.percentile(late, 95)
        require(late_most < self.patience_us + 30_000, f"5 % of the rates went out {late_most / 1000:.1f} ms late")


class LinkFaultsCase:
    """The interface of the output goes down and up, then that of the inputs is deleted and created again, while the gyros
    go on."""

    name = "link_faults"
    says = "links down and up, deleted and made anew: no restart, no stale burst"

    def __init__(self):
        self.twin = Twin(bus_out="can1", still_s=0.5, run_s=0.0)

    def prepare(self, folder):
        self.twin.prepare(folder)
        log = ["play", str(folder / "played.log")]
        batch = folder / "links"
        batch.write_text("link del can0\nlink add can0 mtu 16 type vcan\nlink set can0 up\n", encoding="ascii")
        pause = ["wait", 0.5]
        steps = [log, pause, ["run", ["ip", "link", "set", "can1", "down"]], log,
                 ["run", ["ip", "link", "set", "can1", "up"]], ["until_said", "can1: link is up again"], pause, log,
                 ["run", ["ip", "-batch", str(batch)]], ["until_said", "can0: open again"], pause, log]
        return {"links": self.twin.links(), "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        for text in ("can1: link went down", "can1: link is up again", "can0: the interface was removed",
                     "can0: open again"):
            require(text in run.said, f"not logged: {text}\n{run.said}")
        plays = np.array([line.us for line in run.inputs if line.name == "101"])
        begins = np.concatenate([plays[:1], plays[1:][np.diff(plays) > 400_000]])
        require(len(begins) >= 4, f"{len(begins)} plays seen")
        rates = np.array([line.us for line in run.of(0x610)])
        per_play = [int(((rates >= a) & (rates < b)).sum()) for a, b in zip(begins, [*begins[1:], 1 << 62])]
        require(min(per_play[0], *per_play[2:]) > 600, f"rates in each play: {per_play}")
        require(per_play[1] < 30, f"{per_play[1]} rates out of a link that was down")
        for can_id in run.ids:
            for line in run.of(can_id):
                verdicts.check_crc(line, can_id)
        stale = int(re.search(r"(\d+) stale", run.said).group(1))
        require(stale > 600, f"{stale} frames dropped as stale while the link was down")
        return f"rates in the four plays: {per_play}, {stale} dropped as stale, {describe(run)}"


class FrozenCase:
    """The process is stopped amid traffic and continued: frames that came meanwhile are old, and cause no output."""

    # A rate goes out at most 250 ms late; the rest is the time that the harness takes to send the signals.
    late_most_us = 250_000 + 30_000

    def __init__(self, name, says, frozen_s, run_s):
        self.name, self.says = name, says
        self.frozen_s, self.run_s = frozen_s, run_s

    def prepare(self, folder):
        twin = Twin(run_s=self.run_s)
        twin.prepare(folder)
        return {"links": twin.links(),
                "steps": [["play_and_freeze", [str(folder / "played.log"), STILL_S + RAMP_S + 1.0, self.frozen_s]]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        begin_us, end_us = result["frozen_us"]
        live, replayed = run.of(0x610), [line for line in run.replay() if line.name == "610"]
        require(not [line for line in live if begin_us + 50_000 < line.us < end_us], "it was not stopped")
        require(verdicts.is_subsequence([line.content for line in live], [line.content for line in replayed]),
                "rates that are not in the replay, or not in this order")
        # Some of the many dropped rates equal one that went out; the newest equal one may be its origin.
        causes = {}
        for line in replayed:
            causes.setdefault(line.content, []).append(line.us)
        worst_us = max(min(line.us - us for us in causes[line.content] if us <= line.us) for line in live)
        require(worst_us < self.late_most_us, f"a rate went out {worst_us / 1000:.0f} ms after the frame that caused it")
        dropped = len(replayed) - len(live)
        least = 0.8 * (self.frozen_s - 0.25) * len(replayed) / (STILL_S + RAMP_S + self.run_s)
        require(dropped > least, f"{dropped} rates dropped")
        stale = int(re.search(r"(\d+) stale", run.said).group(1))
        require(stale >= dropped, f"{stale} told as stale")
        require("a stamp that is not the time of their arrival" not in run.said, f"true stamps were replaced\n{run.said}")
        return f"{dropped} rates dropped as stale, the oldest sent after {worst_us / 1000:.0f} ms, {describe(run)}"


class AbsentCase:
    """Started before its interfaces exist: the gateway waits, and needs no restart when they appear."""

    name = "absent"
    says = "interfaces that come seconds after the start: waits, then as the replay"

    def __init__(self):
        self.twin = Twin(bus_b="can1", bus_out="can2", run_s=0.0)

    def prepare(self, folder):
        self.twin.prepare(folder)
        links = [{**link, "absent": True} for link in self.twin.links()]
        batch = folder / "links"
        batch.write_text("".join(f"link add {link['name']} mtu 16 type vcan\nlink set {link['name']} up\n"
                                 for link in links), encoding="ascii")
        steps = [["wait", 2.5], ["run", ["ip", "-batch", str(batch)]],
                 *(["until_said", f"{link['name']}: bound"] for link in links), ["play", str(folder / "played.log")]]
        return {"links": links, "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        for bus in ("can0", "can1", "can2"):
            lines = re.findall(rf"{bus}: no such interface; .*ip link add {bus} type vcan", run.said)
            require(len(lines) == 1, f"{bus} was missed {len(lines)} times\n{run.said}")
            require(f"{bus}: bound" in run.said, f"{bus} was not bound\n{run.said}")
        require(any("can0 is not there" in text for _, text in result["notices"]), "STATUS did not say so")
        # The heartbeats of the first seconds had no bus: their counters are spent.
        replayed = [line for line in run.replay() if line.name == "610"]
        verdicts.check_same_rates(run.of(0x610), replayed)
        verdicts.check_protection(run.of(0x610), 0x610)
        require(len(replayed) > 1000 and run.of(0x611), "no rates, or no heartbeat")
        return f"{len(replayed)} rates as in the replay, {describe(run)}"


class RenamedCase:
    """Interfaces are renamed while the gateway runs: one before it was ever up, two others swap their names, as udev does. All
    before the first frame, because candump keeps the name under which it first received from an interface."""

    name = "renamed"
    says = "interfaces are renamed, and two swap their names: the gateway follows the names, and what is renamed is let go"

    def prepare(self, folder):
        twin = Twin(bus_a="can0", bus_b="can1", bus_out="can2", run_s=0.0)
        twin.prepare(folder)
        batch = folder / "links"
        batch.write_text("link set can0 name can9\nlink set can9 up\nlink add can0 mtu 16 type vcan\nlink set can0 up\n"
                         "link set can1 down\nlink set can1 name swap\nlink set can2 name can1\n"
                         "link set swap name can2\nlink set can1 up\nlink set can2 up\n", encoding="ascii")
        steps = [["run", ["ip", "-batch", str(batch)]],
                 *(["until_said", f"{link['name']}: open again"] for link in twin.links()), ["wait", 0.5],
                 ["play", str(folder / "played.log")]]
        return {"links": [*twin.links(), {"name": "can9", "absent": True}], "steps": steps,
                "after_links": ["ip link set can0 down".split(), "ip link set can2 down".split()],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        for before, now in (("can0", "can9"), ("can1", "can2"), ("can2", "can1")):
            line = f"{before}: the interface is now called {now}; looking for {before} again"
            require(run.said.count(line) == 1, f"{run.said.count(line)} times: {line}\n{run.said}")
        require("link is up again" not in run.said, run.said)
        check_played(run)
        # The heartbeats of the first seconds had no bus: their counters are spent.
        replayed = [line for line in run.replay() if line.name == "610"]
        verdicts.check_same_rates(run.of(0x610), replayed)
        verdicts.check_protection(run.of(0x610), 0x610)
        require(len(replayed) > 1000, f"{len(replayed)} rates")
        require(not [line for line in run.inputs if line.name in ("610", "611", "612") and line.bus == "can9"],
                "frames went out on what was renamed")
        return f"{len(replayed)} rates as in the replay, {describe(run)}"


class FlappingCase:
    """The link of the output goes down and up repeatedly, while frames go out."""

    name = "flapping"
    says = "the output's link goes down 30 times amid traffic: each is counted, and the rates go on"
    times = 30

    def prepare(self, folder):
        twin = Twin(bus_out="can1")
        twin.prepare(folder)
        flaps = ["can1", self.times, 0.04]
        return {"links": twin.links(), "steps": [["play_and_flap", [str(folder / "played.log"), 0.5, flaps]], ["wait", 6.0]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml"), "--metrics", "{memory}/state.toml.prom"]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        downs = metric(folder, "vgyro_bus_link_downs_total", 'bus="can1"')
        require(downs == self.times, f"{downs:g} of {self.times} counted")
        require(metric(folder, "vgyro_bus_link_downs_total", 'bus="can0"') == 0, "the other link counts too")
        rates = len(run.of(0x610))
        samples = len([line for line in run.inputs if line.name == "102"])
        # The link was down for some 1.2 s in all.
        require(rates > 0.5 * samples, f"{rates} rates of {samples} samples")
        return f"{downs:g} downs counted, {rates} rates of {samples} samples, {describe(run)}"


def metric(folder, name, labels=None):
    """A value of the metrics file that the daemon left."""
    text = (folder / "state.toml.prom").read_text(encoding="ascii")
    found = re.search(rf"^{name}{re.escape('{' + labels + '}') if labels else ''} (\S+)$", text, re.MULTILINE)
    require(found, f"no {name} in the metrics")
    return float(found.group(1))


class LaunchTimeCase:
    """The frames of both gyros carry a launch time on the monotonic clock, which every receiver gets as the time of arrival."""

    name = "launch_time"
    says = "frames with a launch time (SO_TXTIME) on another clock: the time of reading stands in, and it is said"

    def prepare(self, folder):
        twin = Twin()
        twin.prepare(folder)
        player = [str(HERE / "launch_player.py"), str(folder / "played.log")]
        return {"links": twin.links(), "steps": [["run_meanwhile", ["/usr/bin/python3", *player]], ["wait", 6.0]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml"), "--metrics", "{memory}/state.toml.prom"]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        require(max(line.us for line in run.inputs) < 1e15 < min(line.us for line in run.outputs),
                "the kernel did not hand the launch times on")
        said = re.findall(r"can0: \d+ frames had a stamp that is not the time of their arrival", run.said)
        require(len(said) == 1, f"said {len(said)} times\n{run.said}")
        require("did not take them in time" not in run.said, f"the bus was blamed\n{run.said}")
        restamped = metric(folder, "vgyro_bus_restamped_frames_total", 'bus="can0"')
        require(restamped == len(run.inputs), f"{restamped:g} of {len(run.inputs)} frames counted")
        rates, samples = run.of(0x610), len([line for line in run.inputs if line.name == "102"])
        require(len(rates) > 0.9 * samples, f"{len(rates)} rates of {samples} samples")
        _, rate, state = verdicts.rates_of(rates, verdicts.Oracle(SOURCE / "dbc/vgyro.dbc"))
        order = [int(s) for i, s in enumerate(state) if i == 0 or s != state[i - 1]]
        require(order == [1, 2], f"states {order}")
        turning = rate[-int(0.3 * RUN_S / (STILL_S + RAMP_S + RUN_S) * len(rate)):]
        error = float(np.mean(turning)) - (TURN_DPS + make_twin.EARTH_DPS)
        require(abs(error) < 1e-3, f"mean error {error:.5f} deg/s")
        return f"{len(rates)} rates of {samples} samples, mean error {error * 3600:+.1f} deg/h, {describe(run)}"


class UnreadNoticesCase:
    """The service manager stops reading after READY: its socket is full within seconds."""

    name = "unread_notices"
    says = "the service manager does not read its socket: rates and SIGTERM as ever"

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        # Two messages a second into a queue of ten.
        return {"links": twin.links(),
                "steps": [["stop_reading_notices", None], ["wait", 7.0], ["play", str(folder / "played.log")], ["wait", 5.0]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml"), "--metrics", "{memory}/state.toml.prom"]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        require(result["exit"] == 0, f"exit {result['exit']!r}; it said: {run.said.strip()}")
        lost = metric(folder, "vgyro_service_messages_lost_total")
        require(lost > 5, f"the socket was never full: {lost:g} messages lost")
        require(not any(text.startswith("STOPPING=1") for _, text in result["notices"]), "somebody has read")
        require("stopped: " in run.said, run.said)
        check_played(run)
        return f"{check_against_replay(run)} rates as in the replay, {lost:g} messages not taken, {describe(run)}"


class LateFdCase:
    """A bound link is given the MTU of CAN XL, which carries FD frames, while it is down."""

    name = "late_fd"
    says = "a link that is made a CAN XL one after it was bound: FD in and out"

    def prepare(self, folder):
        twin = Twin(fd=True, run_s=0.0)
        twin.prepare(folder)
        batch = folder / "links"
        batch.write_text("link set can0 mtu 2060\nlink set can0 up\n", encoding="ascii")
        steps = [["run", ["ip", "-batch", str(batch)]], ["until_said", "can0: link is up again, CAN FD"],
                 ["play", str(folder / "played.log")]]
        return {"links": [{"name": "can0", "mtu": 16}], "after_links": ["ip link set can0 down".split()], "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        check_played(run)
        replayed = [line for line in run.replay() if line.name == "610"]
        verdicts.check_same_rates(run.of(0x610), replayed)
        require(len(replayed) > 1000 and all(line.fd for line in run.of(0x610)), f"{len(replayed)} rates, not all FD")
        return f"{len(replayed)} rates as in the replay, {describe(run)}"


class DeadBusCase:
    """One interface is down, the other does not exist: the gateway has nothing to do, and must do nothing."""

    name = "dead_bus"
    says = "an output that is down and an input that is not there: no busy loop"
    seconds = 6.0

    def prepare(self, folder):
        twin = Twin(bus_a="can0", bus_b="can1", bus_out="can1")
        twin.prepare(folder)
        links = [{"name": "can0", "absent": True}, {"name": "can1"}]
        return {"links": links, "after_links": ["ip link set can1 down".split()], "steps": [["wait", self.seconds]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        require("can1: link is down" in run.said, run.said)
        require(any("can0 is not there; can1 is down" in text for _, text in result["notices"]), "STATUS did not say so")
        used, wake_ups = (result["resources"][what] - result["resources_at_start"][what] for what in ("cpu_s", "wake_ups"))
        # Ten heartbeats a second that no bus takes, each dropped when it is stale, and the work of each second.
        require(wake_ups <= 40 * self.seconds, f"woke up {wake_ups} times in {self.seconds:g} s")
        # A busy loop would take all of it. In a guest a system call costs twenty times as much, more on a busy host: each
        # wake-up may take some milliseconds.
        require(used <= 0.1 * self.seconds, f"{used:.2f} s of processor time in {self.seconds:g} s")
        return f"{wake_ups / self.seconds:.0f} wake-ups a second, {used / self.seconds:.1%} of a processor, {describe(run)}"


class ErrorFramesCase:
    """A peer sends the error frames that a driver in trouble would; vcan passes them to sockets that asked for them."""

    name = "error_frames"
    says = "error frames: bus-off, restart, error-passive, arbitration in log and status"
    played = [(0x004, "0010000000000000"),  # receiver passive
              (0x040, "0000000000000000"),  # bus-off
              (0x002, "0B00000000000000"),  # lost arbitration in bit 11
              (0x100, "0000000000000000")]  # restarted

    def prepare(self, folder):
        Twin().prepare(folder)
        lines = [f"({1_700_000_000 + 1.4 * i:.6f}) can0 {0x20000000 | number:08X}#{data}\n"
                 for i, (number, data) in enumerate(self.played)]
        (folder / "errors.log").write_text("".join(lines), encoding="ascii")
        return {"links": Twin().links(), "steps": [["play", str(folder / "errors.log")], ["wait", 1.5]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        for text in ("can0: error-passive once", "can0: bus-off: wiring", "lost the arbitration", "back on the bus"):
            require(text in run.said, f"not logged: {text}\n{run.said}")
        statuses = [text for _, text in result["notices"]]
        for text in ("can0 is error-passive", "can0 is bus-off"):
            require(any(text in status for status in statuses), f"STATUS never said {text}: {statuses}")
        require("bus-off" not in [s for s in statuses if s.startswith("STATUS=")][-2], "still bus-off after the restart")
        require("(0 lost by the kernel)" in run.said and "stopped: 0 frames in" in run.said, run.said)
        return describe(run)


class ShadowCase:
    """`[output] transmit = false`: everything but sending, until a reload ends it; another sender uses our identifier."""

    name = "shadow"
    says = "shadow mode: all is computed, nothing is sent; a stranger is seen all the same; a reload ends it"

    def prepare(self, folder):
        Twin().prepare(folder)
        config = (folder / "vgyro.toml").read_text(encoding="utf-8")
        # Appended to [output], which is the last table.
        (folder / "vgyro.toml").write_text(config + "transmit = false\n", encoding="utf-8")
        (folder / "loud.toml").write_text(config, encoding="utf-8")
        (folder / "stranger.log").write_text("(1700000000.000000) can0 610#0011223344556677\n", encoding="ascii")
        return {"links": Twin().links(),
                "steps": [["play", str(folder / "played.log")], ["play", str(folder / "stranger.log")], ["wait", 2.5],
                          ["run", ["mv", str(folder / "loud.toml"), str(folder / "vgyro.toml")]], ["reload", None],
                          ["wait", 1.0]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_life(run)
        require(len(result["reloads_us"]) == 1, f"{len(result['reloads_us'])} reloads")
        before = [line for line in run.outputs if line.us < result["reloads_us"][0]]
        require(len(before) == 1 and "0011223344556677" in before[0].text, f"{len(before)} frames in shadow mode")
        require(len(run.outputs) > 5, "nothing is sent after the reload either")
        require(run.said.count("shadow mode: everything but sending is done") == 1, run.said)
        require("came from another sender" in run.said, f"the stranger was not seen\n{run.said}")
        counts = re.search(r"(\d+) virtual rates \((\d+) valid\), .* (\d+) not sent in shadow mode", run.said)
        require(counts and int(counts[2]) > 500 and int(counts[3]) > int(counts[1]), run.said)
        quiet = [text for _, text in result["notices"] if text.startswith("STATUS=running")]
        require(any(text.endswith("; shadow mode: nothing is sent") for text in quiet), f"STATUS: {quiet}")
        return f"{counts[3]} frames not sent, then {len(run.outputs) - 1} sent"


class ReloadCase:
    """SIGHUP, three times: amid traffic, with a bad configuration, with another window and output."""

    name = "reload"
    says = "configuration read again: biases and counters go on; a bad one is refused"
    more = ["--method", "optimal"]

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        (folder / "bad.toml").write_text(text.replace('rate = "Rate"', 'rate = "Rat"', 1), encoding="utf-8")
        (folder / "other.toml").write_text(text.replace("[output]", "[output]\nbias_id = 0x613", 1).replace(
            "window_s = 2.0", "window_s = 3.0", 1), encoding="utf-8")
        (folder / "good.toml").write_text(text, encoding="utf-8")
        def take(name):
            return ["run", ["cp", str(folder / name), str(config)]]
        whole, rest = folder / "played.log", folder / "rest.log"
        lines = whole.read_text(encoding="ascii").splitlines(keepends=True)
        rest.write_text("".join(lines[:int(len(lines) * REST_S / (STILL_S + RAMP_S))]), encoding="ascii")
        log, pause = ["play", str(rest)], ["wait", 0.6]
        steps = [["play_and_reload", [str(whole), STILL_S]], pause, take("bad.toml"), ["reload", None], log, pause,
                 take("other.toml"), ["reload", None], log, take("good.toml")]
        return {"links": twin.links(), "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(config), *self.more]}

    def judge(self, folder, result):
        run = read_run(folder, result, ids=(0x610, 0x611, 0x612, 0x613))
        check_service(run)
        for text in ("its gyros are the same: nothing was interrupted", "in use, with what was learned"):
            require(run.said.count(text) == 1, f"{text}: {run.said.count(text)} times\n{run.said}")
        line = 1 + (folder / "good.toml").read_text(encoding="utf-8").splitlines().index('rate = "Rate"')
        require(re.search(rf'vgyro\.toml:{line}: .*"Rat".*Rate', run.said), f"no place and remedy\n{run.said}")
        require("the new configuration is refused; the old one stays in force" in run.said, run.said)
        statuses = [text for _, text in result["notices"]]
        require(any("the new configuration was refused" in text for text in statuses), "STATUS did not say so")
        times = [text for text in statuses if re.match(r"RELOADING=1\nMONOTONIC_USEC=\d+", text)]
        require(len(times) == 3, f"{len(times)} notices of a reload: {statuses}")
        # Receivers see one stream: every CRC is right, and every counter follows the one before.
        verdicts.check_protection(run.of(0x610), 0x610)
        verdicts.check_protection(run.of(0x612), 0x612)
        verdicts.check_protection(run.of(0x613), 0x613)
        begins = self.begins(run)
        require(len(begins) == 3, f"{len(begins)} plays seen")
        require(not [x for x in run.of(0x611) if x.us > begins[2]] and run.of(0x613), "the other identifier is not used")
        t, rate, state = verdicts.rates_of(run.of(0x610), verdicts.Oracle(SOURCE / "dbc/vgyro.dbc"))
        require((np.diff(t) > 0).all(), "an instant twice")
        first = (t > begins[0] * 1e-6 + REST_S + 0.5) & (t < begins[1] * 1e-6)
        require(np.isfinite(rate[first]).all() and set(state[first]) <= {2, 3}, "not valid after the reload amid traffic")
        since, until = result["reloads_us"][0] - 50_000, result["reloads_us"][0] + 150_000
        samples = sum(line.name == "102" and since <= line.us < until for line in run.inputs)
        missed = samples - int(((t >= since * 1e-6) & (t < until * 1e-6)).sum())
        # A host that stalls at this moment costs some of them.
        require(missed <= 90, f"{missed} of {samples} rates missed in the reload amid traffic")
        errors = []
        for begin in begins[1:]:
            resting = (t > begin * 1e-6 + 0.1) & (t < begin * 1e-6 + REST_S - 0.2)
            require(np.isfinite(rate[resting]).all() and set(state[resting]) == {2}, "not valid after a reload")
            errors.append(float((rate[resting] - make_twin.EARTH_DPS).mean()))
        # The error of a bias from two seconds of rest, and the noise of the better gyro at 500 Hz.
        require(max(map(abs, errors)) < 1e-3, f"mean errors {errors} deg/s")
        return f"{missed} rates missed amid traffic, valid from the first pair after each, mean errors {[f'{e * 3600:+.1f}' for e in errors]} deg/h, {describe(run)}"

    @staticmethod
    def begins(run):
        plays = np.array([line.us for line in run.inputs if line.name == "101"])
        return np.concatenate([plays[:1], plays[1:][np.diff(plays) > 400_000]])


class SlowReloadCase:
    """SIGHUP with a pipe as DBC file, then, amid traffic, with a file that takes long to read."""

    name = "slow_reload"
    says = "a pipe as DBC is refused; while a large DBC is read the rates go on"
    messages = 60_000
    limits = []  # command that starts the gateway with limits

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        os.mkfifo(folder / "pipe.dbc")
        small = (folder / "twin.dbc").read_text(encoding="utf-8")
        more = "".join(f'BO_ {0x80000000 + 0x10000 + i} MORE_{i}: 8 OTHER\n'
                       f' SG_ Value : 0|32@1- (0.001,0) [-1000|1000] "m" Vector__XXX\n\n' for i in range(self.messages))
        (folder / "large.dbc").write_text(small + "\n" + more, encoding="utf-8")
        for name in ("pipe", "large"):
            (folder / f"{name}.toml").write_text(text.replace("twin.dbc", f"{name}.dbc"), encoding="utf-8")
        def take(name):
            return ["run", ["cp", str(folder / name), str(config)]]
        steps = [take("pipe.toml"), ["reload", None], take("large.toml"),
                 ["play_and_reload", [str(folder / "played.log"), STILL_S]]]
        return {"links": twin.links(), "steps": steps,
                "command": self.limits + [str(BIN / "vgyrod"), "--config", str(config), "--method", "optimal"]}

    def check_outcome(self, run):
        require(run.said.count("the new configuration is refused") == 1, run.said)
        require("its gyros are the same: nothing was interrupted" in run.said, run.said)

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_life(run)
        require("pipe.dbc: is a pipe" in run.said, f"the pipe was not refused\n{run.said}")
        self.check_outcome(run)
        verdicts.check_protection(run.of(0x610), 0x610)
        begin_s = [t for t, text in result["notices"] if text.startswith("RELOADING=1")][1]
        took_s = [t for t, text in result["notices"] if text.startswith("READY=1") and t > begin_s][0] - begin_s
        since = result["reloads_us"][1]
        until = since + int(took_s * 1e6)
        samples = sum(line.name == "102" and since <= line.us < until for line in run.inputs)
        rates = sum(since <= line.us < until for line in run.of(0x610))
        require(samples > 20, f"the large file took no time: {samples} samples came meanwhile")
        require(rates >= 0.8 * samples, f"{rates} rates of {samples} samples while the file was read")
        return f"{rates} rates of {samples} samples while the file was read, {describe(run)}"


class ShortMemoryCase(SlowReloadCase):
    """As above, but there is not enough memory for the large file."""

    name = "short_memory"
    says = "a DBC that the memory is too short for is refused; the rates go on"
    limits = ["sh", "-c", 'ulimit -v 60000; exec "$@"', "limited"]

    def check_outcome(self, run):
        require("there is not enough memory to read the configuration" in run.said, run.said)
        require(run.said.count("the new configuration is refused") == 2, run.said)


class UnreadLogCase:
    """stderr is a pipe that nothing reads, and the log is long: the bus shows no effect."""

    name = "unread_log"
    says = "stderr is a full pipe that nobody reads: rates, watchdog and SIGTERM as ever"
    filled_bytes = 60000  # of 65536
    refusals = 50  # each logged in ten lines or more

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        (folder / "good.toml").write_text(text, encoding="utf-8")
        wrong = "".join(f"no_such_key_{i} = {i}\n" for i in range(10))
        (folder / "bad.toml").write_text(wrong + text, encoding="utf-8")
        def take(name):
            return ["run", ["cp", str(folder / name), str(config)]]
        script = (f"mkfifo {{memory}}/unread; exec 3<>{{memory}}/unread; rm {{memory}}/unread; "
                  f"head -c {self.filled_bytes} /dev/zero >&3; exec {BIN / 'vgyrod'} --config {config} --metrics {{memory}}/state.toml.prom 2>&3")
        steps = [take("bad.toml"), *[["reload", None]] * self.refusals, take("good.toml"), ["play", str(folder / "played.log")],
                 ["wait", 2.0]]
        return {"links": twin.links(), "steps": steps, "command": ["/bin/sh", "-c", script]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_life(run)
        check_played(run)
        rates = check_against_replay(run)
        metrics = (folder / "state.toml.prom").read_text(encoding="ascii")
        lost = int(re.search(r"^vgyro_log_lines_lost_total (\d+)$", metrics, re.MULTILINE).group(1))
        require(lost > 100, f"{lost} lines counted as lost")
        return f"{rates} rates as in the replay, {lost} lines lost, {describe(run)}"


class SharedCase:
    """A second gateway on the same state file, and another sender of one of our identifiers."""

    name = "shared"
    says = "a second gateway on the state file does not start; foreign frames with our identifiers are told"

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        command = [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml"), "--state", "{memory}/state.toml"]
        second = f"{' '.join(command)} 2>{folder}/second.err; test $? = 1"
        foreign = ["run", ["cansend", "can0", "610#0011223344556677"]]
        steps = [["run", ["sh", "-c", second]], ["play", str(folder / "played.log")], ["reload", None],
                 ["wait", 3.0], foreign, ["until_said", "with our identifiers"]]
        return {"links": twin.links(), "steps": steps, "command": command}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_life(run)
        second = (folder / "second.err").read_text(encoding="utf-8")
        require(re.search(r"state\.toml: another gateway keeps its biases there \(process \d+\); .*--state FILE", second), second)
        require("can0: 1 frames with our identifiers came from another sender" in run.said, run.said)
        require(not (folder / "state.toml.lock").exists(), "the lock file was left behind")
        statuses = [text for _, text in result["notices"]]
        require(any("another sender uses our identifiers on can0" in text for text in statuses), f"{statuses}")
        return describe(run)


class RestartCase:
    """Killed after the calibration and started again: the gateway goes on with its biases."""

    name = "restart"
    says = "killed and started again with its state file: valid from the first pair, as the replay with that file"
    more = ["--method", "optimal"]

    def prepare(self, folder):
        twin = Twin(run_s=0.0)
        twin.prepare(folder)
        state, kept = "{memory}/state.toml", folder / "kept.toml"
        log = ["play", str(folder / "played.log")]
        steps = [log, ["wait", 0.5], ["kill_and_restart", None], ["run", ["cp", state, str(kept)]], log]
        return {"links": twin.links(), "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml"), *self.more, "--state", state]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        kept = self.check_file(folder / "kept.toml")
        since = result["restarts_us"][0]
        run.inputs = [line for line in run.inputs if line.us >= since]
        run.outputs = [line for line in run.outputs if line.us >= since]
        require("restored the biases saved" in run.said, f"taking up was not logged\n{run.said}")
        rates = check_against_replay(run, *self.more, "--state", str(folder / "kept.toml"))
        oracle = verdicts.Oracle(SOURCE / "dbc/vgyro.dbc")
        t, rate, state = verdicts.rates_of(run.of(0x610), oracle)
        require(np.isfinite(rate).all() and set(state) == {2}, "a rate that is not valid after the restart")
        resting = t - run.inputs[0].us * 1e-6 < REST_S
        error = rate[resting] - make_twin.EARTH_DPS
        # The error of the bias from the first two seconds of rest, and the noise of the better gyro at 500 Hz.
        require(abs(error.mean()) < 1e-3, f"mean error {error.mean():.5f} deg/s after the restart")
        self.check_file(folder / "state.toml")
        require(not (folder / "state.toml.new").exists(), "the writer left something behind")
        return (f"{rates} rates as in the replay, all valid, biases {kept['drift']['bias_dps']} deg/s kept, "
                f"mean error {error.mean() * 3600:+.1f} deg/h, {describe(run)}")

    def check_file(self, path):
        """Checks the checksum and the form of the state file with Python's own readers."""
        require(path.exists(), f"{path.name} was not written")
        data = path.read_bytes()
        content, _, _ = data.rpartition(b"\n[checksum]\n")
        read = tomllib.loads(data.decode("ascii"))
        require(read["checksum"]["crc32"] == f"{zlib.crc32(content):08x}", f"{path.name}: another checksum")
        require(path.stat().st_mode & 0o777 == 0o600, f"{path.name}: mode {path.stat().st_mode:o}")
        # Six standard errors of the noisier gyro's mean over the calibration.
        truth = [gyro.bias_dps for gyro in make_twin.GYROS]
        require(np.allclose(read["drift"]["bias_dps"], truth, rtol=0, atol=1.3e-3), f"biases {read['drift']['bias_dps']}")
        return read


class InheritedCase:
    """Two reloads without a sample between them; then one that needs a new calibration, while the platform turns."""

    name = "inherited"
    says = "biases outlive reloads in a row, and a steady turn that is calibrated as rest does not replace them"
    new_rate_dps = make_twin.EARTH_DPS + 0.001

    def prepare(self, folder):
        twin = Twin(turn_dps=2.0)  # a faster turn is no plausible bias of two gyros, and would be refused for the calibration
        twin.prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        for name, old, new in (("longer", f"rest_s = {REST_S}", f"rest_s = {REST_S + 0.5}"), ("same", "", ""),
                               ("moved", f"rate_dps = {make_twin.EARTH_DPS}", f"rate_dps = {self.new_rate_dps}")):
            require(old in text, f"{old} is not in the configuration")
            (folder / f"{name}.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
        lines = (folder / "played.log").read_text(encoding="ascii").splitlines(keepends=True)
        turning = int(len(lines) * (STILL_S + RAMP_S + 0.1) / (STILL_S + RAMP_S + RUN_S))
        (folder / "turning.log").write_text("".join(lines[turning:]), encoding="ascii")
        def take(name):
            return ["run", ["cp", str(folder / name), str(config)]]
        steps = [["play", str(folder / "played.log")], take("longer.toml"), ["reload", None], take("same.toml"), ["reload", None],
                 take("moved.toml"), ["reload", None], ["play", str(folder / "turning.log")],
                 ["until_said", "contradicts what was known"]]
        return {"links": twin.links(), "steps": steps,
                "command": [str(BIN / "vgyrod"), "--config", str(config), "--method", "optimal", "--state", "{memory}/state.toml"]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        for text, times in (("in use, with what was learned", 2), ("calibrating again", 1), ("contradicts what was known", 1)):
            require(run.said.count(text) == times, f"{text}: {run.said.count(text)} times\n{run.said}")
        biases = RestartCase().check_file(folder / "state.toml")["drift"]["bias_dps"]
        verdicts.check_protection(run.of(0x610), 0x610)
        return f"biases {biases} deg/s kept, {describe(run)}"


class ForeignLayoutsCase:
    """The rate in two foreign layouts, read by a node on the kernel's J1939 stack with arithmetic of its own: the angular rate
    of SAE J1939 beside VG_Rate, and the rate of turn of NMEA 2000 on another bus."""

    name = "foreign_layouts"
    says = "J1939 and NMEA 2000 nodes read the rate in their own layouts"
    ari = ("can0", 0x0CF02A31, 61482, 0x31)
    boat = ("can1", 0x09F11332, 127251, 0x32)

    def __init__(self):
        self.twin = Twin(bus_b="can2")

    def prepare(self, folder):
        self.twin.prepare(folder)
        with open(folder / "vgyro.toml", "a", encoding="utf-8") as config:
            config.write(f"""
[[output.layout]]
dbc = "{SOURCE}/dbc/profiles/j1939_ari.dbc"
message = "ARI"
rate = "YawRate"
valid = "YawRateMerit == 0"
source_address = {self.ari[3]}

[[output.layout]]
bus = "can1"
dbc = "{SOURCE}/dbc/profiles/nmea2000_rate_of_turn.dbc"
message = "RateOfTurn"
rate = "Rate"
counter = "SID"
source_address = {self.boat[3]}
""")
        links = self.twin.links() + [{"name": "can1", "mtu": 16}]
        return {"links": links, "steps": [["play", str(folder / "played.log")]],
                "beside": [sys.executable, str(Path(__file__).with_name("j1939_reader.py")), "{memory}/heard.txt",
                           "can0", "can1"],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        foreign = [line for line in run.inputs if len(line.name) == 8]
        run.inputs = [line for line in run.inputs if len(line.name) == 3]
        check_service(run)
        check_played(run)
        replayed = run.replay()
        _, rate_dps, _ = verdicts.rates_of(run.of(0x610), verdicts.Oracle(SOURCE / "dbc/vgyro.dbc"))
        require(np.isfinite(rate_dps).sum() > 1000 and np.isnan(rate_dps).sum() > 500, "no good mixture of rates")
        reader = "the kernel's J1939"
        heard = (folder / "heard.txt").read_text(encoding="ascii").splitlines() if (folder / "heard.txt").exists() else []
        if not heard:  # the kernel has vcan, but no J1939
            reader = "a raw reader, for this kernel has no J1939"
            heard = [f"{line.bus} {int(line.name, 16) >> 8 & 0x3FFFF} {int(line.name, 16) & 0xFF} {line.data.hex()}"
                     for line in foreign]
        for bus, can_id, group, address in (self.ari, self.boat):
            live = [line.data for line in foreign if int(line.name, 16) == can_id and line.bus == bus]
            require(live == [line.data for line in replayed if int(line.name, 16) == can_id and line.bus == bus],
                    f"{can_id:08X}: the replay sends others than the daemon")
            node = [bytes.fromhex(data) for told in heard for words in [told.split()] for data in [words[3]]
                    if words[:3] == [bus, str(group), str(address)]]
            require(node == live, f"PGN {group}: {len(node)} frames heard, {len(live)} captured")
        self.check_ari([line.data for line in foreign if int(line.name, 16) == self.ari[1]], rate_dps)
        self.check_boat([line.data for line in foreign if int(line.name, 16) == self.boat[1]], rate_dps)
        return f"{len(rate_dps)} rates in each, read by {reader}, {describe(run)}"

    @staticmethod
    def check_ari(frames, rate_dps):
        """SAE J1939: steps of 1/128 deg/s from -250 deg/s, the topmost codes are no value; merit 0 (of 0 to 3) is good."""
        raw = np.array([int.from_bytes(data[4:6], "little") for data in frames])
        merit = np.array([data[6] >> 4 & 3 for data in frames])
        value = np.where(merit == 0, raw / 128 - 250, np.nan)
        require(np.array_equal(np.isnan(value), np.isnan(rate_dps)), "ARI and VG_Rate differ in what is valid")
        require((raw[merit != 0] == 0xFFFF).all() and (raw[merit == 0] <= 0xFAFF).all(), "ARI: wrong codes")
        require(np.nanmax(np.abs(value - rate_dps)) <= 0.5 / 128 + 2.6e-5, "ARI is not the nearest to VG_Rate")

    @staticmethod
    def check_boat(frames, rate_dps):
        """NMEA 2000: steps of 1/32 µrad/s, 0x7FFFFFFF is no value; the sequence number runs from 0 to 252."""
        raw = np.array([int.from_bytes(data[1:5], "little", signed=True) for data in frames])
        value = np.where(raw == 0x7FFFFFFF, np.nan, raw / 32e6 * 180 / np.pi)
        require(np.array_equal(np.isnan(value), np.isnan(rate_dps)), "the boat and VG_Rate differ in what is valid")
        require(np.nanmax(np.abs(value - rate_dps)) <= 2.7e-5, "the boat's rate is not VG_Rate's")
        require([data[0] for data in frames] == [number % 253 for number in range(len(frames))], "sequence numbers")


class CaptureCase:
    """Two captures of the inputs while other nodes send on the same buses: one requested on a private D-Bus, one because the
    gyros contradict each other."""

    name = "capture"
    says = "recordings of the inputs hold each of their frames as candump has it, and no other; their replay gives the rates"
    foreign = ("100#1122334455667788", "103#00", "1F334455#DEADBEEF", "00000101#0102030405060708", "7FF#")
    bus_config = """<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>system</type>
  <listen>unix:path=@MEMORY@/dbus</listen>
  <pidfile>@MEMORY@/dbus.pid</pidfile>
  <auth>EXTERNAL</auth>
  <policy context="default">
    <allow user="*"/>
    <deny own="*"/>
    <deny send_type="method_call"/>
    <allow send_destination="org.freedesktop.DBus"/>
    <allow receive_type="method_call"/>
    <allow receive_type="method_return"/>
    <allow receive_type="error"/>
    <allow receive_type="signal"/>
    <allow send_type="signal"/>
    <allow send_requested_reply="true" send_type="method_return"/>
    <allow send_requested_reply="true" send_type="error"/>
  </policy>
  <include>{policy}</include>
</busconfig>
"""
    sway_s, sway_hz, sway_dps = 10.0, 0.5, 40.0

    def __init__(self):
        self.twin = Twin(bus_b="can1", bus_out="can2", run_s=1.0)

    def prepare(self, folder):
        self.twin.prepare(folder)
        played = (folder / "played.log").read_text(encoding="ascii").splitlines(keepends=True)
        with open(folder / "played.log", "w", encoding="ascii") as log:
            for number, line in enumerate(played):
                log.write(line)
                if number % 50 == 0:
                    for bus in ("can0", "can1"):
                        # An input's identifier is foreign on the other bus.
                        for frame in (*self.foreign, "102#00" if bus == "can0" else "101#00"):
                            log.write(f"{line.split(' ')[0]} {bus} {frame}\n")
        (folder / "sway.log").write_text("".join(self.swaying()), encoding="ascii")
        (folder / "bus.in").write_text(self.bus_config.format(policy=SOURCE / "dbus/org.vgyro.Gateway1.conf"), encoding="ascii")
        # Only the guest knows the path in the configuration of D-Bus.
        script = (f"sed 's|@MEMORY@|{{memory}}|' {folder}/bus.in > {{memory}}/bus.conf; "
                  f"dbus-daemon --config-file={{memory}}/bus.conf --fork || exit 9; "
                  f"exec {BIN / 'vgyrod'} --config {folder / 'vgyro.toml'} --capture captures")
        address = "unix:path={memory}/dbus"
        environment = ["env", f"DBUS_SYSTEM_BUS_ADDRESS={address}"]
        ask = f"{BIN / 'vgyro'} status --json > {folder}/status.json && {BIN / 'vgyro'} capture > {folder}/asked.txt"
        keep = f"cp -r {{memory}}/captures {folder}; kill $(cat {{memory}}/dbus.pid)"
        steps = [["play", str(folder / "played.log")], ["wait", 1.0], ["run", [*environment, "sh", "-c", ask]],
                 ["play", str(folder / "sway.log")], ["until_said", "-contradicted: "], ["run", ["sh", "-c", keep]]]
        return {"links": self.twin.links(), "steps": steps,
                "command": [*environment, "STATE_DIRECTORY={memory}", "sh", "-c", script]}

    def swaying(self):
        """The platform sways; gyro B reads the opposite sign."""
        for i in range(int(self.sway_s * 200)):
            us = 1_700_001_000_000_000 + 5000 * i
            raw = round(1e6 * self.sway_dps * math.sin(2 * math.pi * self.sway_hz * i / 200))
            for delay_us, bus, can_id, rate in ((0, "can0", "101", struct.pack("<i", raw)), (700, "can1", "102", struct.pack(">i", -raw))):
                stamp = us + delay_us
                yield (f"({stamp // 1_000_000}.{stamp % 1_000_000:06}) {bus} {can_id}#"
                       f"{rate.hex().upper()}0000{i % 256:02X}00\n")

    def read(self, folder):
        text = lzma.decompress((folder / "recording.log.xz").read_bytes())
        (folder / "recording.log").write_bytes(text)
        return verdicts.read_log(folder / "recording.log"), json.loads((folder / "capture.json").read_text(encoding="utf-8"))

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_life(run)
        inputs = [line for line in run.inputs if (line.bus, line.name) in (("can0", "101"), ("can1", "102"))]
        require(len(run.inputs) > len(inputs) + 500, "no foreign frames")
        asked, contradicted = sorted((folder / "captures").glob("2*"))
        require(Path((folder / "asked.txt").read_text().strip()).name == asked.name, f"vgyro capture printed another name than {asked.name}")
        require(asked.name.endswith("-asked") and contradicted.name.endswith("-contradicted"), f"{asked.name} {contradicted.name}")
        require(not list((folder / "captures").glob(".*")), "something unfinished was left")
        until = next(i for i, line in enumerate(inputs) if line.us > inputs[0].us + 0.5e6 and line.us - inputs[i - 1].us > 500_000)
        for capture, expected in ((asked, inputs[:until]), (contradicted, inputs)):
            lines, said = self.read(capture)
            for bus in ("can0", "can1"):
                seen, played = ([line.text for line in of if line.bus == bus] for of in (lines, expected))
                require(seen == played, f"{capture.name}: {bus}: {len(seen)} frames, {len(played)} came, or not the same")
            require(len(lines) == len(expected) == said["frames"] and said["frames_dropped"] == 0, f"{len(lines)} frames, {said}")
            require(said["inputs"] == ["can0 101", "can1 102"], f"{said['inputs']}")
        require(said["overlaps"] == asked.name, f"overlaps {said['overlaps']}")
        require(said["text"].startswith("noisy moves -1.00 times quiet"), said["text"])
        status = json.loads((folder / "status.json").read_text(encoding="utf-8"))["captures"]
        require(status["directory"].endswith("/captures") and status["frames_dropped"] == 0, f"{status}")
        resident = run.result["resources"]["rss_most_kb"]
        require(resident <= RSS_MOST_KB + CAPTURE_RSS_MOST_KB, f"{resident} kB resident")
        out = folder / "replayed_capture.log"
        done = subprocess.run([str(BIN / "vgyro"), "replay", "--config", str(folder / "vgyro.toml"), "-o", str(out),
                               str(asked / "recording.log.xz")], capture_output=True, text=True, check=False)
        require(done.returncode == 0, f"replay of the capture failed: {done.stderr.strip()}")
        replayed = [line for line in verdicts.read_log(out) if line.name == "610"]
        live = [line for line in run.of(0x610) if line.us <= inputs[until - 1].us + 400_000]
        require(len(replayed) > 1000, f"{len(replayed)} rates replayed")
        verdicts.check_same_rates(live, replayed)
        return f"{len(inputs)} frames, {len(run.inputs) - len(inputs)} foreign ones left out, {len(replayed)} rates as in the replay, {describe(run)}"


class IdleCase:
    """There is no gyro: heartbeat, status, and a clean end."""

    name = "idle"
    says = "no gyro there: heartbeat ten times a second, SIGINT ends it"

    def prepare(self, folder):
        twin = Twin()
        twin.prepare(folder)
        return {"links": twin.links(), "steps": [["wait", 2.0]], "signal": "SIGINT",
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result)
        check_service(run)
        biases = run.of(0x611)
        require(not run.of(0x610), "a rate without gyros")
        require(15 <= len(biases) <= 32, f"{len(biases)} heartbeats in 2.7 s")
        for can_id in run.ids:
            verdicts.check_protection(run.of(can_id), can_id)
        statuses = [text for _, text in result["notices"] if text.startswith("STATUS=")]
        require(1 <= len(statuses) <= 4, f"{len(statuses)} STATUS notices in 2.7 s")
        require(all("waiting" in text for text in statuses), f"{statuses}")
        return f"{len(biases)} heartbeats, {describe(run)}"


class CommandCase:
    """A test program with a verdict of its own."""

    def __init__(self, name, says, command, exit_code, expected):
        self.name, self.says, self.command = name, says, command
        self.exit_code, self.expected = exit_code, expected

    def prepare(self, folder):
        Twin(bus_a="lo").prepare(folder)
        return {"command": [part.format(folder=folder) for part in self.command]}

    def judge(self, folder, result):
        require("failure" not in result, result.get("failure"))
        output = (folder / "output.txt").read_text(encoding="utf-8", errors="replace")
        found = re.search(self.expected, output)
        require(result["exit"] == self.exit_code and found, f"exit {result['exit']}:\n{output}")
        return found.group(0)


UNITS_DBC = """\
VERSION ""

BU_: RIG

BO_ 257 IMU_A: 8 RIG
 SG_ X : 0|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Y : 16|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Z : 32|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG

BO_ 258 IMU_B: 8 RIG
 SG_ X : 0|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Y : 16|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Z : 32|16@1- (0.005,0) [-160|160] "deg/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG
"""

UNITS_CONFIG = "".join(f"""\
[[gyro]]
name = "{name}"
bus = "can{bus}"
dbc = "units.dbc"
message = "{message}"
rate_x = "X"
rate_y = "Y"
rate_z = "Z"
counter = "Counter"
{mount}
""" for bus, name, message, mount in ((0, "left", "IMU_A", ""), (1, "right", "IMU_B", "mount = [0, 0, 90]"))) + """\
[calibration]
rest_s = 2
rate_dps = [0.0, 0.0, 0.0]

[output]
bus = "can0"
"""


class UnitsCase:
    """Two whole units on two buses, one of them mounted at 90 deg: at rest, then turning about all axes."""

    name = "units"
    says = "two units of three axes, one turned by 90 deg"
    still_s, run_s, rate_hz, noise_dps = 3.0, 5.0, 100.0, 0.03
    ids = tuple(range(0x610, 0x619))

    def truth(self, since_s):
        t = since_s - self.still_s
        return [0.0] * 3 if t < 0.0 else [a * math.sin(w * t) ** 2 for a, w in ((3.0, 2.0), (-4.0, 1.5), (20.0, 1.0))]

    def prepare(self, folder):
        random = np.random.default_rng(29)
        (folder / "units.dbc").write_text(UNITS_DBC, encoding="utf-8")
        (folder / "vgyro.toml").write_text(UNITS_CONFIG, encoding="utf-8")
        lines = []
        for n in range(round((self.still_s + self.run_s) * self.rate_hz)):
            for bus, can_id, bias, late_s in ((0, 0x101, 0.4, 0.0), (1, 0x102, -0.3, 0.004)):
                since_s = n / self.rate_hz + late_s
                x, y, z = self.truth(since_s)
                sensed = (x, y, z) if bus == 0 else (y, -x, z)
                raw = [round((rate + bias + random.normal(0.0, self.noise_dps)) / 0.005) for rate in sensed]
                us = 1_700_000_000_000_000 + round(since_s * 1e6)
                data = struct.pack("<hhhBB", *raw, n % 256, 0).hex().upper()
                lines.append((us, f"({us // 1_000_000}.{us % 1_000_000:06}) can{bus} {can_id:03X}#{data}\n"))
        (folder / "played.log").write_text("".join(text for _, text in sorted(lines)), encoding="ascii")
        return {"links": [{"name": "can0"}, {"name": "can1"}], "steps": [["play", str(folder / "played.log")]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def judge(self, folder, result):
        run = read_run(folder, result, self.ids)
        check_service(run)
        check_played(run)
        replayed = run.replay()
        oracle = verdicts.Oracle(SOURCE / "dbc/vgyro_axes.dbc")
        said = []
        for axis, rate_id in enumerate(self.ids[::3]):
            verdicts.check_same_rates(run.of(rate_id), [line for line in replayed if int(line.name, 16) == rate_id])
            valid = [signals["VG_Rate"] for signals in (oracle.decode(line) for line in run.of(rate_id)) if signals["VG_Valid"] == 1.0]
            require(len(valid) > 400, f"{len(valid)} valid rates about {'xyz'[axis]}")
            said.append(f"{len(valid)} about {'xyz'[axis]}")
        for can_id in self.ids:
            verdicts.check_protection(run.of(can_id), can_id)
        require("axis z: running" in run.said, f"the journal names no axis:\n{run.said}")
        return f"valid rates {', '.join(said)}, as in the replay, {describe(run)}"


class UnitsRestartCase(UnitsCase):
    """Killed after all axes have calibrated, and started again."""

    name = "units_restart"
    says = "two units, killed and started again with the state file: all axes go on where they were"

    def prepare(self, folder):
        orders = super().prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        config.write_text(text.replace("rate_dps = [0.0, 0.0, 0.0]", "latitude_deg = 50.0\nheading_deg = 30.0"), encoding="utf-8")
        state, log = "{memory}/state.toml", ["play", str(folder / "played.log")]
        orders["steps"] = [log, ["wait", 0.5], ["kill_and_restart", None], ["run", ["cp", state, str(folder / "kept.toml")]], log]
        orders["command"] += ["--state", state]
        return orders

    def judge(self, folder, result):
        run = read_run(folder, result, self.ids)
        check_service(run)
        since = result["restarts_us"][0]
        run.inputs = [line for line in run.inputs if line.us >= since]
        run.outputs = [line for line in run.outputs if line.us >= since]
        kept = tomllib.loads((folder / "kept.toml").read_text(encoding="ascii"))
        self.check_kept(kept)
        require("restored the biases saved" in run.said, f"taking up was not logged\n{run.said}")
        replayed = run.replay("--state", str(folder / "kept.toml"))
        oracle = verdicts.Oracle(SOURCE / "dbc/vgyro_axes.dbc")
        for rate_id in self.ids[::3]:
            verdicts.check_same_rates(run.of(rate_id), [line for line in replayed if int(line.name, 16) == rate_id])
            invalid = [line for line in run.of(rate_id) if oracle.decode(line)["VG_Valid"] != 1.0]
            require(run.of(rate_id) and not invalid, f"{len(invalid)} rates of {rate_id:#x} are not valid after the restart")
        for can_id in self.ids:
            verdicts.check_protection(run.of(can_id), can_id)
        return f"all axes valid from the first pair, as in the replay with that file, heading kept, {describe(run)}"

    def check_kept(self, kept):
        require(set(kept["axis"]) == set("xyz") and "misalignment" in kept, f"{kept.keys()}")
        # Six standard errors of the mean over two seconds, and the step of the signal.
        for axis in "xyz":
            biases = kept["axis"][axis]["drift"]["bias_dps"]
            # The mount turns the second unit's x to the left, so its reading about the vehicle's x is minus its own y.
            second = 0.3 if axis == "x" else -0.3
            require(np.allclose(biases, [0.4, second], rtol=0, atol=6 * self.noise_dps / 200 ** 0.5 + 0.01), f"{axis}: {biases}")
        require(0.0 <= kept["heading"]["sigma_rad"] < 4.0, f"{kept['heading']}")


class UnitsReloadCase(UnitsCase):
    """SIGHUP with the platform at rest: a bad configuration, another window, and then another output."""

    name = "units_reload"
    says = "two units, configuration read again: all axes' biases and counters go on; a bad one is refused"

    def prepare(self, folder):
        orders = super().prepare(folder)
        config = folder / "vgyro.toml"
        text = config.read_text(encoding="utf-8")
        (folder / "bad.toml").write_text(text.replace('rate_y = "Y"', 'rate_y = "YY"', 1), encoding="utf-8")
        (folder / "other.toml").write_text(text + "[corrector]\nwindow_s = 3.0\n", encoding="utf-8")
        (folder / "more.toml").write_text(text + f"""\
[[output.layout]]
dbc = "{SOURCE}/dbc/profiles/sbg_ellipse.dbc"
message = "SBG_ImuGyro"
rate_x = "RateX"
rate_y = "RateY"
rate_z = "RateZ"
rate_not_available = -32768
[corrector]
window_s = 3.0
""", encoding="utf-8")
        def take(name):
            return ["run", ["cp", str(folder / name), str(config)]]
        log, pause = ["play", str(folder / "played.log")], ["wait", 0.6]
        orders["steps"] = [log, pause, take("bad.toml"), ["reload", None], take("other.toml"), ["reload", None], log, pause,
                           take("more.toml"), ["reload", None], log]
        return orders

    def judge(self, folder, result):
        run = read_run(folder, result, (*self.ids, 0x122))
        check_service(run)
        for text in ("its gyros are the same: nothing was interrupted", "in use, with what was learned",
                     "the new configuration is refused; the old one stays in force"):
            require(run.said.count(text) == 1, f"{text}: {run.said.count(text)} times\n{run.said}")
        require(re.search(r'vgyro\.toml:\d+: .*"YY"', run.said), f"no place\n{run.said}")
        oracle = verdicts.Oracle(SOURCE / "dbc/vgyro_axes.dbc")
        # Receivers see one stream: every CRC is right, and every counter follows the one before.
        for can_id in self.ids:
            verdicts.check_protection(run.of(can_id), can_id)
        plays = np.array([line.us for line in run.inputs if line.name == "101"])
        begins = np.concatenate([plays[:1], plays[1:][np.diff(plays) > 400_000]])
        require(len(begins) == 3, f"{len(begins)} plays seen")
        for axis, rate_id in enumerate(self.ids[::3]):
            later = [line for line in run.of(rate_id) if line.us > begins[1]]
            resting = [line for line in later if any(0 < line.us - begin < 1e6 * (self.still_s - 0.5) for begin in begins[1:])]
            rates = [oracle.decode(line) for line in later]
            require(all(signals["VG_Valid"] == 1.0 for signals in rates), f"a rate about {'xyz'[axis]} is not valid after a reload")
            mean = np.mean([oracle.decode(line)["VG_Rate"] for line in resting])
            # The error of a bias from two seconds of rest, and the steps of the sensors' signals.
            require(abs(mean) < 6 * self.noise_dps / 400 ** 0.5 + 0.005, f"about {'xyz'[axis]} {mean:.4f} deg/s at rest")
        layouts = run.of(0x122)
        require(layouts and min(line.us for line in layouts) > begins[2], "the layout is not there after the last reload, or before")
        wanted = sum(line.us > begins[2] for line in run.of(self.ids[0]))
        require(abs(len(layouts) - wanted) <= 3, f"{len(layouts)} frames of the layout for {wanted} rates")
        return f"{len(layouts)} frames of all axes in a layout, {describe(run)}"


class CarCase:
    """Recorded traffic of a car in real time: one gyro among many identifiers, the other one and the reference on a bus of
    their own."""

    name = "car"
    says = "real car traffic around the gyros, at real time"
    seconds = 22.0  # ten for the calibration, ten for the first window

    def __init__(self, recordings):
        self.source = recordings / "car_rav4"
        self.ids = (0x610, 0x611, 0x612)

    def prepare(self, folder):
        for path in self.source.glob("*.dbc"):
            (folder / path.name).write_bytes(path.read_bytes())
        log = lzma.decompress((self.source / "measured.log.xz").read_bytes()).decode("ascii")
        lines = log.splitlines(keepends=True)
        since_s = [float(line[1:line.index(")")]) for line in lines]
        lines = [line for line, at_s in zip(lines, since_s) if at_s < since_s[0] + self.seconds]
        (folder / "played.log").write_text("".join(lines), encoding="ascii")
        used = {int(text, 16) for text in re.findall(r" ([0-9A-F]{3})#", log)}
        free = (i for i in range(0x620, 0x800) if i not in used)
        self.ids = tuple(next(free) if i in used else i for i in self.ids)
        (folder / "vgyro.toml").write_text(self.rewritten_config(), encoding="utf-8")
        buses = sorted(set(re.findall(r"\) +(\S+) ", log)))
        return {"links": [{"name": bus} for bus in buses], "steps": [["play", str(folder / "played.log")]],
                "command": [str(BIN / "vgyrod"), "--config", str(folder / "vgyro.toml")]}

    def rewritten_config(self):
        """The recording's configuration, but with output identifiers that the car does not use."""
        text = (self.source / "vgyro.toml").read_text(encoding="utf-8")
        return text.replace("[output]", f"[output]\nrate_id = {self.ids[0]}\nbias_id = {self.ids[1]}\nmodel_id = {self.ids[2]}", 1)

    def judge(self, folder, result):
        run = read_run(folder, result, self.ids)
        check_service(run)
        check_played(run)
        rates = check_against_replay(run)
        require("(0 lost by the kernel)" in run.said, run.said)
        return f"{rates} rates as in the replay among {len(run.inputs)} frames, {describe(run)}"


def all_cases(recordings):
    vgyrod = str(BIN / "vgyrod")
    cases = [
        TwinCase("twin", "rate-table twin on one bus", Twin()),
        TwinCase("two_buses", "a bus for each gyro, a third for the output",
                 Twin(bus_b="can1", bus_out="can2")),
        TwinCase("silent_gyro", "one gyro silent for a second, then back",
                 Twin(bus_b="can1", silent_s=(STILL_S + RAMP_S + 1.0, STILL_S + RAMP_S + 2.0)),
                 check_more=check_silent),
        TwinCase("fd", "CAN FD in and out", Twin(fd=True), dbc="dbc/vgyro_fd.dbc", check_more=check_fd),
        SlowBusCase(),
        LinkFaultsCase(),
        FrozenCase("frozen", "stopped amid traffic and let go: no frame goes out for an input that is long past", 0.6, RUN_S),
        FrozenCase("frozen_long", "stopped for seconds: what waited meanwhile keeps its stamps", 3.5, 6.0),
        AbsentCase(),
        RenamedCase(),
        FlappingCase(),
        LaunchTimeCase(),
        UnreadNoticesCase(),
        LateFdCase(),
        DeadBusCase(),
        ErrorFramesCase(),
        ShadowCase(),
        ReloadCase(),
        SlowReloadCase(),
        ShortMemoryCase(),
        UnreadLogCase(),
        SharedCase(),
        RestartCase(),
        InheritedCase(),
        ForeignLayoutsCase(),
        UnitsCase(),
        UnitsRestartCase(),
        UnitsReloadCase(),
        CaptureCase(),
        IdleCase(),
        CommandCase("no_can_interface", "an interface that is none of CAN: exit 1 and what to do",
                    [vgyrod, "--config", "{folder}/vgyro.toml"], 1,
                    r"lo: not a CAN interface; .*ip link show type can"),
        CommandCase("socket", "the socket layer on a real kernel", [str(BIN / "vcan_socket_probe")], 0,
                    r"\d+ tests from 1 test suite ran"),
        CommandCase("bus", "a bus whose link and interface change on a real kernel", [str(BIN / "vcan_bus_probe")], 0,
                    r"\d+ tests from \d+ test suites ran"),
    ]
    if recordings is not None and (recordings / "car_rav4").is_dir():
        cases.append(CarCase(recordings))
    return cases


def judge(case, folder, orders):
    """Whether the case passed, the longest stall in microseconds (0 if nothing played in real time), and a text."""
    path = folder / "result.json"
    if not path.exists():
        return False, 0, "did not run"
    result, stall_us = json.loads(path.read_text(encoding="utf-8")), 0
    try:
        stall_us = timekeeping.longest_stall_us(folder, orders.get("steps", []), result)
        return True, stall_us, case.judge(folder, result)
    except verdicts.Failure as failure:
        return False, stall_us, str(failure)
