"""What both kinds of client are: a core, and what they say of it. The synchronous one and that of asyncio go on from
here, each with its own way to wait."""

from __future__ import annotations

import os
import ssl
import time
from collections.abc import Callable
from typing import Any, TypeVar

from ..errors import Misuse
from ..names import Name
from . import calling
from .clock import passed_ns
from .core import Core
from .handed_out import DataQueue, RecordQueue
from .session import Settings
from .streams import Wanted

C = TypeVar("C", bound=type)


class Shell:
    """A client, but for how it waits."""

    def __init__(self, server: str, own: Name, settings: Settings, context: ssl.SSLContext | None) -> None:
        self._server = calling.server_of(server)
        self._context = context
        self._pid = os.getpid()
        self._core = Core(settings, own, passed_ns, time.time_ns)
        self._is_closed = False

    @property
    def is_up(self) -> bool:
        """Whether packages leave now."""
        return self._core.session.is_up

    @property
    def words(self) -> str:
        """How the connection stands, for people."""
        return self._core.words

    @property
    def connections(self) -> int:
        """Connections that were made so far."""
        return self._core.session.connections

    def name(self, text: str | Name) -> Name:
        """The module that a text names, such as ``motor.0``."""
        return self._core.settings.installation.name(text)

    def _follow(
        self, subscription: DataQueue, name: str | Name, data: str, period_s: float, newest: bool, expected: Any
    ) -> None:
        """The shell's lock is held; so it is below."""
        self._core.now_ns = passed_ns()
        subscription._following = self._core.follow(
            self._core.own, self.name(name), data, calling.expected_type(expected), int(period_s * 1e6), newest,
            subscription._take, subscription._said,
        )  # fmt: skip

    def _unfollow(self, now_ns: int, subscription: DataQueue) -> None:
        self._core.now_ns = now_ns
        self._core.unfollow(self._core.own, subscription._following)

    def _read_records(
        self, reading: RecordQueue, name: str | Name, stream: str, expected: Any, most_bytes: int
    ) -> None:
        type = calling.expected_type(expected)
        wanted = Wanted(self.name(name), stream, type, most_bytes, reading._take, reading._said)
        self._core.streams.add(passed_ns(), wanted)
        reading._wanted = wanted
        reading._takes_from(wanted.assembly)

    def _unread(self, now_ns: int, reading: RecordQueue) -> None:
        self._core.streams.remove(now_ns, reading._wanted)

    def _check(self) -> None:
        if self._pid != os.getpid():
            raise Misuse("this client was opened before a fork, and its connection is the parent's; open one here")
        if self._is_closed:
            raise Misuse("this client is closed")


def documented_like(original: Any) -> Callable[[C], C]:
    """A class of which methods without a text of their own have that of the original's method of the same name: so it
    is written once."""

    def decorate(cls: C) -> C:
        for name, method in vars(cls).items():
            if callable(method) and not name.startswith("_") and method.__doc__ is None:
                method.__doc__ = getattr(original, name).__doc__
        return cls

    return decorate
