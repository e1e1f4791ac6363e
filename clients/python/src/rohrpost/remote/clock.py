"""The clock of both clients."""

from __future__ import annotations

import time

_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def passed_ns() -> int:
    """Time that passed, ns, from any moment on; also while the computer slept, where it can tell: a caller that slept
    must not say that its command is young."""
    return time.monotonic_ns() if _BOOTTIME is None else time.clock_gettime_ns(_BOOTTIME)
