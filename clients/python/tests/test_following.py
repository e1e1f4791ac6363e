"""Descriptions and subscriptions without a socket: time and answers are arguments."""

from __future__ import annotations

import unittest
from typing import Any

import rohrpost as rp
from rohrpost.common import DescriptionPart, type_of_class
from rohrpost.faults import INTERFACE_DIFFERS, Fault
from rohrpost.names import Name
from rohrpost.remote.calls import Caller
from rohrpost.remote.following import Describing, Following, NoSuchData, item_of
from rohrpost.schema import encode, tree
from rohrpost.schema.description import DataItem, Description
from rohrpost.schema.tree import Field
from rohrpost.wire import DESCRIBE, ERROR, CallEnvelope, Package, ReplyEnvelope, package

from .modules import Probe

SECOND = 1_000_000_000
PROBE = Name.of(7, 96, 0)


class Followed(unittest.TestCase):
    def setUp(self) -> None:
        self.now_ns = 100 * SECOND
        self.asked: list[Package] = []
        self.caller = Caller(Name.of(7, 16, 0), 1, lambda _, its: self.asked.append(its))

    def answer(self, body: bytes, options: int = 0) -> None:
        """To what was asked last."""
        its = self.asked[-1]
        envelope, _ = CallEnvelope.split(its.body)
        front = ReplyEnvelope(envelope.incarnation, envelope.sequence).to_bytes()
        head = its.head
        self.caller.take(package(head.sender, head.to, -head.kind, head.id, front + body, 16, options))

    def part(self, whole: bytes, at: int, length: int) -> bytes:
        return encode(type_of_class(DescriptionPart), DescriptionPart(len(whole), whole[at : at + length]))

    def test_all_parts_of_a_description_come_in_one_time(self) -> None:
        found: list[Any] = []
        whole = Probe.interface_.description.to_bytes()
        Describing(self.caller, lambda: self.now_ns, PROBE, SECOND, found.append)
        # Bytes that come one by one, each in time.
        for at in range(4):
            self.answer(self.part(whole, at, 1))
            self.now_ns += SECOND // 5
            self.caller.poll(self.now_ns)
        self.assertEqual(found, [])
        self.now_ns += SECOND // 5
        self.caller.poll(self.now_ns)
        self.assertEqual([type(it) for it in found], [rp.CallTimeout])
        self.assertIn("within 1s;", str(found[0]))

    def test_a_subscription_waits_longer_for_many_parts_than_for_one(self) -> None:
        problems: list[Any] = []
        following = Following(
            self.caller, lambda: self.now_ns, 1, PROBE, "beat", None, 0, False, lambda _: None, problems.append
        )
        whole = Probe.interface_.description.to_bytes()
        following.poll(self.now_ns)
        for at in range(9):
            self.answer(self.part(whole, at, 1))
            self.now_ns += SECOND - 1
            self.caller.poll(self.now_ns)
        self.assertEqual(problems, [])
        self.now_ns += 1
        self.caller.poll(self.now_ns)
        self.assertIn("within 1s;", str(problems[0]))

    def test_one_whose_interface_always_differs_is_asked_with_pauses(self) -> None:
        problems: list[Any] = []
        following = Following(
            self.caller, lambda: self.now_ns, 1, PROBE, "beat", None, 0, False, lambda _: None, problems.append
        )
        whole = Probe.interface_.description.to_bytes()
        for _ in range(10):
            following.poll(self.now_ns)
            if self.asked and self.asked[-1].head.kind == DESCRIBE:
                self.answer(self.part(whole, 0, len(whole)))
                self.answer(Fault(INTERFACE_DIFFERS, (1,)).to_bytes(), ERROR)
            self.now_ns += SECOND // 20
        self.assertEqual((len(self.asked), len(problems)), (2, 1))

    def test_names_of_others_stay_in_their_line(self) -> None:
        described = Description("Any", "any", (), (DataItem(1, Field("\x1b[2J\n", tree.U8)),))
        with self.assertRaises(NoSuchData) as missing:
            item_of(PROBE, described, "beat", None, "data")
        self.assertTrue(str(missing.exception).endswith("it has: \\u{1b}[2J\\n"), missing.exception)


if __name__ == "__main__":
    unittest.main()
