#!/usr/bin/env python3
"""A gripper that does what it should not, when it is asked to."""

import atexit
import logging
import os
import pickle
import sys
import threading
from dataclasses import replace

import rohrpost as rp
from rohrpost.node.streams import NoRecord


@rp.data
class Note:
    """Words, and bytes."""

    words: str
    more: bytes


@rp.data(name="rohrpost.Odometry")
class Picky:
    """An odometry that nobody gets."""

    pose: rp.Pose
    twist: rp.Twist

    def __post_init__(self) -> None:
        raise ValueError("too far")


def said(part) -> str:
    """What a mistake says."""
    try:
        return f"no exception, but {part()!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def why(ask, *at) -> str:
    """Why a stream has nothing at a time."""
    try:
        ask(*at)
        return "there"
    except NoRecord as error:
        return error.why


def locks(process="self") -> int:
    """How many locks of files a process holds that tell that it lives."""
    found = 0
    for number in os.listdir(f"/proc/{process}/fdinfo"):
        try:
            found += "OFDLCK" in open(f"/proc/{process}/fdinfo/{number}").read()
        except OSError:
            continue
    return found


class Gripper(rp.Module, klass="gripper", settings=("mood",)):
    """Does what tests ask of it."""

    gain: rp.U8 = rp.parameter(2, max=9)

    def __init__(self) -> None:
        self.mood = self.settings["mood"]
        self.orders: list[str] = []
        self.kept = None
        self.seen = 0
        self.heard = ""

    def switched_off(self) -> None:
        logging.info("safe, in a mood that is %s", self.mood)

    def parameters_set(self) -> None:
        if self.gain == 7:
            raise ValueError("not seven")

    @rp.command(16)
    def order(self, what: str) -> None:
        """What the next picture is for."""
        self.orders.append(what)

    @rp.command(17)
    def fail(self, why: str) -> None:
        """Fails."""
        if why == "missing":
            logging.warning("no room: %s", OSError(28, "No space left on device"))
            open("/no/such/file")
        raise RuntimeError(why)

    @rp.command(18)
    def leave(self) -> None:
        """Wants to end."""
        sys.exit(3)

    @rp.command(19)
    def wrong(self) -> rp.U8:
        """Returns what does not fit."""
        return 300

    @rp.command(20)
    def elsewhere(self) -> str:
        """In a thread of its own."""
        told: list[str] = []
        thread = threading.Thread(target=lambda: told.append(said(self.now_ns)))
        thread.start()
        thread.join()
        return told[0]

    @rp.command(21)
    def forked(self) -> str:
        """In a child."""
        reads, writes = os.pipe()
        camera = self.stream("camera.0", "image", rp.Image, timeout_s=20)
        again = said(lambda: rp.run(Gripper))
        child = os.fork()
        if child == 0:
            uses = [said(it) for it in (self.now_ns, camera.missed, lambda: rp.run(Gripper))]
            logging.info("a line of a child")
            os.write(writes, "; ".join([*uses, f"locks: {locks()}, its parent's: {locks(os.getppid()) > 0}"]).encode())
            os._exit(0)
        os.waitpid(child, 0)
        with camera.next(timeout_s=20) as record:
            return f"again: {again}; {os.read(reads, 2000).decode()}; goes on: {record.sequence > 0}"

    @rp.command(22)
    def strayed(self) -> int:
        """A child that comes back."""
        child = os.fork()
        if child == 0:
            return 1
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    @rp.command(23)
    def calls(self) -> list[str]:
        """What goes wrong with other modules."""
        motor = self.proxy("motor.0")
        stale = self.proxy("motor.0")
        # As if the motor had been another when this proxy asked it: its `halt` was what is `drive` by now.
        name, described = stale._described()
        numbers = {"drive": described.function("halt").number, "halt": described.function("drive").number}
        swapped = tuple(replace(it, number=numbers.get(it.name, it.number)) for it in described.functions)
        stale._known = name, replace(described, functions=swapped)
        return [
            f"stale: {said(stale.halt)}",
            said(lambda: motor.fly(1)),
            said(lambda: motor.drive("fast", 0)),
            said(lambda: motor.drive(float("nan"), 0)),
            said(lambda: self.proxy("nothing.0").drive()),
            said(lambda: self.publish("grip", "wide")),
            said(lambda: self.publish("grab", 1.0)),
            said(lambda: self.stream("motor.0", "motion")),
            said(lambda: self.stream("camera.0", "image", rp.Pose)),
            said(lambda: self.begin("edge", 0, 5).__enter__()),
        ]

    @rp.command(24)
    def looks(self) -> list[str]:
        """At the camera's stream."""
        camera = self.stream("camera.0", "image", rp.Image, timeout_s=20)
        told = []
        with camera.next(timeout_s=20) as record:
            view, number, time_ns = record.value.pixels, record.sequence, record.time_ns
            told.append(f"{type(view).__name__} of {len(view)}, {said(lambda: camera.newest().__enter__())}")
        told.append(said(lambda: view[0]))
        with camera.at(time_ns) as record:
            told.append(f"the same: {record.sequence == number}")
        told.append(said(lambda: camera.around(1)).split(" ns")[0])
        there = camera.interpolated(time_ns)
        told.append(f"in between: {type(there).__name__}, {type(there.pixels).__name__} of {there.height_px} rows")
        odometry = self.stream("odometry.0", "odometry", rp.Odometry, timeout_s=20)
        stamps = []
        for _ in range(2):
            with odometry.next(timeout_s=20) as record:
                stamps.append((record.time_ns, record.value.pose.x_m))
                epoch = record.epoch
        (before_ns, before_m), (after_ns, after_m) = stamps
        x_m = odometry.interpolated((before_ns + after_ns) // 2).pose.x_m
        told.append(f"half way: {abs(x_m - (before_m + after_m) / 2) < 1e-6}")
        middle_ns, gap_ns = (before_ns + after_ns) // 2, after_ns - before_ns

        def nearest(*at):
            with odometry.at(*at):
                pass

        for longest_s in (None, (gap_ns - 1) / 1e9, gap_ns / 1e9):
            odometry.with_gap(longest_s)
            for ask in (odometry.around, nearest, odometry.interpolated):
                told.append(f"{why(ask, middle_ns)}, {why(ask, middle_ns, epoch)}, {why(ask, middle_ns, epoch + 1)}")
        threading.Thread(target=lambda: told.append(said(lambda: camera.missed()))).run()
        for _ in range(12):
            # Of more than have a seat each is collected in another thread.
            left = [self.stream("camera.0", "image", rp.Image, timeout_s=20)]
            thread = threading.Thread(target=left.clear)
            thread.start()
            thread.join()
        other: list[str] = []
        thread = threading.Thread(target=lambda: other.append(said(lambda: camera.missed())))
        thread.start()
        thread.join()
        return told + other

    @rp.command(30)
    def keeps(self) -> list[str]:
        """Views of records, beyond their `with`."""
        camera = self.stream("camera.0", "image", rp.Image, timeout_s=20)

        def seen(look):
            with camera.newest() as record:
                return look(record.value.pixels)

        def keep(part) -> None:
            self.kept = part

        def keep_and_fail(pixels) -> None:
            self.kept = pixels[1:]
            raise ValueError("its own")

        def circle(pixels) -> None:
            part = pixels[1:]
            try:
                raise RuntimeError(str(len(part)))
            except RuntimeError as error:
                stays = error  # noqa: F841

        def pester() -> None:
            while not is_over.is_set():
                pestered.add(said(camera.missed))

        def pass_by() -> None:
            with camera.next(timeout_s=20):
                pass

        pass_by()
        told = [f"slice: {said(lambda: seen(lambda pixels: keep(pixels[1:])))}"]
        told.append(f"still there: {len(bytes(self.kept)) > 1000}")
        keep(None)
        told.append(f"whole: {said(lambda: seen(lambda pixels: keep(pickle.PickleBuffer(pixels))))}")
        keep(None)
        told.append(f"failed: {said(lambda: seen(keep_and_fail))}")
        keep(None)
        told.append(f"object: {said(lambda: seen(lambda pixels: keep(pixels.obj)))}")
        told.append(f"of it: {said(lambda: memoryview(self.kept))}")
        told.append(f"circle: {said(lambda: seen(circle))}")
        told.append(f"write: {said(lambda: seen(lambda pixels: pixels.__setitem__(0, 1)))}")
        newest = camera.newest()
        with newest:
            told.append(f"twice: {said(newest.__enter__)}")
        with newest as record:
            told.append(f"again: {record!r}")
        picky = self.stream("odometry.0", "odometry", Picky, timeout_s=20)
        told += [f"picky {it}: {said(picky.next(timeout_s=20).__enter__)}" for it in range(2)]
        with self.stream("laser.0", "scan", timeout_s=20).next(timeout_s=20) as record:
            told.append(f"laser: {type(record.value).__name__}")
        is_over, pestered = threading.Event(), set()
        thread = threading.Thread(target=pester)
        thread.start()
        # More than are there by now, so that it waits.
        for _ in range(15):
            said(pass_by)
        is_over.set()
        thread.join()
        return [*told, f"meanwhile: {pestered}"]

    @rp.command(26)
    def hears(self, word: str) -> None:
        """By a pipe that it watches."""
        reads, writes = os.pipe()

        def ready() -> None:
            self.heard = os.read(reads, 100).decode()
            self.unwatch(watch)
            os.close(reads)

        watch = self.watch(reads, ready)
        os.write(writes, word.encode())
        os.close(writes)

    @rp.command(27)
    def heard_word(self) -> str:
        """What it heard."""
        return self.heard + ", " + said(lambda: self.watch(-1, print))

    @rp.command(28)
    def gains(self) -> rp.U8:
        """What it reckons with."""
        return self.gain

    @rp.command(29)
    def notes(self) -> list[str]:
        """Small records, which do not lie in place; one that is given up, and one whose view is kept."""
        self.write("note", Note("whole", b"xyz"))
        with self.begin("note", Note("filled", b""), 4) as room:
            room[:] = b"abcd"
            told = [said(lambda: self.write("note", Note("between", b"")))]

        def given_up(keeps: bool) -> None:
            with self.begin("wide", Note("given up", b""), 5000) as room:
                self.kept = room[1:] if keeps else None
                if not keeps:
                    raise RuntimeError("no")

        def finished() -> None:
            with self.begin("object", Note("finished", b""), 5000) as room:
                room[:] = bytes(5000)
                self.kept = room.obj

        told += [f"object: {said(finished)}", f"of it: {said(lambda: memoryview(self.kept))}"]
        told += [said(lambda: given_up(False)), said(lambda: given_up(True))]
        return told

    @rp.stream(3)
    def note(self) -> "Note":
        """What it notes."""

    @rp.stream(4)
    def wide(self) -> "Note":
        """The same, with more room."""

    @rp.stream(5)
    def object(self) -> "Note":
        """As much again."""

    @rp.command(25)
    def sees(self) -> rp.U32:
        """Pictures so far."""
        return self.seen

    @rp.on_record("camera.0", "image")
    def look(self, image: rp.Image) -> None:
        self.seen += 1
        what = self.orders.pop() if self.orders else ""
        if what == "fail":
            raise RuntimeError("it is dark")
        if what == "keep":
            self.kept = image.pixels[1:]

    @rp.data_out(1)
    def grip(self) -> float:
        """How."""
        return 0.0

    @rp.stream(2)
    def edge(self) -> float:
        """Of what."""
        return 0.0


if os.fork() == 0:
    # Before it runs, a child is a process like any other.
    os._exit(0)
gripper = None
atexit.register(lambda: print(said(lambda: gripper.now_ns()), flush=True))


class Remembered(Gripper, interface="Gripper"):
    """The same, remembered after its end."""

    def __init__(self) -> None:
        super().__init__()
        globals()["gripper"] = self


rp.run(Remembered)
