"""A session with the TCP router, without a socket, a clock or a thread.

::

     away ─ wait is over ─▶ connecting ─ connected ─▶ handshake ─ welcome ─▶ member ─ register ─▶ up
      ▲                         └───── too long ─────────┴─ refusal ──┴─ silence, damage, end of the stream ┘
      └──────────────────────────── waits longer each time ◀──────────────────────────────────────┘

What was handed to the stream is never sent again; what a broken connection had under way is lost.
"""

from __future__ import annotations

import enum
import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from ..errors import NotSent
from ..names import Installation
from ..wire import BIG_ENDIAN, NEWEST, Package
from . import frames
from .frames import BadFrame, Carried, DescribedPart, RecordPart, Refused, Registered, Splitter, Welcome
from .timing import (
    FRAME_MAX_NS, HANDSHAKE_MAX_NS, SECOND, STALLED_AFTER_NS, Asking, Backoff, ServerClock,
)  # fmt: skip

AGE_NS_MAX = 1_900_000_000
"""A package that may be older is not delivered."""
WAIT_NS_MAX = 1_500_000_000
"""A package that has waited for longer does not leave any more."""
_BATCH_BYTES = 16_384
_LASTING_NS = 5 * SECOND
_REGISTER_AGAIN_NS = SECOND // 2
_LOOK_EVERY_NS = SECOND // 4


class Step(enum.Enum):
    """What the code around a session does next."""

    CONNECT = "connect"
    WRITE = "write"
    CLOSE = "close"
    WAIT = "wait"


class State(enum.Enum):
    """Where a session is, see above."""

    AWAY = "away"
    CONNECTING = "connecting"
    HANDSHAKE = "handshake"
    MEMBER = "member"
    CLOSING = "closing"


@dataclass(frozen=True)
class Settings:
    """What a session knows before its first connection. ``incarnation``: not 0; ``quota_bytes``: of what waits;
    ``big_endian``: the byte order of the heads that it writes; ``node``: of the robot's file, that this program is on,
    if it says so."""

    installation: Installation
    label: str
    incarnation: int
    quota_bytes: int = 1 << 20
    big_endian: bool = False
    node: str = ""


class _Waiting:
    """Packages that wait for the stream: most important first, bounded; the newest of the least important gives way."""

    def __init__(self, quota_bytes: int) -> None:
        self._heap: list[tuple[int, int, int, Package]] = []
        self._quota = quota_bytes
        self._bytes = 0
        self._count = 0

    def push(self, now_ns: int, package: Package) -> None:
        size = len(package.body) + 64
        if package.head.options & NEWEST:
            self._replace(package)
        while self._bytes + size > self._quota:
            last = max(self._heap, default=None, key=lambda entry: entry[:2])
            if last is None or -last[0] >= package.head.priority:
                raise NotSent("more waits already than `quota_bytes` lets; it is sent faster than the stream takes it")
            self._drop(last)
        self._count += 1
        self._bytes += size
        heapq.heappush(self._heap, (-package.head.priority, self._count, now_ns, package))

    def _replace(self, package: Package) -> None:
        def key(of: Package) -> tuple[int, ...]:
            return of.head.sender, of.head.to, of.head.kind, of.head.id, of.head.options & NEWEST

        for entry in [entry for entry in self._heap if key(entry[3]) == key(package)]:
            self._drop(entry)

    def _drop(self, entry: tuple[int, int, int, Package]) -> None:
        self._heap.remove(entry)
        heapq.heapify(self._heap)
        self._bytes -= len(entry[3].body) + 64

    def pop(self, now_ns: int) -> tuple[int, Package] | None:
        while self._heap:
            _, _, since_ns, package = heapq.heappop(self._heap)
            self._bytes -= len(package.body) + 64
            if now_ns - since_ns <= WAIT_NS_MAX:
                return since_ns, package
        return None

    def __bool__(self) -> bool:
        return bool(self._heap)


class SessionStreams(Protocol):
    """What a session has to do with streams."""

    def received(self, now_ns: int, connection: tuple[int, int], part: RecordPart | DescribedPart) -> None:
        """A part came, by this incarnation of the server, in this connection."""

    def objected(self, now_ns: int, registered: Registered, words: str) -> bool:
        """The server does not let this client host a name; whether it is one for streams, and others are registered."""


