"""Modules on the node, as far as they need no node: their interface, what is due, views of shared memory."""

from __future__ import annotations

import pickle
import threading
import unittest
from collections.abc import Callable
from typing import Any, Optional, cast
from unittest import mock

import rohrpost as rp
from rohrpost.node.failures import call_failure, words_of
from rohrpost.node.plans import plan_of
from rohrpost.node.timed import Timed
from rohrpost.node.views import VIEWED_MIN, Held
from rohrpost.schema.encode import encode
from rohrpost.annotations import type_of

from .memory import Memory

MS = 1_000_000


class Feeler(rp.Module, klass="feeler", settings=("port",)):
    """Feels."""

    @rp.stream(1, unit="m")
    def gap(self) -> float:
        """How wide."""
        raise AssertionError("it is never run")

    @rp.data_out(2, rate_hz=100)
    def force(self) -> float:
        """How hard."""
        return 0.0

    @rp.every(0.025)
    def rest(self) -> None:
        """Rests."""


class Nodes(unittest.TestCase):
    def test_streams_are_described_and_settings_known(self) -> None:
        items = Feeler.interface_.description.data
        self.assertEqual([(it.number, it.name, it.is_stream) for it in items], [(1, "gap", True), (2, "force", False)])
        self.assertEqual((items[0].field.unit, Feeler.interface_.settings), ("m", ("port",)))

    def test_what_is_for_the_node_says_so_elsewhere(self) -> None:
        uses: list[Callable[[Feeler], Any]] = [
            lambda it: it.now_ns(), lambda it: it.write("gap", 1.0), lambda it: it.settings
        ]  # fmt: skip
        for use in uses:
            with self.assertRaisesRegex(rp.Misuse, "hosted by nobody yet"):
                use(Feeler())

    def test_run_is_refused_where_it_cannot_be(self) -> None:
        if not rp.is_available():
            with self.assertRaisesRegex(rp.Misuse, "installed without its part in Rust"):
                rp.run(Feeler)
            return
        told: list[str] = []

        def run() -> None:
            try:
                rp.run(Feeler)
            except rp.Misuse as error:
                told.append(str(error))

        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
        self.assertRegex(told[0], "for the main thread")

    def test_what_is_due_is_run_at_the_tick_that_is_nearest(self) -> None:
        its = Feeler.interface_
        timed = Timed([*its.timed, *its.outputs.values()])
        self.assertEqual(timed.period_s, 0.01)
        run = [[it.name for it in timed.due(1000 * MS + at * 10 * MS, 1)] for at in range(6)]
        self.assertEqual([len(names) for names in run], [2, 1, 2, 1, 1, 2])
        self.assertEqual([it.name for it in timed.due(9000 * MS, 1)], ["rest", "force"], "nothing is made up for")
        self.assertEqual([it.name for it in timed.due(9001 * MS, 1)], [])
        self.assertEqual([it.name for it in timed.due(5 * MS, 2)], ["rest", "force"], "time was set")

    def test_views_end_with_their_record_and_never_lead_nowhere(self) -> None:
        pixels = bytes(range(256)) * 16
        data = encode(type_of(rp.Image), rp.Image(64, 64, 64, rp.ImageFormat.Gray8, pixels))
        memory = Memory(data)
        held = Held(type_of(rp.Image), cast(Any, memory))
        view = held.value.pixels
        self.assertIsInstance(view, memoryview)
        self.assertEqual(view, pixels)
        memory[-1] = 7
        self.assertEqual(view[-1], 7, "it is the memory itself")
        del held.value
        self.assertTrue(held.release())
        with self.assertRaises(ValueError):
            view[0]
        held = Held(type_of(rp.Image), cast(Any, memory))
        kept = held.value.pixels[1:3]
        self.assertFalse(held.release(), "a slice is kept")
        self.assertEqual(bytes(kept), pixels[1:3], "and still leads there")
        del kept
        held = Held(type_of(rp.Image), cast(Any, memory))
        lent = pickle.PickleBuffer(held.value.pixels)
        self.assertFalse(held.release(), "somebody else has it, as an array of numpy would")
        self.assertEqual(lent.raw()[:3], pixels[:3])
        held = Held(type_of(rp.Image), cast(Any, memory))
        kept = held.value.pixels[1:3]
        with mock.patch("gc.collect") as collect:
            self.assertFalse(held.release(is_told=False))
        collect.assert_not_called()
        self.assertEqual(len(kept), 2)

    def test_short_bytes_are_copied_and_wrong_ones_refused(self) -> None:
        held = Held(type_of(bytes), cast(Any, Memory(b"\3abc")))
        self.assertEqual(held.value, b"abc")
        self.assertTrue(held.release())
        with self.assertRaisesRegex(ValueError, "2 bytes too many"):
            Held(type_of(bytes), cast(Any, Memory(b"\3abcde")))
        self.assertGreater(VIEWED_MIN, 3)

    def test_simple_types_have_a_plan(self) -> None:
        word, (made_by, parts) = plan_of(type_of(rp.Image)) or ("", (None, []))
        self.assertEqual((word, made_by, [part[0] for part in parts[:3]]), ("struct", rp.Image, ["unsigned"] * 3))
        self.assertEqual((parts[3][1][1], parts[4]), (rp.ImageFormat.Gray16, ("bytes", VIEWED_MIN)))
        for annotation in (rp.LaserScan, rp.U128, list[float], Optional[int], dict[str, int]):
            self.assertIsNone(plan_of(type_of(annotation)), annotation)

    def test_failures_of_calls_are_the_exceptions_of_the_client(self) -> None:
        for kind, expected, words in [
            ("timeout", rp.CallTimeout, "no answer from 1.200.0.0 within 1s; does it run, and is it not too busy?"),
            ("too many", rp.TooManyCalls, "too many calls to 1.200.0.0 are under way"),
            ("not sent", rp.NotSent, "said by Rust"),
        ]:
            error = call_failure(kind, 0x01C80000, b"", "said by Rust", 1.0)
            self.assertIsInstance(error, expected)
            self.assertIn(words, str(error))
        fault = call_failure("fault", 0x01C80000, b"\0", "", 0.0)
        assert isinstance(fault, rp.CallFault)
        self.assertEqual(str(fault), "1.200.0.0: the module is off; switch it on first")

    def test_an_exception_is_told_with_its_place(self) -> None:
        try:
            raise RuntimeError("no\nsuch")
        except RuntimeError as error:
            self.assertRegex(words_of(error), r"^RuntimeError: no\\nsuch \(.*test_node.py:\d+\)$")


if __name__ == "__main__":
    unittest.main()
