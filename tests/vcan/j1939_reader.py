#!/usr/bin/python3
"""A node that is independent of the gateway: receives on the kernel's J1939 stack, like a device on the bus of a truck or a
boat, and writes a line for each message: interface, parameter group, source address, payload. Ends with SIGTERM."""

import selectors
import socket
import sys


def listen(interface):
    node = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_J1939)
    # Without it the kernel delivers no broadcasts.
    node.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    node.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
    node.bind((interface, socket.J1939_NO_NAME, socket.J1939_NO_PGN, socket.J1939_NO_ADDR))
    return node


def main():
    path, *interfaces = sys.argv[1:]
    ready = selectors.DefaultSelector()
    with open(path, "w", encoding="ascii", buffering=1) as heard:
        for interface in interfaces:
            ready.register(listen(interface), selectors.EVENT_READ, interface)
        while True:
            for key, _ in ready.select():
                data, (_, _, group, address) = key.fileobj.recvfrom(64)
                heard.write(f"{key.data} {group} {address} {data.hex()}\n")


if __name__ == "__main__":
    main()
