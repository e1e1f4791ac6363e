"""What a synchronous client hands out: proxies, subscriptions, and what runs a hosted module."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from ..errors import Misuse, RohrpostError
from ..interface import Module
from ..names import Name
from ..schema.tree import Type
from .clock import passed_ns
from .core import Endpoint
from .following import Data, Following
from .records import Record, RecordQueue
from .streams import NoSuchStream, Wanted

if TYPE_CHECKING:
    from .client import Client


class Proxy:
    """The functions of a module as methods, by its own description."""

    def __init__(self, client: Client, endpoint: Endpoint, to: Name, timeout_s: float) -> None:
        self._client, self._endpoint, self._to, self._timeout_s = client, endpoint, to, timeout_s

    def __getattr__(self, function: str) -> Callable[..., Any]:
        if function.startswith("__"):
            raise AttributeError(function)

        def call(*values: Any, **named: Any) -> Any:
            return self._client._call_by_name(self._endpoint, self._to, function, values, named, self._timeout_s)

        return call


class Subscription:
    """Data of a module as they come: ``for data in subscription``, or :meth:`next`. Ended by ``close`` or ``with``."""

    _following: Following

    def __init__(self, client: Client, room: int) -> None:
        self._client = client
        self._values: deque[Data] = deque(maxlen=max(1, room))
        self._is_closed = False
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

    def next(self, timeout_s: float | None = None) -> Data:
        """The next value. Raises what is in the way, or :class:`TimeoutError`, if none comes in time."""
        lock = self._client._lock
        with self._client._locked():
            lock.wait_for(lambda: self._values or self._is_closed or self._client._is_closed, timeout_s)
            if self._values:
                return self._values.popleft()
            if self._is_closed or self._client._is_closed:
                raise Misuse("this subscription is closed")
            raise self.problem or TimeoutError(f"no data came within {timeout_s} s")

    def __iter__(self) -> Iterator[Data]:
        while not self._is_closed:
            yield self.next()

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        if self._is_closed or self._client._is_closed or self._client._pid != os.getpid():
            return
        with self._client._lock:
            self._is_closed = True
            self._client._core.now_ns = passed_ns()
            self._client._core.unfollow(self._client._core.own, self._following)
            self._client._lock.notify_all()
        self._client._wake()


class RecordStream(RecordQueue):
    """A stream of a module, record by record: ``for record in stream``, :meth:`next` or :meth:`newest`. Ended by
    ``close`` or ``with``."""

    _wanted: Wanted

    def __init__(self, client: Client, room: int) -> None:
        super().__init__(room)
        self._client = client
        self._is_closed = False

    def next(self, timeout_s: float | None = None) -> Record:
        """The next record that was not taken yet. Raises what is in the way, or :class:`TimeoutError`, if none comes in
        time."""
        return self._wait(False, timeout_s)

    def newest(self, timeout_s: float | None = None) -> Record:
        """The newest record that came, again if no newer one came since; the first one is waited for. :meth:`next` goes
        on behind it. Raises as :meth:`next` does."""
        return self._wait(True, timeout_s)

    def _wait(self, newest: bool, timeout_s: float | None) -> Record:
        client = self._client

        def is_over() -> bool:
            is_closed = self._is_closed or client._is_closed
            return self._has(newest) or is_closed or isinstance(self.problem, NoSuchStream)

        with client._locked():
            client._lock.wait_for(is_over, timeout_s)
            if self._has(newest):
                return self._taken(newest)
            if self._is_closed or client._is_closed:
                raise Misuse("this stream is closed")
            raise self.problem or TimeoutError(f"no record came within {timeout_s} s")

    def __iter__(self) -> Iterator[Record]:
        while not self._is_closed:
            yield self.next()

    def __enter__(self) -> RecordStream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        if self._is_closed or self._client._is_closed or self._client._pid != os.getpid():
            return
        with self._client._lock:
            self._is_closed = True
            self._client._core.streams.remove(passed_ns(), self._wanted)
            self._client._lock.notify_all()
        self._client._wake()


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
