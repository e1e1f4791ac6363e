"""Packages: heads, and what stands before arguments, results and values. ``docs/src/wire.md`` is exact."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

HEAD_BYTES = 16
BODY_BYTES_MAX = 65_519

BIG_ENDIAN, STAMPED, ERROR, REDELIVERED, NEWEST = 1, 2, 4, 8, 16
"""Bits of a head's options."""
COMMAND_MAX = 16_383
DATA_MAX = 16_384

ON, OFF, STATUS, GET_DATA, SUBSCRIBE, UNSUBSCRIBE, OUTPUT_LEVEL, DESCRIBE = range(1, 9)
PARAMETERS, SET_PARAMETERS, TIME, EXCHANGE = range(9, 13)
"""Functions that every module has."""
FIRST_OWN = 16
COMMON_HASH = 4
"""Hash that commands to them carry."""
DESCRIPTION_PART = 768
DESCRIPTION_MAX = 1 << 20
"""Longest description that is asked for, bytes."""
LEASE_MS_MAX = 60_000
VALIDITY_NS_MAX = 60_000_000_000
TRANSIT_NS_MAX = 2_000_000_000
"""Longest time that a command is under way between two nodes."""
UNKNOWN_NS = (1 << 63) - 1
"""An error of a time that is not known."""


_HEAD = struct.Struct("<IIHhHBB"), struct.Struct(">IIHhHBB")
"""Of a head, by its bit :data:`BIG_ENDIAN`."""


class WireError(ValueError):
    """Bytes are no package of ours."""


@dataclass(frozen=True)
class Head:
    """What every package begins with. ``kind``: the number of a command, that of a reply negated, or that of data
    below -16384 (:func:`data_kind`). ``priority``: 255 is the most urgent."""

    to: int
    sender: int
    kind: int
    id: int = 0
    priority: int = 0
    options: int = 0
    length: int = 0

    def to_bytes(self) -> bytes:
        """16 bytes, in the byte order that its options tell."""
        form = _HEAD[self.options & BIG_ENDIAN]
        return form.pack(self.to, self.sender, self.length, self.kind, self.id, self.priority, self.options)

    @staticmethod
    def from_bytes(data: bytes) -> Head:
        """Reads the first 16 bytes."""
        if len(data) < HEAD_BYTES:
            raise WireError(f"a head has {HEAD_BYTES} bytes, not {len(data)}")
        to, sender, length, kind, id, priority, options = _HEAD[data[15] & BIG_ENDIAN].unpack_from(data)
        return Head(to, sender, kind, id, priority, options, length)

    @property
    def is_command(self) -> bool:
        """Whether it is a command."""
        return 1 <= self.kind <= COMMAND_MAX

    @property
    def data_number(self) -> int | None:
        """The number of its data; none of what is no data."""
        return -16_384 - self.kind if self.kind <= -16_384 else None

    def capped(self) -> Head:
        """With the priority that it may have: a command that of its sender's class, a reply that of its receiver's,
        data the greater of both."""
        sender, receiver = self.sender >> 16 & 0xFF, self.to >> 16 & 0xFF
        if self.is_command or self.kind == 0 or self.kind > COMMAND_MAX or not self.to & 0xFF:
            limit = sender
        elif self.data_number is None:
            limit = receiver
        else:
            limit = max(sender, receiver)
        return self if self.priority <= limit else replace(self, priority=limit)


def data_kind(number: int) -> int:
    """The type of data of this number."""
    return -16_384 - number


@dataclass(frozen=True)
class Package:
    """A package."""

    head: Head
    body: bytes

    def to_bytes(self) -> bytes:
        """Head and body."""
        return self.head.to_bytes() + self.body


def package(to: int, sender: int, kind: int, id: int, body: bytes, priority: int, options: int = 0) -> Package:
    """A package with a head that tells the length of its body."""
    return Package(Head(to, sender, kind, id, priority, options, len(body)), body)


@dataclass(frozen=True)
class CallEnvelope:
    """Before a command's arguments. ``valid_us``: how long after the first try it may still be run, µs; ``age_us``: how
    long ago the first try was, µs, 0 in the first try."""

    interface: int
    incarnation: int
    sequence: int
    valid_us: int
    age_us: int = 0

    BYTES = 20

    def to_bytes(self) -> bytes:
        """As it stands in a body."""
        return struct.pack("<5I", self.interface, self.incarnation, self.sequence, self.valid_us, self.age_us)

    @staticmethod
    def split(body: bytes) -> tuple[CallEnvelope, bytes]:
        """Envelope and arguments."""
        if len(body) < 20:
            raise WireError(f"{len(body)} bytes, where an envelope has 20")
        return CallEnvelope(*struct.unpack("<5I", body[:20])), body[20:]


@dataclass(frozen=True)
class ReplyEnvelope:
    """Before a reply's result."""

    incarnation: int
    sequence: int

    def to_bytes(self) -> bytes:
        """As it stands in a body."""
        return struct.pack("<2I", self.incarnation, self.sequence)

    @staticmethod
    def split(body: bytes) -> tuple[ReplyEnvelope, bytes]:
        """Envelope and result."""
        if len(body) < 8:
            raise WireError(f"{len(body)} bytes, where an envelope has 8")
        return ReplyEnvelope(*struct.unpack("<2I", body[:8])), body[8:]


@dataclass(frozen=True)
class DataHead:
    """Before a value. ``stamp_ns``: system time at which it was true, ns since 1970; ``missed``: periods so far in
    which nothing could be delivered; ``incarnation``: the subscriber's, 0 in data that nobody asked for."""

    stamp_ns: int
    sequence: int
    missed: int
    incarnation: int

    BYTES = 20

    def to_bytes(self) -> bytes:
        """As it stands in a body."""
        return struct.pack("<Q3I", self.stamp_ns, self.sequence, self.missed, self.incarnation)

    @staticmethod
    def split(body: bytes) -> tuple[DataHead, bytes]:
        """Head and value."""
        if len(body) < 20:
            raise WireError(f"{len(body)} bytes, where data begin with 20")
        return DataHead(*struct.unpack("<Q3I", body[:20])), body[20:]
