"""What decoding one message may cost, whatever its description says; Rust counts in the same way
(``modules/schema/src/budget.rs``), and both are held to ``tests/conformance/budget.json``."""

from __future__ import annotations

EMPTY_MAX = 65_536
"""Values that take no bytes, in one message."""
VALUES_MAX = 4_000_000
"""Values in one message that are objects of their own here, of some 100 bytes each: lists, structs and all that is in
them, but for the contents of ``bytes`` and texts, and for numbers in a list of f32 or f64."""
VALUES_PER_BYTE = 8
"""Values for each byte of a message, besides :data:`EMPTY_MAX`: real types have fewer than four."""
NAME_BYTES = 64
"""So many bytes of the name of a field or variant count as another value, as it is printed with each value."""


def values_most(length: int) -> int:
    """So many values a message of this length may have."""
    return min(VALUES_MAX, EMPTY_MAX + VALUES_PER_BYTE * length)


def values_of_name(name: str) -> int:
    """So many values a name counts as."""
    return len(name.encode()) // NAME_BYTES
