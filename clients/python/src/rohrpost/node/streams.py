"""Streams of other modules, looked at when the module likes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..between import between
from ..errors import BadReply, Misuse, RohrpostError
from ..names import Name
from ..schema.decode import decode
from ..schema.errors import WalkError
from ..schema.tree import Type
from .views import Held, View, kept

if TYPE_CHECKING:
    from .._node import Shared, Stream


@dataclass(frozen=True)
class Record:
    """A record in hand."""

    value: Any
    """Its value; many ``bytes`` in it are a view, which is there as long as the record is in hand."""
    time_ns: int
    """When it was true, ns since 1970."""
    epoch: int
    """Epoch of system time; times of different ones cannot be subtracted."""
    sequence: int
    """Its number in the stream."""


class NoRecord(RohrpostError):
    """There is no record in the stream of what was asked for: nothing came yet, or it is there no more."""


class Lost(RohrpostError):
    """The writer has passed this reader, which lost ``records``."""

    def __init__(self, records: int, what: str) -> None:
        super().__init__(f"{records} records of {what} were overwritten before they were read")
        self.records = records


class StreamReader:
    """A stream of another module, with a position of its own. For the module's own thread.

    ::

        with self.camera.newest() as record:
            look(record.value.pixels)
    """

    def __init__(self, stream: Stream, type: Type, unit: str, what: str) -> None:
        self._stream, self._unit, self._what = stream, unit, what
        self._thread = threading.get_ident()
        self._held: Held | None = None
        self.type = type
        """Of its values."""

    @contextmanager
    def newest(self) -> Iterator[Record]:
        """The newest record; the position stays. Raises :class:`NoRecord` before the first."""
        found = self._own().newest()
        if found is None:
            raise NoRecord(f"{self._what} has no record yet")
        with self._hold(*found) as record:
            yield record

    @contextmanager
    def next(self, timeout_s: float = 0.0) -> Iterator[Record]:
        """The next record; the first time the first one written after it was opened. Waits so long, and all else of
        the module with it. Raises :class:`NoRecord` if none came, and :class:`Lost` once if some were overwritten."""
        found, lost = self._own().next(timeout_s)
        if lost:
            raise Lost(lost, self._what)
        if found is None:
            raise NoRecord(f"no record of {self._what} came within {timeout_s} s")
        with self._hold(*found) as record:
            yield record

    @contextmanager
    def record(self, sequence: int) -> Iterator[Record]:
        """The record of this number. Raises :class:`NoRecord` if it is there no more, or not yet."""
        with self._hold(*self._record(sequence)) as record:
            yield record

    def around(self, time_ns: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Number and time of the two records around a time; both the same, if one has this very time. Raises
        :class:`NoRecord`, with the reason, if there are none, or not yet."""
        around, why = self._own().around(time_ns)
        if around is None:
            raise NoRecord(f"{self._what} has no two records around {time_ns} ns: {_WHY[why]}")
        return around

    @contextmanager
    def at(self, time_ns: int) -> Iterator[Record]:
        """The record nearest to a time. Raises :class:`NoRecord` as :meth:`around` does."""
        (before, before_ns), (after, after_ns) = self.around(time_ns)
        with self.record(before if time_ns - before_ns <= after_ns - time_ns else after) as record:
            yield record

    def interpolated(self, time_ns: int) -> Any:
        """The value at a time, between those of the two records around it. Numbers with a fraction go in a straight
        line, those of unit ``rad`` the short way round; all else comes from the record that is nearer in time. Raises
        :class:`NoRecord` as :meth:`around` does."""
        (before, before_ns), (after, after_ns) = self.around(time_ns)
        start, end = (self._copied(it) for it in (before, after))
        return between(self.type, self._unit, start, end, (time_ns - before_ns) / max(after_ns - before_ns, 1))

    def _record(self, sequence: int) -> tuple[int, int, int, bytes | Shared]:
        found = self._own().record(sequence)
        if found is None:
            raise NoRecord(f"record {sequence} of {self._what} is there no more, or not yet")
        return found

    def _copied(self, sequence: int) -> Any:
        """The value of a record, which stays when the record goes."""
        *_, data = self._record(sequence)
        if not isinstance(data, bytes):
            view = View(data)
            data = bytes(view.whole)
            view.release()
        try:
            return decode(self.type, data)
        except WalkError as error:
            raise BadReply(Name(0), f"{self._what}: {error}") from None

    def missed(self) -> dict[str, int]:
        """Records missed on the way by cause: ``lost`` by the network, ``sampled`` out by the configuration,
        ``passed_over`` since this reader was too slow."""
        return dict(zip(("lost", "sampled", "passed_over"), self._own().missed()))

    def _own(self) -> Stream:
        if threading.get_ident() != self._thread:
            raise Misuse(f"{self._what} was opened in another thread, that of its module, which alone may read it")
        if self._held is not None:
            raise Misuse(f"a record of {self._what} is in hand; leave its `with` before another is read")
        return self._stream

    @contextmanager
    def _hold(self, sequence: int, stamp_ns: int, epoch: int, data: bytes | Shared) -> Iterator[Record]:
        try:
            held = self._held = Held(self.type, data)
        except WalkError as error:
            raise BadReply(Name(0), f"{self._what}: {error}") from None
        try:
            yield Record(held.value, stamp_ns, epoch, sequence)
        finally:
            self._held = None
            is_free = held.release()
        if not is_free:
            raise kept(f"record {sequence} of {self._what}")


_WHY = {
    "empty": "it has no record yet",
    "before oldest": "the one before it is there no more, or never was",
    "not yet": "none that comes after it is there yet",
    "other epoch": "system time was set meanwhile",
}
