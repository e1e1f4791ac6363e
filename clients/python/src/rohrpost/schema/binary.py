"""Types as bytes, by the table in ``docs/src/wire.md``.

What reads believes nothing: depth, number of types and all lengths are bounded before anything is made of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ..siphash import siphash
from .errors import SchemaError
from .tree import (
    DEPTH_MAX, NAMES, TYPES_MAX, Array, Enum, Field, List, Map, Named, Option, Plain, Struct, Tuple, Type,
)  # fmt: skip

VERSION = 2
"""Version of the table."""
_TEXT, _UNIT, _LEAST, _MOST = 1, 2, 4, 8
T = TypeVar("T")


def hash_of(data: bytes) -> int:
    """The lower half of SipHash-1-3 with key 0."""
    return siphash(data, 1, 3) & 0xFFFFFFFF


def varint(number: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def type_to_bytes(type: Type, bare: bool = False) -> bytes:
    """A type as it is stored: the version, then the type. ``bare``: without what does not count in a hash."""
    writer = Writer(bare)
    writer.type(type)
    return bytes(writer.bytes)


def type_from_bytes(data: bytes) -> Type:
    """Reads what :func:`type_to_bytes` wrote. Raises :class:`SchemaError`."""
    return Reader.whole(data, Reader.type)


def type_hash(type: Type) -> int:
    """Tells types apart. Texts and ranges do not count, names and units do."""
    return hash_of(type_to_bytes(type, bare=True))


def field_to_bytes(field: Field) -> bytes:
    """A field as it is stored."""
    writer = Writer(False)
    writer.field(field)
    return bytes(writer.bytes)


def field_from_bytes(data: bytes) -> Field:
    """Reads what :func:`field_to_bytes` wrote. Raises :class:`SchemaError`."""
    return Reader.whole(data, Reader.field)


class Writer:
    """Appends."""

    def __init__(self, bare: bool) -> None:
        self.bytes = bytearray([VERSION])
        self._bare = bare

    def byte(self, byte: int) -> None:
        """One byte."""
        self.bytes.append(byte)

    def number(self, number: int) -> None:
        """A varint."""
        self.bytes += varint(number)

    def counted(self, data: bytes) -> None:
        """A length and so many bytes."""
        self.number(len(data))
        self.bytes += data

    def text(self, text: str) -> None:
        """A name."""
        self.counted(text.encode())

    def said(self, text: str) -> None:
        """What something is for."""
        self.text("" if self._bare else text)

    def fields(self, fields: tuple[Field, ...]) -> None:
        """How many, and each."""
        self.number(len(fields))
        for field in fields:
            self.field(field)

    def field(self, field: Field) -> None:
        """A field."""
        self.text(field.name)
        parts = [
            (_TEXT, field.text.encode() if field.text and not self._bare else None),
            (_UNIT, field.unit.encode() if field.unit else None),
            (_LEAST, None if self._bare else field.least),
            (_MOST, None if self._bare else field.most),
        ]
        self.byte(sum(mark for mark, part in parts if part is not None))
        for _, part in parts:
            if part is not None:
                self.counted(part)
        self.type(field.type)

    def named(self, named: Named) -> None:
        """A struct or variant."""
        self.text(named.name)
        self.said(named.text)
        self.byte(named.kind)
        if named.kind == 1:
            self.field(named.fields[0])
        elif named.kind > 1:
            self.fields(named.fields)

    def type(self, type: Type) -> None:
        """A type."""
        if isinstance(type, Plain):
            self.byte(type.tag)
        elif isinstance(type, Option):
            self.byte(17)
            self.type(type.inner)
        elif isinstance(type, List):
            self.byte(18)
            self.type(type.element)
        elif isinstance(type, Array):
            self.byte(19)
            self.number(type.length)
            self.type(type.element)
        elif isinstance(type, Map):
            self.byte(20)
            self.type(type.key)
            self.type(type.value)
        elif isinstance(type, Tuple):
            self.byte(21)
            self.number(len(type.elements))
            for element in type.elements:
                self.type(element)
        elif isinstance(type, Struct):
            self.byte(22)
            self.named(type.named)
        else:
            self.byte(23)
            self.text(type.name)
            self.said(type.text)
            self.number(len(type.variants))
            for variant in type.variants:
                self.named(variant)


class Reader:
    """Takes off the front."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0
        self._depth = 0
        self._types_left = TYPES_MAX

    @staticmethod
    def whole(data: bytes, read: Callable[[Reader], T]) -> T:
        """Reads one thing that takes all of the bytes, behind their version."""
        reader = Reader(data)
        version = reader.byte()
        if version != VERSION:
            raise SchemaError(
                f"descriptions of version {version}, this program knows {VERSION}; use programs of the same version "
                "of Rohrpost"
            )
        try:
            whole = read(reader)
        except RecursionError:
            raise SchemaError("types nested deeper than this interpreter's stack has room for") from None
        left = len(data) - reader._at
        if left:
            raise SchemaError(f"{left} bytes behind the end of the description")
        return whole

    def byte(self) -> int:
        """One byte."""
        if self._at >= len(self._data):
            raise SchemaError("the description ends too early")
        self._at += 1
        return self._data[self._at - 1]

    def flag(self, what: str) -> bool:
        """A byte 0 or 1."""
        byte = self.byte()
        if byte > 1:
            raise SchemaError(f"the byte {byte} is no {what}")
        return byte == 1

    def number(self, bits: int) -> int:
        """A varint of at most so many bits."""
        number = 0
        for shift in range(0, bits, 7):
            byte = self.byte()
            seven = byte & 0x7F
            if bits - shift < 7 and seven >> (bits - shift):
                break
            number |= seven << shift
            if byte < 0x80:
                return number
        raise SchemaError(f"a number that does not fit {bits} bits")

    def counted(self) -> bytes:
        """A length and so many bytes."""
        length = self.number(32)
        if length > len(self._data) - self._at:
            raise SchemaError("the description ends too early")
        self._at += length
        return self._data[self._at - length : self._at]

    def text(self) -> str:
        """A text."""
        try:
            return self.counted().decode()
        except UnicodeDecodeError:
            raise SchemaError("text that is not UTF-8") from None

    def many(self, read: Callable[[Reader], T]) -> tuple[T, ...]:
        """How many, and each. Memory grows with the bytes that are there, as each takes one at least."""
        found = []  # A generator would take one more call of Python for each level of nested types.
        for _ in range(self.number(32)):
            found.append(read(self))
        return tuple(found)

    def _one_more(self) -> None:
        self._types_left -= 1
        if self._types_left < 0:
            raise SchemaError(f"more than {TYPES_MAX} types")

    def _named(self) -> Named:
        self._one_more()
        name, text, kind = self.text(), self.text(), self.byte()
        if kind > 3:
            raise SchemaError(f"the byte {kind} is no kind of members")
        if kind == 0:
            return Named(name, 0, (), text)
        return Named(name, kind, (self.field(),) if kind == 1 else self.many(Reader.field), text)

    def field(self) -> Field:
        """A field."""
        name, marks = self.text(), self.byte()
        if marks > _TEXT + _UNIT + _LEAST + _MOST:
            raise SchemaError(f"the byte {marks} is no sum of marks")
        text = self.text() if marks & _TEXT else ""
        unit = self.text() if marks & _UNIT else ""
        least = self.counted() if marks & _LEAST else None
        most = self.counted() if marks & _MOST else None
        return Field(name, self.type(), text, unit, least, most)

    def type(self) -> Type:
        """A type."""
        if self._depth >= DEPTH_MAX:
            raise SchemaError(f"types nested more than {DEPTH_MAX} deep")
        self._one_more()
        self._depth += 1
        type = self._tagged(self.byte())
        self._depth -= 1
        return type

    def _tagged(self, tag: int) -> Type:
        if tag < len(NAMES):
            return Plain(tag)
        if tag == 17:
            return Option(self.type())
        if tag == 18:
            return List(self.type())
        if tag == 19:
            return Array(self.number(32), self.type())
        if tag == 20:
            return Map(self.type(), self.type())
        if tag == 21:
            return Tuple(self.many(Reader.type))
        if tag == 22:
            return Struct(self._named())
        if tag == 23:
            name, text = self.text(), self.text()
            return Enum(name, self.many(Reader._named), text)
        raise SchemaError(f"the byte {tag} is no type")
