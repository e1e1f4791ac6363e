"""What stands between a module's class and its runtime, over a runtime that does as little as tests need."""

from __future__ import annotations

import contextlib
import importlib
import sys
import types
import unittest
from collections.abc import Callable
from typing import Any
from unittest import mock

import rohrpost as rp
from rohrpost.annotations import type_of
from rohrpost.schema import encode
from rohrpost.schema.binary import field_to_bytes
from rohrpost.schema.tree import Field

from .memory import Memory


class InHand(contextlib.AbstractContextManager[str]):
    """Stands for a record, once and again."""

    def __init__(self, find: Callable[[], None] | None) -> None:
        self.find = find

    def __enter__(self) -> str:
        if self.find is not None:
            self.find()
        return "newest" if self.find is None else "found"

    def __exit__(self, *_: object) -> None:
        pass


class Numbers:
    """Stands for a stream."""

    def reads(self, what: str, plan: object, held: object) -> None:
        pass

    def in_hand(self, find: Callable[[], None] | None = None) -> contextlib.AbstractContextManager[str]:
        return InHand(find)

    def next(self, timeout_s: float) -> tuple[bool, int]:
        return True, 0

    def record(self, sequence: int) -> bool:
        return True


class Runtime(types.ModuleType):
    """Stands for the part in Rust: one place for records, as a stream has one to spare."""

    def __init__(self) -> None:
        super().__init__("rohrpost._node")
        self.place = Memory(5000)
        self.told: list[str] = []
        self.refuses = ""
        self.stream: Numbers | None = None
        self.asked: list[tuple[float, bool]] = []

    def open_stream(self, module: str, item: str, timeout_s: float, is_late: bool) -> tuple[Numbers, bytes] | None:
        self.asked.append((timeout_s, is_late))
        field = field_to_bytes(Field("count", type_of(rp.U8)))
        return None if self.stream is None else (self.stream, field)

    def begin(self, number: int, stamp_ns: int | None, front: bytes, length: int) -> Memory:
        self.told.append("begin")
        return self.place

    def finish(self, own: bytes) -> int:
        self.told.append("finish")
        return 1

    def abandon(self) -> None:
        self.told.append("abandon")

    def publish(self, number: int, stamp_ns: int | None, value: bytes) -> None:
        self.told.append("publish")

    def set_parameter(self, name: str, value: bytes) -> None:
        if self.refuses:
            raise rp.Misuse(self.refuses)


class Painter(rp.Module, klass="painter"):
    """Fills records as it is told."""

    gain: rp.U8 = rp.parameter(2, max=9)
    speed_m_s: rp.F32 = rp.parameter(0.2, max=0.2)

    def __init__(self) -> None:
        self.kept: Any = None
        self.noted: list[str] = []
        self.later = contextlib.ExitStack()

    def parameters_set(self) -> None:
        if self.gain == 7:
            raise ValueError("not seven")

    @rp.command(16)
    def paint(self, how: str) -> str:
        """Paints."""
        with self.begin("picture", b"", 5000) as room:
            part = room[1:]
            if how == "keep":
                self.kept = part
            if how in ("fail", "catch"):
                raise RuntimeError("no paint")
            del part
        return "painted"

    @rp.command(17)
    def catch(self) -> str:
        """Paints once more."""
        told = ""
        try:
            self.paint("catch")
        except RuntimeError as error:
            told = str(error)
        return f"{told}, {self.paint('')}"

    @rp.command(18)
    def circle(self) -> str:
        """Leaves an exception that leads to itself."""
        with self.begin("picture", b"", 5000) as room:
            self.stumble(room)
        return "painted"

    @staticmethod
    def stumble(room: memoryview) -> None:
        part = room[1:]
        try:
            raise RuntimeError(str(len(part)))
        except RuntimeError as error:
            stays = error  # noqa: F841

    @rp.command(19)
    def leave(self) -> str:
        """Begins, and ends some other time."""
        self.kept = self.later.enter_context(self.begin("picture", b"", 5000))
        return "left"

    @rp.command(20)
    def end(self) -> str:
        """Ends what it left."""
        try:
            self.later.close()
        except rp.Misuse as error:
            return str(error)
        return "ended"

    @rp.command(21)
    def dot(self) -> None:
        """Writes."""
        self.write("picture", b".")

    @rp.on_record("camera.0", "note", most_bytes=8)
    def note(self, words: str) -> None:
        self.noted.append(words)

    @rp.stream(1)
    def picture(self) -> bytes:
        """What it paints."""
        raise AssertionError("it is never run")


