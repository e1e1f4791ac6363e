"""Views of shared memory that are there for a while, and say so afterwards.

::

    Shared (Rust: keeps the memory mapped, counts views) ◀── memoryview ◀── what an author makes of it

What an author keeps of it keeps the memory: no view ever leads nowhere. But its bytes are those of
another record by then, so it is told. A record that is filled while its view is kept is never one for others, and its
stream takes no other until the view is let go.
"""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING

from ..errors import Misuse
from ..schema.decode import decode
from ..schema.tree import Type

if TYPE_CHECKING:
    from .._node import Shared

VIEWED_MIN = 1024
"""Shorter bytes in a value are copied: that is quicker than a view."""


class View:
    """Bytes of a record while they are lent."""

    def __init__(self, shared: Shared) -> None:
        self._shared = shared
        self.whole = memoryview(shared)
        self._lent = [self.whole]

    def lend(self, start: int, end: int) -> memoryview | bytes:
        """Some of them, if they are many; else a copy."""
        part = self.whole[start:end]
        if end - start < VIEWED_MIN:
            return bytes(part)
        self._lent.append(part)
        return part

    def release(self, is_told: bool = True) -> bool:
        """They are lent no more; whether nothing of them was kept. Asked again, whether that holds still. ``is_told``:
        it matters, so nothing is said to be kept that is not."""
        if self._is_free():
            return True
        if not is_told:
            return False
        # What nobody reaches any more may wait for it, such as an exception in a local of the frame that caught it.
        gc.collect()
        return self._is_free()

    def _is_free(self) -> bool:
        try:
            for view in reversed(self._lent):
                view.release()
        except BufferError:  # An array of numpy is made of it, say.
            pass
        else:
            self._lent.clear()
            self.__dict__.pop("whole", None)
        # From now on, it makes no new ones: what has it, as `view.obj`, has no way to another record.
        return self._shared.end()


class Held:
    """The value of a record, while it is held: ``bytes`` of it are views, if they are many."""

    def __init__(self, type: Type, data: bytes | Shared) -> None:
        self._view: View | None = None
        if isinstance(data, bytes):
            self.value = decode(type, data)
            return
        view = self._view = View(data)
        try:
            self.value = decode(type, view.whole, view.lend)
        except BaseException:
            self.release(is_told=False)
            raise

    def release(self, is_told: bool = True) -> bool:
        """It is held no more; whether nothing of its memory was kept, if that ``is_told``."""
        self.__dict__.pop("value", None)
        view, self._view = self._view, None
        return view is None or view.release(is_told)


def kept(what: str) -> Misuse:
    """What is told of a view that was kept."""
    return Misuse(
        f"a view of {what} is kept, and shows other bytes from now on; copy what you keep: `bytes(…)`, `numpy.array(…)`"
    )
