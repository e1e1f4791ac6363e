"""Which streams a client has, and how it comes to them. Knows no clock and no socket.

::

     wanted ─▶ asks the TCP router which streams it sends to this node, by which number, and to which name
            ─▶ hosts that name, `tcp.I`, besides its own ─▶ descriptions and parts come, for an assembly each

The TCP router sends all streams that its file gives the node; those that nobody wants here are dropped as they come.
One program of a node has its streams, since a name has one host.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from .. import wire
from ..annotations import U16, U32, data, said
from ..common import type_of_class
from ..errors import CallError, Misuse, RohrpostError
from ..names import DATA, Installation, Name
from ..schema import tree
from ..schema.decode import decode
from ..schema.description import Description
from ..schema.encode import encode
from ..schema.errors import WalkError, plain
from ..schema.tree import Tuple, Type
from .calls import Call, Caller
from .following import DESCRIBED_NS, Describing, NoSuchData, item_of
from .frames import DescribedPart, RecordPart, Registered
from .records import Assembly, Record

STREAMS_MAX = 64
_TCP_ROUTER = 255
_PATIENCE_NS = 1_000_000_000
_ASK_AGAIN_NS = 1_000_000_000
_REGISTER_AGAIN_NS = 5_000_000_000


@data
class BeyondNode:
    """A node that has streams by the TCP router. ``client``: the name to the host of which their parts go."""

    name: str
    client: U32


@data
class BeyondStream:
    """A stream that the TCP router sends. ``place``: its number in parts; ``source``: the module that writes it;
    ``to``: the nodes that have it, by their places."""

    place: U16
    source: U32
    item: str
    record_bytes: Annotated[U32, said(unit="bytes")]
    to: list[U16]


@data
class BeyondStreams:
    """All that it sends, as its file says."""

    nodes: list[BeyondNode]
    streams: list[BeyondStream]


class NoSuchStream(NoSuchData):
    """The TCP router sends no such stream to this node, as its file says; waiting does not help."""


class Wanted:
    """A stream that somebody wants. ``most_bytes``: larger records are not taken."""

    def __init__(
        self,
        publisher: Name,
        stream: str,
        expected: Type | None,
        most_bytes: int,
        take: Callable[[Record], None],
        say: Callable[[RohrpostError | None], None],
    ) -> None:
        self.publisher, self.stream, self.say = publisher, stream, say
        self.place: int | None = None
        self.most_bytes = most_bytes
        self.assembly = Assembly(publisher, stream, expected, most_bytes, take, say)


class Streams:
    """All of a client. ``node``: the node of the file that this program is on; ``register`` has the client register
    its names anew, with :attr:`hosts` among them."""

    def __init__(
        self, installation: Installation, node: str, now: Callable[[], int], register: Callable[[int], None]
    ) -> None:
        self.hosts: Name | None = None
        """The name that it hosts for its streams."""
        self._installation, self._node = installation, node
        self._now, self._register = now, register
        self._wanted: list[Wanted] = []
        self._known: BeyondStreams | None = None
        self._is_asking = False
        self._next_ns = 0
        self._connection = (0, 0)

    # What is wanted.

    def add(self, now_ns: int, wanted: Wanted) -> None:
        """One more. Raises :class:`Misuse`, if this program can have none."""
        if not self._node:
            raise Misuse(
                "records go to a node of the robot's file, and this program does not say which one it is on; take its "
                'certificate, `Tls("certificates", "NODE.system-N")`, or without TLS `label="node NODE of SYSTEM"`'
            )
        if "tcp" not in self._installation.classes:
            raise Misuse("for records the id of class `tcp` must be known; add it to the classes, as the file has it")
        if len(self._wanted) >= STREAMS_MAX:
            raise Misuse(f"a client has at most {STREAMS_MAX} streams")
        self._wanted.append(wanted)
        self._next_ns = 0
        self._place_all()
        if self.hosts is not None and wanted.place is not None:
            # Its description and its newest record came already, and nobody wanted them. They come anew to a host that
            # was none for a moment; what is under way of other streams is given up for that.
            self.hosts = None
            self._register(now_ns)

    def remove(self, now_ns: int, wanted: Wanted) -> None:
        """It is wanted no more."""
        if wanted in self._wanted:
            self._wanted.remove(wanted)
            self._host(now_ns)

    def _say(self, problem: RohrpostError) -> None:
        for wanted in self._wanted:
            wanted.say(problem)

    # Which there are.

    def poll(self, now_ns: int, caller: Caller) -> int | None:
        """Asks, or hosts, what is due; when to look again, ns. Only while packages may leave."""
        if not self._wanted or self._is_asking:
            return None
        if now_ns >= self._next_ns:
            if self._known is None:
                self._is_asking, self._next_ns = True, now_ns + _ASK_AGAIN_NS
                _Asking(caller, self._now, self._router(), self._answered)
                return self._next_ns
            self._next_ns = now_ns + _REGISTER_AGAIN_NS
            self._host(now_ns)
        return self._next_ns

    def _router(self) -> Name:
        return Name.of(self._installation.system, self._installation.classes["tcp"], _TCP_ROUTER)

    def _answered(self, answer: BeyondStreams | RohrpostError) -> None:
        self._is_asking = False
        if isinstance(answer, RohrpostError):
            return self._say(RohrpostError(f"the TCP router does not say which streams it sends: {answer}"))
        self._known, self._next_ns = answer, 0
        self._place_all()

    def _place_all(self) -> None:
        for wanted in self._wanted if self._known else []:
            if wanted.place is None:
                self._place(wanted)

    def _place(self, wanted: Wanted) -> None:
        having = self._having()
        found = [it for it in having if (it.source, it.item) == (wanted.publisher.raw, wanted.stream)]
        if found:
            wanted.place = found[0].place
            wanted.assembly.record_bytes = min(found[0].record_bytes, wanted.most_bytes)
            return
        name = f"{self._installation.text(wanted.publisher)}/{wanted.stream}"
        given = ", ".join(f"{self._installation.text(Name(it.source))}/{plain(it.item)}" for it in having) or "none"
        wanted.say(
            NoSuchStream(
                f"the robot sends node {self._node} no stream {name}; its file needs a [[replica]] with "
                f'`stream = "{name}"` and "{self._node}" in `to`. What it sends: {given}'
            )
        )

    def _having(self) -> list[BeyondStream]:
        """The streams that this node has."""
        if self._known is None:
            return []
        places = [place for place, node in enumerate(self._known.nodes) if node.name == self._node]
        return [it for it in self._known.streams if places and places[0] in it.to]

    # The name that they go to.

    def _host(self, now_ns: int) -> None:
        """Hosts the name of this node's client, if streams are wanted that it has; else not."""
        nodes = [] if self._known is None else self._known.nodes
        client = next((Name(node.client) for node in nodes if node.name == self._node), None)
        hosts = client if any(wanted.place is not None for wanted in self._wanted) else None
        if hosts != self.hosts:
            self.hosts = hosts
            self._register(now_ns)

    def ranges(self) -> list[tuple[int, int]]:
        """What is to be registered for them."""
        return [] if self.hosts is None else [(self.hosts.raw, self.hosts.with_local(DATA).raw)]

    def objected(self, now_ns: int, registered: Registered, words: str) -> bool:
        """The server objects to what was registered; whether it is to a name of streams, and that is given up for now:
        then the others hold at least."""
        first, last = self.ranges()[0] if self.hosts is not None else (1, 0)
        if max(first, registered.first) > min(last, registered.last):
            return False
        more = "; one program of a node has them" if registered.objection in (1, 2) else ""
        self._say(RohrpostError(f"the streams of node {self._node} do not come here: {words}{more}"))
        self.hosts, self._next_ns = None, now_ns + _REGISTER_AGAIN_NS
        self._register(now_ns)
        return True

    # What comes.

    def received(self, now_ns: int, connection: tuple[int, int], part: RecordPart | DescribedPart) -> None:
        """A part came: by this incarnation of the server, in this connection."""
        if connection != self._connection:
            self._connection = connection
            for wanted in self._wanted:
                wanted.assembly.cut()
        for wanted in self._wanted:
            if wanted.place != part.place:
                continue
            if isinstance(part, RecordPart):
                wanted.assembly.part(connection[0], part)
            else:
                wanted.assembly.described(now_ns, connection[0], part)


class _Asking:
    """Asks the TCP router which streams it sends."""

    def __init__(
        self,
        caller: Caller,
        now: Callable[[], int],
        router: Name,
        done: Callable[[BeyondStreams | RohrpostError], None],
    ) -> None:
        self._caller, self._now, self._router, self._done = caller, now, router, done
        Describing(caller, now, router, DESCRIBED_NS, self._described, _PATIENCE_NS)

    def _described(self, described: Description | CallError) -> None:
        if isinstance(described, CallError):
            return self._done(described)
        try:
            item = item_of(self._router, described, "streams", type_of_class(BeyondStreams), "data")
            number = encode(tree.U16, item.number)
            self._caller.begin(
                self._now(), self._router, wire.GET_DATA, described.hash, number, _PATIENCE_NS, self._got
            )
        except RohrpostError as error:
            self._done(error)

    def _got(self, call: Call) -> None:
        try:
            _, value = decode(Tuple((tree.U64, type_of_class(BeyondStreams))), call.outcome())
        except CallError as error:
            return self._done(error)
        except WalkError as error:
            return self._done(RohrpostError(f"its answer cannot be read: {error}"))
        found: BeyondStreams = value
        self._done(found)
