"""Numbers and arrays of numpy, which is not imported for them, and arrays of ``array``: as Python's own."""

from __future__ import annotations

from array import array
from typing import Any

_NUMBERS = {"b": bool, "i": int, "u": int, "f": float}
"""By the kind of numpy's types."""


def plainly(value: Any, as_bytes: bool) -> Any:
    """A number, or the numbers of an array: a list, or with ``as_bytes`` the bytes of one of whole bytes. All else as
    it is."""
    if isinstance(value, array):
        if as_bytes and value.typecode == "B":
            return value.tobytes()
        return value if value.typecode in "uw" else value.tolist()
    kind = getattr(getattr(value, "dtype", None), "kind", None)
    if kind not in _NUMBERS:
        return value
    if value.shape == ():
        return _NUMBERS[kind](value)
    if not as_bytes:
        return value.tolist()
    # Rows of rows are no bytes: their order is for their author to say.
    return value.tobytes() if len(value.shape) == 1 and (kind, value.dtype.itemsize) == ("u", 1) else value
