"""From bytes to values.

| type | here |
| --- | --- |
| unit, none of an option | ``None`` |
| some of an option | the value; where that itself can be ``None``: ``Variant("Some", value)`` |
| numbers, bool, text, character | ``int``, ``float``, ``bool``, ``str`` |
| bytes, list of u8 | ``bytes`` |
| other lists, arrays, tuples | ``list``; of a Python annotation ``tuple[…]`` a ``tuple`` |
| struct | its Python class; ``dict`` where there is none |
| map | ``dict``; with keys that are no words a list of pairs |
| enum | its Python class; :class:`Variant` where there is none |
"""

from __future__ import annotations

import struct
from typing import Any

from .budget import EMPTY_MAX, values_most, values_of_name
from .errors import WalkError, counted, plain
from .readers import READERS
from .scalars import Lend, Reader
from .tree import (
    BOOL, BYTES, CHAR, DEPTH_MAX, F32, F64, TEXT, Array, Enum, List, Map, Named, Option, Plain, Struct, Tuple, Type,
    Variant, float_of, is_byte, is_nullable, unwrapped,
)  # fmt: skip

_READER = READERS.name


def decode(type: Type, data: bytes | memoryview, lend: Lend = None) -> Any:
    """The value that all of ``data`` holds. ``lend``: what ``bytes`` in it become, by where they begin and end; else
    they are copied. Raises :class:`WalkError`, with the path to where it showed."""
    read: Reader | None = type.__dict__.get(_READER)
    if read is not None:
        try:
            value, end = read(data, 0, lend)
            if end == len(data):
                return value
        except Exception:  # Also what an author's class raises.
            pass  # What is wrong, and where, is found below.
    decoder = Decoder(data, lend)
    value = decoder.value(type)
    left = len(data) - decoder.at
    if left:
        raise WalkError(f"{counted(left, 'byte')} too many")
    READERS.used(type)
    return value


def decode_front(type: Type, data: bytes) -> tuple[Any, int]:
    """The value that ``data`` begins with, and how many bytes are left."""
    decoder = Decoder(data)
    value = decoder.value(type)
    return value, len(data) - decoder.at


def made(python: Any, *values: Any, **named: Any) -> Any:
    """A value of an author's class, which may refuse what came: then the bytes are wrong, not this program."""
    try:
        return python(*values, **named)
    except Exception as error:
        words = plain(f"{type(error).__name__}: {error}")[:200]
        raise WalkError(f"its class does not take it: {words}") from error


