"""From values to bytes, the inverse of :mod:`.decode`.

Takes each value in the form that ``decode`` gives, and where only one thing can be meant also as JSON or a person has
it: numbers as text (``"NaN"``, ``"0x1f"``), whole numbers that came as ``1e3``, a list of numbers for bytes, an enum by
its name or as a dict of one entry, structs as dicts with optional fields left out, maps as lists of pairs, numbers and
arrays as numpy and ``array`` have them.
"""

from __future__ import annotations

import dataclasses
import enum
import math
import struct
from typing import Any

from .binary import varint
from .errors import WalkError, counted, shortened
from .foreign import plainly
from .text import F32_MAX, expectation, rust_float, show_any
from .tree import (
    BOOL, BYTES, CHAR, DEPTH_MAX, F32, F64, TEXT, U8, UNIT, Array, Enum, List, Map, Named, Option, Plain, Struct,
    Tuple, Type, Variant, is_byte, is_nullable, is_word, unwrapped,
)  # fmt: skip
from .writers import UNWRITTEN, WRITERS, Writer

_BYTES = (bytes, bytearray, memoryview)
_WHOLE_FLOAT_MAX = 2.0**53
_WRITER = WRITERS.name


def encode(type: Type, value: Any) -> bytes:
    """The bytes that a value of this type has. Raises :class:`WalkError`, with the path to what does not fit."""
    write: Writer | None = type.__dict__.get(_WRITER)
    if write is not None:
        out = bytearray()
        try:
            write(out, value)
            return bytes(out)
        except UNWRITTEN:
            pass  # It may have another form; what is wrong, and where, is found below.
    encoder = _Encoder()
    encoder.value(type, value)
    WRITERS.used(type)
    return bytes(encoder.out)


def parse_argument(type: Type, text: str) -> Any:
    """Reads one word of a command line as a value of this type, for :func:`encode`."""
    type = unwrapped(type)
    if text == "null" and is_nullable(type):
        return None
    if isinstance(type, Option):
        some = parse_argument(type.inner, text)
        return Variant("Some", some) if is_nullable(type.inner) else some
    if not is_word(type):
        raise WalkError(f"expected JSON {expectation(type)}, got `{shortened(text)}`")
    if isinstance(type, Enum):
        found = _find_variant(type, text)
        if found is None:
            raise _mismatch(type, text)
        return Variant(found[1].name)
    if type == BOOL:
        if text not in ("true", "false"):
            raise _mismatch(type, text)
        return text == "true"
    encode(type, text)
    return text


