"""Readers of a type, which are made once: closures that know what comes next, and ask nothing of the type any more.

::

    decode ──▶ reader ── the value
                  └─ Unread, or the bytes end ─▶ Decoder, which reads all anew and says what is wrong, and where

So errors have one place that words them. What :class:`.decode.Decoder` counts while it reads, depth and values without
bytes, is bounded here before a reader is made: a type that may go beyond has none. All values are counted where a list
begins, each element as what it has at most. What is too much then is for the Decoder, which counts each.
"""

from __future__ import annotations

import inspect
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Optional

from .budget import EMPTY_MAX, VALUES_MAX, values_most, values_of_name
from .kept import Kept
from .scalars import Lend, Reader, Unread, long_number, nothing, octets, plain_reader
from .tree import (
    DEPTH_MAX, Array, Enum, List, Map, Members, Named, Option, Plain, Struct, Tuple, Type, Variant, float_of, is_byte,
    is_nullable, unwrapped,
)  # fmt: skip


class _Counting:
    """What the readers of a type with several lists hand on as what lends: it knows how many values may come yet."""

    __slots__ = ("data", "left", "lend")

    def __init__(self, data: Any, lend: Lend, left: int) -> None:
        self.data, self.lend, self.left = data, lend, left

    def __call__(self, start: int, end: int) -> Any:
        return bytes(self.data[start:end]) if self.lend is None else self.lend(start, end)


def reader_of(type: Type) -> Reader | None:
    """Makes a reader of a type; none: it nests too deep, or may have too many values, or such as take no bytes."""
    try:
        made = _Maker(None).made(type, 0)
    except Unread:
        return None
    # What a message without bytes may have, each may.
    if made.empties > EMPTY_MAX or made.values > values_most(0):
        return None
    if made.lists == 1:
        # Not in another one: its length alone says how many there are.
        return _Maker(made.values).made(type, 0).read
    return _counting(made.read, made.values) if made.lists else made.read


READERS = Kept("reader", reader_of)


@dataclass
class _Made:
    """A reader. ``empties``: values that take no bytes in one that is read, at most; ``values``: all, but for those in
    its ``lists`` of which elements are counted; two stand for more. ``bits``: of whole numbers without a sign, which a
    struct reads itself: that is quicker than to call."""

    read: Reader
    empties: int = 0
    is_empty: bool = False
    depth: int = 1
    bits: int = 0
    values: int = 1
    lists: int = 0

    @property
    def part(self) -> Reader | int:
        """As a part of several."""
        return self.bits or self.read


