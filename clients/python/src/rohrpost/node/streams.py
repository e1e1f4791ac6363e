"""Streams of other modules, looked at when the module likes."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, ContextManager

from ..between import between
from ..errors import BadReply, RohrpostError
from ..names import Name
from ..schema.decode import decode
from ..schema.errors import WalkError
from ..schema.tree import Type
from .plans import plan_of
from .views import Held

if TYPE_CHECKING:
    from .._node import InHand, Record, Shared, Stream

_LOOK_S = 0.05
"""A module that does not run yet is looked for again after so long, s."""


class NoRecord(RohrpostError):
    """There is no record in the stream of what was asked for: nothing came yet, or it is there no more.

    Of a time ``why`` says it in a word: ``"empty"``, ``"before oldest"``, ``"not yet"`` (ask again), ``"gap"`` or
    ``"other epoch"``."""

    def __init__(self, text: str, why: str | None = None) -> None:
        super().__init__(text)
        self.why = why


class Lost(RohrpostError):
    """The writer has passed this reader, which lost ``records``."""

    def __init__(self, records: int, what: str) -> None:
        super().__init__(f"{records} records of {what} were overwritten before they were read")
        self.records = records


class OpenedStream:
    """A stream that is there, and how it is read."""

    def __init__(self, stream: Stream, type: Type, unit: str, what: str) -> None:
        self.stream, self.type, self.unit = stream, type, unit
        stream.reads(what, plan_of(type), functools.partial(_held, type, what))
        # A `with` holds it no longer than its record, of which there is one at a time.
        self.newest = stream.in_hand()


class _Later:
    """A record of a stream that was not there yet: it is looked for when its ``with`` begins."""

    def __init__(self, find: Callable[[], InHand]) -> None:
        self._find = find
        self._in_hand: InHand | None = None

    def __enter__(self) -> Record:
        self._in_hand = self._find()
        return self._in_hand.__enter__()

    def __exit__(
        self, error: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        in_hand, self._in_hand = self._in_hand, None
        if in_hand is not None:
            in_hand.__exit__(error, value, trace)


class StreamReader:
    """A stream of another module, with a position of its own. For the module's own thread. The other module need not
    run yet: until it does, there is no record, and it is looked for at each reading.

    ::

        with self.camera.newest() as record:
            look(record.value.pixels)
    """

    def __init__(self, open: Callable[[float, bool], OpenedStream | None], what: str, timeout_s: float) -> None:
        self._open, self._what = open, what
        self._gap_ns: int | None = None
        self._opened = open(timeout_s, False)

    @property
    def type(self) -> Type:
        """Of its values. Raises :class:`NoRecord` as long as the other module never ran."""
        return self._found().type

    def newest(self) -> ContextManager[Record]:
        """The newest record; the position stays. Raises :class:`NoRecord` before the first."""
        return _Later(lambda: self._found().newest) if self._opened is None else self._opened.newest

    def next(self, timeout_s: float = 0.0) -> ContextManager[Record]:
        """The next record; the first time the first one written after it was opened. Waits so long, and all else of
        the module with it. Raises :class:`NoRecord` if none came, and :class:`Lost` once if some were overwritten."""
        if self._opened is None:
            return _Later(functools.partial(self._next_of_late, timeout_s))
        return self._in_hand(functools.partial(self._find_next, timeout_s))

    def record(self, sequence: int) -> ContextManager[Record]:
        """The record of this number. Raises :class:`NoRecord` if it is there no more, or not yet."""
        return self._in_hand(functools.partial(self._find, sequence))

    def with_gap(self, longest_s: float | None) -> StreamReader:
        """Records further apart than this have no value in between, and none that is nearest; without it, however far
        they are apart. Returns this reader."""
        self._gap_ns = None if longest_s is None else round(longest_s * 1e9)
        return self

    def around(self, time_ns: int, epoch: int | None = None) -> tuple[tuple[int, int], tuple[int, int]]:
        """Number and time of the two records around a time of this epoch, without one of the present epoch; both the
        same, if one has this very time. Raises :class:`NoRecord`, with the reason, if there are none, or not yet.

        A record has its epoch with it: ``stream.around(record.time_ns, record.epoch)``. Records of two epochs are never
        put together."""
        around, why, number = self._found().stream.around(time_ns, epoch)
        if around is None:
            raise self._none_around(time_ns, why, number)
        return around

    def at(self, time_ns: int, epoch: int | None = None) -> ContextManager[Record]:
        """The record nearest to a time. Raises :class:`NoRecord` as :meth:`around` does, and in a gap."""
        return self._in_hand(functools.partial(self._find_at, time_ns, epoch))

    def interpolated(self, time_ns: int, epoch: int | None = None) -> Any:
        """The value at a time, between those of the two records around it. Numbers with a fraction go in a straight
        line, those of unit ``rad`` the short way round; all else comes from the record that is nearer in time. Raises
        :class:`NoRecord` as :meth:`around` does, and in a gap."""
        (before, before_ns), (after, after_ns) = self._bridged(time_ns, epoch)
        start, end = (self._copied(it) for it in (before, after))
        return between(self.type, self._found().unit, start, end, (time_ns - before_ns) / max(after_ns - before_ns, 1))

    def _bridged(self, time_ns: int, epoch: int | None) -> tuple[tuple[int, int], tuple[int, int]]:
        """The two records around a time, if they are not too far apart."""
        (before, before_ns), (after, after_ns) = self.around(time_ns, epoch)
        if self._gap_ns is not None and after_ns - before_ns > self._gap_ns:
            raise self._none_around(time_ns, "gap", after_ns - before_ns)
        return (before, before_ns), (after, after_ns)

    def _copied(self, sequence: int) -> Any:
        """The value of a record, which stays when the record goes."""
        data = self._found().stream.copied(sequence)
        if data is None:
            raise self._none(sequence)
        try:
            return decode(self.type, data)
        except WalkError as error:
            raise BadReply(Name(0), f"{self._what}: {error}") from None

    def missed(self) -> dict[str, int]:
        """Records missed on the way by cause: ``lost`` by the network, ``sampled`` out by the configuration,
        ``passed_over`` since this reader was too slow."""
        counts = (0, 0, 0) if self._opened is None else self._opened.stream.missed()
        return dict(zip(("lost", "sampled", "passed_over"), counts))

    def _found(self) -> OpenedStream:
        """It, if it is there by now."""
        opened = self._look(0.0)
        if opened is None:
            raise no_newest(self._what)
        return opened

    def _look(self, timeout_s: float) -> OpenedStream | None:
        if self._opened is None:
            self._opened = self._open(timeout_s, True)
        return self._opened

    def _in_hand(self, find: Callable[[], None]) -> ContextManager[Record]:
        opened = self._opened
        return _Later(lambda: self._found().stream.in_hand(find)) if opened is None else opened.stream.in_hand(find)

    def _next_of_late(self, timeout_s: float) -> InHand:
        # By the count of looks, not by a clock: replayed exactly, it looks as often.
        left = timeout_s
        while (opened := self._look(0.0)) is None:
            if left <= 0.0:
                raise self._none_within(timeout_s)
            time.sleep(min(left, _LOOK_S))
            left -= _LOOK_S
        return opened.stream.in_hand(functools.partial(self._find_next, max(0.0, left)))

    def _none_within(self, timeout_s: float) -> NoRecord:
        return NoRecord(f"no record of {self._what} came within {timeout_s} s")

    def _find_next(self, timeout_s: float) -> None:
        is_found, lost = self._found().stream.next(timeout_s)
        if lost:
            raise Lost(lost, self._what)
        if not is_found:
            raise self._none_within(timeout_s)

    def _find(self, sequence: int) -> None:
        if not self._found().stream.record(sequence):
            raise self._none(sequence)

    def _find_at(self, time_ns: int, epoch: int | None) -> None:
        (before, before_ns), (after, after_ns) = self._bridged(time_ns, epoch)
        self._find(before if time_ns - before_ns <= after_ns - time_ns else after)

    def _none_around(self, time_ns: int, why: str, number: int) -> NoRecord:
        reason = _WHY[why].format(number, self._gap_ns)
        return NoRecord(f"{self._what} has no two records around {time_ns} ns: {reason}", why)

    def _none(self, sequence: int) -> NoRecord:
        return NoRecord(f"record {sequence} of {self._what} is there no more, or not yet")


def no_newest(what: str) -> NoRecord:
    """What is told where there is no newest record."""
    return NoRecord(f"{what} has no record yet", "empty")


def _held(type: Type, what: str, data: bytes | Shared) -> Held:
    """A record that Python reads itself."""
    try:
        return Held(type, data)
    except WalkError as error:
        raise BadReply(Name(0), f"{what}: {error}") from None


_WHY = {
    "empty": "it has no record yet",
    "before oldest": "the one before it is there no more, or never was; the oldest comes {0} ns later",
    "not yet": "none that comes after it is there yet; the newest must be {0} ns younger",
    "gap": "they are {0} ns apart, and at most {1} ns are bridged",
    "other epoch": "system time was set meanwhile; the records are of epoch {0}",
}
