"""Records from parts, without a socket: the cases that Rust has made, and what a hostile server sends."""

from __future__ import annotations

import json
import pathlib
import unittest
import zlib

import rohrpost as rp
from rohrpost import remote
from rohrpost.names import Name
from rohrpost.remote.frames import BadFrame, DescribedPart, RecordPart, Splitter
from rohrpost.remote.handed_out import RecordQueue
from rohrpost.remote.records import Assembly
from rohrpost.schema import DataItem, Description, Field
from rohrpost.schema.tree import BYTES, U32

from . import parts
from .router import frame

CASES = pathlib.Path(__file__).parents[3] / "tests/conformance/records.json"
SECOND = 1_000_000_000
PUBLISHER = Name.of(1, 112, 0)
DATA = DataItem(2, Field("image", BYTES), True), DataItem(3, Field("rate", U32))
DESCRIPTION = Description("Camera", "camera", (), DATA).to_bytes()
CHECK = zlib.crc32(DESCRIPTION)


class Line:
    """An assembly, and the frames that come for it."""

    def __init__(self, record_bytes: int = 100_000, stream: str = "image", place: int = 3) -> None:
        self.records: list[remote.Record] = []
        self.problem: rp.RohrpostError | None = None
        self.now_ns = 10 * SECOND
        self.place = place
        self.splitter = Splitter()
        self.assembly = Assembly(PUBLISHER, stream, None, record_bytes, self.records.append, self._said)

    def _said(self, problem: rp.RohrpostError | None) -> None:
        self.problem = problem

    def feed(self, *frames: bytes, server: int = 1) -> None:
        for its in frames:
            self.splitter.take(its, self.now_ns)
            while (message := self.splitter.next(self.now_ns)) is not None:
                assert isinstance(message, (RecordPart, DescribedPart))
                if message.place != self.place:
                    continue
                if isinstance(message, RecordPart):
                    self.assembly.part(server, message)
                else:
                    self.assembly.described(self.now_ns, server, message)

    def told(self) -> tuple[dict[str, int], int, int]:
        return dict(+self.assembly.refused), self.assembly.lost, self.assembly.sampled


def described(record_bytes: int = 100_000) -> Line:
    line = Line(record_bytes)
    line.feed(*parts.described(DESCRIPTION))
    return line


