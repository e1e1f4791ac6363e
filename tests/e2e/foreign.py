"""A program that is no node takes part at a TCP router. Written from docs/src/wire.md, with the standard library alone.

Arguments: address and port of the TCP router, the common digest (hex), its own system, the byte order of its heads (`little` or `big`), the name of
a probe in another system (`1.96.0.0`), and, for a sealed session, the folder of certificates and the name of its own.

It hosts SYSTEM.96.0 with one function, `double` (u32) -> u32, calls `count` of the probe, subscribes to its `beat`, and prints what comes.
"""

import os
import socket
import ssl
import struct
import sys
import time

HELLO, WELCOME, REFUSAL, REGISTER, REGISTERED, PACKAGE, ASK, ANSWER = range(1, 9)
MAGIC = b"RpTc"
COMMON_FUNCTIONS = 2
GET_DATA, SUBSCRIBE, DESCRIBE, COUNT, DOUBLE, BEAT = 4, 5, 8, 16, 16, 1
INTERFACE_DIFFERS, UNKNOWN_FUNCTION = 3, 4
BIG_ENDIAN, ERROR = 1, 4
PRIORITY = 96


def varint(number):
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes(out + bytes([number]))


def unvarint(data):
    number = shift = 0
    for at, byte in enumerate(data):
        number |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return number, data[at + 1 :]
    raise ValueError("a number without an end")


def text(words):
    return varint(len(words)) + words.encode()


def name(words):
    system, kind, instance, local = map(int, words.split("."))
    return system << 24 | kind << 16 | instance << 8 | local


# `OwnedNamedType` of a u32: its name, and its place among the kinds of types.
U32 = text("u32") + varint(8)
DESCRIPTION = (
    text("Doubling") + text("probe") + text("Doubles numbers")
    + varint(1) + varint(DOUBLE) + text("double") + text("Twice the number") + b"\x01"
    + varint(1) + text("number") + U32 + U32
    + varint(0)
)


class Session:
    """Frames over a stream, and packages in them."""

    def __init__(self, stream, system, common, order):
        self.stream, self.system, self.common = stream, system, common
        self.order, self.kept, self.asked = (">" if order == "big" else "<"), b"", 0.0
        self.life = self.incarnation = int(time.time() * 1000) & 0xFFFFFFFF
        self.sequence = 0

    def say(self, kind, rest):
        self.stream.sendall(struct.pack("<IBBH", len(rest), kind, 0, 0) + rest)

    def frame(self):
        """The next frame; on the way it asks for the time, which says that it is there."""
        while True:
            if time.monotonic() - self.asked > 1 and self.asked:
                self.asked = time.monotonic()
                self.say(ASK, struct.pack("<Q", time.monotonic_ns()))
            if len(self.kept) >= 8:
                length, kind = struct.unpack("<IB", self.kept[:5])
                if len(self.kept) >= 8 + length:
                    rest, self.kept = self.kept[8 : 8 + length], self.kept[8 + length :]
                    return kind, rest
            try:
                piece = self.stream.recv(65536)
            except (TimeoutError, ssl.SSLWantReadError):
                continue
            if not piece:
                raise SystemExit("the TCP router closed the connection")
            self.kept += piece

    def meet(self):
        hello = struct.pack(
            "<4sBBBBQQQQQ", MAGIC, 1, self.system, 0, 0, self.common, 1, self.life, 1, time.monotonic_ns()
        )
        self.say(HELLO, hello + b"a program in Python")
        kind, rest = self.frame()
        if kind == REFUSAL:
            raise SystemExit(f"refused, reason {rest[5]}: {rest[24:].decode()}")
        assert kind == WELCOME and rest[:5] == MAGIC + b"\x01", (kind, rest)
        self.asked = time.monotonic()
        first = name(f"{self.system}.96.0.0")
        self.say(REGISTER, struct.pack("<III", 1, first, first | 0xFF))
        kind, rest = self.frame()
        assert kind == REGISTERED and rest[4] == 0, rest

    def send(self, to, sender, kind, id, body, options=0):
        head = struct.pack(self.order + "IIHhH", to, sender, len(body), kind, id)
        options |= BIG_ENDIAN if self.order == ">" else 0
        self.say(PACKAGE, struct.pack("<Q", 0) + head + bytes([PRIORITY, options]) + body)

    def package(self):
        """The next package: its head's fields, in whatever order they come, and its body."""
        while True:
            kind, rest = self.frame()
            if kind == REFUSAL:
                raise SystemExit(f"refused, reason {rest[5]}: {rest[24:].decode()}")
            if kind == PACKAGE:
                head, body = rest[8:24], rest[24:]
                order = ">" if head[15] & BIG_ENDIAN else "<"
                return struct.unpack(order + "IIHhH", head[:14]) + (head[15], body)

    def call(self, to, function, interface, arguments):
        """The result, or the number of a fault and what it carries. Answers others meanwhile."""
        self.sequence += 1
        sequence, own = self.sequence, name(f"{self.system}.96.0.1")
        body = struct.pack("<IIIII", interface, self.incarnation, sequence, 5_000_000, 0) + arguments
        self.send(to, own, function, sequence & 0xFFFF, body)
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
        self.send(sender, to, -kind, id, struct.pack("<II", incarnation, sequence) + result, options)
        return True


def connect(address, port, certificates):
    stream = socket.create_connection((address, port), timeout=5)
    if certificates:
        folder, own = certificates
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.load_verify_locations(os.path.join(folder, "ca.pem"))
        context.load_cert_chain(os.path.join(folder, f"{own}.pem"), os.path.join(folder, f"{own}.key"))
        stream = context.wrap_socket(stream, server_hostname="tcp-router.rohrpost")
    stream.settimeout(0.2)
    return stream


def main():
    address, port, common, system, order, probe, *certificates = sys.argv[1:]
    session = Session(connect(address, int(port), certificates), int(system), int(common, 16), order)
    session.meet()
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
        if not session.serve(package) and package[3] == -16384 - BEAT:
            beats += 1
            if beats == 3:
                print("heard 3 beats", flush=True)


main()
