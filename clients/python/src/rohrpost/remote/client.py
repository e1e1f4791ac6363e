"""The synchronous client: a shell around the core with a socket, a thread and a lock.

One thread reads and writes, or while calls wait one of theirs (:mod:`.line`); each hosted module has a thread of its
own, which runs its functions one after the other. All methods may be called from any thread.
"""

from __future__ import annotations

import contextlib
import os
import socket
import ssl
import threading
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
from .line import Ears, Line, Waiting
from .session import Settings, Step
from .shell import Shell
from .timing import SystemTime
from .transport import Plain, Sealed

_CONNECT_S = 5.0
_READ_BYTES = 65_536
_REST_NS, _BLOCKED_NS = 250_000_000, 100_000_000
"""How long its thread waits at most."""


class Client(Shell):
    """Takes part at a TCP router; :func:`rohrpost.remote.connect` makes one. Closed at the end of ``with``."""

    def __init__(self, server: str, own: Name, settings: Settings, context: ssl.SSLContext | None) -> None:
        super().__init__(server, own, settings, context)
        self._mutex = threading.RLock()
        self._lock = threading.Condition(self._mutex)
        self._for_others = _Locked(self)
        self._hosts: list[ModuleHost] = []
        self._ears = Ears()
        self._rests_until_ns = 0
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

    def _locked(self) -> _Locked:
        """The lock, for what others ask."""
        return self._for_others

    # Calls.

    def describe(self, name: str | Name, timeout_s: float = 1.0) -> Description:
        """What a module offers."""
        return self._describe(self._core.own, self.name(name), timeout_s)

    def _describe(self, endpoint: Endpoint, to: Name, timeout_s: float) -> Description:
        self._check()
        known = self._core.known(to)
        if known is not None:
            return known
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
        waiting, call, line = Waiting(self._ears), None, None
        try:
            with self._locked():
                now_ns = passed_ns()
                call = endpoint.caller.begin(
                    now_ns, to, prepared.number, prepared.interface, prepared.arguments, int(timeout_s * 1e9),
                    waiting.over,
                )  # fmt: skip
                line = self._ears.lend(waiting) if self._core.session.is_up else None
                is_soon = not self._pushed(now_ns) or call.repeat_ns < self._rests_until_ns or self._core.has_own
            if is_soon:
                self._wake()
            while line is not None and not call.is_done:
                self._ears.listen(line)
                line = self._heard(line, call)
            waiting.wait()
        finally:
            with self._mutex:
                self._ears.give_back(waiting)
                if call is not None and not call.is_done:
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
            self._follow(subscription, name, data, period_s, newest, expected)
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
        with self._locked():
            self._read_records(reading, name, stream, expected, most_bytes)
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

    # Its connection. One thread at a time, with the lock, reads and writes.

    def _pushed(self, now_ns: int) -> bool:
        """Writes what may leave now; whether all of it left."""
        line = self._ears.line
        if line is None or not self._core.session.is_up:
            return False
        self._core.session.speak(now_ns)
        try:
            if self._core.session.has_ready or line.transport.pending():
                self._write(line)
        except (OSError, NoConnection) as error:
            line.broken = error
        return line.broken is None and not line.transport.pending()

    def _heard(self, line: Line, call: Call) -> Line | None:
        """Reads as a thread that listens; none: there is nothing to listen to any more."""
        with self._mutex:
            if line is not self._ears.line or line.broken is not None:
                return None
            is_all, before = False, self._core.session.heard
            try:
                self._read(line)
                is_all = self._pushed(passed_ns())
            except (OSError, NoConnection) as error:
                line.broken = error
            except BaseException:
                line.broken = NoConnection("a thread that read was interrupted")
                raise
            finally:
                if not (is_all and call.is_done and self._core.session.heard == before + 1):
                    # There was more than the answer: the core is to be asked what follows from it.
                    self._wake()
            return line if line.broken is None and self._core.session.is_up else None

    def _write(self, line: Line) -> None:
        pending, session = line.transport.pending(), self._core.session
        if not pending and line.transport.is_ready:
            ready = session.ready()
            if ready:
                line.transport.write(ready)
            session.took(passed_ns(), len(ready))
        if pending:
            with contextlib.suppress(BlockingIOError):
                del pending[: line.stream.send(pending)]

    def _read(self, line: Line) -> None:
        try:
            data = line.stream.recv(_READ_BYTES)
        except BlockingIOError:
            return
        if not data:
            raise NoConnection("the TCP router closed the connection")
        self._core.received(passed_ns(), line.transport.read(data))
        self._lock.notify_all()

    # The thread.

    def _wake(self) -> None:
        self._ears.wake()

    def _run(self) -> None:
        try:
            while not self._is_closed:
                with self._lock:
                    now_ns = passed_ns()
                    step, until_ns = self._core.poll(now_ns)
                    self._rests_until_ns = min(until_ns, now_ns + _REST_NS) if step is Step.WAIT else now_ns + _REST_NS
                    self._lock.notify_all()
                try:
                    self._do(step)
                except Exception as error:  # Nothing may end this thread, and with it all that is hosted here.
                    why = broken(error)
                    with self._lock:
                        self._core.session.closed(passed_ns(), why)
                        self._ears.drop()
        finally:
            with self._lock:
                # However it ends, nobody waits for it any more.
                self._is_closed = True
                self._core.close("this client is closed")
                self._lock.notify_all()
                self._ears.close()

    def _do(self, step: Step) -> None:
        if step is Step.CONNECT:
            self._connect()
        elif step is Step.CLOSE:
            with self._lock:
                self._ears.drop()
        else:
            self._turn(step)

    def _connect(self) -> None:
        why = ""
        try:
            stream = socket.create_connection(self._server, timeout=_CONNECT_S)
            stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, UnicodeError) as error:  # Also a name that is none: of a part of 64 letters, say.
            host, port = self._server
            why = f"the TCP router at {host}:{port} is not reached: {error}"
        with self._lock:
            if why:
                return self._core.session.closed(passed_ns(), why)
            stream.setblocking(False)
            self._core.session.connected(passed_ns())
            self._ears.line = Line(stream, Plain() if self._context is None else Sealed(self._context))

    def _turn(self, step: Step) -> None:
        with self._lock:
            line, now_ns = self._ears.line, passed_ns()
            if line is not None:
                self._write_all(line)
            takes_more = line is not None and line.transport.is_ready and not line.transport.pending()
            # A stream that takes nothing now, or is not sealed yet, is looked at again when something comes.
            if step is not Step.WAIT:
                self._rests_until_ns = now_ns + (0 if takes_more else _BLOCKED_NS)
            rest_ns = self._rests_until_ns - now_ns
        if self._ears.select(max(0, rest_ns) / 1e9):
            with self._lock:
                if line is not None:
                    self._read(line)

    def _write_all(self, line: Line) -> None:
        if line.broken is not None:
            raise line.broken
        self._write(line)
        self._ears.watch()


class _Locked:
    """A client's lock. After a fork a thread that is not there any more may hold it: so the process is asked first."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def __enter__(self) -> None:
        self._client._check()
        self._client._mutex.acquire()
        try:
            self._client._check()
        except BaseException:
            self._client._mutex.release()
            raise

    def __exit__(self, *_: object) -> None:
        self._client._mutex.release()
