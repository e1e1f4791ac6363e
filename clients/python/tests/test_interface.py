"""Interfaces from classes: equal to those in Rust, and clear about what cannot be."""

from __future__ import annotations

import enum
import json
import pathlib
import unittest
from typing import Annotated, Any

import rohrpost as rp
from rohrpost import schema
from rohrpost.annotations import type_of
from rohrpost.schema.binary import type_to_bytes

CASES = pathlib.Path(__file__).parents[3] / "tests" / "conformance" / "cases" / "descriptions.json"


class DriveError(rp.Choice):
    """Why a motor does not drive."""

    NotFinite: None
    Hardware: str


class Driver(rp.Module, klass="motor", interface="Motor"):
    """Drives a robot in the plane."""

    @rp.command(17, idempotent=True, error=DriveError)
    def halt(self) -> None:
        """Brakes to a standstill."""

    @rp.command(16, error=DriveError)
    def drive(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        """Other words than in Rust: they do not count."""

    @rp.data_out(1)
    def motion(self) -> rp.Twist:
        """How the wheels turn now."""
        return rp.Twist()


def of_rust(name: str) -> schema.Description:
    """An interface as Rust describes it."""
    cases = json.loads(CASES.read_text(encoding="utf-8"))
    case = next(case for case in cases if case["answer"].get("ok", {}).get("name") == name)
    described = schema.Description.from_bytes(bytes.fromhex(case["ask"]["bytes"]))
    assert described.hash == case["answer"]["ok"]["hash"]
    return described


class Interfaces(unittest.TestCase):
    def test_the_same_interface_has_the_hash_that_it_has_in_rust(self) -> None:
        self.assertEqual(Driver.interface_.description.hash, of_rust("Motor").hash)

    def test_standard_types_are_those_of_rust(self) -> None:
        for interface, data, here in [
            ("Motor", "motion", rp.Twist), ("Wheels", "odometry", rp.Odometry), ("Laser", "scan", rp.LaserScan),
            ("Camera", "image", rp.Image), ("Cartographer", "pose", rp.Pose),
        ]:  # fmt: skip
            item = of_rust(interface).data_item(data)
            assert item is not None
            self.assertEqual(type_to_bytes(type_of(here), True), type_to_bytes(item.field.type, True), data)

    def test_annotations_become_types(self) -> None:
        @rp.data
        class Lamp(enum.Enum):
            Off = 0
            On = 1

        for annotation, words in [
            (bool, "bool"), (int, "i64"), (float, "f64"), (str, "text"), (bytes, "[u8]"), (None, "null"),
            (rp.U128, "u128"), (rp.Char, "char"), (Annotated[float, 1], "f64"),
            (list[rp.F32], "[f32]"), (dict[str, rp.U8], "{<text>: u8}"), (tuple[int, str], "[i64, text]"),
            (Annotated[list[float], rp.Length(3)], "[f64; 3]"), (Lamp | None, "(Off|On)?"),
        ]:  # fmt: skip
            self.assertEqual(schema.describe_type(type_of(annotation)), words)
        self.assertEqual(schema.decode(type_of(Lamp), b"\1"), Lamp.On)
        self.assertEqual(schema.encode(type_of(Lamp), Lamp.On), b"\1")
        self.assertEqual(schema.decode(type_of(DriveError), b"\1\1x"), DriveError("Hardware", "x"))

    def test_what_cannot_be_says_what_would_be_right(self) -> None:
        def number() -> Any:
            rp.command(3)

        def rate() -> Any:
            rp.data_out(1, rate_hz=0)

        def annotation() -> Any:
            class Bad(rp.Module, klass="bad"):
                @rp.command(16)
                def go(self, what: set[int]) -> None: ...

        def missing() -> Any:
            class Bad(rp.Module, klass="bad"):
                @rp.command(16)
                def go(self, what) -> None: ...  # type: ignore[no-untyped-def]

        def twice() -> Any:
            class Bad(rp.Module, klass="bad"):
                @rp.command(16)
                def go(self) -> None: ...
                @rp.command(16)
                def stop(self) -> None: ...

        def keyword() -> Any:
            class Bad(rp.Module, klass="bad"):
                @rp.command(16)
                def go(self, *, what: int) -> None: ...

        def parameter() -> Any:
            class Bad(rp.Module, klass="bad"):
                speed: float = rp.parameter(5.0, max=1.0)

        def list_parameter() -> Any:
            class Bad(rp.Module, klass="bad"):
                gains: list[float] = rp.parameter([1.0])

        def long_parameter() -> Any:
            class Bad(rp.Module, klass="bad"):
                gain: rp.U128 = rp.parameter(1)

        def maybe_parameter() -> Any:
            class Bad(rp.Module, klass="bad"):
                gain: float | None = rp.parameter(None)

        def klass() -> Any:
            class Bad(rp.Module): ...

        for define, why in [
            (number, "numbers of own commands are 16 to 16383"),
            (rate, "`rate_hz` is above 0"),
            (annotation, "Bad.go.what: `set` has no description"),
            (missing, "`what` needs an annotation"),
            (twice, "command 16 is there twice"),
            (keyword, "take arguments by position"),
            (parameter, "5 is not in its range, at most 1"),
            (list_parameter, "Bad.gains: a parameter is bool, an integer of at most 64 bits, .*, not \\[f64\\]"),
            (long_parameter, "an enum of words, not u128"),
            (maybe_parameter, "an enum of words, not f64\\?"),
            (klass, "of which class is it"),
            (lambda: DriveError("Flat"), "has no variant `Flat`; there are: NotFinite, Hardware"),
            (lambda: Driver().proxy("motor.0"), "is hosted by nobody yet"),
        ]:
            with self.assertRaisesRegex(rp.Misuse, why):
                define()

    def test_fields_with_names_that_python_has_its_own_meaning_of_travel_too(self) -> None:
        @rp.data
        class Odd:
            made: Annotated[rp.U8, rp.said(name="__init__")]
            kind: Annotated[rp.U8, rp.said(name="__class__")]
            start: Annotated[rp.U8, rp.said(name="from")]

        value = schema.decode(type_of(Odd), b"\1\2\3")
        self.assertEqual((value, type(value), getattr(value, "from")), (Odd(1, 2, 3), Odd, 3))
        self.assertEqual(schema.encode(type_of(Odd), value), b"\1\2\3")
        self.assertEqual(schema.to_json(type_of(Odd), value), {"__init__": 1, "__class__": 2, "from": 3})
        self.assertEqual(schema.show(type_of(Odd), value), "{__init__: 1, __class__: 2, from: 3}")

    def test_no_function_hides_one_that_each_module_has(self) -> None:
        def made(key: str, value: Any) -> None:
            type("Hides", (rp.Module,), {key: value, "__annotations__": {key: int}}, klass="any")

        def one(self: Any) -> int:
            raise AssertionError("it is never run")

        for key, value in [
            ("write", rp.command(16)(one)), ("settings", rp.data_out(1)(one)), ("switched_on", rp.every(1.0)(one)),
            ("proxy", rp.parameter(1)), ("_host", rp.stream(2)(one)),
        ]:  # fmt: skip
            with self.assertRaisesRegex(rp.Misuse, f"Hides.{key}: each module has a `{key}` of its own"):
                made(key, value)
        made("written", rp.command(16, name="write")(one))

    def test_numbers_that_are_not_finite_are_in_no_range(self) -> None:
        class Any(rp.Module, klass="any"):
            speed: float = rp.parameter(0.0)
            short: rp.F32 = rp.parameter(0.1, min=0.1, max=0.1)

        its = Any()
        for value in (float("nan"), float("inf")):
            with self.assertRaisesRegex(rp.Misuse, "Any.speed: .* is not in its range, f64"):
                its.speed = value
        its.short = 0.1


if __name__ == "__main__":
    unittest.main()
