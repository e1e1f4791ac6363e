"""The synchronous client: a shell around the core with a socket, a thread and a lock.

One thread reads and writes; each hosted module has a thread of its own, which runs its functions one after the other.
All methods may be called from any thread.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import ssl
import threading
from collections.abc import Iterator
from typing import Any

from ..common import Status
from ..errors import CallError, Misuse, NoConnection
from ..interface import Module
from ..marks import RECORD_BYTES_MAX
from ..names import Name
from ..schema.description import Description
from ..schema.tree import UNIT
from .. import wire
from . import calling
from .calls import Call
from .clock import passed_ns
from .core import Endpoint, broken, not_connected
from .handles import ModuleHost, Proxy, RecordStream, Subscription
from .session import Settings, Step
from .shell import Shell
from .streams import Wanted
from .timing import SystemTime
from .transport import Plain, Sealed, Transport

_CONNECT_S = 5.0
_READ_BYTES = 65_536


class Client(Shell):
    """Takes part at a TCP router; :func:`rohrpost.remote.connect` makes one. Closed at the end of ``with``."""

    def __init__(self, server: str, own: Name, settings: Settings, context: ssl.SSLContext | None) -> None:
        super().__init__(server, own, settings, context)
        self._mutex = threading.RLock()
        self._lock = threading.Condition(self._mutex)
        self._hosts: list[ModuleHost] = []
        self._wake_out, self._wake_in = socket.socketpair()
        for end in (self._wake_in, self._wake_out):
            end.setblocking(False)
        self._thread = threading.Thread(target=self._run, name="rohrpost", daemon=True)
        self._thread.start()

    # Its life.

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends it: what it hosts is gone, calls under way end with :class:`NotSent`."""
        if self._pid != os.getpid() or self._is_closed:
            return
        with self._lock:
            self._is_closed = True
            self._core.close("this client is closed")
            self._lock.notify_all()
        self._wake()
        for host in self._hosts:
            host.stop()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def wait_until_up(self, timeout_s: float) -> None:
        """Waits until it takes part. Raises :class:`NoConnection` with what is in the way."""
        with self._locked():
            self._lock.wait_for(lambda: self._core.session.is_up or self._is_closed, timeout_s)
            if not self._core.session.is_up:
                self._check()
                raise not_connected(self._core)

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """The lock, for what others ask. After a fork a thread that is not there any more may hold it: so the process
        is asked first."""
        self._check()
        with self._lock:
            self._check()
            yield

    # Calls.

    def describe(self, name: str | Name, timeout_s: float = 1.0) -> Description:
        """What a module offers."""
        return self._describe(self._core.own, self.name(name), timeout_s)

    def _describe(self, endpoint: Endpoint, to: Name, timeout_s: float) -> Description:
        box: list[Any] = []
        done = threading.Event()

        def take(result: Any) -> None:
            box.append(result)
            done.set()

        with self._locked():
            self._core.now_ns = passed_ns()
            self._core.describe(endpoint, to, int(timeout_s * 1e9), take)
        self._wake()
        done.wait()
        if isinstance(box[0], CallError):
            raise box[0]
        found: Description = box[0]
        return found

    def command(self, name: str | Name, number: int, interface: int, arguments: bytes, timeout_s: float = 1.0) -> bytes:
        """Calls a function by its number, with the hash of its interface; arguments and result are postcard."""
        prepared = calling.Prepared(number, interface, arguments, UNIT)
        return self._sent(self._core.own, self.name(name), prepared, timeout_s).outcome()

    def _call(self, endpoint: Endpoint, to: Name, prepared: calling.Prepared, timeout_s: float) -> Any:
        return calling.result(prepared, self._sent(endpoint, to, prepared, timeout_s))

    def _sent(self, endpoint: Endpoint, to: Name, prepared: calling.Prepared, timeout_s: float) -> Call:
        done = threading.Event()
        with self._locked():
            now_ns = passed_ns()
            call = endpoint.caller.begin(
                now_ns, to, prepared.number, prepared.interface, prepared.arguments, int(timeout_s * 1e9),
                lambda _: done.set(),
            )  # fmt: skip
        self._wake()
        try:
            done.wait()
        finally:
            if not call.is_done:
                with self._lock:
                    endpoint.caller.forget(call)
        if calling.is_stale(call):
            with self._lock:
                self._core.forget(to)
        return call

    def call(self, name: str | Name, function: str, *values: Any, timeout_s: float = 1.0, **named: Any) -> Any:
        """Calls a function of a module by its description. Raises :class:`rohrpost.CallError`."""
        return self._call_by_name(self._core.own, self.name(name), function, values, named, timeout_s)

    def _call_by_name(
        self, endpoint: Endpoint, to: Name, function: str, values: Any, named: dict[str, Any], timeout_s: float
    ) -> Any:
        description = self._describe(endpoint, to, timeout_s)
        found = calling.function_of(to, description, function)
        return self._call(endpoint, to, calling.prepare(description, found, values, named), timeout_s)

    def proxy(self, name: str | Name, timeout_s: float = 1.0) -> Proxy:
        """The functions of a module: ``client.proxy("motor.0").drive(0.3, 0.0)``. ``timeout_s``: of each call."""
        return Proxy(self, self._core.own, self.name(name), timeout_s)

    def status(self, name: str | Name, timeout_s: float = 1.0) -> Status:
        """How a module is."""
        status: Status = self._call(self._core.own, self.name(name), calling.STATUS, timeout_s)
        return status

    def switch(self, name: str | Name, on: bool, timeout_s: float = 1.0) -> None:
        """Switches a module on or off."""
        prepared = calling.prepare_common(wire.ON if on else wire.OFF)
        self._call(self._core.own, self.name(name), prepared, timeout_s)

    def get(self, name: str | Name, data: str, timeout_s: float = 1.0) -> tuple[int, Any]:
        """The newest data of a module: when they were true, ns since 1970, and themselves."""
        to = self.name(name)
        prepared = calling.prepare_get(to, self._describe(self._core.own, to, timeout_s), data)
        time_ns, value = self._call(self._core.own, to, prepared, timeout_s)
        return time_ns, value

    def time(self) -> SystemTime | None:
        """System time as the TCP router has it, with its error bound; none: it is not known."""
        with self._locked():
            return self._core.time(passed_ns())

    # Data.

    def subscribe(
        self,
        name: str | Name,
        data: str,
        *,
        period_s: float = 0.0,
        newest: bool = False,
        room: int = 64,
        expected: Any = None,
    ) -> Subscription:
        """Follows data of a module, over outages and restarts.

        ``period_s``: the newest value once in so many seconds; 0: each. ``newest``: of values that wait only the newest
        counts. ``room``: values that wait here; the oldest gives way. ``expected``: the type that they must have, such
        as ``rohrpost.Odometry``.
        """
        subscription = Subscription(self, 1 if newest else room)
        with self._locked():
            self._core.now_ns = passed_ns()
            subscription._following = self._core.follow(
                self._core.own, self.name(name), data, calling.expected_type(expected), int(period_s * 1e6), newest,
                subscription._take, subscription._said,
            )  # fmt: skip
        self._wake()
        return subscription

    def stream(
        self,
        name: str | Name,
        stream: str,
        *,
        room: int = 1,
        expected: Any = None,
        most_bytes: int = RECORD_BYTES_MAX,
    ) -> RecordStream:
        """Reads a stream of a module, over outages and restarts, if the robot's file has a ``[[replica]]`` of it for
        the node that this program is on.

        ``room``: records that wait here; the oldest gives way. ``expected``: the type that they must have, such as
        ``rohrpost.Image``. Records of more than ``most_bytes`` are not taken.
        """
        reading = RecordStream(self, room)
        type = calling.expected_type(expected)
        wanted = Wanted(self.name(name), stream, type, most_bytes, reading._take, reading._said)
        with self._locked():
            self._core.streams.add(passed_ns(), wanted)
        reading._wanted = wanted
        reading._takes_from(wanted.assembly)
        self._wake()
        return reading

    # Modules.

    def host(self, name: str | Name, module: Module) -> None:
        """Hosts a module under this name until the client is closed. Its functions run in a thread of their own."""
        with self._locked():
            if module._host is not None:
                raise Misuse(f"{type(module).__name__} is hosted already; make another one")
            host = ModuleHost(self, self.name(name), module)
            self._hosts.append(host)
            module._host = host
        host.thread.start()
        self._wake()

    # The thread.

    def _wake(self) -> None:
        try:
            self._wake_out.send(b"\0")
        except (BlockingIOError, OSError):
            # It is awake, or closed.
            return

    def _run(self) -> None:
        selector = selectors.DefaultSelector()
        selector.register(self._wake_in, selectors.EVENT_READ)
        line: _Line | None = None
        try:
            while not self._is_closed:
                with self._lock:
                    step, until_ns = self._core.poll(passed_ns())
                    self._lock.notify_all()
                if step is Step.CONNECT:
                    line = self._connect(selector)
                elif step is Step.CLOSE:
                    self._drop(selector, line)
                    line = None
                else:
                    line = self._turn(selector, line, step, until_ns)
        finally:
            with self._lock:
                # However it ends, nobody waits for it any more.
                self._is_closed = True
                self._core.close("this client is closed")
                self._lock.notify_all()
            self._drop(selector, line)
            selector.close()
            self._wake_in.close()
            self._wake_out.close()

    @staticmethod
    def _drop(selector: selectors.BaseSelector, line: _Line | None) -> None:
        if line is not None:
            selector.unregister(line.stream)
            line.stream.close()

    def _connect(self, selector: selectors.BaseSelector) -> _Line | None:
        why = ""
        try:
            stream = socket.create_connection(self._server, timeout=_CONNECT_S)
            stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, UnicodeError) as error:  # Also a name that is none: of a part of 64 letters, say.
            host, port = self._server
            why = f"the TCP router at {host}:{port} is not reached: {error}"
        with self._lock:
            if why:
                self._core.session.closed(passed_ns(), why)
                return None
            stream.setblocking(False)
            selector.register(stream, selectors.EVENT_READ)
            self._core.session.connected(passed_ns())
            return _Line(stream, Plain() if self._context is None else Sealed(self._context))

    def _turn(self, selector: selectors.BaseSelector, line: _Line | None, step: Step, until_ns: int) -> _Line | None:
        try:
            if line is not None:
                self._write(line)
                events = selectors.EVENT_READ | (selectors.EVENT_WRITE if line.transport.pending() else 0)
                selector.modify(line.stream, events)
            takes_more = line is not None and line.transport.is_ready and not line.transport.pending()
            # A stream that takes nothing now, or is not sealed yet, is looked at again when something comes.
            wait_ns = until_ns - passed_ns() if step is Step.WAIT else 0 if takes_more else 100_000_000
            for key, _ in selector.select(max(0.0, min(wait_ns, 250_000_000) / 1e9)):
                if key.fileobj is self._wake_in:
                    self._wake_in.recv(4096)
                elif line is not None:
                    self._read(line)
        except Exception as error:  # Nothing that comes may end this thread, and with it all that is hosted here.
            why = broken(error)
            with self._lock:
                self._core.session.closed(passed_ns(), why)
            self._drop(selector, line)
            return None
        return line

    def _write(self, line: _Line) -> None:
        pending = line.transport.pending()
        if not pending and line.transport.is_ready:
            with self._lock:
                ready = self._core.session.ready()
                line.transport.write(ready)
                self._core.session.took(passed_ns(), len(ready))
        if pending:
            try:
                del pending[: line.stream.send(pending)]
            except BlockingIOError:
                return

    def _read(self, line: _Line) -> None:
        try:
            data = line.stream.recv(_READ_BYTES)
        except BlockingIOError:
            return
        if not data:
            raise NoConnection("the TCP router closed the connection")
        plain = line.transport.read(data)
        with self._lock:
            self._core.received(passed_ns(), plain)
            self._lock.notify_all()


class _Line:
    """A connection."""

    def __init__(self, stream: socket.socket, transport: Transport) -> None:
        self.stream = stream
        self.transport = transport
