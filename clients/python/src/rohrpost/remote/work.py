"""What a module's own code is to do. The core decides, the shells run it: one piece after the other for each module."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

Finish = Callable[[int, Any, "BaseException | None"], None]


class Work:
    """Own code to be run; then ``finish(now_ns, result, error)``."""

    def __init__(self, run: Callable[[], Any], finish: Finish) -> None:
        self.run = run
        self._finish = finish

    def finish(self, now_ns: int, result: Any, error: BaseException | None) -> None:
        """It was run. What the author's result or exception cannot do is the module's failure like any other."""
        try:
            self._finish(now_ns, result, error)
        except Exception as wrong:
            self._finish(now_ns, None, RuntimeError(f"what it returns cannot be told: {type(wrong).__name__}"))


class WorkQueue:
    """Work of one module. ``wake`` is run when some comes."""

    MAX = 64

    def __init__(self, wake: Callable[[], None]) -> None:
        self._list: deque[Work] = deque()
        self._wake = wake

    @property
    def is_full(self) -> bool:
        """Whether nothing more of others is taken."""
        return len(self._list) >= self.MAX

    def add(self, work: Work) -> None:
        """More to do."""
        self._list.append(work)
        self._wake()

    def next(self) -> Work | None:
        """Takes the next."""
        return self._list.popleft() if self._list else None
