"""What a synchronous client hands out: proxies, subscriptions, and what runs a hosted module."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..errors import Misuse, RohrpostError
from ..interface import Module
from ..names import Name
from .clock import passed_ns
from .following import Data
from .handed_out import DataQueue, Functions, RecordQueue
from .records import Record
from .streams import NoSuchStream

if TYPE_CHECKING:
    from .client import Client

T = TypeVar("T")
H = TypeVar("H", bound="_Handle[Any]")


class Proxy(Functions):
    """The functions of a module as methods, by its own description."""


class _Handle(Generic[T]):
    """Something to be waited for, until ``close``, the end of ``with``, or that of its client."""

    _kind, _content = "", ""
    problem: RohrpostError | None

    def __init__(self, client: Client) -> None:
        self._client = client
        self._is_closed = False

    def _next(self, is_there: Callable[[], Any], take: Callable[[], T], timeout_s: float | None) -> T:
        client = self._client

        def is_over() -> bool:
            return self._is_closed or client._is_closed or isinstance(self.problem, NoSuchStream)

        with client._locked():
            client._lock.wait_for(lambda: is_there() or is_over(), timeout_s)
            if is_there():
                return take()
            if self._is_closed or client._is_closed:
                raise Misuse(f"this {self._kind} is closed")
            raise self.problem or TimeoutError(f"no {self._content} came within {timeout_s} s")

    def next(self, timeout_s: float | None = None) -> T:
        raise NotImplementedError

    def _end(self, now_ns: int) -> None:
        raise NotImplementedError

    def __iter__(self) -> Iterator[T]:
        while not self._is_closed:
            yield self.next()

    def __enter__(self: H) -> H:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        client = self._client
        if self._is_closed or client._is_closed or client._pid != os.getpid():
            return
        with client._lock:
            self._is_closed = True
            self._end(passed_ns())
            client._lock.notify_all()
        client._wake()


class Subscription(_Handle[Data], DataQueue):
    """Data of a module as they come: ``for data in subscription``, or :meth:`next`. Ended by ``close`` or ``with``."""

    _kind, _content = "subscription", "data"

    def __init__(self, client: Client, room: int) -> None:
        _Handle.__init__(self, client)
        DataQueue.__init__(self, room)

    def next(self, timeout_s: float | None = None) -> Data:
        """The next value. Raises what is in the way, or :class:`TimeoutError`, if none comes in time."""
        return self._next(lambda: self._values, self._values.popleft, timeout_s)

    def _end(self, now_ns: int) -> None:
        self._client._unfollow(now_ns, self)


class RecordStream(_Handle[Record], RecordQueue):
    """A stream of a module, record by record: ``for record in stream``, :meth:`next` or :meth:`newest`. Ended by
    ``close`` or ``with``."""

    _kind, _content = "stream", "record"

    def __init__(self, client: Client, room: int) -> None:
        _Handle.__init__(self, client)
        RecordQueue.__init__(self, room)

    def next(self, timeout_s: float | None = None) -> Record:
        """The next record that was not taken yet. Raises what is in the way, or :class:`TimeoutError`, if none comes in
        time."""
        return self._next(lambda: self._has(False), lambda: self._taken(False), timeout_s)

    def newest(self, timeout_s: float | None = None) -> Record:
        """The newest record that came, again if no newer one came since; the first one is waited for. :meth:`next` goes
        on behind it. Raises as :meth:`next` does."""
        return self._next(lambda: self._has(True), lambda: self._taken(True), timeout_s)

    def _end(self, now_ns: int) -> None:
        self._client._unread(now_ns, self)


class ModuleHost:
    """Runs a module's own code in a thread."""

    def __init__(self, client: Client, name: Name, module: Module) -> None:
        self._client = client
        self._turn = threading.Condition(client._mutex)
        core = client._core
        core.now_ns = passed_ns()
        self._endpoint = core.host(core.now_ns, name, module, self._turn.notify_all)
        core.follow_inputs(self._endpoint, lambda problem: None)
        self.thread = threading.Thread(target=self._run, name=f"rohrpost {name}", daemon=True)

    def _run(self) -> None:
        hosted = self._endpoint.hosted
        assert hosted is not None
        while True:
            with self._turn:
                work = hosted.work.next()
                while work is None:
                    if self._client._is_closed:
                        return
                    self._turn.wait()
                    work = hosted.work.next()
            result, failed = None, None
            try:
                result = work.run()
            except BaseException as error:  # The author's code may raise anything, also `SystemExit`: it is in error.
                failed = error
            with self._client._lock:
                work.finish(passed_ns(), result, failed)
            self._client._wake()

    def stop(self) -> None:
        with self._turn:
            self._turn.notify_all()
        if self.thread is not threading.current_thread():
            self.thread.join(1.0)

    def publish(self, module: Module, data: str, value: Any, time_ns: int | None) -> None:
        hosted = self._endpoint.hosted
        assert hosted is not None
        with self._client._locked():
            hosted.publish(passed_ns(), data, value, time_ns)
        self._client._wake()

    def proxy(self, module: Module, name: str) -> Proxy:
        return Proxy(self._client, self._endpoint, self._client.name(name), 1.0)
