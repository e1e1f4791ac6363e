"""Descriptions and values of others cost bounded memory and time."""

from __future__ import annotations

import inspect
import random
import sys
import unittest
from typing import Any

import rohrpost as rp
from rohrpost import schema
from rohrpost.annotations import type_of
from rohrpost.schema import SchemaError, WalkError, decode, encode, type_from_bytes
from rohrpost.schema.budget import EMPTY_MAX
from rohrpost.schema.tree import (
    F32, F64, TEXT, U8, U16, U32, U64, UNIT, Array, Enum, Field, List, Map, Named, Option, Struct, Tuple,
    Type, Variant,
)  # fmt: skip


def nested(levels: int) -> Type:
    made: Type = UNIT
    for _ in range(levels):
        made = Tuple((made,))
    return made


class Hostile(unittest.TestCase):
    def test_descriptions_are_bounded_before_anything_is_made_of_them(self) -> None:
        many = b"\x02\x15\xff\xff\x03" + bytes(70_000)
        for data, why in [
            (b"\x02" + b"\x11" * 100_000, "types nested more than 128 deep"),
            (many, "more than 16384 types"),
            (b"\x02\x15\xff\xff\xff\xff\x0f", "the description ends too early"),
            (b"\x02\x16\xff\xff\xff\xff\x0f", "the description ends too early"),
            (b"\x02\x15\xff\xff\xff\xff\x1f", "a number that does not fit 32 bits"),
            (b"\x02\x16\x01\xff\x00\x00", "text that is not UTF-8"),
            (b"\x02\x00\x00", "1 bytes behind the end of the description"),
            (b"\x03\x00", "descriptions of version 3, this program knows 2"),
        ]:
            with self.assertRaisesRegex(SchemaError, why):
                type_from_bytes(data)

    def test_no_bytes_raise_anything_else(self) -> None:
        chance = random.Random(1)
        whole = schema.type_to_bytes(Tuple((List(U16), Struct(Named("A", 3, (Field("x", F32, "t", "m"),))), TEXT)))
        for _ in range(5000):
            data = bytearray(whole)
            for _ in range(chance.randrange(1, 4)):
                data[chance.randrange(1, len(data))] = chance.randrange(256)
            try:
                type = type_from_bytes(bytes(data[: chance.randrange(1, len(data) + 1)]))
            except SchemaError:
                continue
            try:
                value = decode(type, chance.randbytes(40))
            except WalkError:
                continue
            schema.show(type, value)
            schema.to_json(type, value)
            encode(type, value)

    def test_types_of_many_calls_a_level_are_read_as_deep_as_promised_or_refused(self) -> None:
        made: Type = UNIT
        for _ in range(126):
            made = Enum("E", (Named("V", 3, (Field("f", made),)),))
        data = schema.type_to_bytes(made)
        self.assertEqual(schema.type_to_bytes(type_from_bytes(data)), data)
        was = sys.getrecursionlimit()
        sys.setrecursionlimit(len(inspect.stack(0)) + 200)
        try:
            with self.assertRaisesRegex(SchemaError, "deeper than this interpreter's stack"):
                type_from_bytes(b"\2" + b"\x11" * 120 + b"\0")
        finally:
            sys.setrecursionlimit(was)

    def test_what_a_class_refuses_are_wrong_bytes(self) -> None:
        @rp.data
        class Percent:
            value: rp.U8

            def __post_init__(self) -> None:
                if self.value > 100:
                    raise ValueError("more than\nall")

        self.assertEqual(decode(type_of(list[Percent]), b"\1\x64"), [Percent(100)])
        with self.assertRaisesRegex(WalkError, r"^\[1\]: its class does not take it: ValueError: more than\\nall$"):
            decode(type_of(list[Percent]), b"\2\x64\x65")

    def test_values_nest_no_deeper_than_the_limit(self) -> None:
        decode(nested(127), b"")
        with self.assertRaisesRegex(WalkError, "nested more than 128 deep"):
            decode(nested(128), b"")
        value: object = None
        for _ in range(128):
            value = [value]
        with self.assertRaisesRegex(WalkError, "nested more than 128 deep"):
            encode(nested(128), value)

    def test_values_without_bytes_are_counted(self) -> None:
        decode(List(UNIT), encode(U64, EMPTY_MAX - 1))
        cases: list[tuple[Type, bytes]] = [
            (List(UNIT), encode(U64, EMPTY_MAX + 1)),
            (List(UNIT), encode(U64, (1 << 64) - 1)),
            (Array((1 << 32) - 1, UNIT), b""),
            (Array((1 << 32) - 1, Array((1 << 32) - 1, UNIT)), b""),
        ]
        for type, data in cases:
            with self.assertRaisesRegex(WalkError, f"more than {EMPTY_MAX} values that take no bytes"):
                decode(type, data)

    def test_whether_elements_are_empty_is_asked_once_for_a_type_and_not_for_each_list(self) -> None:
        wide = Struct(Named("Wide", 3, tuple(Field(str(index), UNIT) for index in range(2000))))
        inner = List(Tuple((wide, U8)))
        self.assertEqual(decode(List(inner), encode(U64, 60_000) + bytes(60_000)), [[]] * 60_000)
        self.assertIn("is_of_empty", inner.__dict__, "it is kept")

    def test_long_numbers_in_text_are_refused_at_once(self) -> None:
        with self.assertRaisesRegex(WalkError, "is out of range|expected a whole number"):
            encode(U32, "9" * 1_000_000)

    def test_what_others_wrote_stays_in_its_line(self) -> None:
        bad = Struct(Named("X", 3, (Field("a\x1b[2J\n", F64),)))
        with self.assertRaises(WalkError) as caught:
            encode(bad, {"a\x1b[2J\n": "\x1b[31m"})
        self.assertTrue(str(caught.exception).isprintable(), str(caught.exception))
        self.assertTrue(schema.describe_type(bad).isprintable())
        self.assertTrue(schema.show(bad, {"a\x1b[2J\n": 1.0}).isprintable())


class Values(unittest.TestCase):
    def test_each_form_that_can_only_mean_one_thing_is_taken(self) -> None:
        lamp = Enum("Lamp", (Named("Off"), Named("TurnOn", 1, (Field("", U8),))))
        cases: list[tuple[Type, Any, bytes]] = [
            (lamp, "off", b"\0"),
            (lamp, {"turn-on": 7}, b"\1\7"),
            (lamp, Variant("TurnOn", 7), b"\1\7"),
            (Option(Option(U8)), Variant("Some", None), b"\1\0"),
            (List(U8), bytearray(b"ab"), b"\2ab"),
            (Map(U8, TEXT), {1: "a"}, b"\1\1\1a"),
            (Map(U8, TEXT), {"1": "a"}, b"\1\1\1a"),
        ]
        for type, value, data in cases:
            self.assertEqual(encode(type, value), data)

    def test_wrong_values_name_the_place(self) -> None:
        pose = Struct(Named("Pose", 3, (Field("x_m", F64), Field("y_m", F64))))
        for value, why in [
            ({"x_m": 0.0}, "y_m: not given; expected a number \\(f64\\)"),
            ({"x_m": 0.0, "y_m": True}, "y_m: expected a number \\(f64\\), got `true`"),
            ({"x_m": 0.0, "y_m": 0.0, "z": 1}, "z: no such field; there is x_m, y_m"),
            (5, "expected {x_m: f64, y_m: f64}, got `5`"),
        ]:
            with self.assertRaisesRegex(WalkError, why):
                encode(pose, value)


if __name__ == "__main__":
    unittest.main()