class Session:
    """Keeps up a connection to the server, registers what it hosts, and carries packages both ways.

    ``deliver`` gets each package that came; ``told`` gets words for people, once for each change, and whether packages
    may leave now; ``streams`` gets parts of records.
    """

    def __init__(
        self,
        settings: Settings,
        ranges: list[tuple[int, int]],
        now_ns: int,
        deliver: Callable[[int, Package], None],
        told: Callable[[bool, str], None],
        streams: SessionStreams | None = None,
    ) -> None:
        self._settings = settings
        self._ranges = ranges
        self._deliver = deliver
        self._told = told
        self._streams = streams
        self._said = ""
        self._state = State.AWAY
        self._until_ns = now_ns
        self._register_ns: int | None = now_ns
        self._number = 0
        self._holds = False
        self._attempt = 0
        self._backoff = Backoff(settings.incarnation)
        self._splitter = Splitter()
        self.heard = 0
        """Messages that came so far."""
        self._waiting = _Waiting(settings.quota_bytes)
        self._out = bytearray()
        self._taken = 0
        self._is_blocked = False
        self._server = 0
        self._joined_ns: int | None = None
        self._heard_ns = self._moved_ns = now_ns
        self._look_ns = 0
        self._asking = Asking(now_ns)
        self.clock = ServerClock()

    @property
    def is_up(self) -> bool:
        """Whether packages may leave."""
        return self._state is State.MEMBER and self._holds

    @property
    def is_away(self) -> bool:
        """Whether there is no connection, nor one that is being made."""
        return self._state is State.AWAY

    @property
    def connections(self) -> int:
        """Connections that were made so far."""
        return self._attempt

    def host(self, now_ns: int, ranges: list[tuple[int, int]]) -> None:
        """It hosts these names from now on."""
        self._ranges = ranges
        self._register_ns, self._holds = now_ns, False

    def send(self, now_ns: int, package: Package) -> None:
        """Sends a package, or keeps it until it may leave. Raises :class:`NotSent`."""
        if self._settings.big_endian:
            package = replace(package, head=replace(package.head, options=package.head.options | BIG_ENDIAN))
        self._waiting.push(now_ns, package)

    def connected(self, now_ns: int) -> None:
        """The connection is made."""
        self._attempt += 1
        self._state, self._until_ns = State.HANDSHAKE, now_ns + HANDSHAKE_MAX_NS
        self._splitter, self._out, self._taken, self._is_blocked = Splitter(), bytearray(), 0, False
        self._heard_ns = self._moved_ns = now_ns
        own = self._settings.installation
        digests = (own.common_digest, own.system_digest)
        self._out += frames.hello(
            own.system, digests, self._settings.incarnation, self._attempt, now_ns, self._settings.label
        )

    def closed(self, now_ns: int, why: str = "") -> None:
        """The connection is closed or broken, or could not be made."""
        if self._state is State.AWAY:
            return
        if why:
            self._say(False, why)
        elif self.is_up:
            self._say(False, "the TCP router closed the connection")
        if self._joined_ns is not None and now_ns - self._joined_ns > _LASTING_NS:
            self._backoff.lasted()
        self._joined_ns = None
        self._state, self._until_ns = State.AWAY, now_ns + self._backoff.next_ns()
        self._register_ns, self._holds = now_ns, False
        self._out = bytearray()

    @property
    def has_ready(self) -> bool:
        """Whether there are bytes to be written."""
        return bool(self._out)

    def ready(self) -> bytes:
        """Bytes to be written."""
        return bytes(self._out)

    def took(self, now_ns: int, count: int) -> None:
        """The stream has taken so many of them; if those were not all, nothing is written until :meth:`writable`."""
        del self._out[:count]
        self._taken += count
        self._is_blocked = bool(self._out)
        if count:
            self._moved_ns = now_ns
        self._asking.sent(now_ns, self._taken)

    def writable(self) -> None:
        """The stream takes bytes again."""
        self._is_blocked = False

    def poll(self, now_ns: int) -> tuple[Step, int]:
        """What to do next; when it is to wait, until when, ns."""
        if self._look_ns and now_ns > self._look_ns + 4 * _LOOK_EVERY_NS:
            # This program stood still itself: all others count as heard.
            self._heard_ns = now_ns
        self._look_ns = now_ns + _LOOK_EVERY_NS
        if not self._out:
            self._moved_ns = now_ns
        if self._state is State.AWAY:
            if now_ns < self._until_ns:
                return Step.WAIT, self._until_ns
            self._state, self._until_ns = State.CONNECTING, now_ns + HANDSHAKE_MAX_NS
            return Step.CONNECT, 0
        if self._state is State.CONNECTING and now_ns < self._until_ns:
            return Step.WAIT, self._until_ns
        gone = "no connection was made in 5 s" if self._state is State.CONNECTING else self._gone(now_ns)
        if gone is not None:
            self.closed(now_ns, gone)
            return Step.CLOSE, 0
        self.speak(now_ns)
        if self._out and not self._is_blocked:
            return Step.WRITE, 0
        return Step.WAIT, self._look_ns

    def _gone(self, now_ns: int) -> str | None:
        since = self._splitter.waits_since_ns
        if self._state is State.CLOSING:
            return ""
        if now_ns - self._moved_ns > STALLED_AFTER_NS:
            return "the TCP router took nothing for 10 s"
        if since is not None and now_ns - since > FRAME_MAX_NS:
            return "a frame of the TCP router did not end within 30 s"
        if self._state is State.HANDSHAKE:
            return "the TCP router did not answer in 5 s" if now_ns >= self._until_ns else None
        silent = self._asking.is_silent(now_ns, self._heard_ns, self._moved_ns, since is not None)
        return "nothing came from the TCP router for too long" if silent else None

    def speak(self, now_ns: int) -> None:
        """Makes ready what may leave now; :meth:`poll` does, too."""
        if self._state is not State.MEMBER:
            return
        if self._asking.is_due(now_ns):
            self._out += frames.ask(now_ns)
            self._asking.asks(now_ns, self._taken + len(self._out))
        if self._register_ns is not None and now_ns >= self._register_ns:
            self._number = self._number % 0xFFFF_FFFF + 1
            self._register_ns = None
            self._out += frames.register(self._number, self._ranges)
        while self.is_up and self._waiting and len(self._out) < _BATCH_BYTES:
            found = self._waiting.pop(now_ns)
            if found is not None:
                since_ns, package = found
                session = self.clock.session(now_ns)
                published = 0 if session is None else max(0, session[0] - (now_ns - since_ns))
                self._out += frames.carry(package, published)

    def received(self, now_ns: int, data: bytes) -> None:
        """Takes bytes of the server's stream, split anywhere."""
        self._heard_ns = now_ns
        self._asking.heard()
        self._splitter.take(data, now_ns)
        while self._state in (State.HANDSHAKE, State.MEMBER):
            try:
                message = self._splitter.next(now_ns)
                if message is None:
                    return
                self._handle(now_ns, message)
            except BadFrame as bad:
                self._over(str(bad))

    def _handle(self, now_ns: int, message: frames.Message) -> None:
        self.heard += 1
        if isinstance(message, Refused):
            if message.is_hopeless:
                self._backoff.hopeless()
            self._over(str(message))
        elif isinstance(message, Welcome) and self._state is State.HANDSHAKE:
            self._welcomed(now_ns, message)
        elif self._state is State.HANDSHAKE or isinstance(message, Welcome):
            self._over("damaged: a frame that is not for now")
        elif isinstance(message, Registered):
            self._registered(now_ns, message)
        elif isinstance(message, Carried):
            self._take(now_ns, message)
        elif isinstance(message, (RecordPart, DescribedPart)):
            if self._streams is not None:
                self._streams.received(now_ns, (self._server, self._attempt), message)
        else:
            self.clock.heard(now_ns, message)

    def _welcomed(self, now_ns: int, welcome: Welcome) -> None:
        common = self._settings.installation.common_digest
        if welcome.common_digest != common:
            self._backoff.hopeless()
            return self._over(str(Refused(frames.VERSION, 2, common, welcome.common_digest, "the TCP router")))
        if welcome.incarnation != self._server:
            self._server, self.clock = welcome.incarnation, ServerClock()
        self.clock.heard(now_ns, welcome.time)
        self._state, self._joined_ns, self._asking = State.MEMBER, now_ns, Asking(now_ns)

    def _registered(self, now_ns: int, registered: Registered) -> None:
        if registered.number != self._number or self._register_ns is not None:
            return
        if registered.objection == 0:
            self._holds = True
            self._say(True, "takes part")
            return
        host = f": {registered.text}" if registered.text else ""
        words = f"{frames.OBJECTIONS[registered.objection]}{host}"
        if self._streams is not None and self._streams.objected(now_ns, registered, words):
            return
        self._register_ns = now_ns + _REGISTER_AGAIN_NS
        self._say(False, words)

    def _take(self, now_ns: int, carried: Carried) -> None:
        session = self.clock.session(now_ns)
        is_old = session is not None and carried.published and sum(session) - carried.published > AGE_NS_MAX
        if not is_old:
            package, head = carried.package, carried.package.head.capped()
            self._deliver(now_ns, package if head is package.head else replace(package, head=head))

    def _say(self, is_up: bool, words: str) -> None:
        if words != self._said:
            self._said = words
            self._told(is_up, words)

    def _over(self, why: str) -> None:
        self._say(False, why)
        self._state, self._holds = State.CLOSING, False