class Decoder:
    """Reads one value after the other."""

    def __init__(self, data: bytes | memoryview, lend: Lend = None) -> None:
        self.data = data
        self.lend = lend
        self.at = 0
        self.depth = 0
        self.empty_left = EMPTY_MAX
        self.left = values_most(len(data))

    def value(self, type: Type) -> Any:
        """The next one, which is of this type."""
        if self.depth >= DEPTH_MAX:
            raise WalkError(f"nested more than {DEPTH_MAX} deep")
        self.count(1)
        before = self.at
        self.depth += 1
        value = self.unbounded(unwrapped(type))
        self.depth -= 1
        if self.at == before:
            self.empty_left -= 1
            if self.empty_left < 0:
                raise WalkError(f"more than {EMPTY_MAX} values that take no bytes")
        return value

    def count(self, values: int) -> None:
        """So many more."""
        self.left -= values
        if self.left < 0:
            raise self.too_many()

    def too_many(self) -> WalkError:
        most = values_most(len(self.data))
        return WalkError(f"more than {most} values in one; send many numbers as bytes, or as lists of f32 or f64")

    def unbounded(self, type: Type) -> Any:
        if isinstance(type, Plain):
            return self.plain(type)
        if isinstance(type, Option):
            if not self.flag():
                return None
            inner = self.value(type.inner)
            return Variant("Some", inner) if is_nullable(type.inner) else inner
        if isinstance(type, List):
            if is_byte(type.element):
                return self.octets()
            return self.many(type.element, self.length(type.is_of_empty), type.is_of_empty)
        if isinstance(type, Array):
            return self.many(type.element, self.fixed_length(type), type.is_of_empty)
        if isinstance(type, Tuple):
            return tuple(self.element(element, index) for index, element in enumerate(type.elements))
        if isinstance(type, Map):
            return self.map(type)
        if isinstance(type, Struct):
            return self.struct(type)
        return self.enum(type)

    def plain(self, type: Plain) -> Any:
        if type.integer:
            return self.integer(*type.integer)
        if type == BOOL:
            return self.flag()
        if type == F64:
            return struct.unpack("<d", self.take(8))[0]
        if type == F32:
            return struct.unpack("<f", self.take(4))[0]
        if type == TEXT:
            return self.text()
        if type == BYTES:
            return self.octets()
        if type == CHAR:
            text = self.text()
            if len(text) != 1:
                raise WalkError("not exactly one character")
            return text
        return None

    def many(self, type: Type, length: int, is_of_empty: bool) -> list[Any]:
        if float_of(type):
            self.left += length  # They are small, and read at once otherwise.
        if length > self.left and not is_of_empty:
            raise self.too_many()
        return [self.element(type, index) for index in range(length)]

    def element(self, type: Type, index: int) -> Any:
        try:
            return self.value(type)
        except WalkError as error:
            raise error.within(f"[{index}]") from None

    def field(self, type: Type, name: str) -> Any:
        try:
            self.count(values_of_name(name))
            return self.value(type)
        except WalkError as error:
            raise error.within(name) from None

    def members(self, named: Named) -> Any:
        if named.kind == 0:
            return None
        if named.kind == 1:
            return self.value(named.fields[0].type)
        if named.kind == 2:
            return tuple(self.element(field.type, index) for index, field in enumerate(named.fields))
        return {field.name: self.field(field.type, field.name) for field in named.fields}

    def struct(self, type: Struct) -> Any:
        members = self.members(type.named)
        return members if type.python is None else made(type.python, **(members or {}))

    def map(self, type: Map) -> Any:
        length = self.length(type.is_of_empty)
        if not type.has_words:
            return [self.element(Tuple((type.key, type.value)), index) for index in range(length)]
        entries: dict[Any, Any] = {}
        for index in range(length):
            key = self.element(type.key, index)
            try:
                entries[key] = self.value(type.value)
            except WalkError as error:
                raise error.within(key.name if isinstance(key, Variant) else str(key)) from None
        return entries

    def enum(self, type: Enum) -> Any:
        index = self.varint(32)
        if index >= len(type.variants):
            raise WalkError(f"variant number {index}, but only {counted(len(type.variants), 'variant')} known")
        variant = type.variants[index]
        try:
            self.count(values_of_name(variant.name))
            payload = self.members(variant)
        except WalkError as error:
            raise error.within(variant.name) from None
        return Variant(variant.name, payload) if type.python is None else made(type.python, variant.name, payload)

    def length(self, is_of_empty: bool) -> int:
        claimed, left = self.varint(64), len(self.data) - self.at
        if is_of_empty and claimed > self.empty_left:
            raise WalkError(f"more than {EMPTY_MAX} values that take no bytes")
        if not is_of_empty and claimed > left:
            raise WalkError(f"claims {claimed} elements, but only {counted(left, 'byte')} left")
        return claimed

    def fixed_length(self, type: Array) -> int:
        """Of an array: its type may say any."""
        left = len(self.data) - self.at
        if type.is_of_empty and type.length > self.empty_left:
            raise WalkError(f"more than {EMPTY_MAX} values that take no bytes")
        if not type.is_of_empty and type.length > left:
            raise WalkError(f"{counted(type.length - left, 'byte')} missing")
        return type.length

    def integer(self, signed: bool, bits: int) -> int:
        if bits == 8:
            byte = self.take(1)[0]
            return byte - 256 if signed and byte > 127 else byte
        number = self.varint(bits)
        return number >> 1 ^ -(number & 1) if signed else number

    def varint(self, bits: int) -> int:
        number = 0
        for shift in range(0, bits, 7):
            byte = self.take(1)[0]
            seven = byte & 0x7F
            if bits - shift < 7 and seven >> (bits - shift):
                break
            number |= seven << shift
            if byte < 0x80:
                return number
        raise WalkError(f"a number that does not fit {bits} bits")

    def text(self) -> str:
        try:
            return self.counted().decode()
        except UnicodeDecodeError:
            raise WalkError("text that is not UTF-8") from None

    def flag(self) -> bool:
        byte = self.take(1)[0]
        if byte > 1:
            raise WalkError(f"expected a byte 0 or 1, got {byte}")
        return byte == 1

    def counted(self) -> bytes:
        return self.take(self.varint(64))

    def octets(self) -> Any:
        """Bytes that are a value."""
        if self.lend is None:
            return self.counted()
        length = self.varint(64)
        start = self.skip(length)
        return self.lend(start, self.at)

    def take(self, length: int) -> bytes:
        start = self.skip(length)
        return bytes(self.data[start : self.at])

    def skip(self, length: int) -> int:
        """Passes over so many bytes; where they begin."""
        missing = length - (len(self.data) - self.at)
        if missing > 0:
            raise WalkError(f"{counted(missing, 'byte')} missing")
        self.at += length
        return self.at - length
