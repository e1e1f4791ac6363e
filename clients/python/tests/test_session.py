"""The session without a socket: time and bytes are arguments."""

from __future__ import annotations

import struct
import unittest

from rohrpost import NotSent
from rohrpost.remote.session import Session, Settings, Step
from rohrpost.wire import NEWEST, Package, data_kind, package

from .modules import INSTALLATION
from .router import REFUSAL, Router, frame

MS = 1_000_000


class Line:
    """A session, the router, and the time between them."""

    def __init__(self, quota_bytes: int = 1 << 20) -> None:
        self.now_ns = 10_000 * MS
        self.said: list[tuple[bool, str]] = []
        self.came: list[Package] = []
        self.router = Router(lambda: self.now_ns)
        self.session = Session(
            Settings(INSTALLATION, "a test", 5, quota_bytes), [(0x07600000, 0x076000FF)], self.now_ns,
            lambda _, its: self.came.append(its), lambda is_up, words: self.said.append((is_up, words)),
        )  # fmt: skip
        self.to_client = bytearray()
        self.connection = self.router.connect(self.to_client.extend)
        self.is_deaf = False

    def turn(self) -> tuple[Step, int]:
        """Until there is nothing to do now."""
        while True:
            step, until_ns = self.session.poll(self.now_ns)
            if step is Step.CONNECT:
                self.connection = self.router.connect(self.to_client.extend)
                self.session.connected(self.now_ns)
            elif step is Step.WRITE:
                ready = self.session.ready()
                self.session.took(self.now_ns, len(ready))
                if not self.is_deaf:
                    self.connection.received(ready)
            elif step is Step.CLOSE:
                self.to_client.clear()
            if self.to_client:
                data, self.to_client[:] = bytes(self.to_client), b""
                self.session.received(self.now_ns, data)
            elif step is Step.WAIT:
                return step, until_ns

    def ids_seen(self) -> list[int]:
        """Ids of the packages that reach the router from now on, which hands none of them on."""
        seen: list[int] = []

        def see(its: bytes) -> int:
            seen.append(its[12])
            return 0

        self.router.sees = see
        return seen

    def pass_time(self, ms: int) -> None:
        for _ in range(ms // 10):
            self.now_ns += 10 * MS
            self.turn()


def beat(number: int, priority: int, options: int = 0, size: int = 10) -> Package:
    return package(0x07600102, 0x07600000, data_kind(1), number, bytes(size), priority, options)


class Sessions(unittest.TestCase):
    def test_it_takes_part_and_knows_the_time(self) -> None:
        line = Line()
        line.turn()
        self.assertEqual(line.said, [(True, "takes part")])
        time = line.session.clock.system(line.now_ns)
        assert time is not None
        self.assertLess(abs(time.ns - 10**18 - line.now_ns), time.error_ns)

    def test_frames_may_be_split_anywhere(self) -> None:
        line = Line()
        line.session.poll(line.now_ns)
        line.session.connected(line.now_ns)
        line.connection.received(line.session.ready())
        for byte in bytes(line.to_client):
            line.session.received(line.now_ns, bytes([byte]))
        line.to_client.clear()
        line.session.took(line.now_ns, len(line.session.ready()))
        line.turn()
        self.assertTrue(line.session.is_up)

    def test_what_is_no_session_is_told_and_tried_again(self) -> None:
        for data, why in [
            (b"HTTP/1.1 400 Bad Request\r\n", "no session of Rohrpost; is this the port of its TCP router?"),
            (b"\x15\x03\x03\x00\x02\x02\x28\x00", "it speaks TLS; write the same `security` in [tcp] at both ends"),
            (struct.pack("<IBBH", 1 << 30, 6, 0, 0), "a frame of 1073741824 bytes is too long"),
            (frame(6, bytes(10)), "damaged: a package without a head"),
            (frame(8, bytes(48)), "damaged: a frame that is not for now"),
            (
                frame(REFUSAL, b"RpTc" + struct.pack("<BBHQQ", 1, 3, 0, 1, 2) + b"base"),
                "the system's digest here is 0000000000000001, that of base 0000000000000002; start all of a system "
                "from the same file (`rohrpost check`, on both)",
            ),
            (
                frame(REFUSAL, b"RpTc" + struct.pack("<BBHQQ", 1, 3, 0, 1, 2) + b"\x1b[2J"),
                "damaged: a text that is none",
            ),
        ]:
            line = Line()
            line.session.poll(line.now_ns)
            line.session.connected(line.now_ns)
            line.session.received(line.now_ns, data)
            self.assertEqual(line.said, [(False, why)])
            line.pass_time(2500)
            self.assertTrue(line.session.is_up, "tried again")

    def test_a_server_that_falls_silent_is_left(self) -> None:
        line = Line()
        line.turn()
        line.is_deaf = True
        line.pass_time(3000)
        self.assertTrue(line.session.is_up, "not at once")
        line.pass_time(2500)
        self.assertFalse(line.session.is_up)
        self.assertEqual(line.said[-1], (False, "nothing came from the TCP router for too long"))
        line.is_deaf = False
        line.pass_time(8000)
        self.assertEqual(line.said[-1], (True, "takes part"))

    def test_what_waits_leaves_by_priority_and_the_newest_alone_where_that_is_asked(self) -> None:
        line = Line()
        seen = line.ids_seen()
        line.connection.ranges = [(0, 0xFFFFFFFF)]
        for number, priority, options in [(1, 16, 0), (2, 96, 0), (3, 50, NEWEST), (3, 50, NEWEST), (4, 96, 0)]:
            line.session.send(line.now_ns, beat(number, priority, options))
        line.router.connections[0].ranges = [(0, 0xFFFFFFFF)]
        line.turn()
        self.assertEqual(seen, [2, 4, 3, 1])

    def test_at_the_quota_the_newest_of_the_least_important_gives_way(self) -> None:
        line = Line(quota_bytes=2000)
        for number in range(4):
            line.session.send(line.now_ns, beat(number, 16, size=400))
        with self.assertRaises(NotSent):
            line.session.send(line.now_ns, beat(9, 16, size=400))
        line.session.send(line.now_ns, beat(5, 96, size=400))
        seen = line.ids_seen()
        line.router.connections[0].ranges = [(0, 0xFFFFFFFF)]
        line.turn()
        self.assertEqual(seen, [5, 0, 1, 2])

    def test_what_is_too_old_neither_leaves_nor_is_delivered(self) -> None:
        line = Line()
        line.session.send(line.now_ns - 1600 * MS, beat(1, 16))
        seen = line.ids_seen()
        line.router.connections[0].ranges = [(0, 0xFFFFFFFF)]
        line.turn()
        self.assertEqual(seen, [])
        for age_ms, count in [(1700, 1), (2000, 1)]:
            published = struct.pack("<Q", line.now_ns - age_ms * MS)
            line.session.received(line.now_ns, frame(6, published + beat(2, 16).to_bytes()))
            self.assertEqual(len(line.came), count, f"{age_ms} ms")

    def test_a_priority_above_what_its_sender_may_have_is_lowered(self) -> None:
        line = Line()
        line.turn()
        command = package(0x07600000, 0x07100001, 16, 1, bytes(20), 255)
        line.session.received(line.now_ns, frame(6, struct.pack("<Q", 0) + command.to_bytes()))
        self.assertEqual(line.came[0].head.priority, 16)


if __name__ == "__main__":
    unittest.main()
