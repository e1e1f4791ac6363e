"""Readers of plain types: numbers, texts, bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, Optional

from .tree import BOOL, BYTES, CHAR, F32, F64, TEXT, Plain

Lend = Optional[Callable[[int, int], Any]]
"""What ``bytes`` from here to there become, if they are a value; none: they are copied."""
Reader = Callable[[Any, int, Lend], tuple[Any, int]]
"""From bytes, and where a value begins in them: the value, and where it ends."""


class Unread(Exception):
    """These bytes are for :class:`.decode.Decoder`."""


def long_number(data: Any, at: int, bits: int) -> tuple[int, int]:
    """A whole number of at most so many bits."""
    number = shift = 0
    while shift < bits:
        byte = data[at]
        at += 1
        number |= (byte & 0x7F) << shift
        if byte < 0x80:
            if number >> bits:
                break
            return number, at
        shift += 7
    raise Unread


def nothing(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    """What takes no bytes."""
    return None, at


def _unsigned(bits: int) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        byte = data[at]
        if byte < 0x80:
            return byte, at + 1
        second = data[at + 1]
        if second < 0x80:
            return byte & 0x7F | second << 7, at + 2
        return long_number(data, at, bits)

    return read


def _signed(bits: int) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        number, at = long_number(data, at, bits)
        return number >> 1 ^ -(number & 1), at

    return read


def _u8(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    return data[at], at + 1


def _i8(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    byte = data[at]
    return byte - 256 if byte > 127 else byte, at + 1


def _bool(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    byte = data[at]
    if byte > 1:
        raise Unread
    return byte == 1, at + 1


def _f64(data: Any, at: int, lend: Lend, read: Any = struct.Struct("<d").unpack_from) -> tuple[Any, int]:
    return read(data, at)[0], at + 8


def _f32(data: Any, at: int, lend: Lend, read: Any = struct.Struct("<f").unpack_from) -> tuple[Any, int]:
    return read(data, at)[0], at + 4


def _span(data: Any, at: int) -> tuple[int, int]:
    """Where counted bytes begin and end."""
    length, at = long_number(data, at, 64)
    end = at + length
    if end > len(data):
        raise Unread
    return at, end


def octets(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    """Bytes that are a value."""
    at, end = _span(data, at)
    return bytes(data[at:end]) if lend is None else lend(at, end), end


def _text(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    at, end = _span(data, at)
    return str(data[at:end], "utf-8"), end


def _char(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
    text, at = _text(data, at, lend)
    if len(text) != 1:
        raise Unread
    return text, at


_PLAIN: dict[Plain, Reader] = {BOOL: _bool, F32: _f32, F64: _f64, TEXT: _text, BYTES: octets, CHAR: _char}


def plain_reader(type: Plain) -> Reader:
    """Of such a type."""
    if type.integer is None:
        return _PLAIN.get(type, nothing)
    signed, bits = type.integer
    if bits == 8:
        return _i8 if signed else _u8
    return _signed(bits) if signed else _unsigned(bits)