class Bridged(unittest.TestCase):
    def setUp(self) -> None:
        self.runtime = Runtime()
        ours = [name for name in sys.modules if name.startswith("rohrpost.node.")]
        patched = mock.patch.dict(sys.modules, {"rohrpost._node": self.runtime})
        patched.start()
        self.addCleanup(patched.stop)
        for name in ours:
            del sys.modules[name]
        bridge: Any = importlib.import_module("rohrpost.node.bridge")
        bridge._node = self.runtime
        self.bridge = bridge.Bridge(Painter)
        self.painter = self.bridge._module = Painter()
        self.painter._host = self.bridge

    def asked(self, number: int, *texts: str) -> str:
        answer, _, words = self.bridge.command(number, b"".join(encode(type_of(str), it) for it in texts))
        return str(words) if answer is None else str(answer[1:], "utf-8")

    def told(self) -> list[str]:
        told, self.runtime.told = self.runtime.told, []
        return told

    def test_records_end_with_the_function_that_began_them(self) -> None:
        self.assertEqual((self.asked(16, ""), self.told()), ("painted", ["begin", "finish"]))
        self.assertEqual((self.asked(19), self.told()), ("left", ["begin", "abandon"]))
        with self.assertRaises(ValueError):
            self.painter.kept[0]
        ended = "a record of `picture` was given up at the end of the function that began it"
        self.assertEqual((self.asked(20), self.told()), (ended, []))
        # The record that is open when a late end comes is another one.
        self.assertEqual(self.asked(19), "left")
        self.told()
        with self.bridge.begin(self.painter, "picture", b"", 5000, None):
            self.assertEqual(self.painter.end(), ended)
        self.assertEqual(self.told(), ["begin", "finish"])

    def test_no_record_is_written_where_a_view_of_another_one_is_kept(self) -> None:
        with self.assertRaisesRegex(rp.Misuse, "is kept, so `picture` takes no record until it is let go"):
            self.painter.paint("keep")
        self.assertIsNone(self.bridge._settled(None), "it was told")
        vars(self.painter).update(kept=None)
        with self.assertRaisesRegex(RuntimeError, "no paint"):
            self.painter.paint("fail")
        with self.assertRaises(rp.Misuse):
            self.painter.paint("keep")
        self.assertIsNone(self.bridge._settled(None), "it was told")
        self.assertEqual(self.told(), ["begin", "abandon"] * 3)
        for number, texts in ((16, [""]), (21, [])):
            self.assertIn("is kept, so `picture`", self.asked(number, *texts))
        self.assertEqual(self.told(), [])
        self.painter.kept[:3] = b"own"
        self.painter.kept = None
        self.assertEqual(self.asked(16, ""), "painted")
        # Left open, with a part of it kept.
        self.asked(19)
        self.told()
        left = self.bridge.begin(self.painter, "picture", b"", 5000, None)
        self.painter.kept = left.__enter__()[2:]
        self.assertIn("is kept, so `picture`", self.bridge._settled(None))
        self.assertEqual(self.told(), ["begin", "abandon"])

    def test_an_exception_holds_no_record_once_it_is_over(self) -> None:
        self.assertIn("RuntimeError: no paint", self.asked(16, "fail"))
        self.assertEqual(self.asked(17), "no paint, painted")
        self.assertEqual(self.told(), ["begin", "abandon", "begin", "abandon", "begin", "finish"])
        self.assertEqual(self.asked(18), "painted")

    def test_records_of_more_bytes_than_wanted_are_not_taken(self) -> None:
        self.bridge._followed[0] = Painter.interface_.records[0]
        field = field_to_bytes(Field("note", type_of(str)))
        for words in ("seven b", "eight by"):
            self.assertIsNone(self.bridge.received(0, field, encode(type_of(str), words), 1, 1, 0))
        self.assertEqual(self.painter.noted, ["seven b"])

    def test_a_stream_of_a_module_that_does_not_run_yet_is_read_when_it_does(self) -> None:
        reader, other = (self.bridge.stream(self.painter, "eye.0", "count", its, 0.5) for its in (rp.U8, rp.F32))
        self.assertEqual(self.runtime.asked, [(0.5, False)] * 2)
        no_record, newest = sys.modules["rohrpost.node.streams"].NoRecord, reader.newest()
        early = [newest, reader.next(), reader.next(0.01), reader.record(0), reader.at(1)]
        for read in [*(it.__enter__ for it in early), lambda: reader.around(1), lambda: reader.type]:
            with self.assertRaises(no_record):
                read()
        self.assertEqual(reader.missed()["lost"], 0)
        self.runtime.stream = Numbers()
        for in_hand, expected in [(newest, "newest"), (early[1], "found"), (early[3], "found"), (newest, "newest")]:
            with in_hand as record:
                self.assertEqual(record, expected)
        self.assertEqual((self.runtime.asked[-1], reader.type), ((0.0, True), type_of(rp.U8)))
        with self.assertRaisesRegex(rp.Misuse, "is u8, but it is opened for f32"):
            other.newest().__enter__()

    def test_what_would_fail_each_time_is_told_so(self) -> None:
        class Failing(rp.Module, klass="failing"):
            why: BaseException

            def __init__(self) -> None:
                raise self.why

        for why, is_hopeless in [
            (OSError("no port"), False), (ValueError("odd"), False), (ImportError("no numpy"), True),
            (SyntaxError("odd"), True), (rp.Misuse("odd"), True), (rp.Misconfigured("no such module"), True),
        ]:  # fmt: skip
            Failing.why = why
            bridge: Any = sys.modules["rohrpost.node.bridge"]
            told = bridge.Bridge(Failing).make("failing.0", "{}", [])
            self.assertEqual(told[1], is_hopeless, told)
            self.assertIn(str(why).split("(")[0], told[0])

    def test_parameters_are_those_of_the_runtime_or_keep_their_values(self) -> None:
        def field(type: Any, value: Any) -> bytes:
            return encode(type_of(type), value)

        def values(gain: int, speed: float) -> list[tuple[str, bytes]]:
            return [("gain", field(rp.U8, gain)), ("speed-m-s", field(rp.F32, speed))]

        self.assertIsNone(self.bridge.parameters_set(values(3, 0.2)), "its most is in its range")
        self.assertEqual(self.painter.gain, 3)
        for gain, speed, why in [(7, 0.1, "not seven"), (4, 0.3, "not in its range"), (4, float("nan"), "not in its")]:
            self.assertIn(why, self.bridge.parameters_set(values(gain, speed)))
            self.assertEqual((self.painter.gain, round(self.painter.speed_m_s, 6)), (3, 0.2))
        self.runtime.refuses = "not now"
        with self.assertRaisesRegex(rp.Misuse, "not now"):
            self.painter.gain = 5
        self.assertEqual(self.painter.gain, 3)


if __name__ == "__main__":
    unittest.main()
