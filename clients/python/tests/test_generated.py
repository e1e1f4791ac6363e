"""Interfaces that went through a file, and came back as code: each compares its hash when it is imported.

``UPDATE_GOLDEN=1`` writes ``generated/gripper.json`` anew; the rest of ``generated`` is made of that and of an
interface in Rust by ``UPDATE_GOLDEN=1 cargo test -p rohrpost-cli --bin rohrpost interface``."""

from __future__ import annotations

import os
import pathlib
import unittest
from typing import Annotated, Any

import rohrpost as rp
from rohrpost import schema
from rohrpost.annotations import type_of

from . import exported
from .generated import gripper, zoo

FILE = pathlib.Path(__file__).parent / "generated" / "gripper.json"


class Generated(unittest.TestCase):
    def test_the_file_is_that_of_the_class(self) -> None:
        made = schema.to_file(exported.Gripper.interface_.description) + "\n"
        if os.environ.get("UPDATE_GOLDEN"):
            FILE.write_text(made, encoding="utf-8")
        self.assertEqual(FILE.read_text(encoding="utf-8"), made)

    def test_code_made_of_a_file_is_the_same_interface(self) -> None:
        there, back = exported.Gripper.interface_.description, gripper.Gripper.interface_.description
        self.assertEqual(back.hash, there.hash)
        self.assertEqual(back.to_bytes(), there.to_bytes(), "texts and ranges, too")
        self.assertEqual(zoo.Zoo.interface_.description.hash, zoo.HASH)

    def test_a_class_below_gives_the_functions_bodies(self) -> None:
        class Mine(zoo.Zoo):
            def continue_(self) -> None:
                self.went = True

            def type_(self) -> float:
                return 0.5

        self.assertEqual(Mine.interface_.description.hash, zoo.HASH)
        handler = Mine.interface_.commands[17]
        mine = Mine()
        getattr(mine, handler.name)()
        self.assertTrue(mine.went)
        self.assertEqual(getattr(mine, Mine.interface_.outputs[16384].name)(), 0.5)

    def test_values_of_odd_names_and_forms_come_back(self) -> None:
        grip = gripper.Grip(
            width_m=0.5, force=2.5, from_=gripper.Finger.Left, places={1: [(0.5, 1.5)]}, blob=b"x", again=None
        )
        made = type_of(gripper.Grip)
        encoded = schema.encode(made, grip)
        again: Any = schema.decode(made, encoded)
        self.assertEqual(again, grip)
        self.assertEqual(schema.to_json(made, grip)["from"], "Left")
        self.assertIn("from: Left", schema.show(made, grip))
        some = schema.decode(made, encoded[:-1] + b"\1\1\7")
        self.assertEqual(some.again, rp.Variant("Some", 7))
        error = type_of(gripper.GripError)
        kinds = {"None": None, "TooStrong": 3.0, "at": (1, "x")}
        for choice in (gripper.GripError(name, value) for name, value in kinds.items()):
            self.assertEqual(schema.decode(error, schema.encode(error, choice)), choice)
        by_place = type_of(dict[tuple[rp.I8, rp.I8], rp.F32])
        self.assertEqual(schema.decode(by_place, schema.encode(by_place, {(-1, 1): 0.5})), [((-1, 1), 0.5)])

    def test_what_is_no_inline_part_says_what_would_be_right(self) -> None:
        with self.assertRaisesRegex(rp.Misuse, "Bad.it: `inline` is for a tuple or a class with fields"):

            class Bad(rp.Choice, variants={"it": Annotated[int, rp.inline]}): ...


if __name__ == "__main__":
    unittest.main()
