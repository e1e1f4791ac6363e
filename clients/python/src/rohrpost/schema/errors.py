"""What can be wrong with descriptions and values, in the words that Rust uses."""

from __future__ import annotations


class SchemaError(ValueError):
    """Bytes are no description."""


class WalkError(ValueError):
    """Bytes or a value do not fit their type.

    ``path`` is the way to the place, such as ``pose.x_m`` or ``ranges_m[3]``; empty: the whole.
    """

    def __init__(self, problem: str, path: str = "") -> None:
        super().__init__(problem)
        self.problem = problem
        self.path = path

    def within(self, name: str) -> WalkError:
        """The same error, seen from outside of the field or argument ``name``."""
        dot = "" if not self.path or self.path.startswith("[") else "."
        self.path = f"{name}{dot}{self.path}"
        return self

    def __str__(self) -> str:
        return f"{plain(self.path)}: {self.problem}" if self.path else self.problem


def plain(text: str) -> str:
    """A text of somebody else, fit for one line of a terminal: what a terminal obeys is written as an escape."""
    if text.isprintable():
        return text
    short = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}
    return "".join(c if c.isprintable() else short.get(c, f"\\u{{{ord(c):x}}}") for c in text)


def shortened(text: str) -> str:
    """What came instead, at most 40 characters of it."""
    return plain(text[:40]) + ("…" if len(text) > 40 else "")


def counted(number: int, noun: str) -> str:
    """``1 byte``, ``2 bytes``."""
    return f"{number} {noun}" + ("" if number == 1 else "s")
