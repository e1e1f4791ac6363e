"""The client for asyncio: a shell around the same core. All of it belongs to one event loop.

::

    async with await aio.connect("robot.local", "tool.64", robot) as client:
        await client.proxy("motor.0").drive(0.3, 0.0)

Functions of hosted modules may be coroutines; others run in the loop and hold it up as long as they take.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import ssl
from collections.abc import Callable
from typing import Any

from .. import wire
from ..common import Status
from ..errors import CallError, Misuse, NoConnection
from ..interface import Module
from ..marks import RECORD_BYTES_MAX
from ..names import Installation, Name
from ..schema.description import Description
from ..schema.tree import UNIT
from . import calling, prepare
from .aio_handles import AsyncProxy, AsyncRecordStream, AsyncSubscription, ModuleHost
from .calls import Call
from .client import Client
from .clock import passed_ns
from .core import Endpoint, broken, not_connected
from .session import Settings, Step
from .shell import Shell, documented_like
from .timing import SystemTime
from .transport import Plain, Sealed, Tls, Transport


async def connect(
    server: str,
    own: str | Name,
    installation: Installation,
    *,
    tls: Tls | None = None,
    label: str = "a program in Python",
    timeout_s: float = 5.0,
    big_endian: bool = False,
    quota_bytes: int = 1 << 20,
) -> AsyncClient:
    """The same as :func:`rohrpost.remote.connect`, for the running event loop."""
    name, settings, context = prepare(own, installation, tls, label, big_endian, quota_bytes)
    client = AsyncClient(server, name, settings, context)
    if timeout_s > 0:
        try:
            await client.wait_until_up(timeout_s)
        except BaseException:
            client.close()
            raise
    return client


@documented_like(Client)
class AsyncClient(Shell):
    """Takes part at a TCP router; :func:`connect` makes one. Closed at the end of ``async with``."""

    def __init__(self, server: str, own: Name, settings: Settings, context: ssl.SSLContext | None) -> None:
        super().__init__(server, own, settings, context)
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._line: _Line | None = None
        self._connecting: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._hosts: list[ModuleHost] = []
        self._turn()

    # Its life.

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._pid != os.getpid() or self._is_closed:
            return
        self._is_closed = True
        self._core.close("this client is closed")
        if self._timer is not None:
            self._timer.cancel()
        if self._connecting is not None:
            self._connecting.cancel()
        for host in self._hosts:
            host.task.cancel()
        if self._line is not None:
            self._line.drop()
        self._changed.set()

    async def wait_until_up(self, timeout_s: float) -> None:
        self._check()
        try:
            await asyncio.wait_for(self._until(lambda: self._core.session.is_up), timeout_s)
        except asyncio.TimeoutError:
            raise not_connected(self._core) from None
        self._check()

    async def _until(self, is_so: Callable[[], Any]) -> None:
        while not is_so() and not self._is_closed:
            await self._changed.wait()

    def _check(self) -> None:
        super()._check()
        try:
            is_here = asyncio.get_running_loop() is self._loop
        except RuntimeError:
            is_here = False
        if not is_here:
            raise Misuse("this client belongs to another event loop, or thread; use it there, or `remote.connect`")

    # Calls.

    async def describe(self, name: str | Name, timeout_s: float = 1.0) -> Description:
        return await self._describe(self._core.own, self.name(name), timeout_s)

    async def _describe(self, endpoint: Endpoint, to: Name, timeout_s: float) -> Description:
        self._check()
        future: asyncio.Future[Description | CallError] = self._loop.create_future()
        self._core.now_ns = passed_ns()
        self._core.describe(endpoint, to, int(timeout_s * 1e9), lambda result: _settle(future, result))
        self._soon()
        found = await future
        if isinstance(found, CallError):
            raise found
        return found

    async def command(
        self, name: str | Name, number: int, interface: int, arguments: bytes, timeout_s: float = 1.0
    ) -> bytes:
        prepared = calling.Prepared(number, interface, arguments, UNIT)
        return (await self._sent(self._core.own, self.name(name), prepared, timeout_s)).outcome()

    async def _call(self, endpoint: Endpoint, to: Name, prepared: calling.Prepared, timeout_s: float) -> Any:
        return calling.result(prepared, await self._sent(endpoint, to, prepared, timeout_s))

    async def _sent(self, endpoint: Endpoint, to: Name, prepared: calling.Prepared, timeout_s: float) -> Call:
        self._check()
        future: asyncio.Future[Call] = self._loop.create_future()
        call = endpoint.caller.begin(
            passed_ns(), to, prepared.number, prepared.interface, prepared.arguments, int(timeout_s * 1e9),
            lambda call: _settle(future, call),
        )  # fmt: skip
        self._soon()
        try:
            await future
        finally:
            endpoint.caller.forget(call)
        if calling.is_stale(call):
            self._core.forget(to)
        return call

    async def call(self, name: str | Name, function: str, *values: Any, timeout_s: float = 1.0, **named: Any) -> Any:
        return await self._call_by_name(self._core.own, self.name(name), function, values, named, timeout_s)

    async def _call_by_name(
        self, endpoint: Endpoint, to: Name, function: str, values: Any, named: dict[str, Any], timeout_s: float
    ) -> Any:
        description = await self._describe(endpoint, to, timeout_s)
        found = calling.function_of(to, description, function)
        return await self._call(endpoint, to, calling.prepare(description, found, values, named), timeout_s)

    def proxy(self, name: str | Name, timeout_s: float = 1.0) -> AsyncProxy:
        return AsyncProxy(self, self._core.own, self.name(name), timeout_s)

    async def status(self, name: str | Name, timeout_s: float = 1.0) -> Status:
        status: Status = await self._call(self._core.own, self.name(name), calling.STATUS, timeout_s)
        return status

    async def switch(self, name: str | Name, on: bool, timeout_s: float = 1.0) -> None:
        prepared = calling.prepare_common(wire.ON if on else wire.OFF)
        await self._call(self._core.own, self.name(name), prepared, timeout_s)

    async def get(self, name: str | Name, data: str, timeout_s: float = 1.0) -> tuple[int, Any]:
        to = self.name(name)
        prepared = calling.prepare_get(to, await self._describe(self._core.own, to, timeout_s), data)
        time_ns, value = await self._call(self._core.own, to, prepared, timeout_s)
        return time_ns, value

    def time(self) -> SystemTime | None:
        self._check()
        return self._core.time(passed_ns())

    def subscribe(
        self,
        name: str | Name,
        data: str,
        *,
        period_s: float = 0.0,
        newest: bool = False,
        room: int = 64,
        expected: Any = None,
    ) -> AsyncSubscription:
        self._check()
        subscription = AsyncSubscription(self, 1 if newest else room)
        self._follow(subscription, name, data, period_s, newest, expected)
        self._soon()
        return subscription

    def stream(
        self,
        name: str | Name,
        stream: str,
        *,
        room: int = 1,
        expected: Any = None,
        most_bytes: int = RECORD_BYTES_MAX,
    ) -> AsyncRecordStream:
        self._check()
        reading = AsyncRecordStream(self, room)
        self._read_records(reading, name, stream, expected, most_bytes)
        self._soon()
        return reading

    def host(self, name: str | Name, module: Module) -> None:
        """Hosts a module under this name until the client is closed. Its functions run in the loop, one after the
        other."""
        self._check()
        if module._host is not None:
            raise Misuse(f"{type(module).__name__} is hosted already; make another one")
        host = ModuleHost(self, self.name(name), module)
        self._hosts.append(host)
        module._host = host
        self._soon()

    # The loop.

    def _soon(self) -> None:
        if not self._is_closed:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_later(0, self._turn)

    def _turn(self) -> None:
        if self._is_closed:
            return
        line = self._line
        for _ in range(64):
            step, until_ns = self._core.poll(passed_ns())
            if step is Step.CONNECT:
                self._connecting = self._loop.create_task(self._connect())
            elif step is Step.CLOSE:
                if line is not None:
                    line.drop()
                line = self._line = None
                if self._connecting is not None:
                    self._connecting.cancel()
            elif step is Step.WRITE and line is not None and line.writes():
                continue
            break
        wait_ns = until_ns - passed_ns() if step is Step.WAIT else 100_000_000 if step is Step.WRITE else 0
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_later(max(0, min(wait_ns, 250_000_000)) / 1e9, self._turn)
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def _connect(self) -> None:
        try:
            _, line = await asyncio.wait_for(self._loop.create_connection(lambda: _Line(self), *self._server), 5.0)
        except (OSError, UnicodeError, asyncio.TimeoutError) as error:
            host, port = self._server
            why = f"the TCP router at {host}:{port} is not reached: {error}"
            self._core.session.closed(passed_ns(), why)
        else:
            self._line = line
            self._core.session.connected(passed_ns())
        self._soon()

    def _broken(self, line: _Line, why: str) -> None:
        if self._line is line and not self._is_closed:
            self._line = None
            self._core.session.closed(passed_ns(), why)
            self._soon()


class _Line(asyncio.Protocol):
    """A connection."""

    def __init__(self, client: AsyncClient) -> None:
        self._client = client
        self._stream: asyncio.Transport | None = None
        self._is_paused = False
        self.transport: Transport = Plain() if client._context is None else Sealed(client._context)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._stream = transport
        transport.set_write_buffer_limits(high=16_384)
        with contextlib.suppress(OSError):  # It is gone already, as is told soon.
            transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._flush()

    def pause_writing(self) -> None:
        self._is_paused = True

    def resume_writing(self) -> None:
        self._is_paused = False
        self._client._soon()

    def writes(self) -> bool:
        """Writes what is ready; whether the stream takes more."""
        try:
            return self._write()
        except Exception as error:  # As for what comes.
            self.drop()
            self._client._broken(self, broken(error, "what is ready cannot be sent"))
            return False

    def _write(self) -> bool:
        if self._is_paused or not self.transport.is_ready:
            return False
        session = self._client._core.session
        ready = session.ready()
        self.transport.write(ready)
        session.took(passed_ns(), len(ready))
        self._flush()
        return True

    def _flush(self) -> None:
        pending = self.transport.pending()
        if pending and self._stream is not None:
            self._stream.write(bytes(pending))
            pending.clear()

    def data_received(self, data: bytes) -> None:
        try:
            plain = self.transport.read(data)
        except NoConnection as error:
            self.drop()
            return self._client._broken(self, str(error))
        self._flush()
        if self._client._line is self:
            try:
                self._client._core.received(passed_ns(), plain)
            except Exception as error:  # Nothing that comes may end what is hosted here.
                self.drop()
                return self._client._broken(self, broken(error))
            self._client._soon()

    def connection_lost(self, error: Exception | None) -> None:
        why = "the TCP router closed the connection" if error is None else f"the connection broke: {error}"
        self._client._broken(self, why)

    def drop(self) -> None:
        """It is over."""
        if self._stream is not None:
            self._stream.abort()


def _settle(future: asyncio.Future[Any], result: Any) -> None:
    if not future.done():
        future.set_result(result)
