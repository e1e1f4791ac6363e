"""What a client of asyncio hands out: proxies, subscriptions, and what runs a hosted module."""

from __future__ import annotations

import asyncio
import inspect
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
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
    from .aio import AsyncClient


class AsyncProxy:
    """The functions of a module as coroutines, by its own description."""

    def __init__(self, client: AsyncClient, endpoint: Endpoint, to: Name, timeout_s: float) -> None:
        self._client, self._endpoint, self._to, self._timeout_s = client, endpoint, to, timeout_s

    def __getattr__(self, function: str) -> Callable[..., Awaitable[Any]]:
        if function.startswith("__"):
            raise AttributeError(function)

        def call(*values: Any, **named: Any) -> Awaitable[Any]:
            return self._client._call_by_name(self._endpoint, self._to, function, values, named, self._timeout_s)

        return call


class AsyncSubscription:
    """Data of a module as they come: ``async for data in subscription``, or :meth:`next`. Ended by ``close``, or at the
    end of ``async with``."""

    _following: Following

    def __init__(self, client: AsyncClient, room: int) -> None:
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

    async def next(self, timeout_s: float | None = None) -> Data:
        """The next value. Raises what is in the way, or :class:`TimeoutError`, if none comes in time."""
        self._client._check()
        try:
            await asyncio.wait_for(self._client._until(lambda: self._values or self._is_closed), timeout_s)
        except asyncio.TimeoutError:
            raise self.problem or TimeoutError(f"no data came within {timeout_s} s") from None
        if not self._values:
            raise Misuse("this subscription is closed")
        return self._values.popleft()

    async def __aiter__(self) -> AsyncIterator[Data]:
        while not self._is_closed:
            yield await self.next()

    async def __aenter__(self) -> AsyncSubscription:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        if not self._is_closed and not self._client._is_closed:
            self._is_closed = True
            self._client._core.now_ns = passed_ns()
            self._client._core.unfollow(self._client._core.own, self._following)
            self._client._soon()


class AsyncRecordStream(RecordQueue):
    """A stream of a module, record by record: ``async for record in stream``, :meth:`next` or :meth:`newest`, as
    :class:`rohrpost.remote.RecordStream` has them. Ended by ``close``, or at the end of ``async with``."""

    _wanted: Wanted

    def __init__(self, client: AsyncClient, room: int) -> None:
        super().__init__(room)
        self._client = client
        self._is_closed = False

    async def next(self, timeout_s: float | None = None) -> Record:
        """The next record that was not taken yet."""
        return await self._wait(False, timeout_s)

    async def newest(self, timeout_s: float | None = None) -> Record:
        """The newest record that came."""
        return await self._wait(True, timeout_s)

    async def _wait(self, newest: bool, timeout_s: float | None) -> Record:
        self._client._check()

        def is_over() -> bool:
            return self._has(newest) or self._is_closed or isinstance(self.problem, NoSuchStream)

        try:
            await asyncio.wait_for(self._client._until(is_over), timeout_s)
        except asyncio.TimeoutError:
            raise self.problem or TimeoutError(f"no record came within {timeout_s} s") from None
        if self._has(newest):
            return self._taken(newest)
        if self._is_closed or self._client._is_closed or self.problem is None:
            raise Misuse("this stream is closed")
        raise self.problem

    async def __aiter__(self) -> AsyncIterator[Record]:
        while not self._is_closed:
            yield await self.next()

    async def __aenter__(self) -> AsyncRecordStream:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        if not self._is_closed and not self._client._is_closed:
            self._is_closed = True
            self._client._core.streams.remove(passed_ns(), self._wanted)
            self._client._soon()


class ModuleHost:
    """Runs a module's own code in the loop."""

    def __init__(self, client: AsyncClient, name: Name, module: Module) -> None:
        self._client = client
        self._has_work = asyncio.Event()
        self._is_ended = False
        core = client._core
        core.now_ns = passed_ns()
        self._endpoint = core.host(core.now_ns, name, module, self._has_work.set)
        core.follow_inputs(self._endpoint, lambda problem: None)
        self.task = client._loop.create_task(self._run())

    async def _run(self) -> None:
        hosted = self._endpoint.hosted
        assert hosted is not None
        while True:
            work = hosted.work.next()
            if work is None:
                self._has_work.clear()
                await self._has_work.wait()
                continue
            result, failed = None, None
            try:
                result = work.run()
                if inspect.isawaitable(result):
                    result, failed = await self._awaited(result)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                if self._is_ended:
                    raise
                failed = error  # The author's code may raise anything, also `SystemExit`; the module is in error then.
            work.finish(passed_ns(), result, failed)
            self._client._soon()
            # Others get their turn, however much there is to do.
            await asyncio.sleep(0)

    async def _awaited(self, its: Awaitable[Any]) -> tuple[Any, BaseException | None]:
        """The outcome of the author's coroutine. It has a task of its own, to tell what is cancelled in there from the
        end of this one."""

        async def run() -> tuple[Any, BaseException | None]:
            try:
                return await its, None
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                return None, error

        task = self._client._loop.create_task(run())
        try:
            await asyncio.wait({task})
        except asyncio.CancelledError:
            self._is_ended = True
            task.cancel()
            raise
        return task.result()

    def publish(self, module: Module, data: str, value: Any, time_ns: int | None) -> None:
        self._client._check()
        hosted = self._endpoint.hosted
        assert hosted is not None
        hosted.publish(passed_ns(), data, value, time_ns)
        self._client._soon()

    def proxy(self, module: Module, name: str) -> AsyncProxy:
        return AsyncProxy(self._client, self._endpoint, self._client.name(name), 1.0)
