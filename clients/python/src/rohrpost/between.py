"""The value between two others, as `rohrpost stream interp` has it.

Numbers with a fraction go in a straight line; where their unit is ``rad`` they are headings and go the short way round.
Structs go field by field, arrays and tuples element by element. All else has no values in between, and comes from the
record that is nearer in time, the earlier one in the middle: whole numbers, flags, texts, enums, optional values, lists,
maps, bytes.
"""

from __future__ import annotations

import dataclasses
import math
import struct
from collections.abc import Iterable
from typing import Any

from .schema.tree import F32, F64, Array, Field, Struct, Tuple, Type

_HEADING = "rad"


def between(type: Type, unit: str, start: Any, end: Any, share: float) -> Any:
    """The value so much of the way from one to the other, 0 to 1, both of this type. ``unit``: of its place."""
    if type in (F32, F64):
        value = _turned(start, end, share) if unit == _HEADING else start + (end - start) * share
        return struct.unpack("<f", struct.pack("<f", value))[0] if type == F32 else value
    if isinstance(type, Array) and isinstance(start, list):
        return [between(type.element, unit, *pair, share) for pair in zip(start, end)]
    if isinstance(type, Tuple):
        values = [between(its, unit, *pair, share) for its, pair in zip(type.elements, zip(start, end))]
        return tuple(values) if isinstance(start, tuple) else values
    if isinstance(type, Struct) and type.named.kind == 1:
        # What wraps one value has the unit of its place, unless it says another.
        (inner,) = type.named.fields
        return between(inner.type, inner.unit or unit, start, end, share)
    if isinstance(type, Struct) and type.named.kind == 2:
        return _fields(type.named.fields, start, end, share)
    if isinstance(type, Struct) and type.named.kind == 3:
        return _members(type, start, end, share)
    return end if share > 0.5 else start


def _fields(fields: Iterable[Field], start: Any, end: Any, share: float) -> Any:
    values = [between(its.type, its.unit, *pair, share) for its, pair in zip(fields, zip(start, end))]
    return tuple(values) if isinstance(start, tuple) else values


def _members(type: Struct, start: Any, end: Any, share: float) -> Any:
    starts, ends = _by_name(start), _by_name(end)
    members = {
        its.name: between(its.type, its.unit, starts[its.name], ends[its.name], share) for its in type.named.fields
    }
    return members if type.python is None else type.python(**members)


def _by_name(value: Any) -> dict[str, Any]:
    if isinstance(value, dict):
        return value
    known = getattr(value, "__rohrpost_names__", {})
    return {known.get(it.name, it.name): getattr(value, it.name) for it in dataclasses.fields(value)}


def _turned(start: float, end: float, share: float) -> float:
    """A direction within -π and π."""
    return _wrapped(start + _wrapped(end - start) * share)


def _wrapped(angle_rad: float) -> float:
    if not math.isfinite(angle_rad):
        return math.nan
    turned = math.fmod(angle_rad, math.tau)
    turned += math.tau if turned < 0 else 0
    return turned - math.tau if turned > math.pi else turned
