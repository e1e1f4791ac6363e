"""How types and values read: for help, for terminals and as JSON."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import struct
from collections.abc import Callable
from decimal import Decimal
from typing import Any

from .errors import plain
from .tree import (
    BYTES, CHAR, F32, F64, UNIT, Array, Enum, Field, List, Map, Named, Option, Plain, Struct, Tuple, Type, Variant,
    is_byte, is_nullable, is_word, unwrapped,
)  # fmt: skip

F32_MAX = 3.4028234663852886e38
LIST_SHOWN = 8
"""How many elements of a list are printed."""
_LEVELS, _MEMBERS = 4, 12


def describe_type(type: Type, level: int = 0) -> str:
    """A type as a short text: how its values are typed. Deep and wide types end in ``…``."""
    type = unwrapped(type)
    if isinstance(type, Plain):
        return {UNIT: "null", BYTES: "[u8]"}.get(type, type.name)
    if level >= _LEVELS:
        return "…"

    def inner(type: Type) -> str:
        return describe_type(type, level + 1)

    if isinstance(type, Option):
        some = inner(type.inner)
        if is_nullable(type.inner):
            return f"{{Some: {some}}}?"
        return f"({some})?" if isinstance(unwrapped(type.inner), Enum) else f"{some}?"
    if isinstance(type, List):
        return f"[{inner(type.element)}]"
    if isinstance(type, Array):
        return f"[{inner(type.element)}; {type.length}]"
    if isinstance(type, Tuple):
        return _tuple(type.elements, level)
    if isinstance(type, Map):
        key, value = inner(type.key), inner(type.value)
        return f"{{<{key}>: {value}}}" if is_word(type.key) else f"[[{key}, {value}]]"
    if isinstance(type, Struct):
        return _members(type.named, level)
    if not type.variants:
        return "(no value)"
    return _joined([_variant(variant, level) for variant in type.variants[: _MEMBERS + 1]], "|")


def _variant(variant: Named, level: int) -> str:
    name = plain(variant.name) or '""'
    return name if variant.kind == 0 else f"{{{name}: {_members(variant, level)}}}"


def _tuple(elements: tuple[Type, ...], level: int) -> str:
    if len(elements) > 1 and all(element == elements[0] for element in elements):
        return f"[{describe_type(elements[0], level + 1)}; {len(elements)}]"
    return f"[{_joined([describe_type(element, level + 1) for element in elements[: _MEMBERS + 1]], ', ')}]"


def _members(named: Named, level: int) -> str:
    if named.kind == 0:
        return "null"
    if named.kind == 1:
        return describe_type(named.fields[0].type, level + 1)
    if named.kind == 2:
        return _tuple(tuple(field.type for field in named.fields), level)
    fields = [
        f"{plain(field.name) or chr(34) * 2}: {describe_type(field.type, level + 1)}"
        for field in named.fields[: _MEMBERS + 1]
    ]
    return f"{{{_joined(fields, ', ')}}}"


def _joined(parts: list[str], separator: str) -> str:
    return separator.join([*parts[:_MEMBERS], "…"] if len(parts) > _MEMBERS else parts)


def describe_result(type: Type) -> str:
    """What a function returns, as people read it."""

    def value(type: Type) -> str:
        return "ok" if unwrapped(type) == UNIT else describe_type(type)

    if is_result(type):
        assert isinstance(type, Enum)
        return ", or error ".join(value(variant.fields[0].type) for variant in type.variants)
    return value(type)


def is_result(type: Type) -> bool:
    """Whether a function that returns it may fail with an error of its own."""
    if not isinstance(type, Enum) or type.name != "Result":
        return False
    return [(variant.name, variant.kind) for variant in type.variants] == [("Ok", 1), ("Err", 1)]


def describe_field(field: Field) -> str:
    """An argument or data with its type, unit and range."""
    text = f"{plain(field.name)}: {describe_type(field.type)}"
    bounds = [_bound(field.type, bound) for bound in (field.least, field.most)]
    if all(bounds):
        text += f", {bounds[0]}..={bounds[1]}"
    elif any(bounds):
        text += f", at least {bounds[0]}" if bounds[0] else f", at most {bounds[1]}"
    return f"{text} {plain(field.unit)}" if field.unit else text


def _bound(type: Type, data: bytes | None) -> str | None:
    from .decode import decode
    from .errors import WalkError

    # What is written as a bound of a list or a struct may be as long as its author likes.
    if data is None or not is_word(type):
        return None
    try:
        return plain(show(type, decode(type, data)))
    except WalkError:
        return None


def expectation(type: Type) -> str:
    """What an error says that it expected."""
    type = unwrapped(type)
    if isinstance(type, Option) and not is_nullable(type.inner):
        return f"{expectation(type.inner)} or null"
    if isinstance(type, Plain):
        if type.integer:
            return f"a whole number ({type.name})"
        words = {"bool": "true or false", "f32": "a number (f32)", "f64": "a number (f64)", "char": "one character"}
        return words.get(type.name, describe_type(type))
    return describe_type(type)


def shortest(number: float) -> float:
    """The number with the shortest decimal that is this f32 and no other: 1.2, not 1.2000000476837158."""
    if not math.isfinite(number):
        return number
    packed = struct.pack("<f", number)
    for digits in range(6, 10):
        decimal = float(f"{number:.{digits}g}")
        try:
            if struct.pack("<f", decimal) == packed:
                return decimal
        except OverflowError:
            continue
    return number


def rust_float(number: float) -> str:
    """As Rust's tools print it."""
    if math.isnan(number):
        return "NaN"
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    if number == 0.0 or 1e-5 <= abs(number) < 1e16:
        text = format(Decimal(repr(number)), "f")
        return text[:-2] if text.endswith(".0") else text
    sign, digits, exponent = Decimal(repr(number)).normalize().as_tuple()
    assert isinstance(exponent, int)
    mantissa = "".join(map(str, digits))
    power = exponent + len(digits) - 1
    point = f".{mantissa[1:]}" if len(mantissa) > 1 else ""
    return f"{'-' if sign else ''}{mantissa[0]}{point}e{power}"


