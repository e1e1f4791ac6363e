"""Writes PNG files, with nothing but zlib."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

GREY, RGB, RGBA = 0, 2, 6
"""Types of colour."""
SIGNATURE = b"\x89PNG\r\n\x1a\n"
SIDE_MAX = (1 << 31) - 1


def png(width: int, height: int, colour: int, depth: int, rows: Iterable[bytes]) -> bytes:
    """A file of these rows, from top to bottom. ``depth``: bits of a sample; of 16 the upper byte is first."""
    packer, pixels = zlib.compressobj(6), bytearray()
    for row in rows:
        # Before each row stands which filter it has: none.
        pixels += packer.compress(b"\0") + packer.compress(row)
    pixels += packer.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    return SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", bytes(pixels)) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
