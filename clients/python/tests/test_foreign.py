"""What other modules of Python give and take: numbers of numpy, arrays, exceptions in a pool of processes."""

from __future__ import annotations

import concurrent.futures
import importlib
import importlib.util
import multiprocessing
import pickle
import pkgutil
import sys
import unittest
from array import array
from typing import Annotated, Any

import rohrpost
import rohrpost as rp
from rohrpost.annotations import type_of
from rohrpost.errors import RohrpostError
from rohrpost.faults import EXPIRED, Fault
from rohrpost.names import Name
from rohrpost.schema import WalkError, decode, encode

HAS_NUMPY = importlib.util.find_spec("numpy") is not None
TO = Name.of(7, 96, 0)
MADE: dict[str, tuple[Any, ...]] = {
    "CallTimeout": (TO, 0.5), "TooManyCalls": (TO,), "CallFault": (TO, Fault(EXPIRED)), "BadReply": (TO, "why"),
    "FunctionError": ({"why": "no"}, TO), "Lost": (3, "it"),
}  # fmt: skip
"""Arguments of those exceptions that take something else than words."""


class Scalar:
    """A number as numpy's are: of a class of its own, with a type and no length."""

    class Kind:
        def __init__(self, kind: str) -> None:
            self.kind, self.itemsize = kind, 8

    shape = ()

    def __init__(self, kind: str, value: Any) -> None:
        self.dtype, self.value = self.Kind(kind), value

    def __int__(self) -> int:
        return int(self.value)

    def __float__(self) -> float:
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)


def exceptions() -> list[type[RohrpostError]]:
    """All of the package that can be loaded here."""
    for module in pkgutil.walk_packages(rohrpost.__path__, "rohrpost."):
        if rp.is_available() or not module.name.startswith(("rohrpost.node", "rohrpost._node")):
            importlib.import_module(module.name)

    def below(cls: type[RohrpostError]) -> list[type[RohrpostError]]:
        return [cls, *(it for sub in cls.__subclasses__() for it in below(sub))]

    # Other tests load modules once more; the classes of those are not in their place any more.
    return [it for it in below(RohrpostError) if getattr(sys.modules.get(it.__module__), it.__name__, None) is it]


def fails(name: str) -> None:
    """Raises one."""
    cls = next(it for it in exceptions() if it.__name__ == name)
    raise cls(*MADE.get(name, ("why",)))


class Exceptions(unittest.TestCase):
    def test_every_exception_is_pickled_as_it_is(self) -> None:
        names = set()
        for cls in exceptions():
            made = cls(*MADE.get(cls.__name__, ("why",)))
            again = pickle.loads(pickle.dumps(made))
            self.assertEqual((type(again), str(again), again.args), (cls, str(made), made.args))
            self.assertEqual(again.__dict__, made.__dict__)
            names.add(cls.__name__)
        self.assertLessEqual({"CallFault", "CallTimeout", "TooManyCalls", "FunctionError", "NoSuchData"}, names)

    def test_a_pool_of_processes_gives_them_back(self) -> None:
        context = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(1, context) as pool:
            for name in ("CallFault", "TooManyCalls", "CallTimeout", "BadReply", "BadArguments"):
                with self.assertRaises(RohrpostError) as raised:
                    pool.submit(fails, name).result(60)
                self.assertEqual(type(raised.exception).__name__, name)


class Numbers(unittest.TestCase):
    def same(self, annotation: Any, value: Any, plain: Any) -> None:
        type = type_of(annotation, "test")
        self.assertEqual(encode(type, value), encode(type, plain), f"{annotation}: {value!r}")

    def test_numbers_of_numpy_are_numbers_wherever_they_stand(self) -> None:
        for kind, annotation, value in [
            ("i", int, -3), ("u", rp.U8, 255), ("f", float, 0.1), ("f", rp.F32, -0.0), ("b", bool, True),
        ]:  # fmt: skip
            self.same(annotation, Scalar(kind, value), value)
            self.same(list[annotation], [Scalar(kind, value)], [value])  # type: ignore[valid-type]
        self.same(rp.Pose, rp.Pose(Scalar("f", 1.5), 0.0, 2), rp.Pose(1.5, 0.0, 2.0))  # type: ignore[arg-type]
        self.same(dict[str, int], {"a": Scalar("i", 1)}, {"a": 1})
        for kind, annotation, value, why in [
            ("i", rp.U8, 256, "256 is out of range"), ("b", int, True, "expected a whole number"),
            ("M", int, 5, "expected a whole number"),
        ]:  # fmt: skip
            with self.assertRaisesRegex(WalkError, why):
                encode(type_of(annotation, "test"), Scalar(kind, value))

    def test_arrays_are_lists_of_numbers(self) -> None:
        for code in "bBhHiIlLqQ":
            self.same(list[int], array(code, [0, 1, 100]), [0, 1, 100])
        for code in "fd":
            self.same(list[rp.F32], array(code, [0.5, -1.5]), [0.5, -1.5])
            self.same(list[float], array(code, [0.5, -1.5]), [0.5, -1.5])
        self.same(bytes, array("B", b"few"), b"few")
        self.same(list[rp.U8], array("B", b"few"), b"few")
        self.same(bytes, array("H", [1, 255]), b"\1\xff")
        self.same(Annotated[list[float], rp.Length(2)], array("d", [1, 2]), [1.0, 2.0])
        self.same(list[float], array("B", [1, 2]), [1.0, 2.0])
        self.same(tuple[int, float], array("i", [1, 2]), (1, 2.0))
        self.same(float | None, Scalar("f", 2), 2.0)
        for annotation, value, why in [
            (bytes, array("H", [256]), "256 is out of range"), (str, array("B", b"few"), "expected text"),
            (Annotated[list[float], rp.Length(3)], array("d", [1]), "expected 3 elements, got 1"),
        ]:  # fmt: skip
            with self.assertRaisesRegex(WalkError, why):
                encode(type_of(annotation, "test"), value)

    @unittest.skipUnless(HAS_NUMPY, "without numpy")
    def test_numpy_itself(self) -> None:
        numpy: Any = importlib.import_module("numpy")
        for annotation, value, plain in [
            (int, numpy.int64(-5), -5), (rp.U8, numpy.uint8(255), 255), (float, numpy.float32(0.5), 0.5),
            (rp.F32, numpy.float64(0.1), 0.1), (bool, numpy.bool_(True), True), (float, numpy.array(3), 3.0),
            (list[rp.F32], numpy.linspace(0, 1, 5), [0.0, 0.25, 0.5, 0.75, 1.0]),
            (list[tuple[int, int]], numpy.arange(4).reshape(2, 2), [(0, 1), (2, 3)]),
            (bytes, numpy.arange(8, dtype="u1")[::2], b"\0\2\4\6"), (list[bool], numpy.array([True]), [True]),
        ]:  # fmt: skip
            self.same(annotation, value, plain)
        with self.assertRaises(WalkError):
            encode(type_of(bytes, "test"), numpy.zeros((2, 2), "u1"))
        numbers = type_of(list[int], "test")
        self.assertEqual(decode(numbers, encode(numbers, numpy.arange(2))), [0, 1])


if __name__ == "__main__":
    unittest.main()
