#!/usr/bin/python3
"""A script of a dozen lines for comparison, live: python-can receives both gyros on one bus, struct decodes the
rates, and their mean is sent back. For bench/faults."""

import struct
import sys

import can

bus = can.Bus(interface="socketcan", channel=sys.argv[1],
              can_filters=[{"can_id": 0x101, "can_mask": 0x7FF}, {"can_id": 0x102, "can_mask": 0x7FF}])
last = 0.0
for message in bus:
    if message.arbitration_id == 0x101:
        last = struct.unpack_from("<i", message.data)[0] * 1e-6
    elif message.arbitration_id == 0x102:
        mean = 0.5 * (last + struct.unpack_from(">i", message.data)[0] * 1e-6)
        bus.send(can.Message(arbitration_id=0x610, is_extended_id=False, data=struct.pack("<q", int(mean / 5e-5))))
