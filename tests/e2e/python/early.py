#!/usr/bin/env python3
"""A gripper that wants streams of cameras that come later, or never."""

import logging

import rohrpost as rp

WITHIN_S = 20.0


class Gripper(rp.Module, klass="gripper", settings=("fails",)):
    """Reads what cameras count."""

    def __init__(self) -> None:
        self.counts = self.stream("camera.0", "count", rp.U32)
        self.newest = self.counts.newest()
        self.other = self.stream("camera.1", "count")
        self.far = self.stream("laser.0", "scan", rp.LaserScan)

    def switched_on(self) -> None:
        if self.settings.get("fails"):
            raise ValueError("no hand")

    @rp.command(16)
    def early(self) -> list[str]:
        """What reading says as long as there is nothing."""
        reads = (
            lambda: self._enter(self.newest), lambda: self._enter(self.counts.next()),
            lambda: self._enter(self.counts.record(0)), lambda: self._enter(self.counts.at(1)),
            lambda: self.counts.around(1), lambda: self.counts.type, lambda: self._enter(self.far.newest()),
            lambda: self._enter(self.far.next(0.2)),
        )  # fmt: skip
        return [self._said(read) for read in reads] + [str(self.counts.missed()["lost"])]

    @rp.command(17)
    def first(self) -> rp.U32:
        """The first record, which is waited for."""
        with self.counts.next(WITHIN_S) as record:
            return record.value

    @rp.command(18)
    def last(self) -> rp.U32:
        """The newest, by what was made before there was any."""
        with self.newest as record:
            return record.value

    @rp.command(19)
    def wrong(self) -> None:
        """A stream that its module turns out not to have."""
        self._enter(self.other.newest())

    @rp.command(20)
    def prints(self) -> None:
        """Prints, and complains."""
        for number in range(20):
            print(f"printed {number}")
            logging.error("logged %d", number)

    @staticmethod
    def _enter(in_hand) -> None:
        with in_hand:
            pass

    @staticmethod
    def _said(part) -> str:
        try:
            return f"no exception, but {part()!r}"
        except Exception as error:
            return f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    rp.run(Gripper)
