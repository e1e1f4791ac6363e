"""Names, packages and sessions by `docs/src/wire.md`, with the standard library alone: for programs that are no
nodes."""

import os
import socket
import ssl
import struct
import time

HELLO, WELCOME, REFUSAL, REGISTER, REGISTERED, PACKAGE, ASK, ANSWER = range(1, 9)
MAGIC = b"RpTc"
COMMON_FUNCTIONS = 3
ON, OFF, STATUS, GET_DATA, SUBSCRIBE, DESCRIBE = 1, 2, 3, 4, 5, 8
BIG_ENDIAN, STAMPED, ERROR = 1, 2, 4


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
    return varint(len(words.encode())) + words.encode()


def name(words):
    system, kind, instance, local = map(int, words.split("."))
    return system << 24 | kind << 16 | instance << 8 | local


def data(number):
    """The type of data of this number."""
    return -16384 - number


def package(to, sender, kind, id, body, priority, options=0, order="<"):
    """A package: its head and its body."""
    options |= BIG_ENDIAN if order == ">" else 0
    head = struct.pack(order + "IIHhH", to, sender, len(body), kind, id)
    return head + bytes([priority, options]) + body


def fields(package):
    """The fields of a package's head, and its body."""
    head, body = package[:16], package[16:]
    return struct.unpack((">" if head[15] & BIG_ENDIAN else "<") + "IIHhH", head[:14]) + (head[15], body)


def command(interface, incarnation, sequence, valid_us, arguments):
    """The body of a command, its first try."""
    return struct.pack("<IIIII", interface, incarnation, sequence, valid_us, 0) + arguments


def stamped(stamp_ns, sequence, value, incarnation=0):
    """The body of data, to the subscriber of this incarnation."""
    return struct.pack("<QIII", stamp_ns, sequence, 0, incarnation) + value


class Session:
    """Frames over a stream, and packages in them."""

    def __init__(self, stream, own, digests, order):
        self.stream, self.own, self.digests = stream, own, digests
        self.order, self.kept, self.asked = (">" if order == "big" else "<"), b"", 0.0
        self.incarnation = int(time.time() * 1000) & 0xFFFFFFFF
        self.sequence = 0

    def say(self, kind, rest):
        self.stream.sendall(struct.pack("<IBBH", len(rest), kind, 0, 0) + rest)

    def frame(self, until=None):
        """The next frame, none by then; on the way it asks for the time, which says that it is there."""
        while until is None or time.monotonic() < until:
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
        return None, b""

    def meet(self, ranges, name):
        hello = struct.pack(
            "<4sBBBBQQQQQ", MAGIC, 1, self.own >> 24, 0, 0, *self.digests, self.incarnation, 1, time.monotonic_ns()
        )
        self.say(HELLO, hello + name.encode())
        kind, rest = self.frame()
        if kind == REFUSAL:
            raise SystemExit(f"refused, reason {rest[5]}: {rest[24:].decode()}")
        assert kind == WELCOME and rest[:5] == MAGIC + b"\x01", (kind, rest)
        self.asked = time.monotonic()
        self.register(1, ranges)
        kind, rest = self.frame()
        assert kind == REGISTERED and rest[4] == 0, rest

    def register(self, number, ranges):
        self.say(REGISTER, struct.pack("<I", number) + b"".join(struct.pack("<II", *both) for both in ranges))

    def send(self, to, sender, kind, id, body, priority, options=0):
        self.say(PACKAGE, struct.pack("<Q", 0) + package(to, sender, kind, id, body, priority, options, self.order))

    def package(self):
        """The next package: its head's fields, in whatever order they come, and its body."""
        while True:
            kind, rest = self.frame()
            if kind == REFUSAL:
                raise SystemExit(f"refused, reason {rest[5]}: {rest[24:].decode()}")
            if kind == PACKAGE:
                return fields(rest[8:])


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
