"""Writers of a type, which are made once, as :mod:`.readers` are: closures that take a value in the form that
``decode`` gives, or that an author's class has. Whatever has another form is for :class:`.encode._Encoder`, which takes
what can only mean one thing, and says what is wrong.
"""

from __future__ import annotations

import dataclasses
import enum
import operator
import struct
from collections.abc import Callable
from typing import Any

from .foreign import plainly
from .kept import Kept
from .tree import (
    BOOL, BYTES, CHAR, DEPTH_MAX, F32, F64, TEXT, Array, Enum, List, Map, Named, Option, Plain, Struct, Tuple, Type,
    Variant, float_of, is_byte, is_nullable, unwrapped,
)  # fmt: skip

Writer = Callable[[bytearray, Any], None]
"""Appends a value to bytes."""
_CLASSES_MAX = 8
"""Classes of which the values of one struct are known at a time."""


class Unwritten(Exception):
    """This value is for :class:`.encode._Encoder`."""


UNWRITTEN = (Unwritten, KeyError, struct.error, OverflowError, UnicodeEncodeError)
"""What a writer raises of values that do not fit."""


def writer_of(type: Type) -> Writer | None:
    """Makes a writer of a type; none: it nests too deep."""
    try:
        return _Maker().made(type, 0)[0]
    except Unwritten:
        return None


WRITERS = Kept("writer", writer_of)
_Made = tuple[Writer, int]
"""A writer, and how deep its values nest."""


class _Maker:
    """Makes the writers of one type; a part that it has several times has one writer."""

    def __init__(self) -> None:
        self._known: dict[int, _Made] = {}

    def made(self, type: Type, depth: int) -> _Made:
        type = unwrapped(type)
        found = self._known.get(id(type))
        if found is None:
            if depth >= DEPTH_MAX:
                raise Unwritten
            found = self._known[id(type)] = self._of(type, depth + 1)
        if depth + found[1] > DEPTH_MAX:
            raise Unwritten
        return found

    def _of(self, type: Type, depth: int) -> _Made:
        if isinstance(type, Plain):
            return _plain(type), 1
        if isinstance(type, Option):
            inner, below = self.made(type.inner, depth)
            return _option(inner, is_nullable(type.inner)), below + 1
        if isinstance(type, (List, Array)):
            if isinstance(type, List) and is_byte(type.element):
                return _octets, 1
            inner, below = self.made(type.element, depth)
            return _many(inner, float_of(type.element), type.length if isinstance(type, Array) else None), below + 1
        if isinstance(type, Tuple):
            inners, below = self._all(type.elements, depth)
            return _several(inners), below
        if isinstance(type, Map):
            # A pair is one more that nests, where the value is a list of them.
            inners, below = self._all((type.key, type.value), depth + (not type.has_words))
            return _map(inners[0], inners[1], type.has_words), below + (not type.has_words)
        if isinstance(type, Struct):
            inners, below = self._all(tuple(field.type for field in type.named.fields), depth)
            return _members(type.named, inners, type.python), below
        return self._enum(type, depth)

    def _all(self, types: tuple[Type, ...], depth: int) -> tuple[list[Writer], int]:
        inners = [self.made(it, depth) for it in types]
        return [it for it, _ in inners], max((below for _, below in inners), default=0) + 1

    def _enum(self, type: Enum, depth: int) -> _Made:
        variants: dict[str, tuple[int, Writer]] = {}
        deepest = 1
        for index, variant in enumerate(type.variants):
            inners, below = self._all(tuple(field.type for field in variant.fields), depth)
            deepest = max(deepest, below)
            write = inners[0] if variant.kind == 1 else _members(variant, inners, None)
            variants.setdefault(variant.name, (index, write))
        return _enum(variants, type.python), deepest


def _append(out: bytearray, number: int) -> None:
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)


def _integer(signed: bool, bits: int) -> Writer:
    least, most = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)

    def write(out: bytearray, value: Any) -> None:
        if value.__class__ is not int or not least <= value <= most:
            raise Unwritten
        if bits == 8:
            out.append(value & 0xFF)
        else:
            _append(out, value << 1 ^ value >> (bits - 1) if signed else value)

    return write


def _bool(out: bytearray, value: Any) -> None:
    if value.__class__ is not bool:
        raise Unwritten
    out.append(value)


def _float(form: str) -> Writer:
    pack = struct.Struct(f"<{form}").pack

    def write(out: bytearray, value: Any) -> None:
        if value.__class__ is not float and value.__class__ is not int:
            raise Unwritten
        out += pack(value)

    return write


def _text(out: bytearray, value: Any) -> None:
    if value.__class__ is not str:
        raise Unwritten
    data = value.encode()
    _append(out, len(data))
    out += data


