"""Which sender may take one more of a bounded number of places: each principal holds at most as many as it leaves free
for others."""

from __future__ import annotations

from collections.abc import Iterable

from ..names import Name


def principal(own: Name, sender: int) -> tuple[int, int]:
    """With which others a sender shares its places: those of its class, or if it is of another system, of that."""
    name = Name(sender)
    return name.system, name.klass if name.system == own.system else 0


def allows(own: Name, sender: int, held: Iterable[int], places: int) -> bool:
    """Whether a sender may take one more of so many; ``held``: the senders that have one."""
    all = [principal(own, it) for it in held]
    return all.count(principal(own, sender)) < places - len(all)
