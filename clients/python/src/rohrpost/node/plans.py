"""How values of records are made in Rust, where their type is simple: numbers, text and bytes in structs, as in pictures.

What has no plan is read by :func:`rohrpost.schema.decode`, as are bytes that do not fit their plan: it says what is wrong
with them.
"""

from __future__ import annotations

from typing import Any

from ..schema.readers import called
from ..schema.tree import (
    BOOL, BYTES, DEPTH_MAX, F32, F64, TEXT, Enum, List, Members, Plain, Struct, Type, is_byte, unwrapped,
)  # fmt: skip
from .views import VIEWED_MIN

_WORDS = {BOOL: "bool", F32: "f32", F64: "f64", TEXT: "text"}


def plan_of(type: Type) -> tuple[str, Any] | None:
    """A word, and what belongs to it; none: the type is not simple, or nests too deep."""
    return _plan(type, DEPTH_MAX)


def _plan(type: Type, depth: int) -> tuple[str, Any] | None:
    type = unwrapped(type)
    if depth == 0:
        return None
    if isinstance(type, Plain):
        return _plain(type)
    if isinstance(type, List):
        return ("bytes", VIEWED_MIN) if is_byte(type.element) else None
    if isinstance(type, Enum):
        # What nobody can change is the same each time.
        has_words = isinstance(type.python, Members) and type.is_words
        return ("words", [type.python(it.name, None) for it in type.variants]) if has_words else None
    if isinstance(type, Struct) and type.python is not None and type.named.kind == 3:
        parts = [_plan(field.type, depth - 1) for field in type.named.fields]
        names = [field.name for field in type.named.fields]
        return None if None in parts else ("struct", (called(type.python, names), parts))
    return None


def _plain(type: Plain) -> tuple[str, Any] | None:
    if type == BYTES:
        return "bytes", VIEWED_MIN
    if type.integer is None:
        return (_WORDS[type], None) if type in _WORDS else None
    signed, bits = type.integer
    return ("signed" if signed else "unsigned", bits) if bits <= 64 else None
