#!/usr/bin/env python3
"""A gripper that lets records go while they are read, and at other wrong times."""

import gc
import threading
import weakref
from typing import Annotated

import rohrpost as rp

MEDDLES = []
KEPT = []


@rp.data(name="rohrpost.Odometry")
class Meddling:
    """An odometry that does something while it is read."""

    pose: rp.Pose
    twist: rp.Twist

    def __post_init__(self) -> None:
        for meddle in MEDDLES:
            meddle()


@rp.data(name="rohrpost.Image")
class Hoarded:
    """A picture of which a part is kept, when it is read for the first time, which fails."""

    width_px: Annotated[rp.U32, rp.said(unit="px")]
    height_px: Annotated[rp.U32, rp.said(unit="px")]
    row_bytes: Annotated[rp.U32, rp.said(unit="B")]
    format: rp.ImageFormat
    pixels: bytes

    def __post_init__(self) -> None:
        if not KEPT:
            KEPT.append(self.pixels[1:])
            raise ValueError("mine")


def said(part) -> str:
    """What a mistake says."""
    try:
        return f"no exception, but {part()!r}"
    except (Exception, SystemExit) as error:
        return f"{type(error).__name__}: {error}"


def elsewhere(part) -> str:
    """In another thread."""
    told: list[str] = []
    thread = threading.Thread(target=lambda: told.append(said(part)))
    thread.start()
    thread.join()
    return told[0]


def let_go(record) -> None:
    record.__exit__(None, None, None)


class Gripper(rp.Module, klass="gripper", settings=("mood",)):
    """Does what tests ask of it."""

    @rp.command(16)
    def meddles(self) -> list[str]:
        """While a record is read."""
        reader = self.stream("odometry.0", "odometry", Meddling, timeout_s=20)
        told: list[str] = []

        def meddle() -> None:
            told.append(f"exit: {said(lambda: let_go(reader.newest()))}")
            told.append(f"enter: {said(reader.newest().__enter__)}")

        def leave() -> None:
            raise SystemExit("at once")

        with reader.next(timeout_s=20):
            pass
        MEDDLES[:] = [meddle]
        with reader.newest() as record:
            told.append(f"read: {type(record.value).__name__}")
            told.append(f"other: {said(lambda: let_go(reader.record(1)))}")
            told.append(f"still: {said(reader.newest().__enter__)}")
            told.append(f"thread: {elsewhere(reader.missed)}")
        told.append(f"over: {said(lambda: let_go(reader.newest()))}")
        MEDDLES[:] = [leave]
        told.append(f"left: {said(reader.newest().__enter__)}")
        MEDDLES.clear()
        number = record.sequence
        with reader.newest() as record:
            number = record.sequence
        with reader.record(number) as again:
            told.append(f"equal: {record == again}, {record == number}")

        def stale() -> None:
            # As a finalizer might do between two lines of Python.
            reader._opened.stream.record(number)
            reader._opened.stream.copied(number)

        told.append(f"stale: {said(reader._opened.stream.in_hand(stale).__enter__)}")
        return told

    @rp.command(17)
    def keeps(self) -> list[str]:
        """Parts of records, or it seems so."""
        hoarder = self.stream("camera.0", "image", Hoarded, timeout_s=20)
        plain = self.stream("camera.0", "image", timeout_s=20)
        collected: list[int] = []

        def hoard() -> None:
            with hoarder.next(timeout_s=20) as record:
                len(record.value.pixels)

        def keep_and_fail() -> None:
            with plain.newest() as record:
                KEPT[:] = [record.value["pixels"][1:]]
                raise ValueError("its own")

        def circle(record) -> None:
            part = record.value["pixels"][1:]
            try:
                raise RuntimeError(str(len(part)))
            except RuntimeError as error:
                record.value["error"] = error

        def in_circle() -> None:
            with plain.newest() as record:
                circle(record)
                del record

        told = [f"hoarded: {said(hoard)}"]
        collect, gc.collect = gc.collect, lambda: collected.append(1)
        gc.disable()
        try:
            told.append(f"failed: {said(keep_and_fail)}, collected {len(collected)} times")
            told.append(f"circle: {said(in_circle)}, collected {len(collected)} times")
        finally:
            gc.collect = collect
            gc.enable()
        KEPT.clear()
        told.append(f"collected: {said(in_circle)}")
        return told

    @rp.command(18)
    def circles(self) -> list[str]:
        """A reader that leads to itself by way of how it reads."""

        def opened() -> weakref.ref:
            reader = self.stream("odometry.0", "odometry", timeout_s=20)
            reader._opened.stream.reads("it", ("words", [lambda: reader]), lambda data: reader)
            reader._opened.newest = reader._opened.stream.in_hand(lambda: reader)
            return weakref.ref(reader)

        seen = opened()
        gc.collect()
        return [f"reader: {seen()}"]

    @rp.stream(2)
    def edge(self) -> float:
        """Of what."""
        return 0.0


rp.run(Gripper)
