"""A program that is no node takes part at a TCP router. Written from docs/src/wire.md, with the standard library
alone.

Arguments: address and port of the TCP router, both digests (hex, with `-` between), its own name (`3.96.0.0`), the
byte order of its heads (`little` or `big`), the name of a probe (`1.96.0.0`), and, for a sealed session, the folder
of certificates and the name of its own.

It hosts that name with one function, `double` (u32) -> u32, calls `count` of the probe, subscribes to its `beat`, and
prints the results.
"""

import struct
import sys
import time

from wire import DESCRIBE, ERROR, SUBSCRIBE, Session, command, connect, data, name, text, unvarint, varint

COUNT, DOUBLE, BEAT = 16, 16, 1
INTERFACE_DIFFERS, UNKNOWN_FUNCTION = 3, 4
PRIORITY = 96

# Descriptions: their version, and the tag of a u32. A field's marks are 0 when nothing more is said of it.
VERSION, U32, NO_MARKS = b"\x02", b"\x04", b"\x00"
DESCRIPTION = (
    VERSION + text("Doubling") + text("probe") + text("Doubles numbers")
    + varint(1) + varint(DOUBLE) + text("double") + text("Twice the number") + b"\x01"
    + varint(1) + text("number") + NO_MARKS + U32 + U32
    + varint(0)
)


class Program(Session):
    """Calls, and is called."""

    def call(self, to, function, interface, arguments):
        """The result, or the number of a fault and what it carries. Answers others meanwhile."""
        self.sequence += 1
        sequence, own = self.sequence, self.own | 1
        body = command(interface, self.incarnation, sequence, 5_000_000, arguments)
        self.send(to, own, function, sequence & 0xFFFF, body, PRIORITY)
        while True:
            package = self.package()
            _, sender, _, kind, _, options, body = package
            if kind == -function and sender == to and body[:8] == struct.pack("<II", self.incarnation, sequence):
                fault = unvarint(body[8:])[0] if options & ERROR else None
                return fault, body[9:] if options & ERROR else body[8:]
            self.serve(package)

    def serve(self, package):
        """Answers a command of somebody else; whether it was one."""
        to, sender, _, kind, id, _, body = package
        if not 0 < kind < 16384:
            return False
        interface, incarnation, sequence = struct.unpack("<III", body[:12])
        arguments, options = body[20:], 0
        if kind == DESCRIBE:
            at, _ = unvarint(arguments)
            part = DESCRIPTION[at : at + 768]
            result = varint(len(DESCRIPTION)) + varint(len(part)) + part
        elif kind == DOUBLE:
            number, _ = unvarint(arguments)
            result = varint(2 * number)
            print(f"doubled {number}", flush=True)
        else:
            result, options = varint(UNKNOWN_FUNCTION) + varint(kind), ERROR
        self.send(sender, to, -kind, id, struct.pack("<II", incarnation, sequence) + result, PRIORITY, options)
        return True


def main():
    address, port, digests, own, order, probe, *certificates = sys.argv[1:]
    digests = [int(digest, 16) for digest in digests.split("-")]
    session = Program(connect(address, int(port), certificates), name(own), digests, order)
    session.meet([(session.own, session.own | 0xFF)], "a program in Python")
    print("takes part", flush=True)
    probe = name(probe)
    # Which interface the probe has it says when it is asked for another one.
    fault, rest = session.call(probe, COUNT, 1, varint(7))
    assert fault == INTERFACE_DIFFERS, (fault, rest)
    interface, _ = unvarint(rest)
    fault, rest = session.call(probe, COUNT, interface, varint(7))
    assert fault is None, (fault, rest)
    print(f"counted {unvarint(rest)[0]}", flush=True)
    wish = varint(BEAT) + varint(1) + varint(0) + varint(3000) + b"\x02"
    renewed, beats = 0.0, 0
    while True:
        if time.monotonic() - renewed > 1:
            renewed = time.monotonic()
            fault, rest = session.call(probe, SUBSCRIBE, interface, wish)
            assert fault is None, (fault, rest)
        package = session.package()
        own = struct.pack("<I", session.incarnation)
        if not session.serve(package) and package[3] == data(BEAT) and package[6][16:20] == own:
            beats += 1
            if beats == 3:
                print("heard 3 beats", flush=True)


main()
