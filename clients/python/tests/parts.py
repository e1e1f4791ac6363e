"""Parts of records, as a TCP router sends them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from .router import frame

RECORD_PART, DESCRIPTION = 9, 10
PART_BYTES = 4096
STAMP_NS = 10**18


def described(words: bytes, *, place: int = 3, generation: int = 0, part_bytes: int = 1000) -> Iterator[bytes]:
    """Frames of a description."""
    for at in range(0, len(words), part_bytes):
        head = struct.pack("<HH3IQ", place, generation, zlib.crc32(words), len(words), at, 0)
        yield frame(DESCRIPTION, head + words[at : at + part_bytes])


def part(
    body: bytes,
    sequence: int,
    check: int,
    *,
    offset: int = 0,
    length: int | None = None,
    place: int = 3,
    generation: int = 0,
    sampled: int = 0,
    stamp: int = 0,
) -> bytes:
    """One frame of a record, ``length`` of which is that of the body if not told."""
    length = len(body) if length is None else length
    stamp = stamp or STAMP_NS + sequence
    head = struct.pack("<HH4I4Q3I", place, generation, check, 9, length, offset, sequence, 1, stamp, 0, 0, 0, sampled)
    return frame(RECORD_PART, head + body)


def record(body: bytes, sequence: int, check: int, *, place: int = 3, sampled: int = 0) -> Iterator[bytes]:
    """All frames of a record."""
    for at in range(0, max(1, len(body)), PART_BYTES):
        cut = body[at : at + PART_BYTES]
        yield part(cut, sequence, check, offset=at, length=len(body), place=place, sampled=sampled)