def to_json(type: Type, value: Any, of_bytes: Callable[[bytes], Any] = list) -> Any:
    """A value of this type in the form that JSON has of it, as ``rohrpost call --json`` prints it. ``of_bytes``: what
    becomes of bytes; else they are a list of numbers."""
    type = unwrapped(type)
    if value is None:
        return None
    if isinstance(type, Plain):
        return _plain_to_json(type, value, of_bytes)
    if isinstance(type, Option):
        if is_nullable(type.inner):
            some = to_json(type.inner, value.value, of_bytes)
            return "Some" if some is None else {"Some": some}
        return to_json(type.inner, value, of_bytes)
    if isinstance(type, (List, Array)):
        if is_byte(type.element):
            return of_bytes(bytes(value))
        return [to_json(type.element, element, of_bytes) for element in value]
    if isinstance(type, Tuple):
        return [to_json(inner, element, of_bytes) for inner, element in zip(type.elements, value)]
    if isinstance(type, Map):
        if not type.has_words:
            return [[to_json(type.key, key, of_bytes), to_json(type.value, inner, of_bytes)] for key, inner in value]
        return {_key(type.key, key): to_json(type.value, inner, of_bytes) for key, inner in value.items()}
    if isinstance(type, Struct):
        return _members_to_json(type.named, value, of_bytes)
    variant = type.by_name[value.name]
    payload = None if isinstance(value, enum.Enum) else _members_to_json(variant, value.value, of_bytes)
    return variant.name if payload is None else {variant.name: payload}


def _plain_to_json(type: Plain, value: Any, of_bytes: Callable[[bytes], Any]) -> Any:
    if type in (F32, F64):
        number = shortest(value) if type == F32 else value
        return number if math.isfinite(number) else rust_float(number)
    if type == BYTES:
        return of_bytes(value)
    if type.integer and not -(1 << 63) <= value < 1 << 64:
        return str(value)
    return value


