"""Readers and writers that are made once of a type agree with those that walk it, on what fits and what does not."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import json
import pathlib
import pickle
import random
import sys
import unittest
import unittest.mock
from collections.abc import Callable, Iterator
from typing import Any

import rohrpost as rp
from rohrpost.annotations import type_of
from rohrpost.schema import WalkError, encode, to_json, type_from_bytes
from rohrpost.schema.budget import EMPTY_MAX
from rohrpost.schema.decode import Decoder, decode
from rohrpost.schema.encode import _Encoder
from rohrpost.schema.readers import READERS, reader_of
from rohrpost.schema.scalars import Unread
from rohrpost.schema.tree import (
    BOOL, BYTES, CHAR, F32, F64, TEXT, U8, U32, UNIT, Array, Enum, Field, List, Map, Named, Option, Plain,
    Struct, Tuple, Type, Variant, is_byte, is_nullable, unwrapped,
)  # fmt: skip
from rohrpost.schema.writers import writer_of

from .generated import zoo
from .generated.gripper import Grip, GripError

CASES = pathlib.Path(__file__).parents[3] / "tests" / "conformance" / "cases"
OWN: list[type] = [rp.Image, rp.Odometry, rp.LaserScan, Grip, GripError]


def conforming() -> Iterator[Type]:
    """Each type of the conformance suite's cases."""
    known = set()
    for file in ("values.json", "descriptions.json", "refused.json"):
        for case in json.loads((CASES / file).read_text()):
            known.add(case["ask"].get("type"))
    for data in sorted(known - {None}):
        try:
            yield type_from_bytes(bytes.fromhex(data))
        except rp.schema.SchemaError:
            continue


def any_type(chance: random.Random, depth: int) -> Type:
    """A type of any kind."""
    kind = chance.randrange(17, 25) if depth else 0
    if kind < 18:
        return Plain(chance.randrange(17))

    def inner() -> Type:
        return any_type(chance, depth - 1)

    def named(name: str) -> Named:
        members = chance.randrange(4)
        count = (0, 1, chance.randrange(3), chance.randrange(4))[members]
        return Named(name, members, tuple(Field(f"f{at}", inner()) for at in range(count)))

    if kind == 18:
        return Option(inner())
    if kind == 19:
        return List(inner())
    if kind == 20:
        return Array(chance.randrange(4), inner())
    if kind == 21:
        return Map(inner(), inner())
    if kind == 22:
        return Tuple(tuple(inner() for _ in range(chance.randrange(4))))
    if kind == 23:
        return Struct(named("S"))
    return Enum("E", tuple(named(f"V{at}") for at in range(chance.randrange(1, 4))))


def any_value(chance: random.Random, type: Type) -> Any:
    """A value of it, in the form that ``decode`` gives."""
    type = unwrapped(type)
    if isinstance(type, Plain):
        return any_plain(chance, type)
    if isinstance(type, Option):
        inner = any_value(chance, type.inner)
        return None if chance.random() < 0.5 else Variant("Some", inner) if is_nullable(type.inner) else inner
    if isinstance(type, List):
        length = chance.randrange(4) if chance.random() < 0.9 else chance.randrange(300)
        return chance.randbytes(length) if is_byte(type.element) else many(chance, type.element, length)
    if isinstance(type, Array):
        return many(chance, type.element, type.length)
    if isinstance(type, Tuple):
        return tuple(any_value(chance, it) for it in type.elements)
    if isinstance(type, Map):
        pairs = [(any_value(chance, type.key), any_value(chance, type.value)) for _ in range(chance.randrange(3))]
        return dict(pairs) if type.has_words else pairs
    if isinstance(type, Struct):
        members = any_members(chance, type.named)
        return members if type.python is None else type.python(**(members or {}))
    variant = chance.choice(type.variants)
    payload = any_members(chance, variant)
    return (type.python or Variant)(variant.name, payload)


def many(chance: random.Random, type: Type, length: int) -> list[Any]:
    return [any_value(chance, type) for _ in range(length)]


