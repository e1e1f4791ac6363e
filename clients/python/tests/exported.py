"""An interface that Python wrote, for the others."""

from __future__ import annotations

import enum
from typing import Annotated

import rohrpost as rp

Newtons = Annotated[Annotated[float, rp.said(unit="N", min=0.0, max=20.0)], rp.wrapped("Newtons", "A force.")]


@rp.data
class Finger(enum.Enum):
    """One of them."""

    Left = 0
    Right = 1


@rp.data(name="test.Grip")
class Grip:
    """How it holds. \"\"\" */ \\ it"""

    width_m: Annotated[float, rp.said(unit="m", text="Between the fingers.")]
    force: Newtons
    from_: Annotated[Finger | None, rp.said(name="from")]
    places: dict[rp.U8, list[tuple[rp.F32, rp.F32]]]
    blob: bytes
    again: Annotated[rp.U8 | None, rp.maybe]


class GripError(rp.Choice, variants={"None": None, "TooStrong": Newtons, "at": Annotated[tuple[int, str], rp.inline]}):
    """Why it does not hold."""


class Gripper(rp.Module, klass="gripper"):
    """Holds things."""

    @rp.command(16, error=GripError)
    def close(self, force_n: Annotated[float, rp.said(unit="N", max=20.0)], fingers: list[Finger]) -> Grip:
        """Closes until it feels this force."""
        raise NotImplementedError

    @rp.command(17, idempotent=True, name="yield")
    def yield_(self) -> None:
        """Opens."""

    @rp.data_out(1)
    def grip(self) -> Grip:
        """How it holds now."""
        raise NotImplementedError

    @rp.data_out(2)
    def width(self) -> Annotated[float, rp.said(unit="m", min=0.0)]:
        """Between the fingers."""
        raise NotImplementedError

    @rp.stream(3)
    def odometry(self) -> rp.Odometry:
        """Where it is."""
        raise NotImplementedError
