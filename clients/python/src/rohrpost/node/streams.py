"""Streams of other modules, looked at when the module likes."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from ..between import between
from ..errors import BadReply, RohrpostError
from ..names import Name
from ..schema.decode import decode
from ..schema.errors import WalkError
from ..schema.tree import Type
from .plans import plan_of
from .views import Held

if TYPE_CHECKING:
    from .._node import InHand, Shared, Stream


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


class StreamReader:
    """A stream of another module, with a position of its own. For the module's own thread.

    ::

        with self.camera.newest() as record:
            look(record.value.pixels)
    """

    def __init__(self, stream: Stream, type: Type, unit: str, what: str) -> None:
        self._stream, self._unit, self._what = stream, unit, what
        self.type = type
        """Of its values."""
        stream.reads(what, plan_of(type), functools.partial(_held, type, what))
        self._gap_ns: int | None = None
        # A `with` holds it no longer than its record, of which there is one at a time.
        self._newest = stream.in_hand()

    def newest(self) -> InHand:
        """The newest record; the position stays. Raises :class:`NoRecord` before the first."""
        return self._newest

    def next(self, timeout_s: float = 0.0) -> InHand:
        """The next record; the first time the first one written after it was opened. Waits so long, and all else of
        the module with it. Raises :class:`NoRecord` if none came, and :class:`Lost` once if some were overwritten."""
        return self._stream.in_hand(functools.partial(self._find_next, timeout_s))

    def record(self, sequence: int) -> InHand:
        """The record of this number. Raises :class:`NoRecord` if it is there no more, or not yet."""
        return self._stream.in_hand(functools.partial(self._find, sequence))

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
        around, why, number = self._stream.around(time_ns, epoch)
        if around is None:
            raise self._none_around(time_ns, why, number)
        return around

    def at(self, time_ns: int, epoch: int | None = None) -> InHand:
        """The record nearest to a time. Raises :class:`NoRecord` as :meth:`around` does, and in a gap."""
        return self._stream.in_hand(functools.partial(self._find_at, time_ns, epoch))

    def interpolated(self, time_ns: int, epoch: int | None = None) -> Any:
        """The value at a time, between those of the two records around it. Numbers with a fraction go in a straight
        line, those of unit ``rad`` the short way round; all else comes from the record that is nearer in time. Raises
        :class:`NoRecord` as :meth:`around` does, and in a gap."""
        (before, before_ns), (after, after_ns) = self._bridged(time_ns, epoch)
        start, end = (self._copied(it) for it in (before, after))
        return between(self.type, self._unit, start, end, (time_ns - before_ns) / max(after_ns - before_ns, 1))

    def _bridged(self, time_ns: int, epoch: int | None) -> tuple[tuple[int, int], tuple[int, int]]:
        """The two records around a time, if they are not too far apart."""
        (before, before_ns), (after, after_ns) = self.around(time_ns, epoch)
        if self._gap_ns is not None and after_ns - before_ns > self._gap_ns:
            raise self._none_around(time_ns, "gap", after_ns - before_ns)
        return (before, before_ns), (after, after_ns)

    def _copied(self, sequence: int) -> Any:
        """The value of a record, which stays when the record goes."""
        data = self._stream.copied(sequence)
        if data is None:
            raise self._none(sequence)
        try:
            return decode(self.type, data)
        except WalkError as error:
            raise BadReply(Name(0), f"{self._what}: {error}") from None

    def missed(self) -> dict[str, int]:
        """Records missed on the way by cause: ``lost`` by the network, ``sampled`` out by the configuration,
        ``passed_over`` since this reader was too slow."""
        return dict(zip(("lost", "sampled", "passed_over"), self._stream.missed()))

    def _find_next(self, timeout_s: float) -> None:
        is_found, lost = self._stream.next(timeout_s)
        if lost:
            raise Lost(lost, self._what)
        if not is_found:
            raise NoRecord(f"no record of {self._what} came within {timeout_s} s")

    def _find(self, sequence: int) -> None:
        if not self._stream.record(sequence):
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
    return NoRecord(f"{what} has no record yet")


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