def any_members(chance: random.Random, named: Named) -> Any:
    if named.kind < 2:
        return any_value(chance, named.fields[0].type) if named.kind else None
    values = [any_value(chance, it.type) for it in named.fields]
    return tuple(values) if named.kind == 2 else {it.name: value for it, value in zip(named.fields, values)}


def any_plain(chance: random.Random, type: Plain) -> Any:
    if type.integer:
        signed, bits = type.integer
        magnitude = chance.getrandbits(chance.randrange(1, bits + 1 - signed))
        return ~magnitude if signed and chance.random() < 0.5 else magnitude
    made: dict[Plain, Callable[[], Any]] = {
        UNIT: lambda: None, BOOL: lambda: chance.random() < 0.5, F64: lambda: chance.uniform(-1e9, 1e9),
        F32: lambda: float(chance.randrange(-1000, 1000)), CHAR: lambda: chance.choice("aß€🤖"),
        TEXT: lambda: "".join(chance.choices("aß€🤖", k=chance.choice((0, 3, 200)))),
        BYTES: lambda: chance.randbytes(chance.choice((0, 3, 200))),
    }  # fmt: skip
    return made[type]()


def outcome(read: Callable[[], Any]) -> str:
    """What came of it: the value with its classes, or the words."""
    try:
        return repr(read())
    except WalkError as error:
        return f"WalkError: {error}"


def walked(type: Type, data: bytes) -> Any:
    decoder = Decoder(data)
    value = decoder.value(type)
    if decoder.at < len(data):
        left = len(data) - decoder.at
        raise WalkError(f"{left} byte{'s' if left > 1 else ''} too many")
    return value


def types(chance: random.Random) -> Iterator[Type]:
    yield from conforming()
    yield from map(type_of, OWN)
    yield from (field.type for it in zoo.Zoo.interface_.description.functions for field in it.arguments)
    for _ in range(200):
        yield any_type(chance, chance.randrange(1, 4))


def written(type: Type, value: Any) -> bytes:
    encoder = _Encoder()
    encoder.value(type, value)
    return bytes(encoder.out)


def odd(chance: random.Random, value: Any) -> Any:
    """The same, with something in it that has another form, or does not fit."""
    if isinstance(value, (list, tuple)) and value and chance.random() < 0.8:
        at = chance.randrange(len(value))
        changed = [*value[:at], odd(chance, value[at]), *value[at + 1 :]]
        return changed if chance.random() < 0.5 else tuple(changed)
    if isinstance(value, dict) and value and chance.random() < 0.8:
        name = chance.choice(list(value))
        return value | {name: odd(chance, value[name])}
    if isinstance(value, (Variant, rp.Choice)) and chance.random() < 0.8:
        return chance.choice((Variant(value.name, odd(chance, value.value)), {value.name: value.value}, value.name))
    if isinstance(value, int) and chance.random() < 0.5:
        return chance.choice((str(value), hex(value), value + 256, -value, float(value % 1000)))
    choices: list[Any] = [None, True, 0, 1, 255, 256, -1, 1.0, 1e300, "", "a", "V0", b"a", [], [1], {}, {"f0": 1}]
    choices += ["\ud800", {1: 2}, 1 << 64, Variant("Some"), rp.State.On, rp.Pose(), Variant("V0", 1), object]
    return chance.choice(choices)


