"""Records of streams: their parts, as the TCP router sends them, become whole records. Without a clock or a socket.

::

     part ─▶ of the record that is open? ─┬─ its next bytes ─▶ all there: the record is handed out
                                          └─ the first of a newer one ─▶ what is open is given up, and that is opened

One record of a stream is open at a time, and holds no more than came. Records are known by sequence, incarnation and
stamp, never by when they come.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..errors import RohrpostError
from ..names import Name
from ..schema.decode import decode
from ..schema.description import Description
from ..schema.errors import SchemaError, WalkError
from ..schema.tree import Type
from .following import NoSuchData, item_of
from .frames import PART_BYTES, DescribedPart, RecordPart

SEQUENCE_MAX = 1 << 56
_DESCRIBE_EVERY_NS = 1_000_000_000
_U32, _U16 = 0xFFFFFFFF, 0xFFFF


class BadRecord(RohrpostError):
    """A record is not what the description of its module says."""


@dataclass(frozen=True)
class Missed:
    """Records that are not here, by cause. ``lost``: on the way, since the line was too slow for them, or away;
    ``sampled``: left out by the configuration of the replica; ``passed_over``: replaced here by newer ones before
    anybody took them."""

    lost: int = 0
    sampled: int = 0
    passed_over: int = 0

    @property
    def all(self) -> int:
        """All causes together."""
        return self.lost + self.sampled + self.passed_over


@dataclass(frozen=True)
class Record:
    """A record of a stream. ``sequence``: its number there; ``incarnation``: of its writer; ``time_ns``: its stamp,
    system time in ns since 1970, of this ``epoch``; ``data``: its bytes."""

    sequence: int
    incarnation: int
    time_ns: int
    epoch: int
    data: bytes = field(repr=False)
    type: Type = field(repr=False)

    @cached_property
    def value(self) -> Any:
        """What it says. Raises :class:`BadRecord`."""
        try:
            return decode(self.type, self.data)
        except WalkError as error:
            words = "its writer does not write what its interface says"
            raise BadRecord(f"record #{self.sequence} cannot be read: {error}; {words}") from None


@dataclass(frozen=True)
class _Life:
    """What a sender of parts may count sequences from anew."""

    server: int
    generation: int

    def is_before(self, other: _Life) -> bool:
        ahead = other.generation - self.generation & _U16
        return self.server == other.server and 0 < ahead < 0x8000


@dataclass(frozen=True)
class _Known:
    """Which record it is, and how many were sampled out before it in that life."""

    life: _Life
    sequence: int
    rest: tuple[int, ...]
    sampled: int

    @staticmethod
    def by(life: _Life, part: RecordPart) -> _Known:
        rest = part.incarnation, part.epoch, part.stamp, part.length
        return _Known(life, part.sequence, rest, part.sampled)


class Assembly:
    """Parts of one stream on their way to whole records, of at most ``record_bytes``. ``take`` gets each record that is
    whole, ``say`` what is wrong, and none when it is well again."""

    def __init__(
        self,
        publisher: Name,
        stream: str,
        expected: Type | None,
        record_bytes: int,
        take: Callable[[Record], None],
        say: Callable[[RohrpostError | None], None],
    ) -> None:
        self.record_bytes = record_bytes
        self.lost, self.sampled = 0, 0
        self.refused: Counter[str] = Counter()
        """Parts that were not taken, by cause: ``duplicate``, ``late``, ``undescribed``, ``too-large``, ``unsound``;
        and records of which the rest never came: ``incomplete``."""
        self._publisher, self._stream, self._expected = publisher, stream, expected
        self._take, self._say = take, say
        self._type: Type | None = None
        self._check: int | None = None
        self._words, self._words_of = bytearray(), (0, 0)
        self._describe_ns = 0
        self._newest: _Known | None = None
        self._open: _Known | None = None
        self._body = bytearray()

    @property
    def type(self) -> Type | None:
        """What its records are, once that is known."""
        return self._type

    def cut(self) -> None:
        """The connection is over: nothing more comes of what is open."""
        self._give_up()
        self._words, self._words_of = bytearray(), (0, 0)

    def _give_up(self) -> None:
        self.refused["incomplete"] += self._open is not None
        self._open, self._body = None, bytearray()

    def described(self, now_ns: int, server: int, part: DescribedPart) -> None:
        """A part of the description came."""
        life, newest = _Life(server, part.generation), self._newest
        if part.check == self._check or (newest is not None and life.is_before(newest.life)):
            return
        if part.offset == 0:
            self._words, self._words_of = bytearray(), (part.check, part.length)
        if self._words_of != (part.check, part.length) or part.offset != len(self._words):
            return
        self._words += part.body
        if len(self._words) < part.length:
            return
        words, self._words = bytes(self._words), bytearray()
        if zlib.crc32(words) != part.check:
            return
        if now_ns < self._describe_ns:
            # To read one takes long, and a server may send them all the time.
            self.refused["undescribed"] += 1
            return
        self._describe_ns = now_ns + _DESCRIBE_EVERY_NS
        self._understand(words, part.check)

    def _understand(self, words: bytes, check: int) -> None:
        self._give_up()
        self._check = self._type = None
        try:
            item = item_of(self._publisher, Description.from_bytes(words), self._stream, self._expected, "stream")
        except SchemaError as error:
            return self._say(NoSuchData(f"{self._publisher}: its description cannot be read: {error}"))
        except NoSuchData as error:
            return self._say(error)
        self._check, self._type = check, self._expected or item.field.type
        self._say(None)

    def part(self, server: int, part: RecordPart) -> None:
        """A part of a record came."""
        if self._check is None or part.description != self._check:
            return self._refuse("undescribed")
        if part.length > self.record_bytes:
            words = f"a record of {part.length} bytes, and at most {self.record_bytes} are taken here"
            self._say(BadRecord(f"{self._publisher}/{self._stream}: {words}; see `most_bytes`"))
            return self._refuse("too-large")
        whole = min(PART_BYTES, part.length - part.offset)
        is_sound = part.offset % PART_BYTES == 0 and len(part.body) == whole
        if not is_sound or part.stamp == 0 or part.sequence > SEQUENCE_MAX:
            return self._refuse("unsound")
        known = _Known.by(_Life(server, part.generation), part)
        if known != self._open:
            cause = self._begin(known, part)
            if cause:
                return self._refuse(cause)
        if part.offset != len(self._body):
            # On a line nothing is missing, and nothing changes places.
            return self._refuse("duplicate" if part.offset < len(self._body) else "unsound")
        self._body += part.body
        if len(self._body) == part.length:
            self._hand_out(known, part)

    def _refuse(self, cause: str) -> None:
        self.refused[cause] += 1

    def _begin(self, known: _Known, part: RecordPart) -> str:
        """Opens a record; or why not."""
        newest = self._newest
        if newest is not None and known.life.is_before(newest.life):
            return "late"
        if newest is not None and known.sequence <= newest.sequence:
            if (known.sequence, known.rest) == (newest.sequence, newest.rest):
                self._newest = known
                return "duplicate"
            if known.life == newest.life:
                return "late"
        if part.offset:
            # Its beginning was not taken.
            return "late"
        self._give_up()
        self._open = known
        return ""

    def _hand_out(self, known: _Known, part: RecordPart) -> None:
        newest, self._newest = self._newest, known
        data, self._open, self._body = bytes(self._body), None, bytearray()
        if newest is not None and not self._is_anew(newest, known):
            gap = known.sequence - newest.sequence - 1
            sampled = min(gap, known.sampled - newest.sampled & _U32) if known.life == newest.life else 0
            self.sampled += sampled
            self.lost += gap - sampled
        assert self._type is not None, "a record is opened when its description is known"
        self._say(None)
        self._take(Record(part.sequence, part.incarnation, part.stamp, part.epoch, data, self._type))

    @staticmethod
    def _is_anew(newest: _Known, known: _Known) -> bool:
        """Whether the stream was made anew, so that its sequences have nothing to do with earlier ones."""
        is_back = known.sequence <= newest.sequence
        return is_back or (known.life.server == newest.life.server and known.life != newest.life)
