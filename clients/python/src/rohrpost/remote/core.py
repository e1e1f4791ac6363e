"""All that a client is, without a socket, a clock or a thread: its session, its names, their calls, subscriptions and
modules. The synchronous client and that of asyncio are thin shells around it.

What a shell does: it tells :meth:`Core.poll` the time and does what that says, hands bytes over, runs the work of
modules, and holds one lock (or one thread) around all of it.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any

from .. import faults
from ..errors import CallError, Misuse, NoConnection, NotSent, RohrpostError
from ..faults import Fault
from ..interface import Handler, Module
from ..names import COMMANDS, DATA, REPLIES, Name
from ..schema.description import Description
from ..schema.errors import plain
from ..schema.tree import Type
from ..wire import ERROR, UNKNOWN_NS, CallEnvelope, Package, ReplyEnvelope, WireError, package
from .calls import Caller, incarnation
from .following import Data, Describing, Following
from .hosted import Hosted
from .recorded import RecordWork
from .session import Session, Settings, Step
from .streams import Streams, Wanted
from .timing import SystemTime
from .work import WorkQueue

_HOSTED_MAX = 64
_WAITING_MAX = 1024
_REST_NS = 1_000_000_000
"""What fails without a connection, too, is tried again after so long."""
_LOG = logging.getLogger(__name__)


class Endpoint:
    """One name of this client: its calls, its subscriptions, and the module behind it, if there is one."""

    def __init__(self, name: Name, caller: Caller) -> None:
        self.name = name
        self.caller = caller
        self.follows: dict[int, Following] = {}
        self.hosted: Hosted | None = None
        self.reads: list[Wanted] = []
        """Streams that its module follows."""
        self._next_id = 0

    def free_id(self) -> int:
        """An id for a subscription."""
        while True:
            self._next_id = self._next_id % 0xFFFF + 1
            if self._next_id not in self.follows:
                return self._next_id


class Core:
    """See above. ``monotonic_ns``: only for how long a command has waited when its turn comes; ``wall_ns``: ns since
    1970 by this computer, for incarnations, and for stamps where system time is not known."""

    def __init__(
        self, settings: Settings, own: Name, monotonic_ns: Callable[[], int], wall_ns: Callable[[], int]
    ) -> None:
        now_ns = monotonic_ns()
        self.settings = settings
        self.now_ns = now_ns
        self._monotonic_ns = monotonic_ns
        self._wall_ns = wall_ns
        self._endpoints: dict[Name, Endpoint] = {}
        self._own: deque[Package] = deque()
        """From one name of this client to another: what the TCP router would not bring back."""
        self._descriptions: dict[Name, Description] = {}
        self.words = "not connected yet"
        """What people are to know of the connection."""
        self.was_up = False
        self.streams = Streams(settings.installation, settings.node, lambda: self.now_ns, self._register)
        self.session = Session(settings, [], now_ns, self._deliver, self._told, self.streams)
        self.own = self.add(now_ns, own)

    # Names.

    def add(self, now_ns: int, name: Name) -> Endpoint:
        """One more name is hosted. Raises :class:`Misuse` if it is there already."""
        name = name.module
        if name in self._endpoints:
            raise Misuse(f"{name} is hosted by this client already")
        if name.system != self.settings.installation.system or not name.klass:
            raise Misuse(f"{name} is not of this client's system, {self.settings.installation.system}")
        if len(self._endpoints) > _HOSTED_MAX:
            raise Misuse(f"a client hosts at most {_HOSTED_MAX} modules")
        endpoint = Endpoint(name, Caller(name, incarnation(self._wall_ns()), self._send))
        self._endpoints[name] = endpoint
        self._register(now_ns)
        return endpoint

    def host(self, now_ns: int, name: Name, module: Module, wake: Callable[[], None]) -> Endpoint:
        """Hosts a module under a name. ``wake`` is run when there is work for it."""
        name = name.module
        endpoint = self.own if name == self.own.name and self.own.hosted is None else self.add(now_ns, name)
        work = WorkQueue(wake)
        own = incarnation(self._wall_ns())
        endpoint.hosted = Hosted(name, module, now_ns, own, self._send, self.stamp, work, self._monotonic_ns)
        return endpoint

    def follow_inputs(self, endpoint: Endpoint, problem: Callable[[RohrpostError | None], None]) -> None:
        """Subscribes to all that a hosted module follows."""
        hosted = endpoint.hosted
        assert hosted is not None
        for handler in hosted.interface.records:
            try:
                self._read_input(endpoint, hosted, handler, problem)
            except Misuse:
                self.remove(self.now_ns, endpoint)
                raise
        for handler in hosted.interface.inputs:
            mark = handler.mark
            to = self.settings.installation.name(mark.publisher)

            def take(data: Data, handler: Any = handler) -> None:
                hosted.received(handler, data.value)

            self.follow(endpoint, to, mark.data, handler.type, int(mark.period_s * 1e6), mark.newest, take, problem)

    def _read_input(
        self, endpoint: Endpoint, hosted: Hosted, handler: Handler, problem: Callable[[RohrpostError | None], None]
    ) -> None:
        mark, waiting = handler.mark, RecordWork(hosted, handler)
        to = self.settings.installation.name(mark.publisher)
        wanted = Wanted(to, mark.stream, handler.type, mark.most_bytes, waiting.take, problem)
        self.streams.add(self.now_ns, wanted)
        endpoint.reads.append(wanted)

    def remove(self, now_ns: int, endpoint: Endpoint) -> None:
        """A module is hosted no more."""
        for wanted in endpoint.reads:
            self.streams.remove(now_ns, wanted)
        endpoint.reads.clear()
        for following in list(endpoint.follows.values()):
            self.unfollow(endpoint, following)
        endpoint.hosted = None
        if endpoint is not self.own:
            del self._endpoints[endpoint.name]
            self._register(now_ns)

    def _register(self, now_ns: int) -> None:
        own = [(name.raw, name.raw | 0xFF) for name in sorted(self._endpoints)]
        self.session.host(now_ns, own + self.streams.ranges())

    # The stream.

    def poll(self, now_ns: int) -> tuple[Step, int]:
        """What the shell does next; when it is to wait, until when, ns. A failure in here is a mistake of this package:
        it costs the connection, which is made anew, and not the shell with all that it hosts."""
        try:
            return self._polled(now_ns)
        except Exception as error:
            is_away, why = self.session.is_away, broken(error, "what is due cannot be done")
            self.session.closed(now_ns, why)
            return (Step.WAIT, now_ns + _REST_NS) if is_away else (Step.CLOSE, 0)

    def _polled(self, now_ns: int) -> tuple[Step, int]:
        self.now_ns = now_ns
        self._bring(now_ns)
        due = []
        for endpoint in list(self._endpoints.values()):
            due.append(endpoint.caller.poll(now_ns))
            follows = [it for it in endpoint.follows.values() if self.session.is_up or it.to in self._endpoints]
            due.extend(following.poll(now_ns) for following in follows)
            if endpoint.hosted is not None:
                due.append(endpoint.hosted.poll(now_ns))
        if self.session.is_up:
            due.append(self.streams.poll(now_ns, self.own.caller))
        step, until_ns = self.session.poll(now_ns)
        if step is Step.WAIT:
            until_ns = now_ns if self._own else min([until_ns, *(it for it in due if it is not None)])
        return step, until_ns

    @property
    def has_own(self) -> bool:
        """Whether :meth:`poll` has packages to bring from one name of this client to another."""
        return bool(self._own)

    def _send(self, now_ns: int, package: Package) -> None:
        """Sends it; to a name of this client with the next :meth:`poll`, with a connection or without."""
        if Name(package.head.to).module not in self._endpoints:
            return self.session.send(now_ns, package)
        if len(self._own) >= _WAITING_MAX:
            raise NotSent(f"{_WAITING_MAX} packages wait already for modules of this client; it is sent too fast")
        self._own.append(package)

    def _bring(self, now_ns: int) -> None:
        while self._own:
            self._deliver(now_ns, self._own.popleft())

    def received(self, now_ns: int, data: bytes) -> None:
        """Bytes of the stream came."""
        self.now_ns = now_ns
        self.session.received(now_ns, data)

    def _told(self, is_up: bool, words: str) -> None:
        self.words = words
        self.was_up |= is_up

    def _deliver(self, now_ns: int, package: Package) -> None:
        to = Name(package.head.to)
        endpoint = self._endpoints.get(to.module)
        if endpoint is None or (to.local == COMMANDS and endpoint.hosted is None):
            return self._no_mailbox(now_ns, package)
        if to.local == COMMANDS and endpoint.hosted is not None:
            endpoint.hosted.take(now_ns, package)
        elif to.local == REPLIES:
            endpoint.caller.take(package)
        elif to.local == DATA:
            following = endpoint.follows.get(package.head.id)
            if following is not None:
                following.received(package)

    def _no_mailbox(self, now_ns: int, command: Package) -> None:
        head = command.head
        if not head.is_command or not head.sender:
            return
        try:
            envelope, _ = CallEnvelope.split(command.body)
            body = ReplyEnvelope(envelope.incarnation, envelope.sequence).to_bytes()
            body += Fault(faults.NO_MAILBOX).to_bytes()
            self._send(now_ns, package(head.sender, head.to, -head.kind, head.id, body, head.priority, ERROR))
        except (WireError, NotSent):
            return

    # What a program asks for.

    def describe(self, endpoint: Endpoint, to: Name, timeout_ns: int, done: Callable[[Any], None]) -> None:
        """``done`` gets the description, at once if it is known, or a :class:`CallError`."""
        known = self.known(to)
        if known is not None:
            return done(known)

        def described(result: Description | CallError) -> None:
            if isinstance(result, Description):
                self._descriptions[to] = result
                while len(self._descriptions) > _HOSTED_MAX:
                    del self._descriptions[next(iter(self._descriptions))]
            done(result)

        Describing(endpoint.caller, lambda: self.now_ns, to, timeout_ns, described)

    def known(self, to: Name) -> Description | None:
        """What a module offers, if it was asked already."""
        return self._descriptions.get(to)

    def forget(self, to: Name) -> None:
        """A module's interface has changed: it is asked for anew."""
        self._descriptions.pop(to, None)

    def follow(
        self,
        endpoint: Endpoint,
        to: Name,
        data: str,
        expected: Type | None,
        period_us: int,
        newest: bool,
        take: Callable[[Data], None],
        state: Callable[[RohrpostError | None], None],
    ) -> Following:
        """Subscribes, until :meth:`unfollow`; over outages and restarts, too."""
        following = Following(
            endpoint.caller, lambda: self.now_ns, endpoint.free_id(), to, data, expected, period_us, newest, take, state
        )
        endpoint.follows[following.id] = following
        return following

    def unfollow(self, endpoint: Endpoint, following: Following) -> None:
        """Ends a subscription."""
        if endpoint.follows.pop(following.id, None) is not None:
            following.close()

    def time(self, now_ns: int) -> SystemTime | None:
        """System time as the TCP router has it; none: not known yet, or the TCP router does not know it."""
        return self.session.clock.system(now_ns)

    def stamp(self, now_ns: int) -> SystemTime:
        """System time, or this computer's where that is not known: of epoch 0, and an error that is not known."""
        return self.time(now_ns) or SystemTime(self._wall_ns(), UNKNOWN_NS, 0)

    def close(self, why: str) -> None:
        """All calls are over."""
        for endpoint in self._endpoints.values():
            endpoint.caller.give_up_all(lambda: NotSent(why))


def not_connected(core: Core) -> NoConnection:
    """Why it does not take part."""
    return NoConnection(core.words)


def broken(error: Exception, what: str = "what came cannot be taken") -> str:
    """Why a connection ends. ``what`` failed, if that is a mistake of this package."""
    if isinstance(error, NoConnection):
        return str(error)
    if isinstance(error, OSError):
        return f"the connection broke: {error}"
    _LOG.error("%s, so the connection is made anew", what, exc_info=error)
    return plain(f"{what}: {type(error).__name__}: {error}")[:900]
