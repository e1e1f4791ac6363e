"""The subscriber's side: data of another module, as long as somebody wants them. Knows no clock and no socket."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..common import DescriptionPart, Subscribe, Unsubscribe, type_of_class
from ..errors import BadReply, CallError, CallFault, CallTimeout, RohrpostError
from ..faults import INTERFACE_DIFFERS
from ..names import DATA, Name
from ..schema.binary import type_to_bytes
from ..schema.decode import decode
from ..schema.description import DataItem, Description
from ..schema.encode import encode
from ..schema.errors import SchemaError, WalkError, plain
from ..schema.text import describe_type
from ..schema.tree import U32, Type
from ..wire import (
    COMMON_HASH, DESCRIBE, DESCRIPTION_MAX, NEWEST, SUBSCRIBE, UNSUBSCRIBE, DataHead, Package,
)  # fmt: skip
from .calls import Call, Caller

LEASE_MS = 3000
_RENEW_NS = 1_000_000_000
_PATIENCE_NS = 1_000_000_000
DESCRIBED_NS = 10 * _PATIENCE_NS
"""A description comes in this time, however slow the way is and many parts it has."""


@dataclass(frozen=True)
class Data:
    """A value that came. ``time_ns``: system time at which it was true, ns since 1970; ``sequence``: its number, a gap
    is a loss unless only the newest counts; ``missed``: periods so far in which nothing could be delivered."""

    value: Any
    time_ns: int
    sequence: int
    missed: int


class NoSuchData(RohrpostError):
    """The module has no such data, or of another type."""


def item_of(to: Name, described: Description, name: str, expected: Type | None, what: str) -> DataItem:
    """Data, or a stream (``what``), of this name and type. Raises :class:`NoSuchData`."""
    having = [it for it in described.data if what == "data" or it.is_stream]
    item = next((it for it in having if it.name == name), None)
    if item is None:
        names = ", ".join(plain(it.name) for it in having) or "none"
        raise NoSuchData(f"{to}: no {what} `{name}`; it has: {names}")
    if expected and type_to_bytes(expected, True) != type_to_bytes(item.field.type, True):
        raise NoSuchData(
            f"{to}: {what} `{name}` are {describe_type(item.field.type)}, and not {describe_type(expected)} as here; "
            "names of types and units count, too"
        )
    return item


class Describing:
    """Asks a module what it offers, part by part, all of them in this time, each in ``each_ns``; ``done`` gets it, or
    what went wrong. ``now`` tells the time, ns."""

    def __init__(
        self,
        caller: Caller,
        now: Callable[[], int],
        to: Name,
        timeout_ns: int,
        done: Callable[[Description | CallError], None],
        each_ns: int | None = None,
    ) -> None:
        self._caller, self._now, self._to, self._done = caller, now, to, done
        self._timeout_ns, self._until_ns = timeout_ns, now() + timeout_ns
        self._each_ns = timeout_ns if each_ns is None else each_ns
        self._bytes = b""
        self._ask()

    def _ask(self) -> None:
        arguments, now_ns = encode(U32, len(self._bytes)), self._now()
        left_ns = min(self._until_ns - now_ns, self._each_ns)
        if self._bytes and left_ns <= 0:
            return self._done(CallTimeout(self._to, self._timeout_ns / 1e9))
        try:
            self._caller.begin(now_ns, self._to, DESCRIBE, COMMON_HASH, arguments, left_ns, self._answered)
        except CallError as error:
            self._done(error)

    def _answered(self, call: Call) -> None:
        try:
            part: DescriptionPart = decode(type_of_class(DescriptionPart), call.outcome())
            if not part.bytes or part.total > DESCRIPTION_MAX or len(self._bytes) + len(part.bytes) > part.total:
                raise SchemaError(f"a part of {len(part.bytes)} bytes of a description of {part.total}")
            self._bytes += part.bytes
            if len(self._bytes) < part.total:
                return self._ask()
            description = Description.from_bytes(self._bytes)
            _ = description.hash  # Whatever is wrong with it shows here.
        except CallTimeout as error:
            # However much of all the time the last part had.
            is_over = self._now() >= self._until_ns
            return self._done(CallTimeout(self._to, self._timeout_ns / 1e9) if is_over else error)
        except CallError as error:
            return self._done(error)
        except (WalkError, SchemaError, RecursionError) as error:
            return self._done(BadReply(self._to, str(error)))
        self._done(description)


class Following:
    """One subscription. ``take`` gets each value; ``state`` gets what is wrong, and none when it is well again."""

    def __init__(
        self,
        caller: Caller,
        now: Callable[[], int],
        id: int,
        to: Name,
        data: str,
        expected: Type | None,
        period_us: int,
        newest: bool,
        take: Callable[[Data], None],
        state: Callable[[RohrpostError | None], None],
    ) -> None:
        self.to, self.id = to, id
        self._caller, self._now = caller, now
        self._data, self._expected = data, expected
        self._period_us, self._newest = period_us, newest
        self._take, self._state = take, state
        self._description: Description | None = None
        self._item: DataItem | None = None
        self._next_ns = 0
        self._is_asking = False
        self._is_closed = False
        self._last: int | None = None
        self.lost = 0
        """Packages that should have come and did not."""

    @property
    def type(self) -> Type | None:
        """The type of its data, once it is known."""
        return None if self._item is None else self._expected or self._item.field.type

    def poll(self, now_ns: int) -> int:
        """Subscribes or renews when it is time; when to look again, ns."""
        if now_ns >= self._next_ns and not self._is_asking:
            self._is_asking, self._next_ns = True, now_ns + _RENEW_NS
            if self._description is None:
                Describing(self._caller, self._now, self.to, DESCRIBED_NS, self._described, _PATIENCE_NS)
            else:
                self._subscribe(self._description)
        return self._next_ns

    def _described(self, described: Description | CallError) -> None:
        if isinstance(described, CallError):
            return self._failed(described)
        try:
            item = item_of(self.to, described, self._data, self._expected, "data")
        except NoSuchData as error:
            return self._failed(error)
        self._description, self._item = described, item
        self._subscribe(described)

    def _subscribe(self, description: Description) -> None:
        assert self._item is not None
        wish = Subscribe(self._item.number, self.id, self._period_us, LEASE_MS, DATA)
        arguments, options = encode(type_of_class(Subscribe), wish), NEWEST if self._newest else 0
        try:
            self._caller.begin(
                self._now(), self.to, SUBSCRIBE, description.hash, arguments, _PATIENCE_NS, self._subscribed, options
            )
        except CallError as error:
            self._failed(error)

    def _subscribed(self, call: Call) -> None:
        if call.error is not None:
            if isinstance(call.error, CallFault) and call.error.fault.number == INTERFACE_DIFFERS:
                # Asked anew when its time comes: one that always says so is not asked without a pause.
                self._description = None
            return self._failed(call.error)
        self._is_asking = False
        self._state(None)

    def _failed(self, error: RohrpostError) -> None:
        self._is_asking = False
        if not self._is_closed:
            self._state(error)

    def received(self, package: Package) -> None:
        """A package of data came that may be of this subscription; all else is dropped."""
        head, item = package.head, self._item
        if item is None or self._is_closed or head.id != self.id or head.data_number != item.number:
            return
        if Name(head.sender).module != self.to or len(package.body) < DataHead.BYTES:
            return
        front, value = DataHead.split(package.body)
        if front.incarnation != self._caller.incarnation:
            return
        if self._last is not None and not self._newest:
            gap = front.sequence - self._last - 1 & 0xFFFFFFFF
            self.lost += gap if gap < 1 << 31 else 0
        self._last = front.sequence
        try:
            decoded = decode(self._expected or item.field.type, value)
        except WalkError as error:
            words = "its publisher does not write what its interface says"
            return self._state(RohrpostError(f"data {item.number} of {self.to} cannot be read: {error}; {words}"))
        self._take(Data(decoded, front.stamp_ns, front.sequence, front.missed))

    def close(self) -> None:
        """Ends it."""
        self._is_closed = True
        arguments = encode(type_of_class(Unsubscribe), Unsubscribe(self.id, DATA))
        try:
            self._caller.begin(
                self._now(), self.to, UNSUBSCRIBE, COMMON_HASH, arguments, _PATIENCE_NS, lambda call: None
            )
        except CallError:
            # Its lease ends by itself.
            return
