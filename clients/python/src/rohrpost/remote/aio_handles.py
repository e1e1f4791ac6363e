"""What a client of asyncio hands out: proxies, subscriptions, and what runs a hosted module."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..errors import Misuse, RohrpostError
from ..interface import Module
from ..names import Name
from .clock import passed_ns
from .following import Data
from .handed_out import DataQueue, Functions, RecordQueue
from .handles import RecordStream, Subscription
from .records import Record
from .shell import documented_like
from .streams import NoSuchStream

if TYPE_CHECKING:
    from .aio import AsyncClient

T = TypeVar("T")
H = TypeVar("H", bound="_AsyncHandle[Any]")


class AsyncProxy(Functions):
    """The functions of a module as coroutines, by its own description."""


class _AsyncHandle(Generic[T]):
    """Something to be waited for, until ``close``, the end of ``async with``, or that of its client."""

    _kind, _content = "", ""
    problem: RohrpostError | None

    def __init__(self, client: AsyncClient) -> None:
        self._client = client
        self._is_closed = False

    async def _next(self, is_there: Callable[[], Any], take: Callable[[], T], timeout_s: float | None) -> T:
        self._client._check()

        def is_over() -> bool:
            return self._is_closed or isinstance(self.problem, NoSuchStream)

        try:
            await asyncio.wait_for(self._client._until(lambda: is_there() or is_over()), timeout_s)
        except asyncio.TimeoutError:
            raise self.problem or TimeoutError(f"no {self._content} came within {timeout_s} s") from None
        if is_there():
            return take()
        if self._is_closed or self._client._is_closed or self.problem is None:
            raise Misuse(f"this {self._kind} is closed")
        raise self.problem

    async def next(self, timeout_s: float | None = None) -> T:
        raise NotImplementedError

    def _end(self, now_ns: int) -> None:
        raise NotImplementedError

    async def __aiter__(self) -> AsyncIterator[T]:
        while not self._is_closed:
            yield await self.next()

    async def __aenter__(self: H) -> H:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        if not self._is_closed and not self._client._is_closed:
            self._is_closed = True
            self._end(passed_ns())
            self._client._soon()


@documented_like(Subscription)
class AsyncSubscription(_AsyncHandle[Data], DataQueue):
    """Data of a module as they come: ``async for data in subscription``, or :meth:`next`. Ended by ``close``, or at the
    end of ``async with``."""

    _kind, _content = "subscription", "data"

    def __init__(self, client: AsyncClient, room: int) -> None:
        _AsyncHandle.__init__(self, client)
        DataQueue.__init__(self, room)

    async def next(self, timeout_s: float | None = None) -> Data:
        return await self._next(lambda: self._values, self._values.popleft, timeout_s)

    def _end(self, now_ns: int) -> None:
        self._client._unfollow(now_ns, self)


@documented_like(RecordStream)
class AsyncRecordStream(_AsyncHandle[Record], RecordQueue):
    """A stream of a module, record by record: ``async for record in stream``, :meth:`next` or :meth:`newest`. Ended by
    ``close``, or at the end of ``async with``."""

    _kind, _content = "stream", "record"

    def __init__(self, client: AsyncClient, room: int) -> None:
        _AsyncHandle.__init__(self, client)
        RecordQueue.__init__(self, room)

    async def next(self, timeout_s: float | None = None) -> Record:
        return await self._next(lambda: self._has(False), lambda: self._taken(False), timeout_s)

    async def newest(self, timeout_s: float | None = None) -> Record:
        return await self._next(lambda: self._has(True), lambda: self._taken(True), timeout_s)

    def _end(self, now_ns: int) -> None:
        self._client._unread(now_ns, self)


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
