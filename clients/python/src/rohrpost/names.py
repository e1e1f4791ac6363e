"""Names of mailboxes, and the classes of an installation."""

from __future__ import annotations

import functools
import importlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .siphash import siphash

COMMANDS, REPLIES, DATA = 0, 1, 2
"""Local ids that every module has."""
ALL_SYSTEMS = 255


class BadName(ValueError):
    """A text is no name."""


@functools.total_ordering
@dataclass(frozen=True)
class Name:
    """A mailbox name: 32 bits. ``1.200.0.2`` is system 1, class 200, instance 0, local id 2."""

    raw: int

    @staticmethod
    def of(system: int, klass: int, instance: int, local: int = COMMANDS) -> Name:
        """From its parts, 0 to 255 each."""
        for part in (system, klass, instance, local):
            if not 0 <= part <= 255:
                raise BadName(f"mailbox name: `{part}` is not a number from 0 to 255")
        return Name(system << 24 | klass << 16 | instance << 8 | local)

    @staticmethod
    def parse(text: str) -> Name:
        """From its text, such as ``1.200.0.0``. Raises :class:`BadName`."""
        parts = text.split(".")
        if len(parts) != 4:
            raise BadName(
                f"mailbox name `{text}` has {len(parts)} parts; write system.class.instance.local, such as 1.200.0.0"
            )
        for part in parts:
            if not re.fullmatch(r"\+?[0-9]{1,64}", part) or int(part) > 255:
                raise BadName(f"mailbox name `{text}`: `{part}` is not a number from 0 to 255")
        return Name.of(*map(int, parts))

    @property
    def system(self) -> int:
        """First byte."""
        return self.raw >> 24

    @property
    def klass(self) -> int:
        """Second byte: also the priority of what it sends."""
        return self.raw >> 16 & 0xFF

    @property
    def instance(self) -> int:
        """Third byte."""
        return self.raw >> 8 & 0xFF

    @property
    def local(self) -> int:
        """Last byte: which mailbox of the module."""
        return self.raw & 0xFF

    @property
    def module(self) -> Name:
        """The module's mailbox of commands."""
        return self.with_local(COMMANDS)

    def with_local(self, local: int) -> Name:
        """Another mailbox of the same module."""
        return Name(self.raw & ~0xFF | local)

    def __str__(self) -> str:
        return f"{self.system}.{self.klass}.{self.instance}.{self.local}"

    def __repr__(self) -> str:
        return str(self)

    def __eq__(self, other: object) -> bool:
        return self.raw == other.raw if isinstance(other, Name) else NotImplemented

    def __hash__(self) -> int:
        return self.raw

    def __lt__(self, other: Name) -> bool:
        return self.raw < other.raw


@dataclass(frozen=True)
class Installation:
    """What a program must know of an installation: its own system, the classes by name, and both digests.

    ``rohrpost check`` prints the digests. The common one follows from the classes, if all of them are given. Programs
    of a system that no file describes agree on any number as the system's digest.
    """

    system: int
    classes: Mapping[str, int] = field(default_factory=dict)
    common_digest: int = 0
    system_digest: int = 0

    @staticmethod
    def with_digests(system: int, digests: str, classes: Mapping[str, int] | None = None) -> Installation:
        """From what ``rohrpost check`` prints: ``0123456789abcdef-fedcba9876543210``."""
        match = re.fullmatch(r"([0-9a-fA-F]{16})-([0-9a-fA-F]{16})", digests)
        if not match:
            raise ValueError(
                f"`{digests}` are no digests; write what `rohrpost check` prints: two times 16 hexadecimal digits "
                "with - between"
            )
        return Installation(system, dict(classes or {}), int(match[1], 16), int(match[2], 16))

    @staticmethod
    def with_classes(system: int, classes: Mapping[str, int], system_digest: int = 0) -> Installation:
        """From all classes of the configuration; the common digest is computed."""
        return Installation(system, dict(classes), common_digest(classes), system_digest)

    @staticmethod
    def from_file(path: str | Path, system: int | None = None, system_digest: int = 0) -> Installation:
        """The classes, and the system unless told, of a configuration file. Needs Python 3.11."""
        try:
            tomllib = importlib.import_module("tomllib")
        except ImportError:
            raise RuntimeError(
                "Python 3.10 reads no TOML; give the classes by hand, or use Python 3.11 or later"
            ) from None
        with open(path, "rb") as file:
            table: dict[str, Any] = tomllib.load(file)
        try:
            classes = {str(name): int(its["id"]) for name, its in table["classes"].items()}
            own = int(table["system"]["id"]) if system is None else system
        except (KeyError, TypeError, AttributeError, ValueError):
            raise ValueError(
                f"{path}: `[classes]` with an `id` each, and `[system]` with its `id`, are needed"
            ) from None
        return Installation.with_classes(own, classes, system_digest)

    @staticmethod
    def from_check(path: str | Path) -> Installation:
        """From the file that ``rohrpost check FILE --json`` printed: system, classes and both digests."""
        try:
            its = json.loads(Path(path).read_text(encoding="utf-8"))["installation"]
            classes = {str(entry["name"]): int(entry["id"]) for entry in its["classes"]}
            return Installation.with_digests(int(its["system"]["id"]), its["digest"], classes)
        except (KeyError, TypeError, json.JSONDecodeError):
            raise ValueError(f"{path}: write into it what `rohrpost check robot.toml --json` prints") from None

    def name(self, text: str | Name) -> Name:
        """The module that a text names: ``motor.0``, ``2.motor.0.0``, ``200.0`` or ``2.200.0.0``."""
        if isinstance(text, Name):
            return text.module
        parts = text.split(".")
        if len(parts) == 2:
            parts = [str(self.system), *parts, "0"]
        if len(parts) != 4:
            raise BadName(
                f"`{text}` is no module name; write class.instance, such as `laser.0`, or of another system "
                "system.class.instance.0, such as `2.laser.0.0`"
            )
        if not re.fullmatch(r"[0-9]+", parts[1]):
            if parts[1] not in self.classes:
                known = ", ".join(sorted(self.classes)) or "none"
                raise BadName(f"`{text}`: no class `{parts[1]}` is known here; there are: {known}")
            parts[1] = str(self.classes[parts[1]])
        return Name.parse(".".join(parts)).module

    def text(self, name: Name) -> str:
        """A module as people call it: ``motor.0``, or ``2.motor.0.0`` of another system."""
        klass = next((text for text, its in self.classes.items() if its == name.klass), str(name.klass))
        if name.system == self.system:
            return f"{klass}.{name.instance}"
        return f"{name.system}.{klass}.{name.instance}.0"


def common_digest(classes: Mapping[str, int]) -> int:
    """Digest of what must be equal in all systems that meet: the classes with their ids."""
    lines = [f"class {number} {name}\n" for name, number in sorted(classes.items(), key=lambda it: -it[1])]
    return siphash(("rohrpost common 1\n" + "".join(lines)).encode(), 2, 4)
