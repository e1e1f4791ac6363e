"""Records that a hosted module follows: they become its work. Knows no clock and no socket."""

from __future__ import annotations

from typing import Any

from ..common import State
from ..interface import Handler
from .hosted import Hosted
from .records import BadRecord, Record
from .work import Work


class RecordWork:
    """Records of a stream that one function of a module follows. One waits, the newest."""

    def __init__(self, hosted: Hosted, handler: Handler) -> None:
        self._hosted, self._handler = hosted, handler
        self._waiting: Record | None = None

    def take(self, record: Record) -> None:
        """A record came."""
        hosted, is_queued = self._hosted, self._waiting is not None
        if hosted.state is not State.On:
            return
        if not is_queued and hosted.work.is_full:
            hosted.lost += 1
            return
        hosted.lost += is_queued
        self._waiting = record
        if not is_queued:
            hosted.work.add(Work(self._run, self._finish))

    def _run(self) -> Any:
        record, self._waiting = self._waiting, None
        if record is None or self._hosted.state is not State.On:
            return None
        return getattr(self._hosted.module, self._handler.name)(record.value)

    def _finish(self, now_ns: int, _: Any, error: BaseException | None) -> None:
        if isinstance(error, BadRecord):
            # Its writer is wrong, and not this module.
            self._hosted.lost += 1
        elif error is not None:
            self._hosted.failed(error)
