"""What stands at the functions of modules: commands, data, streams, what they follow, and when they are run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from .errors import Misuse
from .wire import COMMAND_MAX, DATA_MAX, FIRST_OWN

F = TypeVar("F", bound=Callable[..., Any])
MARK = "__rohrpost__"
"""What stands at a function, as an attribute."""
RECORD_BYTES_MAX = 64 << 20
"""Larger records are not taken, unless a program says so."""


@dataclass(frozen=True)
class Command:
    """What :func:`command` says."""

    number: int
    idempotent: bool
    error: Any
    name: str


@dataclass(frozen=True)
class DataOut:
    """What :func:`data_out` says. ``rate_hz``: how often it is asked for and published; none: by ``publish`` alone."""

    number: int
    rate_hz: float | None
    unit: str
    name: str


@dataclass(frozen=True)
class OnData:
    """What :func:`on_data` says. ``period_s``: none: each value; else the newest once in so many seconds."""

    publisher: str
    data: str
    period_s: float
    newest: bool


@dataclass(frozen=True)
class OnRecord:
    """What :func:`on_record` says."""

    publisher: str
    stream: str
    most_bytes: int


@dataclass(frozen=True)
class StreamOut:
    """What :func:`stream` says."""

    number: int
    unit: str
    name: str


@dataclass(frozen=True)
class Every:
    """What :func:`every` says."""

    period_s: float


def command(number: int, *, idempotent: bool = False, error: Any = None, name: str = "") -> Callable[[F], F]:
    """A function that others call, by its number, 16 and above.

    ``idempotent``: running it twice does no harm. ``error``: the type of its own errors, which it returns by raising
    :class:`rohrpost.FunctionError`. ``name``: what others know it by, where Python cannot have that name, such as
    ``raise``.
    """
    if not FIRST_OWN <= number <= COMMAND_MAX:
        raise Misuse(f"command {number}: numbers of own commands are {FIRST_OWN} to {COMMAND_MAX}")
    return _marked(Command(number, idempotent, error, name))


def data_out(number: int, *, rate_hz: float | None = None, unit: str = "", name: str = "") -> Callable[[F], F]:
    """Data that others ask for and subscribe to. With ``rate_hz`` the function is run so often while the module is on,
    and what it returns is published; else ``self.publish`` does. ``name``: as of :func:`command`."""
    if not 0 <= number <= DATA_MAX:
        raise Misuse(f"data {number}: numbers of data are 0 to {DATA_MAX}")
    if rate_hz is not None and not 0 < rate_hz <= 10_000:
        raise Misuse(f"data {number}: `rate_hz` is above 0 and at most 10000, not {rate_hz}")
    return _marked(DataOut(number, rate_hz, unit, name))


def stream(number: int, *, unit: str = "", name: str = "") -> Callable[[F], F]:
    """A stream that others read, by its name and the type that the function returns; it is never run. ``self.write``
    and ``self.begin`` write its records. For modules on the node alone. ``name``: as of :func:`command`."""
    if not 0 <= number <= DATA_MAX:
        raise Misuse(f"stream {number}: numbers of streams are 0 to {DATA_MAX}")
    return _marked(StreamOut(number, unit, name))


def every(period_s: float) -> Callable[[F], F]:
    """A function without arguments that is run once in so many seconds while the module is on."""
    if not 0.0001 <= period_s <= 86_400:
        raise Misuse(f"a period of {period_s} s: it is 0.0001 to 86400")
    return _marked(Every(period_s))


def on_data(publisher: str, data: str, *, period_s: float = 0.0, newest: bool = False) -> Callable[[F], F]:
    """A function that is run with each value of another module's data, such as ``"odometry.0", "odometry"``.

    ``period_s``: the newest value once in so many seconds. ``newest``: of values that wait only the newest counts. If
    the function's argument has an annotation, the data must be of that type.
    """
    return _marked(OnData(publisher, data, period_s, newest))


def on_record(publisher: str, stream: str, *, most_bytes: int = RECORD_BYTES_MAX) -> Callable[[F], F]:
    """A function that is run with the records of another module's stream, such as ``"camera.0", "image"``: with the
    newest, whenever its turn comes. Records of more than ``most_bytes`` are not taken. If the function's argument has
    an annotation, the records must be of that type."""
    return _marked(OnRecord(publisher, stream, most_bytes))


def _marked(mark: Command | DataOut | OnData | OnRecord | StreamOut | Every) -> Callable[[F], F]:
    def decorate(function: F) -> F:
        setattr(function, MARK, mark)
        return function

    return decorate
