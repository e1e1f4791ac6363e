"""What a hostile program tries against the robot of the demo, as packages, for any transport.

Classes are those of the demo: router 250, motor 200, laser 150, mapper 96, tcp 64, output 32, tool 16; its pilot is
1.140.0.
"""

import itertools
import struct
import time

from wire import STATUS, SUBSCRIBE, STAMPED, COMMON_FUNCTIONS, command, data, name, stamped, text, varint

PILOT, MOTOR, LASER, MAPPER, OUTPUT = (name(f"1.{number}.0.0") for number in (140, 200, 150, 96, 32))
ROUTERS = [name("1.250.0.0"), name("1.250.1.0"), name("1.64.0.0"), name("1.64.255.0")]
SCAN, DRIVE, LINE = 1, 16, 1
TRANSIT, TUNNEL, LINES = 3, 4, 3
FOREVER = 0xFFFFFFFF


def scan(range_m):
    """A LaserScan of 181 beams that all end at once: a module that drives by it stops."""
    beams = struct.pack("<f", range_m) * 181
    return struct.pack("<fff", -1.57, 0.01745, 8.0) + varint(181) + beams + b"\0"


def line(module, words, lost=0, ahead_s=0):
    stamp_ns = time.time_ns() + ahead_s * 1_000_000_000
    no_errno = b"\x00"
    return varint(stamp_ns) + varint(module) + b"\x02" + varint(lost) + varint(0) + no_errno + text(words)


class Attacks:
    """Each by its name: a package as (to, sender, kind, id, body, priority, options).

    `own` are modules that the program may speak for; `laser` is the hash of the laser's interface,
    which the laser tells any caller.
    """

    def __init__(self, own, laser):
        self.own, self.laser, self.sequence = own, laser, itertools.count(1)
        self.incarnation = int(time.time()) & 0xFFFFFFFF

    def all(self):
        return {
            "scan": self.scan(self.own[0]),
            "scan-as-laser": self.scan(LASER),
            "drive": self.call(MOTOR, self.own[0], DRIVE, 0, 1_000_000, struct.pack("<dd", 1.0, 0.0)),
            "transit": (next(self.some(ROUTERS)) | TRANSIT, self.own[0], data(1), 0, b"x" * 64, 16, 0),
            "tunnel": (next(self.some(ROUTERS)) | TUNNEL, self.own[0], data(1), 0, b"\x45" + bytes(59), 16, 0),
            "line-as-motor": self.line(line(MOTOR, "is on fire")),
            "line-flood": self.line(line(self.own[0], "\x1b[2Jall is well")),
            "line-future": self.line(line(self.own[0], "from tomorrow", ahead_s=86_400)),
            "line-lost": self.line(line(self.own[0], "many", lost=4_000_000_000)),
            "priority": (MAPPER | 2, self.own[0], data(1), 0, stamped(time.time_ns(), 0, scan(1.0)), 255, STAMPED),
            "call-forever": self.call(PILOT, next(self.some(self.own)), STATUS, COMMON_FUNCTIONS, FOREVER, b""),
            "lease-forever": self.lease(next(self.some(self.own))),
            "absent": (self.absent(), self.own[0], data(1), 0, b"nobody", 16, 0),
            "far-class": (MAPPER, self.own[0], -STATUS, 0, struct.pack("<II", 1, 1), 255, 0),
        }

    def some(self, of):
        return itertools.cycle(of[next(self.sequence) % len(of) :] + of)

    def scan(self, sender):
        sequence = next(self.sequence)
        body = stamped(time.time_ns(), sequence, scan(0.05))
        return (PILOT | 2, sender, data(SCAN), sequence % 3, body, 140, STAMPED)

    def call(self, to, sender, function, interface, valid_us, arguments):
        sequence = next(self.sequence)
        body = command(interface, self.incarnation, sequence, valid_us, arguments)
        return (to, sender | 1, function, sequence & 0xFFFF, body, 255, 0)

    def lease(self, sender):
        wish = varint(SCAN) + varint(next(self.sequence) & 0xFFFF) + varint(0) + varint(FOREVER) + b"\x02"
        return self.call(LASER, sender, SUBSCRIBE, self.laser, FOREVER, wish)

    def line(self, value):
        body = stamped(time.time_ns(), next(self.sequence), value)
        return (OUTPUT | LINES, self.own[0], data(LINE), 0, body, 255, STAMPED)

    def absent(self):
        """Another name each time, of classes that the robot has, and of others."""
        number = next(self.sequence) * 2_654_435_761 & 0xFFFF
        return name("1.96.0.0") & 0xFF000000 | (number | 0x0101) << 8 | 7
