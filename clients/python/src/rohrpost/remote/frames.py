"""The frames of a session: what stands in the stream of bytes between a client and the TCP router.

``docs/src/wire.md``, "Sessions over a stream of bytes", is exact. What reads believes nothing, and keeps no more than
came.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Union

from ..errors import NoConnection
from ..schema.errors import plain
from ..wire import BODY_BYTES_MAX, HEAD_BYTES, Head, Package

HELLO, WELCOME, REFUSAL, REGISTER, REGISTERED, PACKAGE, ASK, ANSWER, RECORD_PART, DESCRIPTION = range(1, 11)
"""Kinds of frames."""
MAGIC = b"RpTc"
VERSION = 1
LENGTH_MAX = 8 + HEAD_BYTES + BODY_BYTES_MAX
NAME_BYTES_MAX = 64
RANGES_MAX = 2048
HOPS_MAX = 8
PART_BYTES = 4096
"""All parts of a record but the last have so many."""
DESCRIPTION_BYTES_MAX = 64 << 10
"""Longest description that is carried with records."""


class BadFrame(NoConnection):
    """What came is no frame of a session; nothing behind it can be read."""


@dataclass(frozen=True)
class Answer:
    """What the server says of its clocks; all in ns. ``error``: how far off system time is at most."""

    asked: int
    came: int
    left: int
    system: int
    error: int
    epoch: int


@dataclass(frozen=True)
class Welcome:
    """The server takes this client."""

    common_digest: int
    incarnation: int
    time: Answer


@dataclass(frozen=True)
class Refused:
    """The server does not take this client, or not any more."""

    version: int
    reason: int
    yours: int
    ours: int
    text: str

    @property
    def is_hopeless(self) -> bool:
        """Whether it does not help to try again soon."""
        return self.reason in (1, 2, 3, 10)

    def __str__(self) -> str:
        text = plain(self.text)
        full = "the TCP router has as many clients as it takes" + (f", and {text}" if text else "")
        words = {
            1: f"the TCP router speaks session format {self.version}, this end {VERSION}; run the same version of "
            "Rohrpost at both ends (`rohrpost version`)",
            2: f"the common digest here is {self.yours:016x}, that of {text} {self.ours:016x}; give both "
            "configurations the same classes (`rohrpost check`, on both)",
            3: f"the system's digest here is {self.yours:016x}, that of {text} {self.ours:016x}; start all of a system "
            "from the same file (`rohrpost check`, on both)",
            4: f"{full}; raise `clients`, or end some",
            5: f"another client has taken its place: {text}"
            if text
            else "a later connection of this client has taken its place",
            6: f"the TCP router could not read what came: {text}",
            7: "the TCP router heard nothing for too long",
            8: "nothing was read here for too long",
            9: "the TCP router ends",
            10: f"the certificate here does not fit: {text}; use that of this node (`rohrpost keys new`)",
        }
        return words[self.reason]


@dataclass(frozen=True)
class Registered:
    """Whether this client hosts its names; ``objection`` 0: it does."""

    number: int
    objection: int
    first: int
    last: int
    text: str


@dataclass(frozen=True)
class Carried:
    """A package, and when it was published by the server's session clock, ns (0: not known)."""

    published: int
    hops: int
    package: Package


@dataclass(frozen=True)
class RecordPart:
    """A part of a record of a stream. ``place``: which replica; ``generation``: how often the server has seen the
    stream made anew; ``description``: check of that by which it is read; times in ns, ``written`` 0: nobody knows."""

    body: bytes
    place: int
    generation: int
    description: int
    incarnation: int
    length: int
    offset: int
    sequence: int
    epoch: int
    stamp: int
    written: int
    error: int
    step: int
    sampled: int


@dataclass(frozen=True)
class DescribedPart:
    """A part of the description of the module that writes a stream. ``written``: records that it ever wrote."""

    body: bytes
    place: int
    generation: int
    check: int
    length: int
    offset: int
    written: int


Message = Union[Welcome, Refused, Registered, Carried, Answer, RecordPart, DescribedPart]


def _frame(kind: int, rest: bytes, hops: int = 0) -> bytes:
    return struct.pack("<IBBH", len(rest), kind, hops, 0) + rest


def hello(system: int, digests: tuple[int, int], incarnation: int, attempt: int, now_ns: int, name: str) -> bytes:
    """The first frame of a connection."""
    front = struct.pack("<4sBBBBQQQQQ", MAGIC, VERSION, system, 0, 0, *digests, incarnation, attempt, now_ns)
    return _frame(HELLO, front + name.encode())


def register(number: int, ranges: list[tuple[int, int]]) -> bytes:
    """The names that this client hosts."""
    return _frame(REGISTER, struct.pack("<I", number) + b"".join(struct.pack("<II", *both) for both in ranges))


def carry(package: Package, published_ns: int) -> bytes:
    """A package."""
    return _frame(PACKAGE, struct.pack("<Q", published_ns) + package.to_bytes())


def ask(now_ns: int) -> bytes:
    """A question for the time."""
    return _frame(ASK, struct.pack("<Q", now_ns))


