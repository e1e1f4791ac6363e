"""Exceptions. All of them are :class:`RohrpostError`."""

from __future__ import annotations

from typing import Any

from .faults import Fault
from .names import Name
from .schema.text import show_any


class RohrpostError(Exception):
    """What goes wrong between modules. It can be pickled, so it comes out of a pool of processes as it is."""

    def __reduce__(self) -> tuple[Any, ...]:
        # By what it holds: most are made of something else than their words.
        return _restored, (type(self), self.args, self.__dict__)


class Misuse(RohrpostError):
    """A mistake of this program: a handle that is closed or was opened before a fork, a definition that cannot be."""


class Misconfigured(RohrpostError):
    """What the configuration does not have, or has otherwise: a name of no module, a stream that is on another node.
    A module that ends with it, or with a mistake of its program, before it runs is not started again."""


class NoConnection(RohrpostError):
    """The TCP router is not reached, or lets this program not take part."""


class CallError(RohrpostError):
    """Why a call has no result."""


class CallTimeout(CallError):
    """No answer in time. The command may have been run, or not; it is no longer valid."""

    def __init__(self, to: Name, timeout_s: float) -> None:
        super().__init__(f"no answer from {to} within {seconds(timeout_s)}; does it run, and is it not too busy?")
        self.to = to


class NotSent(CallError):
    """The command could not be sent, and was not run."""


class TooManyCalls(CallError):
    """Too many calls are under way. The command was not sent."""

    def __init__(self, to: Name) -> None:
        super().__init__(f"too many calls to {to} are under way; wait for earlier ones, or give them up")
        self.to = to


class CallFault(CallError):
    """The server, or a router, did not run it: ``fault`` says why."""

    def __init__(self, to: Name, fault: Fault) -> None:
        super().__init__(f"{to}: {fault}")
        self.to = to
        self.fault = fault


class BadReply(CallError):
    """The answer is not what the interface promises."""

    def __init__(self, to: Name, why: str) -> None:
        super().__init__(f"the answer of {to} cannot be read: {why}")
        self.to = to


class BadArguments(CallError):
    """The arguments do not fit the function, or do not fit in a package."""

    def __init__(self, why: str) -> None:
        super().__init__(f"the arguments cannot be written: {why}")


class FunctionError(CallError):
    """The function was run and returned its own error, ``value``. A function of yours raises it to return one."""

    def __init__(self, value: Any, to: Name | None = None) -> None:
        super().__init__(show_any(value, 8))
        self.value = value
        self.to = to


def _restored(cls: type[RohrpostError], words: tuple[Any, ...], holds: dict[str, Any]) -> RohrpostError:
    """One that was pickled."""
    error = cls.__new__(cls, *words)
    error.__dict__.update(holds)
    return error


def seconds(time_s: float) -> str:
    """A time as Rust prints it: ``1s``, ``1.5s``, ``200ms``."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if time_s * factor >= 1.0:
            return f"{time_s * factor:.9g}{unit}"
    return f"{time_s * 1e9:.9g}ns"
