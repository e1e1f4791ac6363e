"""Interface ``Gripper`` of class ``gripper``.

Made by ``rohrpost interface generate --lang python``: do not change it here, but where it was written, and make this
anew.
"""

from __future__ import annotations

import enum
from typing import Annotated

import rohrpost as rp

HASH = 0x341216c5
"""Of the interface: that of the file of which this was made."""


@rp.data
class Finger(enum.Enum):
    """One of them."""

    Left = 0
    Right = 1


Newtons = Annotated[Annotated[float, rp.said(unit="N", min=0.0, max=20.0)], rp.wrapped("Newtons", "A force.")]


@rp.data(name="test.Grip")
class Grip:
    """How it holds. \"\"\" */ \\ it"""

    width_m: Annotated[float, rp.said(unit="m", text="Between the fingers.")]
    force: Newtons
    from_: Annotated[Finger | None, rp.said(name="from")]
    places: dict[rp.U8, list[tuple[rp.F32, rp.F32]]]
    blob: bytes
    again: Annotated[rp.U8 | None, rp.maybe]


class GripError(
    rp.Choice,
    variants={
        "None": None,
        "TooStrong": Newtons,
        "at": Annotated[tuple[int, str], rp.inline],
    },
):
    """Why it does not hold."""


class Gripper(rp.Module, klass="gripper"):
    """Holds things."""

    @rp.command(16, error=GripError)
    def close(
        self,
        force_n: Annotated[float, rp.said(unit="N", max=20.0)],
        fingers: list[Finger],
    ) -> Grip:
        """Closes until it feels this force."""
        raise NotImplementedError

    @rp.command(17, idempotent=True, name="yield")
    def yield_(self) -> None:
        """Opens."""
        raise NotImplementedError

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


if Gripper.interface_.description.hash != HASH:
    raise rp.Misuse("Gripper: this package makes another interface of this module than the file had; make it anew")
