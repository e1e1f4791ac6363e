"""A hosted module without a socket: what others send costs bounded memory, whatever the module does meanwhile."""

from __future__ import annotations

import unittest

from rohrpost.common import Subscribe
from rohrpost.faults import BUSY, MAILBOX_FULL, Fault
from rohrpost.names import Name
from rohrpost.remote.hosted import Hosted
from rohrpost.remote.timing import SystemTime
from rohrpost.remote.work import WorkQueue
from rohrpost.wire import COMMON_HASH, ERROR, ON, SET_PARAMETERS, STATUS, SUBSCRIBE, CallEnvelope, Package, package

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

    def refused(self, first: int, count: int) -> int:
        """How many of so many callers are refused a place."""
        self.sent.clear()
        for sender in range(first, first + count):
            self.hosted.take(self.now_ns, self.command(sender, 1, STATUS, COMMON_HASH))
        self.assertEqual({*self.faults()} - {BUSY}, set())
        return len(self.faults())

    def test_callers_are_bounded_and_forgotten_when_no_repeat_can_come(self) -> None:
        # Each class, and each other system, gets as many places as it leaves free.
        self.assertEqual(self.refused(0x076000, 100), 68)
        self.assertEqual(self.refused(0x076100, 100), 84)
        self.assertEqual(self.refused(0x086000, 50) + self.refused(0x086100, 50), 92)
        self.now_ns += 70 * SECOND
        self.assertEqual(self.refused(0x077000, 32), 0)

    def test_subscriptions_are_shared_alike(self) -> None:
        publisher = self.hosted.publisher
        for system, places in ((7, 32), (8, 16), (9, 8)):
            taken = 0
            for id in range(100):
                asked = self.command(system << 16 | 0x6000 | id, 1, SUBSCRIBE, COMMON_HASH)
                taken += publisher.subscribe(self.now_ns, asked, 1, Subscribe(1, id, 0, 60_000, 2))
            self.assertEqual(taken, places)


if __name__ == "__main__":
    unittest.main()
