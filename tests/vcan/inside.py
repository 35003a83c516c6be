#!/usr/bin/python3
"""The part of the vcan harness that runs where the CAN interfaces are: in a network namespace of its own, or in a User Mode
Linux guest. Reads its plan from plan.json in the first folder, writes the results beside it, and keeps captures in the
second folder meanwhile. Starting programs is slow in the guest, so this starts few and imports little."""

import fcntl
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import time

READY_WITHIN_S = 30.0
NAP_S = 0.01
STALL_NOTED_S = 0.02
STOP_WITHIN_S = 20.0
SAID_WITHIN_S = 20.0
WATCHDOG_USEC = 2_000_000


class Daemon:
    """The gateway under test, and its messages to the service manager."""

    def __init__(self, command, folder):
        self.notices = []  # (seconds since the start, text)
        # An abstract name leaves nothing behind in the file system.
        self.address = f"@vgyro-test-{os.getpid()}"
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.listener.bind(self.address.replace("@", "\0"))
        self.begin = time.monotonic()
        self.command = command
        self.stderr_path = os.path.join(folder, "vgyrod.err")
        self.restarts_us = []  # on the clock of the frames
        self.reloads_us = []
        self.frozen_us = []  # from, to
        self.listened_us = []  # from, to; in between the harness starts programs, which takes the processor too
        self.is_heard = True  # False: nothing reads its messages
        self.start()

    def start(self):
        with open(self.stderr_path, "ab") as stderr:
            environment = dict(os.environ, NOTIFY_SOCKET=self.address, WATCHDOG_USEC=str(WATCHDOG_USEC))
            self.process = subprocess.Popen(self.command, stderr=stderr, env=environment)

    def kill_and_restart(self):
        self.process.kill()
        self.process.wait(STOP_WITHIN_S)
        self.restarts_us.append(time.time_ns() // 1000)
        self.start()
        if not self.listen(READY_WITHIN_S, "READY=1"):
            raise OSError("not READY after it was killed and started again")

    def reload(self):
        self.reloads_us.append(time.time_ns() // 1000)
        self.process.send_signal(signal.SIGHUP)
        if not self.listen(READY_WITHIN_S, "RELOADING=1") or not self.listen(READY_WITHIN_S, "READY=1"):
            raise OSError("no RELOADING and READY after SIGHUP")

    def freeze(self, seconds):
        """Stops the process for some time, like a debugger or a suspended host."""
        self.process.send_signal(signal.SIGSTOP)
        self.frozen_us.append(time.time_ns() // 1000)
        self.listen(seconds)
        self.frozen_us.append(time.time_ns() // 1000)
        self.process.send_signal(signal.SIGCONT)

    def listen(self, seconds, until=None):
        """Collects notices for some time, or until one of them starts with `until`."""
        begin_us = time.time_ns() // 1000
        try:
            return self.collect(seconds, until)
        finally:
            self.listened_us.append([begin_us, time.time_ns() // 1000])

    def collect(self, seconds, until):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.listener.settimeout(min(left, 0.1))
            if not self.is_heard:
                time.sleep(min(left, 0.1))
                continue
            try:
                text = self.listener.recv(4096).decode()
            except TimeoutError:
                if self.process.poll() is not None:
                    return False
                continue
            self.notices.append((time.monotonic() - self.begin, text))
            if until is not None and text.startswith(until):
                return True
        return until is None

    def resources(self):
        """Resident memory (now and at most, in kB), and processor time in seconds."""
        with open(f"/proc/{self.process.pid}/status", encoding="ascii") as file:
            fields = dict(line.split(":", 1) for line in file)
        with open(f"/proc/{self.process.pid}/stat", encoding="ascii") as file:
            user, system = file.read().rsplit(")", 1)[1].split()[11:13]
        tick = os.sysconf("SC_CLK_TCK")
        return {
            "rss_kb": int(fields["VmRSS"].split()[0]),
            "rss_most_kb": int(fields["VmHWM"].split()[0]),
            "cpu_s": (int(user) + int(system)) / tick,
            "wake_ups": int(fields["voluntary_ctxt_switches"]),
        }

    def stop(self, number):
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            code = self.process.wait(STOP_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = "still running after its signal"
        self.is_heard = True
        self.listen(0.05)
        self.listener.close()
        return code


class StallWatch:
    """A process that sleeps repeatedly and notes when it overslept: the daemon had no processor then either."""

    def __init__(self, path):
        self.path = path
        with open(path, "wb"):
            pass
        parent = os.getpid()
        self.child = os.fork()
        if self.child == 0:
            try:
                self.watch(parent)
            finally:
                os._exit(1)  # without flushing the parent's buffers

    def watch(self, parent):
        with open(self.path, "ab", buffering=0) as notes:
            before = time.monotonic()
            while os.getppid() == parent:
                time.sleep(NAP_S)
                now = time.monotonic()
                if now - before > NAP_S + STALL_NOTED_S:
                    notes.write(b"%d %d\n" % (time.time_ns() // 1000, (now - before - NAP_S) * 1e6))
                before = now

    def stop(self):
        """The end of each stall, on the clock of the frames, and its length, both in microseconds."""
        os.kill(self.child, signal.SIGKILL)
        os.waitpid(self.child, 0)
        with open(self.path, encoding="ascii") as notes:
            seen = [[int(number) for number in line.split()] for line in notes]
        os.unlink(self.path)
        return seen


def stop_quietly(process):
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()


def wait_until_still(path):
    """candump may lag behind the buses; it has caught up when its file no longer grows."""
    size, still = -1, 0
    for _ in range(200):
        time.sleep(0.1)
        before, size = size, os.path.getsize(path)
        still = still + 1 if size == before else 0
        if still == 4:
            return


def run_program(command, **options):
    done = subprocess.run(command, stderr=subprocess.PIPE, check=False, **options)
    if done.returncode != 0:
        raise OSError(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.decode(errors='replace').strip()}")


def make_links(case):
    lines = []
    for link in case["links"]:
        if not link.get("absent"):  # made by a later step
            lines += [f"link add {link['name']} mtu {link.get('mtu', 16)} type vcan", f"link set {link['name']} up"]
    if lines:
        run_program(["ip", "-batch", "-"], input="\n".join(lines).encode())
    for command in case.get("after_links", []):
        run_program(command)


def remove_links(case):
    """Deletes only links that exist: ip ends a batch at the first missing one, and would leave the others to the next case."""
    there = {name for _, name in socket.if_nameindex()}
    lines = [f"link del {link['name']}" for link in case["links"] if link["name"] in there]
    if lines:
        run_program(["ip", "-batch", "-"], input="\n".join(lines).encode())


def play(log, daemon, folder, after_s=None, what=None):
    """Plays a log onto the buses in real time, and does something else in the middle of it."""
    with open(os.path.join(folder, "canplayer.err"), "ab") as stderr:
        player = subprocess.Popen(["canplayer", "-I", log], stderr=stderr)
    if what is not None:
        daemon.listen(after_s)
        what()
    while player.poll() is None:
        daemon.listen(0.2)
    if player.returncode != 0:
        raise OSError(f"canplayer {log}: exit {player.returncode}")


def run_meanwhile(command, daemon):
    """Runs a program that takes long."""
    running = subprocess.Popen(command)
    while running.poll() is None:
        daemon.listen(0.2)
    if running.returncode != 0:
        raise OSError(f"{' '.join(command)}: exit {running.returncode}")


def wait_until_said(text, daemon, seconds):
    """Waits until the daemon has logged a text."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with open(daemon.stderr_path, encoding="utf-8", errors="replace") as file:
            if text in file.read():
                return
        daemon.listen(0.1)
    raise OSError(f"not said within {seconds:g} s: {text}")


def flap(interface, times, pause_s, daemon):
    """Takes a link down and up repeatedly by ioctl, because starting programs would take too long."""
    get_flags, set_flags, up = 0x8913, 0x8914, 1  # linux/sockios.h, linux/if.h
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as control:
        for _ in range(times):
            request = struct.pack("16sh14x", interface.encode(), 0)
            flags = struct.unpack("16sh14x", fcntl.ioctl(control, get_flags, request))[1]
            for now in (flags & ~up, flags | up):
                fcntl.ioctl(control, set_flags, struct.pack("16sh14x", interface.encode(), now))
                daemon.listen(pause_s)


def take_steps(steps, daemon, folder):
    for verb, what in steps:
        if verb == "play":
            play(what, daemon, folder)
        elif verb == "wait":
            daemon.listen(what)
        elif verb == "until_said":
            wait_until_said(what, daemon, SAID_WITHIN_S)
        elif verb == "kill_and_restart":
            daemon.kill_and_restart()
        elif verb == "play_and_reload":
            play(what[0], daemon, folder, what[1], daemon.reload)
        elif verb == "play_and_freeze":
            play(what[0], daemon, folder, what[1], lambda seconds=what[2]: daemon.freeze(seconds))
        elif verb == "play_and_flap":
            play(what[0], daemon, folder, what[1], lambda flaps=what[2]: flap(*flaps, daemon))
        elif verb == "run_meanwhile":
            run_meanwhile(what, daemon)
        elif verb == "stop_reading_notices":
            daemon.is_heard = False
        elif verb == "reload":
            daemon.reload()
        else:
            run_program(what)


def keep_files(memory, folder):
    """Copies the daemon's files from memory. It writes them there because the folder is the host's, on whose disk the whole
    guest would wait."""
    for name in os.listdir(memory):
        if name.startswith(("state.toml", "vgyrod.err", "heard.txt")):
            run_program(["cp", "-p", os.path.join(memory, name), folder])
            os.unlink(os.path.join(memory, name))


def run_case(case, folder, memory, result):
    # In a memory file system the capture does not wait for a disk.
    capture_path = os.path.join(memory, "capture.tmp")
    watch = dump = daemon = beside = None
    try:
        make_links(case)
        with open(capture_path, "wb") as capture, open(os.path.join(folder, "candump.err"), "wb") as errors:
            dump = subprocess.Popen(["candump", "-L", "-D", "-r", "8000000", "any"], stdout=capture, stderr=errors)
            if "beside" in case:
                beside = subprocess.Popen(case["beside"], stderr=errors)
            time.sleep(0.5)
            watch = StallWatch(os.path.join(memory, "stalls.tmp"))
            daemon = Daemon(case["command"], memory)
            result["ready"] = daemon.listen(READY_WITHIN_S, "READY=1")
            if result["ready"]:
                result["resources_at_start"] = daemon.resources()
                take_steps([["wait", 0.2], *case["steps"], ["wait", 0.5]], daemon, folder)
                if daemon.process.poll() is None:
                    result["resources"] = daemon.resources()
            result["exit"] = daemon.stop(getattr(signal, case.get("signal", "SIGTERM")))
            result["notices"] = daemon.notices
            result["restarts_us"] = daemon.restarts_us
            result["reloads_us"] = daemon.reloads_us
            result["frozen_us"] = daemon.frozen_us
            wait_until_still(capture_path)
            stop_quietly(dump)
        with open(capture_path, "rb") as capture, open(os.path.join(folder, "capture.log"), "wb") as out:
            out.write(capture.read())
    finally:
        if watch is not None:
            result["stalls_us"] = watch.stop()
            result["listened_us"] = daemon.listened_us if daemon else []
        for process in (dump, beside, daemon.process if daemon else None):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
        if os.path.exists(capture_path):
            os.unlink(capture_path)
        keep_files(memory, folder)
        remove_links(case)


def run_command(case, folder, _memory, result):
    """Runs a test program with a verdict of its own."""
    with open(os.path.join(folder, "output.txt"), "wb") as out:
        done = subprocess.run(case["command"], stdout=out, stderr=subprocess.STDOUT, check=False)
    result["exit"] = done.returncode


def main():
    folder, memory = sys.argv[1:]
    with open(os.path.join(folder, "plan.json"), encoding="utf-8") as file:
        plan = json.loads(file.read().replace("{memory}", memory))
    for case in plan["cases"]:
        case_folder = os.path.join(folder, case["name"])
        result = {"name": case["name"]}
        try:
            (run_case if "links" in case else run_command)(case, case_folder, memory, result)
        except (OSError, subprocess.SubprocessError) as error:
            result["failure"] = str(error)
        with open(os.path.join(case_folder, "result.json"), "w", encoding="utf-8") as file:
            json.dump(result, file)
        print(f"vcan: {case['name']} ran", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
