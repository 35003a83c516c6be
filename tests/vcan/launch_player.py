#!/usr/bin/python3
"""Plays a candump log onto its buses in real time, with a launch time (SO_TXTIME) on the monotonic clock for each frame.
Classic frames only; no tool of Debian 12 can do it."""

import socket
import struct
import sys
import time

SO_TXTIME = SCM_TXTIME = 61  # asm-generic/socket.h
FRAME = struct.Struct("=IB3x8s")


def open_bus(name):
    bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.bind((name,))
    bus.setsockopt(socket.SOL_SOCKET, SO_TXTIME, struct.pack("=iI", time.CLOCK_MONOTONIC, 0))
    return bus


def frames_of(path):
    with open(path, encoding="ascii") as file:
        for line in file:
            stamp, name, frame = line.split()
            can_id, data = frame.split("#")
            payload = bytes.fromhex(data)
            yield float(stamp[1:-1]), name, FRAME.pack(int(can_id, 16), len(payload), payload)


def main():
    frames = list(frames_of(sys.argv[1]))
    buses = {name: open_bus(name) for name in {name for _, name, _ in frames}}
    begin = time.monotonic()
    for at_s, name, frame in frames:
        due = begin + at_s - frames[0][0]
        if (left := due - time.monotonic()) > 0:
            time.sleep(left)
        launch = [(socket.SOL_SOCKET, SCM_TXTIME, struct.pack("=Q", int(due * 1e9)))]
        buses[name].sendmsg([frame], launch)


if __name__ == "__main__":
    main()
