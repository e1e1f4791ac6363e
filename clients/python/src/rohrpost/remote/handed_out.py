"""What both kinds of client hand out, but for how it waits: functions of a module as methods, data
and records that nobody has taken yet."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from ..errors import RohrpostError
from ..names import Name
from ..schema.tree import Type
from .core import Endpoint
from .following import Data, Following
from .records import Assembly, Missed, Record
from .streams import Wanted


class Functions:
    """The functions of a module as methods, by its own description."""

    def __init__(self, client: Any, endpoint: Endpoint | None, to: Name, timeout_s: float) -> None:
        self._client, self._endpoint, self._to, self._timeout_s = client, endpoint, to, timeout_s

    def __getattr__(self, function: str) -> Callable[..., Any]:
        if function.startswith("__"):
            raise AttributeError(function)

        def call(*values: Any, **named: Any) -> Any:
            return self._client._call_by_name(self._endpoint, self._to, function, values, named, self._timeout_s)

        return call


class DataQueue:
    """Data that came and were not taken yet; without a lock."""

    _following: Following

    def __init__(self, room: int) -> None:
        self._values: deque[Data] = deque(maxlen=max(1, room))
        self.problem: RohrpostError | None = None
        """What is wrong at present, if anything is; it goes on trying."""
        self.dropped = 0
        """Values that gave way here, since nobody took them."""

    @property
    def lost(self) -> int:
        """Values that should have come and did not."""
        return self._following.lost

    @property
    def type(self) -> Type | None:
        """The type of the values, once the module has described itself."""
        return self._following.type

    def _take(self, data: Data) -> None:
        self.dropped += len(self._values) == self._values.maxlen
        self._values.append(data)

    def _said(self, problem: RohrpostError | None) -> None:
        self.problem = problem


class RecordQueue:
    """Records of one stream that came and were not taken yet: so many as there is ``room`` for, the newest."""

    _wanted: Wanted

    def __init__(self, room: int) -> None:
        self._waiting: deque[Record] = deque(maxlen=max(1, room))
        self._newest: Record | None = None
        self._passed_over = 0
        self._assembly: Assembly | None = None
        self.problem: RohrpostError | None = None
        """What is wrong at present, if anything is; it goes on trying."""

    def _takes_from(self, assembly: Assembly) -> None:
        self._assembly = assembly

    def _take(self, record: Record) -> None:
        self._passed_over += len(self._waiting) == self._waiting.maxlen
        self._waiting.append(record)
        self._newest = record

    def _said(self, problem: RohrpostError | None) -> None:
        self.problem = problem

    def _has(self, newest: bool) -> bool:
        return self._newest is not None if newest else bool(self._waiting)

    def _taken(self, newest: bool) -> Record:
        """The newest, or the next one; there is one."""
        if not newest:
            return self._waiting.popleft()
        assert self._newest is not None
        self._passed_over += max(0, len(self._waiting) - 1)
        self._waiting.clear()
        return self._newest

    @property
    def missed(self) -> Missed:
        """Records so far that did not come, or were not taken, by cause. The first that came is the first that
        counts."""
        assembly = self._assembly
        return Missed() if assembly is None else Missed(assembly.lost, assembly.sampled, self._passed_over)

    @property
    def refused(self) -> dict[str, int]:
        """Parts that were not taken, by cause, as ``rohrpost net`` counts them, and records of which the rest never
        came (``incomplete``)."""
        return {} if self._assembly is None else dict(+self._assembly.refused)

    @property
    def type(self) -> Type | None:
        """The type of the records, once it is known."""
        return None if self._assembly is None else self._assembly.type
