"""A module for tests."""

from __future__ import annotations

import threading
import rohrpost as rp
from rohrpost import remote

INSTALLATION = remote.Installation(7, {"probe": 96, "tool": 16}, 7, 1)


class Refused(rp.Choice):
    """Why not."""

    Never: None
    Because: str


class Probe(rp.Module, klass="probe"):
    """Does what tests ask of it."""

    gain: rp.U8 = rp.parameter(2, min=1, max=9, text="Times.")

    def __init__(self) -> None:
        self.counted = 0
        self.waits = False
        self.may_go = threading.Event()
        self.changes: list[str] = []

    def switched_on(self) -> None:
        self.changes.append("on")

    def switched_off(self) -> None:
        self.changes.append("off")

    def parameters_set(self) -> None:
        if self.gain == 7:
            raise ValueError("not seven")

    @rp.command(16)
    def count(self, by: rp.U32) -> rp.U64:
        """Counts."""
        self.counted += by
        return self.counted

    @rp.command(17, error=Refused)
    def refuse(self, why: str) -> int:
        """Refuses."""
        raise rp.FunctionError(Refused("Because", why) if why else Refused("Never"))

    @rp.command(18)
    def fail(self) -> None:
        """Fails."""
        raise RuntimeError("broken\n\x1b[31m")

    @rp.command(19)
    def wait(self) -> None:
        """Waits."""
        self.waits = True
        self.may_go.wait(20)

    @rp.command(20)
    def wrong(self) -> rp.U8:
        """Returns what does not fit."""
        return 300

    @rp.data_out(1, rate_hz=100)
    def beat(self) -> rp.U64:
        """How far it has counted."""
        return self.counted

    @rp.data_out(2)
    def word(self) -> str:
        """What it says."""
        return ""