class _Encoder:
    def __init__(self) -> None:
        self.out = bytearray()
        self.depth = 0

    def value(self, type: Type, value: Any) -> None:
        if self.depth >= DEPTH_MAX:
            raise WalkError(f"nested more than {DEPTH_MAX} deep")
        self.depth += 1
        type = unwrapped(type)
        self.unbounded(type, plainly(value, type == BYTES or (isinstance(type, List) and is_byte(type.element))))
        self.depth -= 1

    def unbounded(self, type: Type, value: Any) -> None:
        if isinstance(type, Plain):
            self.plain(type, value)
        elif isinstance(type, Option):
            self.option(type, value)
        elif isinstance(type, List):
            self.list(type, value)
        elif isinstance(type, Array):
            self.tuple(type, [type.element] * min(type.length, _length(value)), type.length, value)
        elif isinstance(type, Tuple):
            self.tuple(type, type.elements, len(type.elements), value)
        elif isinstance(type, Map):
            self.map(type, value)
        elif isinstance(type, Struct):
            self.members(type, type.named, value)
        else:
            self.enum(type, value)

    def plain(self, type: Plain, value: Any) -> None:
        if type.integer:
            self.integer(type, *type.integer, _whole(type, value))
        elif type == BOOL and isinstance(value, bool):
            self.out.append(value)
        elif type in (F32, F64):
            self.out += struct.pack("<f" if type == F32 else "<d", _float(type, value))
        elif (type == TEXT and isinstance(value, str)) or (type == CHAR and isinstance(value, str) and len(value) == 1):
            self.text(type, value)
        elif type == BYTES and isinstance(value, _BYTES):
            self.counted(bytes(value))
        elif type == BYTES and isinstance(value, (list, tuple)):
            self.list(List(U8), value)
        elif not (type == UNIT and value is None):
            raise _mismatch(type, value)

    def option(self, type: Option, value: Any) -> None:
        if value is None:
            self.out.append(0)
            return
        if is_nullable(type.inner):
            named = _named(value)
            if named is None or named[0] != "Some":
                raise _mismatch(type, value)
            value = named[1]
        self.out.append(1)
        self.value(type.inner, value)

    def list(self, type: List, value: Any) -> None:
        if is_byte(type.element) and isinstance(value, _BYTES):
            self.counted(bytes(value))
        elif isinstance(value, (list, tuple)):
            self.out += varint(len(value))
            for index, element in enumerate(value):
                self.element(type.element, element, index)
        else:
            raise _mismatch(type, value)

    def tuple(self, type: Type, types: Any, length: int, value: Any) -> None:
        if isinstance(value, _BYTES):
            value = list(bytes(value))
        if not isinstance(value, (list, tuple)):
            raise _mismatch(type, value)
        if len(value) != length:
            raise WalkError(f"expected {counted(length, 'element')}, got {len(value)}")
        for index, (inner, element) in enumerate(zip(types, value)):
            self.element(inner, element, index)

    def element(self, type: Type, value: Any, index: int) -> None:
        try:
            self.value(type, value)
        except WalkError as error:
            raise error.within(f"[{index}]") from None

    def member(self, type: Type, value: Any, name: str) -> None:
        try:
            self.value(type, value)
        except WalkError as error:
            raise error.within(name) from None

    def map(self, type: Map, value: Any) -> None:
        if type.has_words and isinstance(value, dict):
            self.out += varint(len(value))
            for key, inner in value.items():
                name = _word(key)
                word = parse_argument(type.key, key) if isinstance(key, str) else key
                self.member(type.key, word, name)
                self.member(type.value, inner, name)
        elif isinstance(value, (list, tuple, dict)):
            self.out += varint(len(value))
            for index, pair in enumerate(value.items() if isinstance(value, dict) else value):
                if not isinstance(pair, (list, tuple)) or len(pair) != 2:
                    raise _mismatch(type, pair).within(f"[{index}]")
                self.element(Tuple((type.key, type.value)), pair, index)
        else:
            raise _mismatch(type, value)

    def members(self, type: Type, named: Named, value: Any) -> None:
        """What a struct or variant has in it."""
        if dataclasses.is_dataclass(value) and not isinstance(value, (type_of_class, Variant)):
            known = getattr(value, "__rohrpost_names__", {})
            value = {known.get(it.name, it.name): getattr(value, it.name) for it in dataclasses.fields(value)}
        if named.kind == 0 and value in (None, {}):
            return
        if named.kind == 1:
            self.value(named.fields[0].type, value)
        elif named.kind == 2 and isinstance(value, (list, tuple)):
            self.tuple(type, [field.type for field in named.fields], len(named.fields), value)
        elif named.kind == 3 and isinstance(value, dict):
            self.fields(named, value)
        else:
            raise _mismatch(type, value)

    def fields(self, named: Named, entries: dict[str, Any]) -> None:
        for field in named.fields:
            if field.name in entries:
                self.member(field.type, entries[field.name], field.name)
            elif is_nullable(field.type):
                self.member(field.type, None, field.name)
            else:
                raise WalkError(f"not given; expected {expectation(field.type)}", field.name)
        known = [field.name for field in named.fields]
        for name in entries:
            if name not in known:
                raise WalkError(f"no such field; there is {', '.join(known) or 'none'}", str(name))

    def enum(self, type: Enum, value: Any) -> None:
        named = _named(value)
        found = named and _find_variant(type, named[0])
        if not named or not found:
            raise _mismatch(type, value)
        index, variant = found
        self.out += varint(index)
        payload = {} if variant.kind == 3 and named[1] is None else named[1]
        before = len(self.out)
        try:
            self.members(type, variant, payload)
        except WalkError as error:
            # A payload of another form: it is the whole choice that does not fit.
            if not error.path and len(self.out) == before and variant.kind != 1:
                raise _mismatch(type, value) from None
            raise error.within(variant.name) from None

    def integer(self, type: Plain, signed: bool, bits: int, number: int) -> None:
        least, most = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
        if not least <= number <= most:
            raise WalkError(f"{shortened(str(number))} is out of range: {type.name} is {least} to {most}")
        if bits == 8:
            self.out.append(number & 0xFF)
        else:
            self.out += varint(number << 1 ^ number >> (bits - 1) if signed else number)

    def text(self, type: Plain, value: str) -> None:
        try:
            self.counted(value.encode())
        except UnicodeEncodeError:
            raise WalkError("text that is not UTF-8: it has half a surrogate pair") from None

    def counted(self, data: bytes) -> None:
        self.out += varint(len(data))
        self.out += data