class _Maker:
    """Makes the readers of one type; a part that it has several times has one reader. ``beside``: values outside of
    its one list; none: there are more lists, and :class:`_Counting` knows."""

    def __init__(self, beside: int | None) -> None:
        self._known: dict[int, _Made] = {}
        self._beside = beside

    def made(self, type: Type, depth: int) -> _Made:
        type = unwrapped(type)
        found = self._known.get(id(type))
        if found is None:
            if depth >= DEPTH_MAX:
                raise Unread
            found = self._known[id(type)] = self._of(type, depth + 1)
            found.empties += found.is_empty
        if depth + found.depth > DEPTH_MAX:
            raise Unread
        return found

    def _of(self, type: Type, depth: int) -> _Made:
        if isinstance(type, Plain):
            signed, bits = type.integer or (True, 0)
            return _Made(plain_reader(type), 0, type.tag == 0, 1, 0 if signed or bits == 8 else bits)
        if isinstance(type, Option):
            inner = self.made(type.inner, depth)
            made = _around(_option(inner.read, is_nullable(type.inner)), inner)
            made.values, made.lists = 1 + inner.values, inner.lists
            return made
        if isinstance(type, List):
            return _Made(octets) if is_byte(type.element) else self._list(type, depth)
        if isinstance(type, Array):
            inner = self.made(type.element, depth)
            empties = min(type.length * inner.empties, EMPTY_MAX + 1)
            as_float, is_empty = float_of(type.element), inner.is_empty or not type.length
            values = 1 if as_float else 1 + min(type.length * inner.values, VALUES_MAX)
            lists = min(type.length * inner.lists, 2)
            read = _many(inner, as_float, type.length, None)
            return _Made(read, empties, is_empty, inner.depth + 1, 0, values, lists)
        if isinstance(type, Tuple):
            inners = [self.made(it, depth) for it in type.elements]
            return _together(_several([it.part for it in inners], _as_tuple), inners)
        if isinstance(type, Map):
            return self._map(type, depth)
        if isinstance(type, Struct):
            return self._struct(type, depth)
        return self._enum(type, depth)

    def _list(self, type: List, depth: int) -> _Made:
        inner = self.made(type.element, depth)
        if inner.empties:
            raise Unread
        as_float = float_of(type.element)
        made = _around(_many(inner, as_float, None, self._beside), inner)
        made.lists = 0 if as_float else 1 + min(inner.lists, 1)
        return made

    def _map(self, type: Map, depth: int) -> _Made:
        # A pair is one more that nests, where the value is a list of them.
        inners = [self.made(it, depth + (not type.has_words)) for it in (type.key, type.value)]
        if inners[0].empties or inners[1].empties:
            raise Unread
        each = inners[0].values + inners[1].values + (not type.has_words)
        made = _together(_map(inners[0].read, inners[1].read, type.has_words, (each, self._beside)), inners)
        made.depth += not type.has_words
        made.values, made.lists = 1, 1 + min(made.lists, 1)
        return made

    def _members(self, named: Named, depth: int) -> list[_Made]:
        return [self.made(field.type, depth) for field in named.fields]

    def _struct(self, type: Struct, depth: int) -> _Made:
        named, python = type.named, type.python
        if python is not None and named.kind == 2:
            raise Unread
        inners = self._members(named, depth) if named.kind else []
        names = [field.name for field in named.fields]
        if named.kind == 0:
            return _Made(nothing if python is None else _made_of_nothing(python), 0, True)
        make = _payload(named) if python is None else called(python, names)
        made = _together(_several([it.part for it in inners], make), inners)
        made.values += _names(named)
        return made

    def _enum(self, type: Enum, depth: int) -> _Made:
        variants: list[_Chosen] = []
        python = Variant if type.python is None else type.python
        # What nobody can change is the same each time.
        is_fixed = type.python is None or isinstance(type.python, Members)
        inners: list[_Made] = []
        most = 0
        for variant in type.variants:
            its = self._members(variant, depth) if variant.kind else []
            inners += its
            names = values_of_name(variant.name) + _names(variant)
            most = max(most, names + sum(it.values for it in its))
            read = its[0].read if variant.kind == 1 else None
            if variant.kind > 1:
                read = _several([it.part for it in its], _payload(variant))
            fixed = python(variant.name, None) if is_fixed and not variant.kind else None
            variants.append((fixed, variant.name, read))
        made = _together(_enum(variants, python), inners)
        made.is_empty, made.values = False, 1 + most
        return made


def _names(named: Named) -> int:
    """Values that the names of fields count as, where values have them."""
    return sum(values_of_name(field.name) for field in named.fields) if named.kind == 3 else 0


def _around(read: Reader, inner: _Made) -> _Made:
    return _Made(read, inner.empties, False, inner.depth + 1)


def _together(read: Reader, inners: list[_Made]) -> _Made:
    empties = min(sum(it.empties for it in inners), EMPTY_MAX + 1)
    is_empty = all(it.is_empty for it in inners)
    values = 1 + min(sum(it.values for it in inners), VALUES_MAX)
    lists = min(sum(it.lists for it in inners), 2)
    return _Made(read, empties, is_empty, max((it.depth for it in inners), default=0) + 1, 0, values, lists)


