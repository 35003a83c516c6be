#!/usr/bin/python3
"""The part of bench/faults that runs where the vcan interfaces are; see tests/vcan/ground.py. Its orders are in
plan.json in the first folder, and its results go there too; captures are kept in the second folder meanwhile."""

import json
import os
import signal
import subprocess
import sys
import time

TICK = os.sysconf("SC_CLK_TCK")


def cpu_s(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        user, system = file.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / TICK


def resident_kb(pid):
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        return int(next(line for line in file if line.startswith("VmHWM")).split()[1])


def latencies_us(path):
    """Latencies from the last gyro frame to the rate's frame, by the kernel's stamps."""
    found, last = [], None
    with open(path, encoding="ascii") as file:
        for line in file:
            stamp, _, frame = line.split()[:3]
            if frame.startswith(("101#", "102#")):
                last = float(stamp.strip("()"))
            elif frame.startswith("610#") and last is not None:
                found.append((float(stamp.strip("()")) - last) * 1e6)
    return found


def mark(folder, name):
    """Creates a file; when it appears, the host reads its own clock of processor time."""
    time.sleep(0.3)
    with open(os.path.join(folder, name), "wb"):
        pass
    time.sleep(0.3)


def run(job, folder, memory):
    capture = os.path.join(memory, "capture.log")
    with open(os.path.join(folder, job["name"] + ".err"), "wb") as errors, open(capture, "wb") as out:
        dump = program = None
        if job.get("capture"):
            dump = subprocess.Popen(["candump", "-L", "-r", "8000000", "any,101:7FE,102:7FF,610:7FF"], stdout=out)
        if job["command"]:
            program = subprocess.Popen(job["command"], stderr=errors, cwd=folder)
        time.sleep(job.get("settle_s", 1.0))
        mark(folder, job["name"] + ".begin")
        before = cpu_s(program.pid) if program else 0.0
        load = subprocess.run(job["load"], capture_output=True, text=True, check=True)
        mark(folder, job["name"] + ".end")
        used, resident = (cpu_s(program.pid) - before, resident_kb(program.pid)) if program else (0.0, 0)
        if program:
            program.send_signal(signal.SIGTERM)
            program.wait(20)
        if dump:
            time.sleep(0.5)
            dump.terminate()
            dump.wait()
    frames, everything, late_s = load.stdout.split()
    result = {"name": job["name"], "frames": int(frames), "sent": int(everything), "late_s": float(late_s), "cpu_s": used,
              "resident_kb": resident}
    if job.get("capture"):
        result["latencies_us"] = latencies_us(capture)
    return result


def main():
    folder, memory = sys.argv[1:]
    with open(os.path.join(folder, "plan.json"), encoding="utf-8") as file:
        plan = json.load(file)
    subprocess.run(["ip", "-batch", "-"], check=True, input="".join(
        f"link add {name} type vcan\nlink set {name} up\n" for name in plan["links"]).encode())
    results = [run(job, folder, memory) for job in plan["jobs"]]
    with open(os.path.join(folder, "results.json"), "w", encoding="utf-8") as file:
        json.dump(results, file)


if __name__ == "__main__":
    main()
