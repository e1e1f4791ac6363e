"""Functions that are run by time: the runtime ticks at the shortest period, and this says what is due."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..interface import DataOut, Handler


@dataclass
class _Due:
    handler: Handler
    period_ns: int
    due_ns: int = 0


class Timed:
    """All of a module. Those with longer periods are run at the tick that is nearest."""

    def __init__(self, handlers: list[Handler]) -> None:
        self._all = [_Due(it, int(period * 1e9)) for it in handlers if (period := _period_s(it)) is not None]
        self._epoch = 0
        self._half_ns = min((it.period_ns for it in self._all), default=0) // 2
        self.period_s = min((it.period_ns / 1e9 for it in self._all), default=None)
        """Of the ticks; none: none are needed."""

    def restart(self) -> None:
        """All are due now."""
        for it in self._all:
            it.due_ns = 0

    def due(self, now_ns: int, epoch: int) -> Iterator[Handler]:
        """Those to be run now. What was slept through is not made up for."""
        if epoch != self._epoch:
            self._epoch = epoch
            self.restart()
        for it in self._all:
            if now_ns + self._half_ns < it.due_ns:
                continue
            behind = now_ns - it.due_ns
            it.due_ns = now_ns + it.period_ns if behind > it.period_ns else it.due_ns + it.period_ns
            yield it.handler


def _period_s(handler: Handler) -> float | None:
    mark = handler.mark
    if isinstance(mark, DataOut):
        return None if mark.rate_hz is None else 1.0 / mark.rate_hz
    period: float = mark.period_s
    return period
