"""The caller's side: the calls under way of one name. Knows no clock and no socket."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ..errors import BadArguments, BadReply, CallError, CallFault, CallTimeout, NotSent, TooManyCalls
from ..faults import Fault
from ..names import ALL_SYSTEMS, REPLIES, Name
from ..schema.errors import WalkError
from ..wire import (
    BODY_BYTES_MAX, COMMAND_MAX, ERROR, VALIDITY_NS_MAX, CallEnvelope, Package, ReplyEnvelope, WireError, package,
)  # fmt: skip

CALLS_MAX = 64
"""Calls under way at a time, to all servers together."""
CALLS_MAX_EACH = 8
"""To one server: so many answers it remembers."""
_REPEATS = 3
_U32 = 0xFFFFFFFF


@dataclass(eq=False)
class Call:
    """A call under way. ``on_done`` is run once, when it is over; then ``error``, or ``result`` without one."""

    to: Name
    number: int
    interface: int
    sequence: int
    arguments: bytes
    began_ns: int
    timeout_ns: int
    on_done: Callable[[Call], None]
    options: int = 0
    repeat_ns: int = 0
    was_repeated: bool = False
    is_done: bool = False
    result: bytes = b""
    error: CallError | None = None
    extra: Any = field(default=None)

    def outcome(self) -> bytes:
        """The result's bytes. Raises what went wrong."""
        if self.error is not None:
            raise self.error
        return self.result


def is_to(to: Name, sender: Name) -> bool:
    """Whether what answers was called: itself, or that name in all systems."""
    return to.module == sender.module or to.module == Name.of(ALL_SYSTEMS, sender.klass, sender.instance)


class Caller:
    """All calls of one name. ``send`` may raise :class:`NotSent`."""

    def __init__(self, own: Name, incarnation: int, send: Callable[[int, Package], None]) -> None:
        self.own = own
        self.incarnation = incarnation
        self._send = send
        self._calls: list[Call] = []
        self._sequence = 0

    def begin(
        self,
        now_ns: int,
        to: Name,
        number: int,
        interface: int,
        arguments: bytes,
        timeout_ns: int,
        on_done: Callable[[Call], None],
        options: int = 0,
    ) -> Call:
        """Sends a command. Raises :class:`BadArguments`, :class:`TooManyCalls` or :class:`NotSent`."""
        if not 1 <= number <= COMMAND_MAX:
            raise BadArguments(f"{number} is no function's number")
        if len(arguments) + CallEnvelope.BYTES > BODY_BYTES_MAX:
            raise BadArguments(f"{len(arguments)} bytes, and a package holds {BODY_BYTES_MAX - CallEnvelope.BYTES}")
        if len(self._calls) >= CALLS_MAX or sum(call.to == to for call in self._calls) >= CALLS_MAX_EACH:
            raise TooManyCalls(to)
        self._sequence = self._sequence + 1 & _U32
        timeout_ns = min(timeout_ns, _U32 * 1000)
        call = Call(to, number, interface, self._sequence, arguments, now_ns, timeout_ns, on_done, options)
        self._try(now_ns, call, 0)
        self._calls.append(call)
        return call

    def _try(self, now_ns: int, call: Call, age_us: int) -> None:
        call.repeat_ns = now_ns + min(call.timeout_ns, VALIDITY_NS_MAX) // _REPEATS
        valid_us = min(call.timeout_ns // 1000, _U32)
        envelope = CallEnvelope(call.interface, self.incarnation, call.sequence, valid_us, age_us)
        body = envelope.to_bytes() + call.arguments
        sender = self.own.with_local(REPLIES).raw
        command = package(call.to.raw, sender, call.number, call.sequence & 0xFFFF, body, self.own.klass, call.options)
        self._send(now_ns, command)

    def forget(self, call: Call) -> None:
        """Gives a call up; its answer, should it come, is dropped."""
        if call in self._calls:
            self._calls.remove(call)

    def give_up_all(self, error: Callable[[], CallError]) -> None:
        """All calls are over, each with an error of its own."""
        for call in list(self._calls):
            self._finish(call, error())

    def take(self, reply: Package) -> None:
        """An answer came; one to nobody is dropped."""
        try:
            envelope, result = ReplyEnvelope.split(reply.body)
        except WireError:
            return
        sender = Name(reply.head.sender)
        for call in self._calls:
            is_its = call.sequence == envelope.sequence and envelope.incarnation == self.incarnation
            if is_its and call.number == -reply.head.kind and is_to(call.to, sender):
                return self._answered(call, result, bool(reply.head.options & ERROR))

    def _answered(self, call: Call, result: bytes, is_fault: bool) -> None:
        if not is_fault:
            call.result = result
            return self._finish(call, None)
        try:
            fault = Fault.from_bytes(result)
        except WalkError as error:
            return self._finish(call, BadReply(call.to, str(error)))
        # One try that was refused says nothing of the others that are under way, nor one system of others.
        if not (fault.is_of_one_try and (call.was_repeated or call.to.system == ALL_SYSTEMS)):
            self._finish(call, CallFault(call.to, fault))

    def _finish(self, call: Call, error: CallError | None) -> None:
        self._calls.remove(call)
        call.error, call.is_done = error, True
        call.on_done(call)

    def poll(self, now_ns: int) -> int | None:
        """Repeats what is to be repeated, and ends what is over; when to look again, ns."""
        for call in list(self._calls):
            if now_ns >= call.began_ns + call.timeout_ns:
                self._finish(call, CallTimeout(call.to, call.timeout_ns / 1e9))
            elif now_ns >= call.repeat_ns:
                # Age 0 means a first try.
                self._repeat(now_ns, call)
        return min((min(call.repeat_ns, call.began_ns + call.timeout_ns) for call in self._calls), default=None)

    def _repeat(self, now_ns: int, call: Call) -> None:
        call.was_repeated = True
        try:
            self._try(now_ns, call, min(max(1, (now_ns - call.began_ns) // 1000), _U32))
        except NotSent:
            # As good as one that was lost: the next one, or the timeout, takes care.
            return


def incarnation(wall_ns: int) -> int:
    """Tells a program from the one that had its name before: later, as long as clocks go on."""
    return wall_ns // 1_000_000 & _U32
