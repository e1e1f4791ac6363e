"""Modules with numpy: one fills records from arrays, the other looks at them as arrays, and writes into a file what it
saw. Arguments: a configuration, a name, the file."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rohrpost as rp

# With its types mypy would take longer than with all else.
numpy: Any = importlib.import_module("numpy")
CONFIG, NAME, FILE = sys.argv[1:]
WIDTH, HEIGHT = 64, 48


@rp.data
class Kinds:
    """One of each kind that Rust makes of a record."""

    is_so: bool
    small: rp.I8
    byte: rp.U8
    short: rp.U16
    signed: int
    long: rp.U64
    near: rp.F32
    exact: float
    words: str
    few: bytes
    format: rp.ImageFormat
    pose: rp.Pose


ALL_KINDS = [
    Kinds(True, -128, 255, 65535, -(2**63), 2**64 - 1, 0.5, 0.1, "größer", b"few", rp.ImageFormat.Png, rp.Pose(1.5)),
    Kinds(False, 127, 0, 128, 2**63 - 1, 127, -0.0, -1e300, "", b"", rp.ImageFormat.Gray8, rp.Pose(0.0, -2.0, 3.0)),
]


@rp.data
class Pair:
    """Of more bytes than one view has."""

    first: bytes
    second: bytes


PAIR = Pair(bytes(range(256)) * 8, bytes(2000))


def said(part: Callable[[], Any]) -> str:
    try:
        return f"no exception, but {part()!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"


class Camera(rp.Module, klass="camera"):
    """Sees."""

    def __init__(self) -> None:
        # Every second column is seen, so no row of it lies in one piece.
        wide = numpy.arange(HEIGHT * WIDTH * 2, dtype=numpy.uint16).reshape(HEIGHT, WIDTH * 2)
        self.grey, self.told = wide[:, ::2], ""

    @rp.stream(1)
    def image(self) -> rp.Image:
        """What it sees."""
        raise AssertionError("it is never run")

    @rp.stream(2)
    def depth(self) -> rp.Image:
        """How far away that is."""
        raise AssertionError("it is never run")

    @rp.stream(3)
    def refused(self) -> str:
        """What it was not allowed."""
        raise AssertionError("it is never run")

    @rp.stream(4)
    def kinds(self) -> Kinds:
        """Whatever there is."""
        raise AssertionError("it is never run")

    @rp.stream(5)
    def pair(self) -> Pair:
        """More than one of something."""
        raise AssertionError("it is never run")

    @rp.every(0.005)
    def see(self) -> None:
        image = rp.Image(WIDTH, HEIGHT, WIDTH * 2, rp.ImageFormat.Gray16, b"")
        with self.begin("image", image, self.grey.nbytes) as pixels:
            numpy.frombuffer(pixels, numpy.uint16).reshape(HEIGHT, WIDTH)[...] = self.grey
            whole = said(lambda: pixels.__setitem__(slice(None), self.grey))
        metres = numpy.linspace(0, 1, HEIGHT * WIDTH, dtype=numpy.float32)
        image = rp.Image(WIDTH, HEIGHT, WIDTH * 4, rp.ImageFormat.DepthF32, b"")
        with self.begin("depth", image, metres.nbytes) as pixels:
            pixels[:] = metres.view(numpy.uint8)
        for kinds in ALL_KINDS:
            self.write("kinds", kinds)
        self.write("pair", PAIR)
        image = rp.Image(WIDTH, HEIGHT, WIDTH * 2, rp.ImageFormat.Gray16, self.grey)
        self.write("refused", f"{whole}; {said(lambda: self.write('image', image))}")


class Looker(rp.Module, klass="looker"):
    """Looks."""

    kept: Any = None

    @rp.every(0.005)
    def look(self) -> None:
        told: dict[str, Any] = {}
        try:
            images, depths, refused = (
                self.stream("camera.0", "image", rp.Image),
                self.stream("camera.0", "depth", rp.Image),
                self.stream("camera.0", "refused", str),
            )
            kinds, pairs = (
                self.stream("camera.0", "kinds", Kinds),
                self.stream("camera.0", "pair", Pair),
            )
            with refused.next(5.0) as record:
                told["refused"] = record.value
        except rp.RohrpostError:
            return  # It is not there yet.
        with images.newest() as record:
            grey = numpy.frombuffer(record.value.pixels, numpy.uint16).reshape(HEIGHT, WIDTH)
            flat = numpy.asarray(record.value.pixels)
            told["grey"] = grey[[0, 0, 1, -1], [0, 1, 0, -1]].tolist()
            told["flat"] = [str(flat.dtype), flat.shape]
            told["is copied"] = not numpy.shares_memory(grey, flat)
            told["write"] = said(lambda: grey.__setitem__(0, 1))
            mine = numpy.array(grey)
            del grey, flat
        told["mine"] = mine[0, :3].tolist()
        with depths.newest() as record:
            told["metres"] = round(float(numpy.frombuffer(record.value.pixels, numpy.float32).mean()), 3)
        with pairs.newest():
            pass  # A stream that was not there yet is opened by its first reading.
        told["calls"] = self.calls(images) + self.calls(pairs)
        seen: set[int] = set()
        while len(seen) < len(ALL_KINDS):
            # Some are lost where this is slow.
            with contextlib.suppress(rp.RohrpostError), kinds.next(5.0) as record:
                seen.add(ALL_KINDS.index(record.value) if record.value in ALL_KINDS else -1)
        told["kinds"] = sorted(seen)
        with pairs.newest() as record:
            told["pair"] = [record.value == PAIR, type(record.value.second).__name__]
        told["kept"] = said(lambda: self.keep(images))
        told["leads"] = self.kept.shape
        self.kept = None
        told["again"] = said(lambda: self.keep(depths, False))
        Path(f"{FILE}.new").write_text(json.dumps(told))
        os.rename(f"{FILE}.new", FILE)
        os.kill(os.getpid(), signal.SIGTERM)

    def calls(self, stream: Any) -> list[str]:
        """What of a reading is Python."""
        calls: list[str] = []
        sys.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_name) if event == "call" else None)
        with stream.newest() as record:
            repr(type(record.value))
        sys.setprofile(None)
        return calls

    def keep(self, stream: Any, is_kept: bool = True) -> None:
        with stream.newest() as record:
            part = numpy.frombuffer(record.value.pixels, numpy.uint8)[1:]
            self.kept = part if is_kept else None
            del part


if __name__ == "__main__":
    rp.run(Camera if NAME == "camera.0" else Looker, ["--config", CONFIG, "--name", NAME])
