"""A program beside the robot, on its own computer: it calls, reads and plots as a tool, and needs no module.

::

    import rohrpost

    robot = rohrpost.connect()
    robot.call("motor.0", "drive", 0.3, 0.0)
    for record in robot.stream("odometry.0", "odometry"):
        print(record.value.pose)
"""

from __future__ import annotations

import itertools
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from . import node as node_part, remote, wire
from .common import Status, Subscribe, Unsubscribe, type_of_class
from .errors import BadReply, CallFault, Misuse, RohrpostError
from .faults import INTERFACE_DIFFERS
from .names import DATA, Installation, Name
from .remote import Client, Tls
from .remote.calling import STATUS, Prepared, expected_type, function_of, prepare, prepare_common, prepare_get, value_of
from .remote.following import LEASE_MS, Data, item_of
from .remote.handed_out import Functions
from .remote.records import Record
from .schema.decode import decode
from .schema.description import DataItem, Description
from .schema.encode import encode
from .schema.errors import WalkError

if TYPE_CHECKING:
    from ._node import CopiedStream, Tool

T = TypeVar("T")
_WAIT_S = 0.1
"""Longest wait in Rust: Ctrl-C is heard in between."""
_RENEW_S = LEASE_MS / 3000.0


class Robot:
    """What runs on this computer, as a tool sees it; :func:`rohrpost.connect` makes one. Closed at the end of ``with``,
    and at the end of the program. Threads may share it."""

    def __init__(self, tool: Tool) -> None:
        self._tool = tool
        self._described: dict[int, Description] = {}
        self._followed: dict[int, Following] = {}
        self._ids = itertools.count(1)
        self._lock = threading.Lock()
        self._at_exit = weakref.finalize(self, tool.close)

    def __enter__(self) -> Robot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Gives its place back."""
        self._at_exit()

    @property
    def modules(self) -> list[str]:
        """Names of all modules of the configuration, and their aliases."""
        return self._tool.modules()

    def describe(self, name: str, timeout_s: float = 1.0) -> Description:
        """What a module offers."""
        return self._describe(Name(self._tool.name(name)), timeout_s)

    def call(self, name: str, function: str, *values: Any, timeout_s: float = 1.0, **named: Any) -> Any:
        """Calls a function of a module by its description. Raises :class:`rohrpost.CallError`."""
        return self._call_by_name(None, Name(self._tool.name(name)), function, values, named, timeout_s)

    def proxy(self, name: str, timeout_s: float = 1.0) -> Functions:
        """The functions of a module: ``robot.proxy("motor.0").drive(0.3, 0.0)``. ``timeout_s``: of each call."""
        return Functions(self, None, Name(self._tool.name(name)), timeout_s)

    def status(self, name: str, timeout_s: float = 1.0) -> Status:
        """How a module is."""
        status: Status = self._sent(Name(self._tool.name(name)), STATUS, timeout_s)
        return status

    def switch(self, name: str, on: bool, timeout_s: float = 1.0) -> None:
        """Switches a module on or off."""
        prepared = prepare_common(wire.ON if on else wire.OFF)
        self._sent(Name(self._tool.name(name)), prepared, timeout_s)

    def get(self, name: str, data: str, timeout_s: float = 1.0) -> tuple[int, Any]:
        """The newest data of a module: when they were true, ns since 1970, and themselves."""
        to = Name(self._tool.name(name))
        found: tuple[int, Any] = self._asked(to, lambda described: prepare_get(to, described, data), timeout_s)
        return found

    def subscribe(self, name: str, data: str, *, period_s: float = 0.0, room: int = 64) -> Following:
        """Follows data of a module: each value, or the newest once in ``period_s``. ``room``: values that wait here;
        the oldest gives way."""
        to = Name(self._tool.name(name))
        described = self._describe(to, 1.0)
        item = item_of(to, described, data, None, "data")
        return Following(self, to, described, item, period_s, room)

    def stream(self, name: str, stream: str, *, expected: Any = None) -> Reading:
        """Reads a stream in the memory of this computer. ``expected``: the type that records must have, such as
        ``rohrpost.Image``."""
        to = Name(self._tool.name(name))
        item = item_of(to, self._describe(to, 1.0), stream, expected_type(expected), "stream")
        type = expected_type(expected) or item.field.type
        return Reading(self._tool.stream(to.raw, item.number), type, f"`{stream}` of {name}")

    def _describe(self, to: Name, timeout_s: float) -> Description:
        known = self._described.get(to.raw)
        if known is None:
            known = self._described[to.raw] = Description.from_bytes(self._tool.describe(to.raw, timeout_s))
        return known

    def _call_by_name(
        self, _: None, to: Name, function: str, values: tuple[Any, ...], named: dict[str, Any], timeout_s: float
    ) -> Any:
        def its(described: Description) -> Prepared:
            return prepare(described, function_of(to, described, function), values, named)

        return self._asked(to, its, timeout_s)

    def _asked(self, to: Name, make: Callable[[Description], Prepared], timeout_s: float) -> Any:
        prepared = make(self._describe(to, timeout_s))
        try:
            return self._sent(to, prepared, timeout_s)
        except CallFault as error:
            if error.fault.number != INTERFACE_DIFFERS:
                raise
        # It is another by now, and nothing was run.
        del self._described[to.raw]
        return self._sent(to, make(self._describe(to, timeout_s)), timeout_s)

    def _sent(self, to: Name, it: Prepared, timeout_s: float) -> Any:
        return value_of(it, to, self._tool.call(to.raw, it.interface, it.number, it.arguments, timeout_s))

    def _pump(self, timeout_s: float) -> None:
        """Waits for one value, and gives it to its subscription."""
        with self._lock:
            came = self._tool.data(timeout_s)
            if came is not None:
                sender, number, id, time_ns, sequence, missed, value = came
                followed = self._followed.get(id)
                if followed is not None and followed._is_of(sender, number):
                    followed._take(time_ns, sequence, missed, value)


class _Waiting(Generic[T]):
    """Something to be waited for, until ``close`` or the end of ``with``."""

    _what: str

    def next(self, timeout_s: float | None = None) -> T:
        """The next one. Raises :class:`TimeoutError` if none comes in time; without a time it waits."""
        until_s = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            left_s = _WAIT_S if until_s is None else max(0.0, min(_WAIT_S, until_s - time.monotonic()))
            found = self._look(left_s)
            if found is not None:
                return found
            if until_s is not None and time.monotonic() >= until_s:
                raise TimeoutError(f"nothing of {self._what} came within {timeout_s} s")

    def _look(self, timeout_s: float) -> T | None:
        raise NotImplementedError

    def close(self) -> None:
        """Ends it."""

    def __iter__(self) -> Iterator[T]:
        while True:
            yield self.next()

    def __exit__(
        self, error: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Following(_Waiting[Data]):
    """Data of a module as they come: ``for data in following``, or :meth:`next`."""

    def __init__(
        self, robot: Robot, to: Name, described: Description, item: DataItem, period_s: float, room: int
    ) -> None:
        self._robot, self._to, self._interface, self._item = robot, to, described.hash, item
        self._what = f"`{item.name}` of {to}"
        self._id = next(robot._ids) & 0xFFFF
        self._period_us = round(period_s * 1e6)
        self._values: deque[Data] = deque(maxlen=max(1, room))
        self._renew_s = 0.0
        robot._pump(0.0)
        robot._followed[self._id] = self

    def __enter__(self) -> Following:
        return self

    def _look(self, timeout_s: float) -> Data | None:
        if time.monotonic() >= self._renew_s:
            wish = Subscribe(self._item.number, self._id, self._period_us, LEASE_MS, DATA)
            self._ask(wire.SUBSCRIBE, encode(type_of_class(Subscribe), wish))
            self._renew_s = time.monotonic() + _RENEW_S
        if not self._values:
            self._robot._pump(timeout_s)
        return self._values.popleft() if self._values else None

    def _ask(self, function: int, arguments: bytes) -> None:
        self._robot._tool.call(self._to.raw, self._interface, function, arguments, 1.0)

    def _is_of(self, sender: int, number: int) -> bool:
        return (sender, number) == (self._to.raw, self._item.number)

    def _take(self, time_ns: int, sequence: int, missed: int, value: bytes) -> None:
        try:
            self._values.append(Data(decode(self._item.field.type, value), time_ns, sequence, missed))
        except WalkError as error:
            raise BadReply(self._to, str(error)) from None

    def close(self) -> None:
        """Ends it."""
        if self._robot._followed.pop(self._id, None) is not None:
            wish = Unsubscribe(self._id, DATA)
            try:
                self._ask(wire.UNSUBSCRIBE, encode(type_of_class(Unsubscribe), wish))
            except RohrpostError:
                pass  # The lease ends it.


class Reading(_Waiting[Record]):
    """A stream of a module, record by record: ``for record in reading``, :meth:`next` or :meth:`newest`."""

    def __init__(self, stream: CopiedStream, type: Any, what: str) -> None:
        self._stream, self._type, self._what = stream, type, what
        self.lost = 0
        """Records that were overwritten before they were read."""

    def __enter__(self) -> Reading:
        return self

    def newest(self, timeout_s: float = 5.0) -> Record:
        """The newest record; the first one is waited for. :meth:`next` goes on as before. Raises :class:`TimeoutError`
        if there is none in time."""
        until_s = time.monotonic() + timeout_s
        while True:
            found = self._stream.newest()
            if found is not None:
                return Record(*found, self._type)
            if time.monotonic() >= until_s:
                raise TimeoutError(f"{self._what} has no record within {timeout_s} s; does its module run here?")
            time.sleep(0.02)

    def _look(self, timeout_s: float) -> Record | None:
        found, lost = self._stream.next(timeout_s)
        self.lost += lost
        return None if found is None else Record(*found, self._type)

    def close(self) -> None:
        """Frees its seat."""
        self._stream.close()


@overload
def connect(
    server: None = None, *, installation: str | None = None, node: str | None = None
) -> Robot: ...
@overload
def connect(
    server: str,
    *,
    installation: str | Path | Installation,
    own: str = "tool.64",
    tls: Tls | None = None,
    timeout_s: float = 5.0,
) -> Client: ...
def connect(
    server: str | None = None,
    *,
    installation: str | Path | Installation | None = None,
    node: str | None = None,
    own: str = "tool.64",
    tls: Tls | None = None,
    timeout_s: float = 5.0,
) -> Robot | Client:
    """Takes part in a robot as a tool, with the rights of that class.

    Without ``server``: in what runs on this computer; if several do, in the ``installation`` of this name. ``node``:
    on which of its nodes here, if not the first.

    With ``server`` (``HOST:PORT`` of the robot's TCP router): from anywhere, by :mod:`rohrpost.remote`.
    ``installation`` is then the file that ``rohrpost check FILE --json`` printed, or an :class:`rohrpost.Installation`. Raises
    :class:`rohrpost.NoConnection`.
    """
    if server is not None:
        if installation is None:
            raise Misuse("say installation=FILE, the output of `rohrpost check robot.toml --json`")
        known = installation if isinstance(installation, Installation) else Installation.from_check(installation)
        return remote.connect(server, own, known, tls=tls, timeout_s=timeout_s)
    missing = node_part.missing()
    if missing is not None:
        raise Misuse(missing)
    if isinstance(installation, (Path, Installation)):
        raise Misuse("an installation on this computer is named by its name")
    from ._node import Tool

    node_part.hear_forks()
    return Robot(Tool(installation, node))
