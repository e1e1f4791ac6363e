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
        self._name, self._make = f"_{name}", make

    def of(self, type: Type) -> T | None:
        """That of this type, if there is one."""
        found: T | None = type.__dict__.get(self._name)
        return found

    def used(self, type: Type) -> None:
        """A value of this type was read or written without it."""
        its: dict[str, Any] = type.__dict__
        if f"{self._name}_used" not in its:
            its[f"{self._name}_used"] = True
        elif self._name not in its:
            its[self._name] = self._make(type)