type_of_class = type


def _length(value: Any) -> int:
    return len(value) if isinstance(value, (list, tuple, *_BYTES)) else 0


def _mismatch(type: Type, value: Any) -> WalkError:
    got = value if isinstance(value, str) else show_any(value, 4)
    return WalkError(f"expected {expectation(type)}, got `{shortened(got)}`")


def _named(value: Any) -> tuple[str, Any] | None:
    """The name and the payload of a choice, in each form that an enum may be given in."""
    if isinstance(value, enum.Enum):
        return value.name, None
    if isinstance(value, str):
        return value, None
    if isinstance(value, dict) and len(value) == 1:
        name, payload = next(iter(value.items()))
        return (name, payload) if isinstance(name, str) else None
    name = getattr(value, "name", None)
    return (name, getattr(value, "value", None)) if isinstance(name, str) else None


def _find_variant(type: Enum, name: str) -> tuple[int, Named] | None:
    """The exact one, or else the only one that is the same but for case, ``-`` and ``_``."""

    def simple(text: str) -> str:
        return text.replace("-", "").replace("_", "").lower()

    for index, variant in enumerate(type.variants):
        if variant.name == name:
            return index, variant
    alike = [(index, it) for index, it in enumerate(type.variants) if simple(it.name) == simple(name)]
    return alike[0] if len(alike) == 1 else None


def _word(key: Any) -> str:
    if isinstance(key, (Variant, enum.Enum)):
        return key.name
    return key if isinstance(key, str) else show_any(key, 4)


def _hex(text: str) -> int | None:
    digits = text[1:] if text.startswith("-") else text
    if not digits[:2].lower() == "0x" or not digits[2:].isalnum() or not digits.isascii():
        return None
    try:
        number = int(digits[2:], 16)
    except ValueError:
        return None
    return -number if text.startswith("-") else number


def _parse_float(text: str) -> float | None:
    """As Rust reads it: no spaces, no underscores."""
    if not text.isascii() or text.strip() != text or "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _whole(type: Plain, value: Any) -> int:
    wrong = WalkError(f"expected a whole number ({type.name}), got ")
    if isinstance(value, str):
        hexadecimal = _hex(value)
        if hexadecimal is not None:
            return hexadecimal
        # No longer than any number that fits: Python takes its time for long ones.
        if len(value) <= 64 and value.lstrip("+-").isdigit() and value.isascii():
            try:
                return int(value)
            except ValueError:
                raise WalkError(f"{wrong.problem}`{shortened(value)}`") from None
        number = _parse_float(value)
        if number is None:
            raise WalkError(f"{wrong.problem}`{shortened(value)}`")
        value = number
    if isinstance(value, float) and value.is_integer() and abs(value) <= _WHOLE_FLOAT_MAX:
        return int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise WalkError(f"{wrong.problem}`{shortened(show_any(value, 4))}`")
    return int(value)


def _float(type: Plain, value: Any) -> float:
    given, number = value, value
    if isinstance(value, str):
        number = _hex(value)
        if number is None:
            number = _parse_float(value)
        infinite = isinstance(number, float) and math.isinf(number) and any(c.isdigit() for c in value)
        if infinite:
            raise _beyond(type, value)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        shown = given if isinstance(given, str) else show_any(given, 4)
        raise WalkError(f"expected a number ({type.name}), got `{shortened(shown)}`")
    try:
        number = float(number)
    except OverflowError:
        raise _beyond(type, show_any(given, 4)) from None
    if type == F32 and math.isfinite(number):
        try:
            struct.pack("<f", number)
        except OverflowError:
            raise _beyond(type, show_any(given, 4)) from None
    return float(number)


def _beyond(type: Plain, got: str) -> WalkError:
    most = F32_MAX if type == F32 else 1.7976931348623157e308
    return WalkError(f"{shortened(got)} is out of range: {type.name} ends at {rust_float(most)}")