def _members_to_json(named: Named, value: Any, of_bytes: Callable[[bytes], Any]) -> Any:
    if named.kind == 0:
        return None
    if named.kind == 1:
        return to_json(named.fields[0].type, value, of_bytes)
    if named.kind == 2:
        return [to_json(field.type, element, of_bytes) for field, element in zip(named.fields, value)]
    if dataclasses.is_dataclass(value):
        return {field.name: to_json(field.type, _member(value, field.name), of_bytes) for field in named.fields}
    return {field.name: to_json(field.type, value[field.name], of_bytes) for field in named.fields}


def _key(type: Type, key: Any) -> str:
    if isinstance(key, (Variant, enum.Enum)):
        return key.name
    return key if isinstance(key, str) else show(type, key)


def show(type: Type, value: Any, limit: int = LIST_SHOWN) -> str:
    """One line for people, lists cut after ``limit`` elements, as the tools print it."""
    type = unwrapped(type)
    if value is None:
        return "null"
    if isinstance(type, Plain):
        if type == F32:
            return rust_float(shortest(value))
        if type == CHAR:
            return "'" + plain(value).replace("'", "\\'") + "'"
        return show_any(value, limit)
    if isinstance(type, Option):
        if is_nullable(type.inner):
            return _chosen("Some", show(type.inner, value.value, limit))
        return show(type.inner, value, limit)
    if isinstance(type, (List, Array)):
        return _list([show(type.element, element, limit) for element in value[:limit]], len(value), limit)
    if isinstance(type, Tuple):
        return _list([show(i, v, limit) for i, v in zip(type.elements[:limit], value)], len(value), limit)
    if isinstance(type, Map):
        if not type.has_words:
            pairs = [f"[{show(type.key, k, limit)}, {show(type.value, v, limit)}]" for k, v in value[:limit]]
            return _list(pairs, len(value), limit)
        entries = [f"{_bare(_key(type.key, k))}: {show(type.value, v, limit)}" for k, v in value.items()]
        return f"{{{', '.join(entries)}}}"
    if isinstance(type, Struct):
        return _show_members(type.named, value, limit)
    variant = type.by_name[value.name]
    if variant.kind == 0:
        return _bare(variant.name)
    return _chosen(variant.name, _show_members(variant, value.value, limit))


def _member(value: Any, known: str) -> Any:
    """A field of a dataclass by the name that others know it by."""
    renamed = getattr(value, "__rohrpost_names__", {})
    return getattr(value, next((own for own, its in renamed.items() if its == known), known))


def _show_members(named: Named, value: Any, limit: int) -> str:
    if named.kind == 0:
        return "null"
    if named.kind == 1:
        return show(named.fields[0].type, value, limit)
    if named.kind == 2:
        return _list([show(f.type, v, limit) for f, v in zip(named.fields[:limit], value)], len(value), limit)
    at = (lambda name: _member(value, name)) if dataclasses.is_dataclass(value) else value.__getitem__
    return "{" + ", ".join(f"{_bare(f.name)}: {show(f.type, at(f.name), limit)}" for f in named.fields) + "}"


def _chosen(name: str, payload: str) -> str:
    return _bare(name) if payload == "null" else f"{_bare(name)}({payload})"


def _bare(name: str) -> str:
    """Names stand bare where nobody can mistake them."""
    bare = name and all(c.isalnum() or c in "_-.+" for c in name)
    return name if bare else '"' + plain(name).replace('"', '\\"') + '"'


def _list(shown: list[str], length: int, limit: int) -> str:
    more = f"… {length - limit} more" if length > limit else ""
    return "[" + ", ".join([*shown, more] if more else shown) + "]"


def show_any(value: Any, limit: int) -> str:
    """The same for a value of which no type is known."""
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, float):
        return rust_float(value)
    if isinstance(value, str):
        return '"' + plain(value).replace('"', '\\"') + '"'
    if isinstance(value, (list, tuple, bytes, bytearray)):
        return _list([show_any(element, limit) for element in value[:limit]], len(value), limit)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_bare(str(k))}: {show_any(v, limit)}" for k, v in value.items()) + "}"
    if isinstance(value, Variant):
        return _chosen(value.name, show_any(value.value, limit))
    return str(value)
