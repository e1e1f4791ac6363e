"""What types are made of; the table is in ``docs/src/wire.md``, "Descriptions"."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Union

DEPTH_MAX = 128
"""Descriptions and values nest no deeper than this."""
TYPES_MAX = 16_384
"""Types and fields in one description."""

NAMES = (
    "unit", "bool", "u8", "u16", "u32", "u64", "u128", "i8", "i16", "i32", "i64", "i128", "f32", "f64", "char",
    "text", "bytes",
)  # fmt: skip
"""Types that are their tag alone, by their tag."""


class _Kept:
    """What a type is kept with beside its fields (:mod:`.kept`) stays behind where it is copied to."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if not name.startswith("_")}


@dataclass(frozen=True)
class Plain(_Kept):
    """A type that is its tag alone."""

    tag: int

    @property
    def name(self) -> str:
        """As in :data:`NAMES`."""
        return NAMES[self.tag]

    @cached_property
    def integer(self) -> tuple[bool, int] | None:
        """Whether it has a sign, and its bits; none of what is no whole number."""
        if 2 <= self.tag <= 6:
            return False, 8 << (self.tag - 2)
        if 7 <= self.tag <= 11:
            return True, 8 << (self.tag - 7)
        return None


UNIT, BOOL, U8, U16, U32, U64, U128, I8, I16, I32, I64, I128, F32, F64, CHAR, TEXT, BYTES = map(Plain, range(17))


@dataclass(frozen=True)
class Option(_Kept):
    """A value or none."""

    inner: Type


@dataclass(frozen=True)
class List(_Kept):
    """Any number of one type."""

    element: Type

    @cached_property
    def is_of_empty(self) -> bool:
        """Whether no element takes any byte."""
        return is_empty(self.element)


@dataclass(frozen=True)
class Array(_Kept):
    """A fixed number of one type."""

    length: int
    element: Type

    @cached_property
    def is_of_empty(self) -> bool:
        """Whether no element takes any byte."""
        return is_empty(self.element)


@dataclass(frozen=True)
class Map(_Kept):
    """Keys, and what belongs to each."""

    key: Type
    value: Type

    @cached_property
    def is_of_empty(self) -> bool:
        """Whether no pair takes any byte."""
        return is_empty(self.key) and is_empty(self.value)

    @cached_property
    def has_words(self) -> bool:
        """Whether each key is one word, so that the value here is a ``dict``; else it is a list of pairs."""
        return is_word(self.key)


@dataclass(frozen=True)
class Tuple(_Kept):
    """One after the other."""

    elements: tuple[Type, ...]


@dataclass(frozen=True)
class Field:
    """A type in its place: a field of a struct, an argument of a function, data, a parameter.

    ``least`` and ``most`` are postcard of the type. What a range means is the author's word to people and tools.
    """

    name: str
    type: Type
    text: str = ""
    unit: str = ""
    least: bytes | None = None
    most: bytes | None = None


@dataclass(frozen=True)
class Named:
    """A struct, or a variant of an enum. ``kind``: 0 nothing in it, 1 one without a name, which it wraps, 2 several
    without names, 3 fields by their names."""

    name: str
    kind: int = 0
    fields: tuple[Field, ...] = ()
    text: str = ""


@dataclass(frozen=True)
class Struct(_Kept):
    """A struct. ``python``: the class of its values; none: they are dicts."""

    named: Named
    python: Any = field(default=None, compare=False, repr=False)


class Members:
    """``python`` of an enum that is an ``enum.Enum``: its members, which nobody changes, by name."""

    def __init__(self, by_name: Mapping[str, Any]) -> None:
        self._by_name = dict(by_name)

    def __call__(self, chosen: str, _: Any) -> Any:
        return self._by_name[chosen]


@dataclass(frozen=True)
class Enum(_Kept):
    """An enum. ``python``: the class of its values; none: they are :class:`Variant`."""

    name: str
    variants: tuple[Named, ...]
    text: str = ""
    python: Any = field(default=None, compare=False, repr=False)

    @cached_property
    def is_words(self) -> bool:
        """Whether no variant carries anything."""
        return all(variant.kind == 0 for variant in self.variants)

    @cached_property
    def by_name(self) -> dict[str, Named]:
        """Its variants; of those that share a name, the first."""
        return {variant.name: variant for variant in reversed(self.variants)}


Type = Union[Plain, Option, List, Array, Map, Tuple, Struct, Enum]


@dataclass(frozen=True)
class Variant:
    """A choice of an enum by its name, and what it carries."""

    name: str
    value: Any = None


def unwrapped(type: Type) -> Type:
    """The type inside of structs that wrap one: they add a name, no bytes, and nothing to a value."""
    while isinstance(type, Struct) and type.named.kind == 1:
        type = type.named.fields[0].type
    return type


def is_nullable(type: Type) -> bool:
    """Whether ``None`` is among its values, so that an option of it must mark its ``Some``."""
    type = unwrapped(type)
    return type == UNIT or isinstance(type, Option) or (isinstance(type, Struct) and type.named.kind == 0)


def is_byte(type: Type) -> bool:
    """Whether a list of it is a string of bytes."""
    return unwrapped(type) == U8


def float_of(type: Type) -> str:
    """As :mod:`struct` calls a number with a point; empty: it is none."""
    type = unwrapped(type)
    return "f" if type == F32 else "d" if type == F64 else ""


def is_empty(type: Type) -> bool:
    """Whether no value of it takes any byte."""
    if isinstance(type, Array):
        return type.length == 0 or is_empty(type.element)
    if isinstance(type, Tuple):
        return all(map(is_empty, type.elements))
    if isinstance(type, Struct):
        return all(is_empty(field.type) for field in type.named.fields)
    return type == UNIT


def is_of_parameters(type: Type) -> bool:
    """Whether a parameter can have this type, which a file of saved ones gives back."""
    if isinstance(type, Plain):
        return type in (BOOL, F32, F64, TEXT) or (type.integer is not None and type.integer[1] <= 64)
    return isinstance(type, Enum) and type.is_words


def is_word(type: Type) -> bool:
    """Whether one word names any value of it: a number, a bool, text, a character, a variant that carries nothing."""
    type = unwrapped(type)
    if isinstance(type, Plain):
        return type not in (UNIT, BYTES)
    return isinstance(type, Enum) and type.is_words
