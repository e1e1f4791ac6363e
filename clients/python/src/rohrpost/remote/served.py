"""At most once: decides whether a command runs, is answered from memory, or is refused. Knows no clock.

A caller repeats a command if the answer does not come. What one incarnation of a server has begun to run, it never runs
again: of each caller it remembers which of the last 128 numbers it has begun, and the last 8 answers.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .. import faults
from ..faults import Fault
from ..names import Name
from ..wire import TRANSIT_NS_MAX, VALIDITY_NS_MAX
from .places import allows

CALLERS_MAX = 64
REPLIES_KEPT = 8
WINDOW = 128
_U32 = 0xFFFFFFFF


@dataclass(frozen=True)
class Request:
    """A command as it came in; times in ns."""

    sender: int
    incarnation: int
    sequence: int
    valid_ns: int
    age_ns: int
    is_redelivered: bool
    is_idempotent: bool

    @property
    def validity_ns(self) -> int:
        """How long it may be run; a longer time than a minute is not believed."""
        return min(self.valid_ns, VALIDITY_NS_MAX)

    @property
    def is_repeat(self) -> bool:
        """Whether the caller has sent it before."""
        return self.age_ns > 0


@dataclass(frozen=True)
class Again:
    """It was run; this was the answer."""

    is_error: bool
    body: bytes


RUN, IGNORE = "run", "ignore"


def _signed(number: int) -> int:
    number &= _U32
    return number - (1 << 32) if number > 0x7FFFFFFF else number


@dataclass
class _Memory:
    incarnation: int
    last: int
    run: int = 0
    """Bit n: that number ``last - n`` was begun."""
    answers: dict[int, Again] = field(default_factory=dict)
    until_ns: int = 0


class Deduplicator:
    """What one server, ``own``, has run. It lives since ``started_ns``."""

    def __init__(self, own: Name, started_ns: int) -> None:
        self._own = own
        self._started_ns = started_ns
        self._callers: dict[int, _Memory] = {}

    def decide(self, request: Request, now_ns: int) -> str | Again | Fault:
        """:data:`RUN` (then :meth:`done`), :class:`Again`, a fault to be told, or :data:`IGNORE`."""
        known = self._callers.get(request.sender)
        if known is not None:
            remembered = self._place(known, request, now_ns)
            if remembered is not None:
                return remembered
        oldest_ns = request.age_ns + TRANSIT_NS_MAX
        is_before_us = request.is_repeat and oldest_ns > now_ns - self._started_ns
        if (is_before_us or request.is_redelivered) and not request.is_idempotent:
            return Fault(faults.INTERRUPTED)
        if request.age_ns > request.validity_ns:
            is_first = not request.is_repeat and not request.is_redelivered
            return Fault(faults.EXPIRED) if is_first else IGNORE
        if (known is None or known.until_ns < now_ns) and not self._make_room(request.sender, now_ns):
            return Fault(faults.BUSY)
        self._note(request, now_ns)
        return RUN

    @staticmethod
    def _place(known: _Memory, request: Request, now_ns: int) -> str | Again | Fault | None:
        later = _signed(request.incarnation - known.incarnation)
        if later < 0 and now_ns <= known.until_ns:
            return Fault(faults.EARLIER_INCARNATION)
        if later != 0:
            return None
        behind = _signed(known.last - request.sequence)
        if behind >= WINDOW and now_ns <= known.until_ns:
            return IGNORE
        if 0 <= behind < WINDOW and known.run >> behind & 1:
            # Under way, or so old that nobody waits for it any more.
            return known.answers.get(request.sequence, IGNORE)
        return None

    def _make_room(self, sender: int, now_ns: int) -> bool:
        """Forgets callers from which no repeat can come any more, if there is no place else; never one that can still
        repeat."""
        if not allows(self._own, sender, self._callers, CALLERS_MAX):
            self._callers = {of: its for of, its in self._callers.items() if its.until_ns >= now_ns}
        return allows(self._own, sender, self._callers, CALLERS_MAX)

    def _note(self, request: Request, now_ns: int) -> None:
        memory = self._callers.get(request.sender)
        ahead = 0 if memory is None else _signed(request.sequence - memory.last)
        if memory is None or memory.incarnation != request.incarnation or abs(ahead) >= WINDOW:
            memory = self._callers[request.sender] = _Memory(request.incarnation, request.sequence)
            ahead = 0
        if ahead > 0:
            memory.run = memory.run << ahead & (1 << WINDOW) - 1 | 1
            memory.last = request.sequence
        else:
            memory.run |= 1 << -ahead
        left_ns = max(0, request.validity_ns - request.age_ns) + TRANSIT_NS_MAX
        memory.until_ns = max(memory.until_ns, now_ns + left_ns)

    def done(self, request: Request, is_error: bool, body: bytes) -> None:
        """Remembers the answer of a command that was run."""
        memory = self._callers.get(request.sender)
        if memory is None or memory.incarnation != request.incarnation:
            return
        memory.answers[request.sequence] = Again(is_error, body)
        while len(memory.answers) > REPLIES_KEPT:
            del memory.answers[next(iter(memory.answers))]
