"""A connection of the synchronous client, and which thread waits for its bytes.

::

    the client's own thread ── selects ──▶ socket        as a rule
    a thread that calls     ── polls ────▶ socket        while it waits for its answer: nothing is handed over then

The thread that reads or writes holds the client's lock meanwhile, so the order of bytes is that of the stream. The
client's own thread looks at the socket from time to time even so: one that calls may be held up by a handler of
signals.
"""

from __future__ import annotations

import select
import selectors
import socket
import threading

from ..errors import NoConnection
from .calls import Call
from .transport import Transport

_CAN_LEND = hasattr(select, "epoll")
"""Whether what a thread waits for can be changed by another meanwhile."""


class Line:
    """A connection. ``number``: of its socket; ``broken``: why its bytes are not read any more; the client's own thread
    ends it then."""

    def __init__(self, stream: socket.socket, transport: Transport) -> None:
        self.stream = stream
        self.number = stream.fileno()
        self.transport = transport
        self.broken: OSError | NoConnection | None = None
        self.watched = 0


class Waiting:
    """A thread that waits for its call."""

    def __init__(self, ears: Ears) -> None:
        self._ears = ears
        self._turn = threading.Lock()
        self._turn.acquire()
        self.thread = threading.get_ident()
        self.listens = False
        self.before: Waiting | None = None
        """Of the same thread, which a handler of signals interrupted."""

    def over(self, _: Call) -> None:
        """It has waited long enough; the client's lock is held."""
        self._turn.release()
        is_awake = self._ears.listener is self and self.thread == threading.get_ident()
        if self.listens and not is_awake:
            self._ears.kick()

    def wait(self) -> None:
        """Until it is over."""
        self._turn.acquire()


class Ears:
    """What the client's own thread waits for. ``listener``: a call's thread that waits for the socket in its
    place. All but :meth:`select` and :meth:`listen` is for those that hold the client's lock."""

    def __init__(self) -> None:
        self.line: Line | None = None
        self.listener: Waiting | None = None
        self._is_closed = False
        self._selector = selectors.DefaultSelector()
        self._wake = _Bell()
        self._kick = _Bell()
        self._selector.register(self._wake.rings, selectors.EVENT_READ)

    def wake(self) -> None:
        """The client's own thread looks anew; from any thread, without the lock."""
        self._wake.ring()

    def kick(self) -> None:
        """The listener looks anew."""
        self._kick.ring()

    def watch(self) -> None:
        """The socket is watched as it is needed now."""
        line = self.line
        if line is None:
            return
        events = 0 if self.listener else selectors.EVENT_READ
        if line.transport.pending():
            events |= selectors.EVENT_WRITE
        if events == line.watched:
            return
        if not line.watched:
            self._selector.register(line.stream, events)
        elif not events:
            self._selector.unregister(line.stream)
        else:
            self._selector.modify(line.stream, events)
        line.watched = events

    def lend(self, waiting: Waiting) -> Line | None:
        """The line, for which this thread waits until :meth:`give_back`; none, if it cannot."""
        listener = self.listener
        if self.line is None or not _CAN_LEND or (listener is not None and listener.thread != waiting.thread):
            return None
        waiting.before, self.listener, waiting.listens = listener, waiting, True
        self.watch()
        return self.line

    def give_back(self, waiting: Waiting) -> None:
        """It waits no more."""
        if self.listener is waiting:
            self.listener, waiting.listens = waiting.before, False
            self.watch()
            if self.listener is not None:
                # What was for it may have been taken meanwhile.
                self.kick()
        if self._is_closed and self.listener is None:
            self._end()

    def listen(self, line: Line) -> None:
        """Waits until something comes, or for :meth:`kick`."""
        poll = select.poll()
        # By its number: it may have been dropped just now, and then the bell rings, too.
        poll.register(line.number, select.POLLIN)
        poll.register(self._kick.rings, select.POLLIN)
        for ready, _ in poll.poll():
            if ready == self._kick.rings.fileno():
                self._kick.hush()

    def select(self, timeout_s: float) -> bool:
        """Waits so long, or until something comes, or for :meth:`wake`; whether the socket is to be read."""
        is_ready = self.listener is not None
        for key, _ in self._selector.select(timeout_s):
            if key.fileobj is self._wake.rings:
                self._wake.hush()
            else:
                is_ready = True
        return is_ready

    def drop(self) -> None:
        """The line is no more."""
        line, self.line = self.line, None
        if line is not None:
            if line.watched:
                self._selector.unregister(line.stream)
            self.kick()
            line.stream.close()

    def close(self) -> None:
        """All is over; a listener may still look at its bell."""
        self.drop()
        self._is_closed = True
        self._selector.close()
        if self.listener is None:
            self._end()

    def _end(self) -> None:
        self._wake.close()
        self._kick.close()


class _Bell:
    """Wakes a thread that waits for sockets."""

    def __init__(self) -> None:
        self.rings, self._end = socket.socketpair()
        for end in (self.rings, self._end):
            end.setblocking(False)

    def ring(self) -> None:
        try:
            self._end.send(b"\0")
        except (BlockingIOError, OSError):
            # It rings, or is closed.
            return

    def hush(self) -> None:
        try:
            self.rings.recv(4096)
        except BlockingIOError:
            return

    def close(self) -> None:
        self.rings.close()
        self._end.close()
