"""When to try again, when to ask, and what answers say of the server's clocks. Knows no clock itself."""

from __future__ import annotations

import random
from dataclasses import dataclass

from ..wire import UNKNOWN_NS
from .frames import Answer

SECOND = 1_000_000_000
ASK_EVERY_NS = SECOND
SILENT_AFTER_NS = 3_500_000_000
SLOW_SILENT_AFTER_NS = 8 * SECOND
STALLED_AFTER_NS = 10 * SECOND
HANDSHAKE_MAX_NS = 5 * SECOND
FRAME_MAX_NS = 30 * SECOND
DRIFT_PPB = 250_000
"""How far two clocks drift apart at most, ns each second."""
_FIRST_NS, _BACKOFF_MAX_NS = 100_000_000, 2 * SECOND
_KEPT = 8


class Backoff:
    """Delay before the next connection: 50 to 100 ms, each time about twice as long, up to 2 s."""

    def __init__(self, seed: int) -> None:
        self._failures = 0
        self._chance = random.Random(seed)

    def lasted(self) -> None:
        """A connection lasted."""
        self._failures = 0

    def hopeless(self) -> None:
        """It will not help to be quick."""
        self._failures = 16

    def next_ns(self) -> int:
        """How long to wait, ns."""
        longest = min(_FIRST_NS << self._failures, _BACKOFF_MAX_NS)
        self._failures = min(self._failures + 1, 16)
        return longest // 2 + self._chance.randrange(longest // 2)


class Asking:
    """Questions for the time of one connection; their answers also say that the server is there."""

    def __init__(self, now_ns: int) -> None:
        self.next_ns = now_ns
        self._asked = 0
        self._waits: int | None = None
        self._left_ns: int | None = None

    def is_due(self, now_ns: int) -> bool:
        """Whether it is time to ask; a question that has not left yet is enough."""
        return now_ns >= self.next_ns and self._waits is None

    def asks(self, now_ns: int, end: int) -> None:
        """A question was made ready; it has left when the stream has taken ``end`` bytes."""
        self._asked += 1
        self.next_ns = now_ns + (SECOND // 10 if self._asked < 5 else ASK_EVERY_NS)
        self._waits = end

    def sent(self, now_ns: int, taken: int) -> None:
        """The stream has taken so many bytes since it began."""
        if self._waits is not None and self._waits <= taken:
            self._waits = None
            if self._left_ns is None:
                self._left_ns = now_ns

    def heard(self) -> None:
        """Something came."""
        self._left_ns = None

    def is_silent(self, now_ns: int, heard_ns: int, moved_ns: int, is_slow: bool) -> bool:
        """Whether the server has not said anything for too long that it could have said."""
        after = SLOW_SILENT_AFTER_NS if is_slow else SILENT_AFTER_NS
        could = heard_ns
        if self._left_ns is not None:
            could = self._left_ns
        elif self._waits is not None:
            could = moved_ns
        return now_ns - heard_ns > after and now_ns - could > after - ASK_EVERY_NS


@dataclass(frozen=True)
class SystemTime:
    """System time: ns since 1970, and how far off that is at most, ns. Times of different epochs cannot be
    subtracted."""

    ns: int
    error_ns: int
    epoch: int


@dataclass(frozen=True)
class _Sample:
    answer: Answer
    heard_ns: int
    ways_ns: int

    def error_ns(self, now_ns: int) -> int:
        age = max(0, now_ns - self.heard_ns) + self.ways_ns
        return -(-self.ways_ns // 2) + age * DRIFT_PPB // SECOND + 1

    def session_ns(self, now_ns: int) -> int:
        return self.answer.left + self.ways_ns // 2 + max(0, now_ns - self.heard_ns)


class ServerClock:
    """What is known of the clocks of one incarnation of the server. The shortest exchange counts most, until its age
    makes it worse than a later one."""

    def __init__(self) -> None:
        self._kept: list[_Sample] = []
        self._best: _Sample | None = None

    def heard(self, now_ns: int, answer: Answer) -> None:
        """An answer was read."""
        if now_ns < answer.asked:
            return
        sample = _Sample(answer, now_ns, max(0, now_ns - answer.asked - (answer.left - answer.came)))

        def contradicts(other: _Sample) -> bool:
            apart = abs(other.session_ns(now_ns) - sample.session_ns(now_ns))
            return apart > other.error_ns(now_ns) + sample.error_ns(now_ns)

        if any(map(contradicts, self._kept)):
            # One of both ends slept, or its clock was set.
            self._kept.clear()
        self._kept = [*self._kept[1 - _KEPT :], sample]
        # All of them age alike.
        self._best = min(self._kept, key=lambda sample: sample.error_ns(now_ns))

    def session(self, now_ns: int) -> tuple[int, int] | None:
        """The server's session clock, and how far off that is at most; ns."""
        best = self._best
        return None if best is None else (best.session_ns(now_ns), best.error_ns(now_ns))

    def round_trip_ns(self) -> int | None:
        """The shortest way there and back of late, ns."""
        return min((sample.ways_ns for sample in self._kept), default=None)

    def system(self, now_ns: int) -> SystemTime | None:
        """System time as the server has it; none if it does not know it."""
        known = [sample for sample in self._kept if sample.answer.error < UNKNOWN_NS]
        if not known:
            return None
        epoch = max(sample.answer.epoch for sample in known)
        known = [sample for sample in known if sample.answer.epoch == epoch]
        best = min(known, key=lambda sample: sample.error_ns(now_ns) + sample.answer.error)
        ns = best.answer.system + best.ways_ns // 2 + max(0, now_ns - best.heard_ns)
        return SystemTime(ns, best.error_ns(now_ns) + best.answer.error, epoch)