class Records(unittest.TestCase):
    def test_the_cases_of_rust(self) -> None:
        cases = json.loads(CASES.read_text(encoding="utf-8"))
        self.assertGreater(len(cases), 5)
        for case in cases:
            line = Line(case["record_bytes"], case["stream"], case["place"])
            for step in case["steps"]:
                if "cut" in step:
                    line.assembly.cut()
                else:
                    line.feed(bytes.fromhex(step["frame"]), server=step["server"])
            got = [
                [it.sequence, it.incarnation, it.epoch, it.time_ns, len(it.data), zlib.crc32(it.data)]
                for it in line.records
            ]
            self.assertEqual(got, case["records"], case["what"])
            self.assertEqual(line.told(), (case["refused"], case["lost"], case["sampled"]), case["what"])

    def test_frames_split_anywhere_are_the_same_records(self) -> None:
        line, body = described(), bytes(range(256)) * 40
        for byte in b"".join(parts.record(body, 5, CHECK)):
            line.feed(bytes([byte]))
        self.assertEqual([it.data for it in line.records], [body])

    def test_parts_that_come_twice_or_out_of_order_change_nothing(self) -> None:
        line, body = described(), bytes(range(256)) * 40
        first, second, third = parts.record(body, 5, CHECK)
        line.feed(second, first, first, third, second, second, third)
        self.assertEqual([it.data for it in line.records], [body])
        self.assertEqual(line.told(), ({"late": 1, "duplicate": 2, "unsound": 1}, 0, 0))

    def test_a_part_that_is_none_ends_the_session(self) -> None:
        for its in [
            parts.part(b"1234", 1, CHECK, offset=4096, length=4099),
            parts.part(b"1234", 1, CHECK, length=3),
            parts.part(b"", 1, CHECK, length=3),
            parts.part(b"1234", 1, CHECK, offset=0xFFFFFFFF, length=0xFFFFFFFF),
            frame(parts.RECORD_PART, bytes(63)),
            frame(parts.DESCRIPTION, bytes(24)),
            frame(parts.DESCRIPTION, bytes(8) + b"\x01\x00\x01\x00" + bytes(13)),
        ]:
            with self.assertRaises(BadFrame):
                described().feed(its)

    def test_memory_grows_with_what_came_and_not_with_what_is_announced(self) -> None:
        line = described(record_bytes=0xFFFFFFFF)
        for sequence in range(1000):
            line.feed(parts.part(bytes(4096), sequence, CHECK, length=0xFFFFFFFF))
            self.assertLessEqual(len(line.assembly._body), 4096)
        self.assertEqual(line.told(), ({"incomplete": 999}, 0, 0))
        self.assertEqual(line.records, [])

    def test_a_record_that_is_too_large_is_told(self) -> None:
        line = described(record_bytes=10)
        line.feed(*parts.record(bytes(11), 1, CHECK))
        self.assertEqual(line.told()[0], {"too-large": 1})
        self.assertRegex(str(line.problem), "camera|1.112.0.0/image: a record of 11 bytes, and at most 10 are taken")
        line.feed(*parts.record(bytes(10), 2, CHECK))
        self.assertIsNone(line.problem)

    def test_descriptions_are_bounded_and_read_once_a_second(self) -> None:
        line = described()
        read: list[int] = []
        understand = line.assembly._understand

        def count(words: bytes, check: int) -> None:
            read.append(1)
            understand(words, check)

        line.assembly._understand = count  # type: ignore[method-assign]
        for number in range(50):
            other = Description("Camera", "camera", (), (DataItem(number, Field("image", U32), True),)).to_bytes()
            line.feed(*parts.described(other))
        self.assertEqual(read, [], "not within the second of the first")
        line.now_ns += SECOND
        line.feed(*parts.described(b"\xff" * 100))
        self.assertEqual(read, [1])
        self.assertRegex(str(line.problem), "its description cannot be read")
        self.assertLessEqual(len(line.assembly._words), 64 << 10)
        damaged = list(parts.described(DESCRIPTION))
        line.now_ns += SECOND
        line.feed(*(its[:-1] + b"?" for its in damaged))
        self.assertEqual(read, [1], "what its check does not fit is dropped")
        line.feed(*parts.described(DESCRIPTION))
        self.assertIsNone(line.problem)

    def test_a_stream_that_is_not_in_the_description_or_of_another_type_is_told(self) -> None:
        line = Line(stream="picture")
        line.feed(*parts.described(DESCRIPTION))
        self.assertEqual(str(line.problem), "1.112.0.0: no stream `picture`; it has: image")
        said: list[rp.RohrpostError | None] = []
        other = Assembly(PUBLISHER, "image", U32, 100, lambda record: None, said.append)
        for its in parts.described(DESCRIPTION):
            splitter = Splitter()
            splitter.take(its, 0)
            message = splitter.next(0)
            assert isinstance(message, DescribedPart)
            other.described(0, 1, message)
        self.assertRegex(str(said[-1]), r"stream `image` are \[u8\], and not u32 as here")

    def test_a_record_that_is_no_value_says_so_when_it_is_read(self) -> None:
        line = described()
        line.feed(*parts.record(b"\x05abc", 1, CHECK), *parts.record(b"\x03abc", 2, CHECK))
        with self.assertRaisesRegex(remote.BadRecord, "record #1 cannot be read"):
            line.records[0].value
        self.assertEqual(line.records[1].value, b"abc")

    def test_a_queue_keeps_the_newest_and_counts_the_others(self) -> None:
        queue, line = RecordQueue(2), described()
        line.feed(*(its for number in range(1, 6) for its in parts.record(b"\x00", number, CHECK)))
        for its in line.records:
            queue._take(its)
        queue._takes_from(line.assembly)
        self.assertEqual((queue._taken(False).sequence, queue.missed), (4, remote.Missed(0, 0, 3)))
        for its in line.records[:2]:
            queue._take(its)
        self.assertEqual((queue._taken(True).sequence, queue._has(False), queue.missed.all), (2, False, 5))
        self.assertEqual((queue._has(True), queue._taken(True).sequence), (True, 2))


if __name__ == "__main__":
    unittest.main()
