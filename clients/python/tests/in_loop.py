"""A client of asyncio, used as the synchronous one is, so that one test is for both. Its loop has its own thread."""

from __future__ import annotations

import asyncio
import inspect
import os
import threading
from collections.abc import Callable, Coroutine
from typing import Any

from rohrpost.remote import aio
from rohrpost.remote.aio_handles import AsyncProxy, AsyncRecordStream, AsyncSubscription

PATIENCE_S = 60


class Loop:
    """Runs coroutines, for threads that wait for them."""

    def __init__(self) -> None:
        self._pid, self._is_closed = os.getpid(), False
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def run(self, its: Coroutine[Any, Any, Any]) -> Any:
        """The outcome, here."""
        if self._is_closed or self._pid != os.getpid():
            return asyncio.run(its)  # A forked child has none of its parent's threads.
        return asyncio.run_coroutine_threadsafe(its, self._loop).result(PATIENCE_S)

    def close(self) -> None:
        """It ends, when all that was begun has ended."""

        async def rest() -> None:
            tasks = asyncio.all_tasks() - {asyncio.current_task()}
            await asyncio.wait(tasks, timeout=PATIENCE_S) if tasks else None

        self.run(rest())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        self._is_closed = True


class Waits:
    """What it is around, of which all functions are run in the loop, and waited for."""

    def __init__(self, loop: Loop, its: Any) -> None:
        self._loop, self._its = loop, its

    def __getattr__(self, name: str) -> Any:
        its = getattr(self._its, name)
        return its if name.startswith("_") or not callable(its) else self.waits(its)

    def waits(self, its: Callable[..., Any]) -> Callable[..., Any]:
        """A function that runs this one in the loop."""

        def call(*values: Any, **named: Any) -> Any:
            async def run() -> Any:
                result = its(*values, **named)
                return await result if inspect.isawaitable(result) else result

            result = self._loop.run(run())
            is_handle = isinstance(result, (AsyncProxy, AsyncSubscription, AsyncRecordStream))
            return Waits(self._loop, result) if is_handle else result

        return call

    def __enter__(self) -> Any:
        self._loop.run(self._its.__aenter__())
        return self

    def __exit__(self, *error: object) -> None:
        self._loop.run(self._its.__aexit__(*error))


class Client(Waits):
    """A client, and the loop that it has to itself."""

    def close(self) -> None:
        """Of both."""
        if self._its._is_closed:
            return

        async def close() -> None:
            self._its.close()

        self._loop.run(close())
        self._loop.close()

    def __exit__(self, *error: object) -> None:
        self.close()


def connect(*values: Any, **named: Any) -> Any:
    """As :func:`rohrpost.remote.connect` does."""
    loop = Loop()
    try:
        return Client(loop, loop.run(aio.connect(*values, **named)))
    except BaseException:
        loop.close()
        raise
