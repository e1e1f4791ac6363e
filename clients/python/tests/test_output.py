"""What a launched module prints: lines of output, whole, and none that a child of a fork says for its parent."""

from __future__ import annotations

import importlib
import io
import sys
import types
import unittest
from typing import Any
from unittest import mock


class Printed(unittest.TestCase):
    def setUp(self) -> None:
        self.said: list[tuple[int, str, int | None]] = []
        # As the part in Rust has it: three arguments, none with a default.
        runtime: Any = types.ModuleType("rohrpost._node")
        runtime.say = lambda level, text, errno: self.said.append((level, text, errno))
        ours = [name for name in sys.modules if name.startswith("rohrpost.node")]
        patched = mock.patch.dict(sys.modules, {"rohrpost._node": runtime})
        patched.start()
        self.addCleanup(patched.stop)
        for name in ours:
            del sys.modules[name]
        output: Any = importlib.import_module("rohrpost.node.output")
        output._node = runtime
        self.pipe = io.BytesIO()
        # Kept, as `sys.__stdout__` is: else it would close the pipe.
        self.under = io.TextIOWrapper(self.pipe, "utf-8")
        self.printed = output._Printed(self.under)
        self.printed.is_heard = True
        for its in (self.printed, self.under):
            self.addCleanup(its.detach)

    def lines(self) -> list[str]:
        return self.pipe.getvalue().decode().split("\n")[:-1]

    def test_each_line_is_said_once_and_marked_in_the_pipe(self) -> None:
        print("half of it,", end="", file=self.printed)
        self.assertEqual(self.said, [])
        print(" and the rest\n\nlast", file=self.printed)
        self.assertEqual(self.said, [(2, "half of it, and the rest", None), (2, "last", None)])
        self.assertEqual(self.lines(), ["\x1ehalf of it, and the rest", "\x1e", "\x1elast"])

    def test_a_line_that_does_not_end_is_cut_and_each_piece_is_marked(self) -> None:
        for _ in range(2500):
            print("ü", end="", file=self.printed)
        print(file=self.printed)
        self.assertEqual([len(text) for _, text, _ in self.said], [1000, 1000, 500])
        self.assertTrue(all(line.startswith("\x1e") and len(line.encode()) <= 4096 for line in self.lines()))

    def test_a_child_of_a_fork_says_nothing_for_its_parent(self) -> None:
        print("of the parent", end="", file=self.printed)
        held = self.printed._lock
        self.printed.leave()
        self.assertIsNot(self.printed._lock, held)
        print("of the child", file=self.printed)
        self.assertEqual((self.said, self.lines()), ([], ["of the child"]))

    def test_what_is_no_whole_line_is_printed_at_the_end(self) -> None:
        print("no line", end="", file=self.printed)
        self.printed.end()
        self.assertEqual((self.said, self.pipe.getvalue()), ([], b"no line"))