def _char(out: bytearray, value: Any) -> None:
    if value.__class__ is not str or len(value) != 1:
        raise Unwritten
    _text(out, value)


def _octets(out: bytearray, value: Any) -> None:
    if value.__class__ not in (bytes, bytearray, memoryview):
        value = plainly(value, True)
        if value.__class__ is not bytes:
            raise Unwritten
    data = bytes(value)
    _append(out, len(data))
    out += data


def _nothing(out: bytearray, value: Any) -> None:
    if value is not None:
        raise Unwritten


_PLAIN: dict[Plain, Writer] = {
    BOOL: _bool, F32: _float("f"), F64: _float("d"), TEXT: _text, BYTES: _octets, CHAR: _char,
}  # fmt: skip


def _plain(type: Plain) -> Writer:
    return _integer(*type.integer) if type.integer else _PLAIN.get(type, _nothing)


def _option(inner: Writer, is_marked: bool) -> Writer:
    def write(out: bytearray, value: Any) -> None:
        if value is None:
            out.append(0)
            return
        if is_marked:
            if value.__class__ is not Variant or value.name != "Some":
                raise Unwritten
            value = value.value
        out.append(1)
        inner(out, value)

    return write


def _many(inner: Writer, as_float: str, fixed: int | None) -> Writer:
    def write(out: bytearray, value: Any) -> None:
        if value.__class__ is not list and value.__class__ is not tuple:
            value = plainly(value, False)
            if value.__class__ is not list:
                raise Unwritten
        if fixed is None:
            _append(out, len(value))
        elif len(value) != fixed:
            raise Unwritten
        if as_float:
            if not {float, int}.issuperset(map(type, value)):
                raise Unwritten
            out += struct.pack(f"<{len(value)}{as_float}", *value)
        else:
            for element in value:
                inner(out, element)

    return write


def _several(inners: list[Writer]) -> Writer:
    def write(out: bytearray, value: Any) -> None:
        if (value.__class__ is not tuple and value.__class__ is not list) or len(value) != len(inners):
            raise Unwritten
        for inner, element in zip(inners, value):
            inner(out, element)

    return write


def _map(key: Writer, value: Writer, has_words: bool) -> Writer:
    pair = _several([key, value])

    def words(out: bytearray, entries: Any) -> None:
        if entries.__class__ is not dict:
            raise Unwritten
        _append(out, len(entries))
        for name, inner in entries.items():
            key(out, name)
            value(out, inner)

    return words if has_words else _many(pair, "", None)


def _members(named: Named, inners: list[Writer], python: Any) -> Writer:
    if named.kind == 3:
        return _fields([field.name for field in named.fields], inners)
    if named.kind == 2:
        return _several(inners)

    def write(out: bytearray, value: Any) -> None:
        if value is not None and (python is None or value.__class__ is not python):
            raise Unwritten

    return write


def _fields(names: list[str], inners: list[Writer]) -> Writer:
    if len(set(names)) < len(names):
        raise Unwritten
    classes: dict[Any, Callable[[Any], Any]] = {}

    def learn(cls: Any) -> Callable[[Any], Any]:
        if len(classes) >= _CLASSES_MAX:
            classes.clear()
        classes[cls] = _members_of(cls, names)
        return classes[cls]

    def write(out: bytearray, value: Any) -> None:
        if value.__class__ is dict:
            if len(value) != len(names):
                raise Unwritten
            members = [value[name] for name in names]
        else:
            cls = value.__class__
            members = (classes.get(cls) or learn(cls))(value)
        for inner, member in zip(inners, members):
            inner(out, member)

    return write


def _members_of(cls: Any, names: list[str]) -> Callable[[Any], Any]:
    """What takes the fields of these names, in this order, out of a value of a dataclass."""
    if not dataclasses.is_dataclass(cls) or cls is Variant:
        raise Unwritten
    known = getattr(cls, "__rohrpost_names__", {})
    own = {known.get(it.name, it.name): it.name for it in dataclasses.fields(cls)}
    if own.keys() != set(names):
        raise Unwritten
    if len(names) > 1:
        return operator.attrgetter(*(own[name] for name in names))
    return lambda value: [getattr(value, own[name]) for name in names]


def _enum(variants: dict[str, tuple[int, Writer]], python: Any) -> Writer:
    def write(out: bytearray, value: Any) -> None:
        payload = None
        if isinstance(value, enum.Enum):
            name = value.name
        elif value.__class__ is str:
            name = value
        elif value.__class__ is Variant or value.__class__ is python:
            name, payload = value.name, value.value
        else:
            raise Unwritten
        index, inner = variants[name]
        _append(out, index)
        inner(out, payload)

    return write