# What makes values.


def _as_tuple(*values: Any) -> Any:
    return values


def _payload(named: Named) -> Callable[..., Any]:
    if named.kind != 3:
        return _as_tuple
    names = [field.name for field in named.fields]
    return lambda *values: dict(zip(names, values))


def called(python: Any, names: list[str]) -> Callable[..., Any]:
    """By position, which is quicker, where that says the same."""
    try:
        takes = list(inspect.signature(python).parameters.values())
    except (TypeError, ValueError):
        takes = []
    if [it.name for it in takes] == names and all(it.kind is it.POSITIONAL_OR_KEYWORD for it in takes):
        return python  # type: ignore[no-any-return]
    return lambda *values: python(**dict(zip(names, values)))


# Readers.


def _counting(inner: Reader, beside: int) -> Reader:
    return lambda data, at, lend: inner(data, at, _Counting(data, lend, values_most(len(data)) - beside))


def _made_of_nothing(python: Any) -> Reader:
    return lambda data, at, lend: (python(), at)


def _option(inner: Reader, is_marked: bool) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        byte = data[at]
        if byte > 1:
            raise Unread
        if not byte:
            return None, at + 1
        value, at = inner(data, at + 1, lend)
        return Variant("Some", value) if is_marked else value, at

    return read


def _claimed(data: Any, at: int, lend: Any, each: int, beside: int | None) -> tuple[int, int]:
    """How many elements; each of them takes a byte at least, and is so many values."""
    length = data[at]
    if length < 0x80:
        at += 1
    else:
        length, at = long_number(data, at, 64)
    if length > len(data) - at:
        raise Unread
    if each:
        if beside is None:
            left = lend.left
            lend.left -= length * each
        else:
            left = values_most(len(data)) - beside
        if length * each > left:
            raise Unread
    return length, at


def _many(element: _Made, as_float: str, fixed: int | None, beside: int | None) -> Reader:
    size, inner, each = struct.calcsize(as_float), element.read, 0 if as_float else element.values

    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        length, at = _claimed(data, at, lend, each, beside) if fixed is None else (fixed, at)
        if as_float:
            end = at + length * size
            if end > len(data):
                raise Unread
            return list(struct.unpack_from(f"<{length}{as_float}", data, at)), end
        values = []
        for _ in range(length):
            value, at = inner(data, at, lend)
            values.append(value)
        return values, at

    return read


def _several(inners: list[Reader | int], make: Callable[..., Any]) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        values = []
        for inner in inners:
            if not isinstance(inner, int):
                value, at = inner(data, at, lend)
            else:
                value = data[at]
                if value < 0x80:
                    at += 1
                else:
                    second = data[at + 1]
                    if second < 0x80:
                        value, at = value & 0x7F | second << 7, at + 2
                    else:
                        value, at = long_number(data, at, inner)
            values.append(value)
        return make(*values), at

    return read


def _map(key: Reader, value: Reader, has_words: bool, counted: tuple[int, int | None]) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        length, at = _claimed(data, at, lend, *counted)
        pairs = []
        for _ in range(length):
            first, at = key(data, at, lend)
            second, at = value(data, at, lend)
            pairs.append((first, second))
        return dict(pairs) if has_words else pairs, at

    return read


_Chosen = tuple[Any, str, Optional[Reader]]
"""A variant: its value, if that is always the same; its name; and what reads its payload, if there is one."""


def _enum(variants: list[_Chosen], make: Callable[[str, Any], Any]) -> Reader:
    def read(data: Any, at: int, lend: Lend) -> tuple[Any, int]:
        index = data[at]
        if index < 0x80:
            at += 1
        else:
            index, at = long_number(data, at, 32)
        fixed, name, inner = variants[index]
        if inner is None:
            return make(name, None) if fixed is None else fixed, at
        value, at = inner(data, at, lend)
        return make(name, value), at

    return read
