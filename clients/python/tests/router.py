"""A TCP router that does as little as tests need: takes hellos, believes registrations, and hands packages on."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable

COMMON = 7
WELCOME, REFUSAL, REGISTERED, PACKAGE, ANSWER = 2, 3, 5, 6, 8
HELLO, REGISTER, ASK = 1, 4, 7


def frame(kind: int, rest: bytes) -> bytes:
    return struct.pack("<IBBH", len(rest), kind, 0, 0) + rest


class Connection:
    """One client's session, as the server has it. ``write`` takes bytes for the client."""

    def __init__(self, router: Router, write: Callable[[bytes], None]) -> None:
        self._router = router
        self.write = write
        self._kept = b""
        self.ranges: list[tuple[int, int]] = []
        self.registered: list[list[tuple[int, int]]] = []
        """What it hosted, one registration after the other."""

    def received(self, data: bytes) -> None:
        self._kept += data
        while len(self._kept) >= 8:
            length, kind = struct.unpack("<IB", self._kept[:5])
            if len(self._kept) < 8 + length:
                return
            rest, self._kept = self._kept[8 : 8 + length], self._kept[8 + length :]
            self._handle(kind, rest)

    def _handle(self, kind: int, rest: bytes) -> None:
        now_ns = self._router.now_ns()
        if kind == HELLO:
            (asked,) = struct.unpack("<Q", rest[40:48])
            head = struct.pack("<4sB3xQQ", b"RpTc", 1, COMMON, self._router.incarnation)
            self.write(frame(WELCOME, head + self._answer(asked, now_ns)))
        elif kind == REGISTER:
            number, *names = struct.unpack(f"<{len(rest) // 4}I", rest)
            ranges = list(zip(names[::2], names[1::2]))
            taken = self._router.taken(self, ranges)
            if taken is None:
                self.ranges = ranges
                self.registered.append(ranges)
                self.write(frame(REGISTERED, struct.pack("<IB3xII", number, 0, 0, 0)))
            else:
                self.write(frame(REGISTERED, struct.pack("<IB3xII", number, 1, *taken) + b"another"))
        elif kind == ASK:
            self.write(frame(ANSWER, self._answer(struct.unpack("<Q", rest)[0], now_ns)))
        elif kind == PACKAGE:
            self._router.carry(rest, self)

    def _answer(self, asked: int, now_ns: int) -> bytes:
        return struct.pack("<6Q", asked, now_ns, now_ns, 10**18 + now_ns, 1000, 3)


class Router:
    """All connections. ``sees`` decides what becomes of a package: how often it is handed on."""

    def __init__(self, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self.now_ns = now_ns
        self.incarnation = 1
        self.connections: list[Connection] = []
        self.is_strict = False
        """Whether a name has one host."""
        self.sees: Callable[[bytes], int] = lambda package: 1

    def connect(self, write: Callable[[bytes], None]) -> Connection:
        connection = Connection(self, write)
        self.connections.append(connection)
        return connection

    def taken(self, by: Connection, ranges: list[tuple[int, int]]) -> tuple[int, int] | None:
        """The first of these ranges of which another connection hosts a part."""
        if not self.is_strict:
            return None
        others = [range for other in self.connections if other is not by for range in other.ranges]
        return next((its for its in ranges if any(its[0] <= last and first <= its[1] for first, last in others)), None)

    def host_of(self, name: int) -> Connection | None:
        """The connection that hosts a name."""
        for connection in list(self.connections):
            if any(first <= name <= last for first, last in connection.ranges):
                return connection
        return None

    def carry(self, rest: bytes, by: Connection) -> None:
        """Hands a package on, but not back: as the real one does."""
        order = ">" if rest[8 + 15] & 1 else "<"
        (to,) = struct.unpack(order + "I", rest[8:12])
        for connection in list(self.connections):
            if connection is not by and any(first <= to <= last for first, last in connection.ranges):
                for _ in range(self.sees(rest[8:])):
                    connection.write(frame(PACKAGE, rest))


class Server:
    """The same at a port of this computer."""

    def __init__(self) -> None:
        self.router = Router()
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._socket.getsockname()[1]}"
        self._streams: list[socket.socket] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                stream, _ = self._socket.accept()
            except OSError:
                return
            self._streams.append(stream)
            threading.Thread(target=self._serve, args=(stream,), daemon=True).start()

    def _serve(self, stream: socket.socket) -> None:
        def write(data: bytes) -> None:
            try:
                stream.sendall(data)
            except OSError:
                return

        with self._lock:
            connection = self.router.connect(write)
        try:
            while data := stream.recv(65536):
                with self._lock:
                    connection.received(data)
        except OSError:
            pass
        with self._lock:
            self.router.connections.remove(connection)
        stream.close()

    def drop_all(self) -> None:
        """Breaks all connections."""
        for stream in self._streams:
            try:
                stream.shutdown(socket.SHUT_RDWR)
            except OSError:
                continue
        self._streams.clear()

    def close(self) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self.drop_all()