class Splitter:
    """Cuts a stream into messages, wherever it is split."""

    def __init__(self) -> None:
        self._kept = bytearray()
        self.waits_since_ns: int | None = None
        """When the frame began that is not whole yet."""

    def take(self, data: bytes, now_ns: int) -> None:
        """More bytes came."""
        if data and not self._kept:
            self.waits_since_ns = now_ns
        self._kept += data

    def next(self, now_ns: int) -> Message | None:
        """The next whole message. Raises :class:`BadFrame`."""
        kept = self._kept
        if len(kept) < 8:
            return None
        length, kind, hops, zero = struct.unpack("<IBBH", kept[:8])
        if 20 <= kept[0] <= 23 and kept[1] == 3 and 1 <= kept[2] <= 4:
            raise BadFrame("it speaks TLS; write the same `security` in [tcp] at both ends")
        if kind not in _PARSE:
            raise BadFrame("no session of Rohrpost; is this the port of its TCP router?")
        if zero or (hops and kind != PACKAGE):
            raise BadFrame("damaged: a head with bits that mean nothing")
        if length > LENGTH_MAX:
            raise BadFrame(f"a frame of {length} bytes is too long")
        if len(kept) < 8 + length:
            return None
        rest = bytes(kept[8 : 8 + length])
        del kept[: 8 + length]
        self.waits_since_ns = now_ns if kept else None
        try:
            return _PARSE[kind](rest, hops)
        except struct.error:
            raise BadFrame("damaged: a frame that is too short or too long for its kind") from None


def _magic(rest: bytes) -> int:
    if rest[:4] != MAGIC or len(rest) < 5:
        raise BadFrame("no session of Rohrpost; is this the port of its TCP router?")
    return rest[4]


def _text(data: bytes) -> str:
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = "\n"
    if len(data) > NAME_BYTES_MAX or any(ord(c) < 32 or 127 <= ord(c) < 160 for c in text):
        raise BadFrame("damaged: a text that is none")
    return text


def _welcome(rest: bytes, _: int) -> Message:
    version = _magic(rest)
    if version != VERSION:
        raise BadFrame(f"session format {version}, ours is {VERSION}; run the same version of Rohrpost at both ends")
    if rest[5:8] != bytes(3):
        raise BadFrame("damaged: bits that mean nothing")
    common, incarnation = struct.unpack("<QQ", rest[8:24])
    return Welcome(common, incarnation, _answer(rest[24:], 0))


def _refusal(rest: bytes, _: int) -> Refused:
    version = _magic(rest)
    reason, zero, yours, ours = struct.unpack("<BHQQ", rest[5:24])
    if not 1 <= reason <= 10 or zero:
        raise BadFrame("damaged: unknown reason of a refusal")
    return Refused(version, reason, yours, ours, _text(rest[24:]))


def _registered(rest: bytes, _: int) -> Registered:
    number, objection, first, last = struct.unpack("<IB3xII", rest[:16])
    if objection > 4 or rest[5:8] != bytes(3):
        raise BadFrame("damaged: unknown objection")
    return Registered(number, objection, first, last, _text(rest[16:]))


def _package(rest: bytes, hops: int) -> Carried:
    (published,) = struct.unpack("<Q", rest[:8])
    if len(rest) < 8 + HEAD_BYTES:
        raise BadFrame("damaged: a package without a head")
    head = Head.from_bytes(rest[8 : 8 + HEAD_BYTES])
    body = rest[8 + HEAD_BYTES :]
    if head.length != len(body):
        raise BadFrame("damaged: a package of another length than its head says")
    return Carried(published, hops, Package(head, body))


def _answer(rest: bytes, _: int) -> Answer:
    answer = Answer(*struct.unpack("<6Q", rest))
    if answer.left < answer.came:
        raise BadFrame("damaged: an answer that left before its question came")
    return answer


def _record_part(rest: bytes, _: int) -> RecordPart:
    part = RecordPart(rest[_RECORD_HEAD.size :], *_RECORD_HEAD.unpack(rest[: _RECORD_HEAD.size]))
    if (part.length and not part.body) or part.offset + len(part.body) > part.length:
        raise BadFrame("damaged: a part lies outside its record")
    return part


def _described_part(rest: bytes, _: int) -> DescribedPart:
    part = DescribedPart(rest[_DESCRIBED_HEAD.size :], *_DESCRIBED_HEAD.unpack(rest[: _DESCRIBED_HEAD.size]))
    if not part.body or part.length > DESCRIPTION_BYTES_MAX or part.offset + len(part.body) > part.length:
        raise BadFrame("damaged: a part lies outside its description")
    return part


_RECORD_HEAD = struct.Struct("<HH4I4Q3I")
_DESCRIBED_HEAD = struct.Struct("<HH3IQ")
_PARSE: dict[int, Callable[[bytes, int], Message]] = {
    WELCOME: _welcome, REFUSAL: _refusal, REGISTERED: _registered, PACKAGE: _package, ANSWER: _answer,
    RECORD_PART: _record_part, DESCRIPTION: _described_part,
}  # fmt: skip
OBJECTIONS = {
    1: "another client hosts this range, or what it lies in",
    2: "another client hosts a part of this range, or it crosses another range of this client",
    3: "the name is not of the client's system, or the file gives it to another node: with TLS, use that node's "
    "certificate; without, say `node NODE of SYSTEM` as the label",
    4: "no room for more names",
}
"""Why a client may not host what it says."""
