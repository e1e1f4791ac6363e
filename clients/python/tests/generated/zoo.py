"""Interface ``Zoo`` of class ``zoo``.

Made by ``rohrpost interface generate --lang python``: do not change it here, but where it was written, and make this
anew.
"""

from __future__ import annotations

from typing import Annotated

import rohrpost as rp

HASH = 0x2caf1aa6
"""Of the interface: that of the file of which this was made."""


class Lamp(rp.Choice, variants={"Off": None, "on-full": None, "None": None}):
    """Whether it shines. \"Quoted\" */ text \"\"\" with \\ signs."""


@rp.data
class OrderDrive:
    speed_m_s: Annotated[float, rp.said(unit="m/s", text="Forward.", min=0.0, max=1.5)]
    until: Lamp | None


class Order(
    rp.Choice,
    variants={
        "Stop": None,
        "Go": Annotated[float, rp.said(unit="m/s")],
        "Hold": rp.U8 | None,
        "Turn": Annotated[tuple[rp.I32, bool], rp.inline],
        "Drive": Annotated[OrderDrive, rp.inline],
    },
):
    """What to do.

    Go: How fast.
    """


Meters = Annotated[Annotated[rp.F32, rp.said(unit="m", min=-1.0, max=1000000000.0)], rp.wrapped("Meters", "A length.")]


@rp.data(name="test.Pen")
class Pen:
    inside: Lamp


@rp.data(name="test.Pen")
class Pen2:
    inside: rp.U8


@rp.data
class Marker:
    """Nothing in it."""


@rp.data
class Numbers:
    """Numbers of all sizes."""

    signed: tuple[rp.I8, rp.I16, rp.I32, int, rp.I128]
    unsigned: tuple[rp.U8, rp.U16, rp.U32, rp.U64]
    huge: rp.U128
    floats: tuple[rp.F32, float]


Pair = Annotated[tuple[Annotated[rp.I16, rp.said(unit="°")], rp.Char], rp.wrapped("Pair"), rp.inline]


class Result(
    rp.Choice,
    variants={
        "Ok": rp.U8,
        "Err": str,
    },
):
    ...


@rp.data(name="test.Zoo")
class Zoo2:
    numbers: Numbers
    small: Annotated[list[float], rp.Length(3)]
    no_room: Annotated[list[rp.U8], rp.Length(0)]
    flag: bool
    letter: rp.Char
    name: str
    nothing: None
    distance: Meters
    pair: Pair
    maybe: rp.U8 | None
    nested: Annotated[list[Annotated[rp.U8 | None, rp.maybe]], rp.Length(3)]
    some_nothing: Annotated[list[Annotated[None, rp.maybe]], rp.Length(2)]
    orders: list[Order]
    bytes_: Annotated[list[rp.U8], rp.said(name="bytes")]
    blob: bytes
    lists: list[list[rp.I16]]
    by_name: dict[str, rp.U16]
    by_number: dict[int, rp.Char]
    by_lamp: dict[Lamp, bool]
    by_place: dict[tuple[rp.I8, rp.I8], rp.F32]
    result: Result
    units: list[None]
    class_: Annotated[rp.U8, rp.said(name="class", text="The same word in Python, Rust and C++.")]
    from_: Annotated[rp.I8, rp.said(name="from")]
    type_: Annotated[rp.U8, rp.said(name="type")]
    odd_name: Annotated[rp.U8, rp.said(name="Odd name!")]
    odd_name_2: Annotated[rp.U8, rp.said(name="odd_name")]


class Zoo(rp.Module, klass="zoo"):
    """All kinds of types, and of names."""

    @rp.command(16, idempotent=True, error=Lamp)
    def feed(
        self,
        from_: Annotated[float, rp.said(name="from", unit="kg", min=0.0, max=20.5)],
        count: Annotated[rp.U8, rp.said(min=1)],
        order: Order,
    ) -> Meters:
        """Feeds one."""
        raise NotImplementedError

    @rp.command(17, name="continue")
    def continue_(self) -> None:
        raise NotImplementedError

    @rp.command(18, name="publish")
    def publish_(
        self,
        lambda_: Annotated[Pen, rp.said(name="lambda")],
        other: Pen2,
    ) -> rp.Odometry | None:
        raise NotImplementedError

    @rp.command(300, error=str)
    def clean(
        self,
        marker: Marker,
    ) -> None:
        """Two errors have one name."""
        raise NotImplementedError

    @rp.data_out(1)
    def animals(self) -> Zoo2:
        """All animals."""
        raise NotImplementedError

    @rp.stream(3)
    def odometry(self) -> rp.Odometry:
        """Where it is."""
        raise NotImplementedError

    @rp.data_out(16384, name="type")
    def type_(self) -> Annotated[rp.F32, rp.said(unit="rad", min=-3.2)]:
        raise NotImplementedError


if Zoo.interface_.description.hash != HASH:
    raise rp.Misuse("Zoo: this package makes another interface of this module than the file had; make it anew")
