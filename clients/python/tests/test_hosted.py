"""A hosted module without a socket: what others send costs bounded memory, whatever the module does meanwhile."""

from __future__ import annotations

import unittest

from rohrpost.faults import BUSY, MAILBOX_FULL, Fault
from rohrpost.names import Name
from rohrpost.remote.hosted import Hosted
from rohrpost.remote.timing import SystemTime
from rohrpost.remote.work import WorkQueue
from rohrpost.wire import COMMON_HASH, ERROR, ON, SET_PARAMETERS, STATUS, CallEnvelope, Package, package

from .modules import Probe

SECOND = 1_000_000_000


class Bounds(unittest.TestCase):
    def setUp(self) -> None:
        self.sent: list[Package] = []
        self.now_ns = 100 * SECOND
        self.work = WorkQueue(lambda: None)
        self.hosted = Hosted(
            Name.of(7, 96, 0), Probe(), self.now_ns, 1, lambda _, its: self.sent.append(its),
            lambda now_ns: SystemTime(now_ns, 0, 1), self.work, lambda: self.now_ns,
        )  # fmt: skip

    def command(self, sender: int, sequence: int, number: int, interface: int, arguments: bytes = b"") -> Package:
        body = CallEnvelope(interface, 1, sequence, 60_000_000).to_bytes() + arguments
        return package(self.hosted.name.raw, sender << 8 | 1, number, sequence & 0xFFFF, body, 96)

    def faults(self) -> list[int]:
        return [Fault.from_bytes(its.body[8:]).number for its in self.sent if its.head.options & ERROR]

    def test_work_of_a_module_that_stands_still_does_not_pile_up(self) -> None:
        for number, interface, arguments in [
            (ON, COMMON_HASH, b""),
            (SET_PARAMETERS, COMMON_HASH, b"\0\0"),
            (16, self.hosted.interface.description.hash, b"\1"),
        ]:
            for sequence in range(200):
                self.hosted.take(self.now_ns, self.command(0x076000 + number, sequence, number, interface, arguments))
        held = 0
        while self.work.next() is not None:
            held += 1
        self.assertLessEqual(held, WorkQueue.MAX)
        self.assertIn(MAILBOX_FULL, self.faults())

    def test_callers_are_bounded_and_forgotten_when_no_repeat_can_come(self) -> None:
        for sender in range(100):
            self.hosted.take(self.now_ns, self.command(0x076000 + sender, 1, STATUS, COMMON_HASH))
        self.assertEqual(self.faults(), [BUSY] * 36)
        self.now_ns += 70 * SECOND
        self.sent.clear()
        self.hosted.take(self.now_ns, self.command(0x077000, 1, STATUS, COMMON_HASH))
        self.assertEqual(self.faults(), [])


if __name__ == "__main__":
    unittest.main()
