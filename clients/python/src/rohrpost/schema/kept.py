"""What is made once of a type, and stands at it from then on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from .tree import Type

T = TypeVar("T")


class Kept(Generic[T]):
    """One thing for each type, if ``make`` gives one. It is made by the second use: types that are made for one value
    need none."""

    def __init__(self, name: str, make: Callable[[Type], T | None]) -> None:
        self.name, self._make = f"_{name}", make
        """Of the attribute that it is; ``type.__dict__.get(name)`` asks for it without a call."""

    def used(self, type: Type) -> None:
        """A value of this type was read or written without it."""
        its: dict[str, Any] = type.__dict__
        if f"{self.name}_used" not in its:
            its[f"{self.name}_used"] = True
        elif self.name not in its:
            its[self.name] = self._make(type)