class Readers(unittest.TestCase):
    def test_both_read_the_same_and_say_the_same_of_what_is_damaged(self) -> None:
        chance = random.Random(3)
        made = damaged = 0
        for type in types(chance):
            for _ in range(4):
                data = encode(type, any_value(chance, type))
                read = reader_of(type)
                if read is not None:
                    made += 1
                    self.assertEqual(repr(read(data, 0, None)), repr((walked(type, data), len(data))))
                    self.assertEqual(read(memoryview(b"\1" + data), 1, None)[1], len(data) + 1)
                for _ in range(2):
                    self.assertEqual(outcome(lambda: decode(type, data)), outcome(lambda: walked(type, data)))
                for wrong in self.wrong(chance, data):
                    damaged += "WalkError" in (said := outcome(lambda: walked(type, wrong)))
                    self.assertEqual(outcome(lambda: decode(type, wrong)), said, f"{type} of {wrong.hex()}")
        self.assertTrue(made > 800 and damaged > 2000, f"{made} read, {damaged} damaged")

    @staticmethod
    def wrong(chance: random.Random, data: bytes) -> Iterator[bytes]:
        yield data + b"\0"
        for _ in range(3):
            yield data[: chance.randrange(len(data) + 1)]
        for _ in range(4 if data else 0):
            at = chance.randrange(len(data))
            yield data[:at] + bytes([chance.choice((0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)))]) + data[at + 1 :]
            yield data[:at] + b"\xff" * chance.randrange(12) + data[at:]

    def test_a_message_has_a_bounded_number_of_values(self) -> None:
        """Refused before they are made, by what reads a type the first time as by what reads it then."""
        small = Struct(Named("Small", 3, (Field("a", U8),)))
        many = bytes([0xFF, 0xFF, 0xFF, 0x1F])  # 64 Mi of them
        limit = r"more than 4000000 values in one; send many numbers as bytes, or as lists of f32 or f64"
        cases: list[tuple[Type, bytes, str]] = [
            (List(small), many + bytes(1 << 26), ""),
            (Struct(Named("S", 3, (Field("of", Map(U8, U8)),))), many + bytes(1 << 26), r"of\[\d+\]: "),
            (Array(4_000_000, U8), bytes(4_000_000), ""),
            (Array(2, Array(2_000_000, U8)), bytes(4_000_000), r"\[1\]: "),
        ]
        for type, data, where in cases:
            for _ in range(3):
                with self.assertRaisesRegex(WalkError, f"^{where}{limit}"):
                    decode(type, data)
        for _ in range(3):
            self.assertEqual(len(decode(BYTES, many + bytes(0x3FFFFFF))), 0x3FFFFFF)
            self.assertEqual(len(decode(List(F32), b"\xc0\x84\x3d" + bytes(4_000_000))), 1_000_000)

    def test_python_and_rust_refuse_the_same_messages(self) -> None:
        for case in json.loads((CASES.parent / "budget.json").read_text()):
            type = type_from_bytes(bytes.fromhex(case["type"]))
            data = bytes.fromhex(case["head"]) + bytes.fromhex(case["each"]) * case["times"]
            for _ in range(3):
                with self.subTest(case["what"]):
                    try:
                        decode(type, data)
                        said = None
                    except WalkError as error:
                        said = str(error)
                    self.assertEqual(said, case["error"])

    def test_both_count_values_alike(self) -> None:
        chance, refused, read = random.Random(5), 0, 0
        with contextlib.ExitStack() as stack:
            for module in ("budget", "readers"):
                its = sys.modules[f"rohrpost.schema.{module}"]
                stack.enter_context(unittest.mock.patch.object(its, "VALUES_MAX", 6))
            # Copies have no reader of before, which has another limit.
            for type in map(copy.deepcopy, types(chance)):
                for _ in range(6):
                    data = encode(type, any_value(chance, type))
                    said = outcome(lambda: walked(type, data))
                    refused += "more than 6 values" in said
                    read += "WalkError" not in said
                    self.assertEqual(outcome(lambda: decode(type, data)), said, f"{type} of {data.hex()}")
        self.assertTrue(min(refused, read) > 100, f"{refused} refused, {read} read")

    def test_both_write_the_same_and_say_the_same_of_what_does_not_fit(self) -> None:
        chance = random.Random(4)
        made = other = refused = 0
        for type in types(chance):
            write = writer_of(type)
            for _ in range(4):
                value = any_value(chance, type)
                data = written(type, value)
                if write is not None:
                    out = bytearray(b"before")
                    write(out, value)
                    made += 1
                    self.assertEqual(out, b"before" + data)
                for _ in range(2):
                    self.assertEqual(encode(type, value), data)
                self.assertEqual(encode(type, to_json(type, value)), data)
                for _ in range(12):
                    strange = odd(chance, value)
                    said = outcome(lambda: written(type, strange))
                    refused += "WalkError" in said
                    other += "WalkError" not in said
                    self.assertEqual(outcome(lambda: encode(type, strange)), said, f"{type} of {strange}")
        self.assertTrue(min(made, other, refused) > 800, f"{made} written, {other} of other forms, {refused} refused")

    def test_a_struct_is_written_of_any_class_that_has_its_fields(self) -> None:
        pose = type_of(rp.Pose)
        classes = [dataclasses.make_dataclass(f"Own{at}", ["heading_rad", "x_m", "y_m"]) for at in range(20)]
        for made in [*classes, *classes]:
            self.assertEqual(encode(pose, made(3.0, 1.0, 2.0)), encode(pose, rp.Pose(1.0, 2.0, 3.0)))
        for less in (["x_m"], ["x_m", "y_m", "heading_rad", "z_m"]):
            with self.assertRaises(WalkError):
                encode(pose, dataclasses.make_dataclass("Other", less)(*map(float, range(len(less)))))

    def test_a_type_that_may_go_beyond_a_limit_has_no_reader(self) -> None:
        nested = Tuple((U8,))
        for _ in range(126):
            nested = Tuple((nested,))
        wide: Type = UNIT
        for _ in range(17):
            wide = Tuple((wide, wide))
        self.assertIsNotNone(reader_of(nested))
        shared = nested.elements[0]
        twice = Tuple((shared, Tuple((shared,))))
        empties = (wide, List(UNIT), Map(U8, UNIT), Array(EMPTY_MAX, UNIT), List(Option(UNIT)))
        for type in (Tuple((nested,)), twice, *empties):
            self.assertIsNone(reader_of(type))
        self.assertIsNotNone(writer_of(nested))
        for type in (Tuple((nested,)), twice):
            self.assertIsNone(writer_of(type))
        self.assertIsNotNone(reader_of(Array(EMPTY_MAX - 1, UNIT)))
        read = reader_of(Array((1 << 32) - 1, F64))
        assert read is not None
        with self.assertRaises(Unread):
            read(bytes(8), 0, None)
        with self.assertRaisesRegex(WalkError, "^4294967287 bytes missing"):
            decode(Array((1 << 32) - 1, F64), bytes(8))

    def test_a_reader_is_made_when_a_type_is_read_again(self) -> None:
        type = Tuple((U32, TEXT))
        decode(type, b"\1\1a")
        self.assertIsNone(type.__dict__.get(READERS.name))
        for wrong in (b"\1\1", b"\1\1\xff", b"\1\1ab"):
            with self.assertRaises(WalkError):
                decode(type, wrong)
        self.assertIsNone(type.__dict__.get(READERS.name))
        decode(type, b"\1\1a")
        self.assertIsNotNone(type.__dict__.get(READERS.name))
        self.assertEqual(type, Tuple((U32, TEXT)), "it is the same type still")
        for copied in (pickle.loads(pickle.dumps(type)), copy.deepcopy(type)):
            self.assertEqual(copied, type)
            self.assertIsNone(copied.__dict__.get(READERS.name))

    def test_classes_are_made_as_their_authors_say(self) -> None:
        @rp.data
        class Odd:
            a: rp.U8
            b: rp.U8

            def __init__(self, b: int, a: int) -> None:
                self.a, self.b = a, b

        @rp.data
        class Checked:
            a: rp.U8

            def __post_init__(self) -> None:
                if self.a > 1:
                    raise IndexError("more than one")

        for _ in range(3):
            odd = decode(type_of(Odd), b"\1\2")
            self.assertEqual((odd.a, odd.b), (1, 2))
            self.assertEqual(decode(type_of(Checked), b"\1"), Checked(1))
        with self.assertRaisesRegex(WalkError, "its class does not take it: IndexError: more than one"):
            decode(type_of(Checked), b"\2")


if __name__ == "__main__":
    unittest.main()
