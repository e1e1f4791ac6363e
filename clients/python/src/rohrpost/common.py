"""What the functions say that every module has."""

from __future__ import annotations

import enum

from .annotations import U8, U16, U32, U64, Choice, data
from .schema import tree
from .schema.tree import Field, Named


@data
class State(enum.Enum):
    """What a module is doing."""

    Starting = 0
    Off = 1
    On = 2
    Error = 3
    Stopping = 4


@data
class OutputLevel(enum.Enum):
    """Which lines a module sends."""

    Error = 0
    Warn = 1
    Info = 2
    Debug = 3
    Trace = 4


@data
class Refused:
    """Packages that a module did not take, by cause."""

    not_allowed: U64 = 0
    no_place: U64 = 0
    malformed: U64 = 0
    unasked: U64 = 0
    other_publisher: U64 = 0
    other_number: U64 = 0
    earlier_incarnation: U64 = 0


@data
class Status:
    """How a module is. ``uptime_ms``: time since it started, ms."""

    state: State
    error: str
    incarnation: U32
    uptime_ms: U64
    subscribers: U32
    missed: U64
    lost: U64
    output_lost: U64
    output_suppressed: U64
    output_level: OutputLevel | None
    refused: Refused


@data
class Subscribe:
    """Asks for continuous data. ``period_us``: 0 each value, else the newest once in so many µs; ``lease_ms``: without
    renewal it ends after this time, ms; ``mailbox``: local id that the data go to."""

    number: U16
    id: U16
    period_us: U32
    lease_ms: U32
    mailbox: U8


@data
class Unsubscribe:
    """Ends a subscription."""

    id: U16
    mailbox: U8


@data
class TimeReport:
    """System time at a module: ns since 1970, its epoch, how far off it is at most, ns, and where it comes from."""

    ns: U64
    epoch: U64
    error_ns: U64
    source: str


@data
class DescriptionPart:
    """A part of a description's bytes."""

    total: U32
    bytes: bytes


@data
class ParameterPage:
    """Some of a module's parameters. Each is two times bytes: a described field, and its present value."""

    total: U16
    changes: U32
    parameters: list[tuple[bytes, bytes]]


@data
class SetParameters:
    """Sets parameters, all of them or none; a value is postcard of the parameter's type."""

    values: list[tuple[str, bytes]]
    only_check: bool


@data
class Change:
    """A parameter that was set: its values before and now, postcard."""

    name: str
    old: bytes
    new: bytes


@data
class ExchangePage:
    """With which modules a module exchanges something: here none is counted."""

    total: U16
    exchanges: list[bytes]


def _texts(name: str, *fields: str) -> Named:
    return Named(name, 3, tuple(Field(field, tree.TEXT) for field in fields))


class Refusal(Choice):
    """Why parameters are not set."""


setattr(
    Refusal,
    "__rohrpost_type__",
    tree.Enum(
        "Refusal",
        (
            Named("NoParameters"),
            _texts("Unknown", "name", "known"),
            Named("Twice", 1, (Field("", tree.TEXT),)),
            _texts("Type", "name", "text"),
            _texts("Range", "name", "value", "range"),
            Named("Module", 1, (Field("", tree.TEXT),)),
        ),
        python=Refusal,
    ),
)


def result_of(value: tree.Type, error: tree.Type) -> tree.Enum:
    """What a function returns that may fail."""
    return tree.Enum("Result", (Named("Ok", 1, (Field("", value),)), Named("Err", 1, (Field("", error),))))


def type_of_class(cls: type) -> tree.Type:
    """The type of a class with :func:`rohrpost.data`."""
    found: tree.Type = cls.__dict__["__rohrpost_type__"]
    return found
