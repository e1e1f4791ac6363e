"""A module that is hosted: its common functions, its state, its own code as work. Knows no clock and no socket."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .. import faults, wire
from ..common import (
    DescriptionPart, ExchangePage, Refused, State, Status, Subscribe, TimeReport, Unsubscribe, type_of_class,
)  # fmt: skip
from ..errors import FunctionError, Misuse, NotSent
from ..faults import Fault
from ..interface import Handler, Module
from ..marks import DataOut
from ..names import Name
from ..schema import tree
from ..schema.binary import varint
from ..schema.decode import decode
from ..schema.encode import encode
from ..schema.errors import WalkError, plain
from ..schema.tree import Tuple, Type
from ..wire import CallEnvelope, Head, Package, ReplyEnvelope, WireError, package
from .parameters import Parameters
from .publisher import Publisher, Value
from .served import IGNORE, Again, Deduplicator, Request
from .timing import SystemTime
from .work import Work, WorkQueue

_COMMON_ARGUMENTS: dict[int, Type] = {
    wire.GET_DATA: tree.U16, wire.SUBSCRIBE: type_of_class(Subscribe), wire.UNSUBSCRIBE: type_of_class(Unsubscribe),
    wire.OUTPUT_LEVEL: tree.U8, wire.DESCRIBE: tree.U32, wire.PARAMETERS: tree.U16, wire.EXCHANGE: tree.U16,
}  # fmt: skip
_OF_INTERFACE = (wire.GET_DATA, wire.SUBSCRIBE)
_WORK = (wire.ON, wire.OFF, wire.SET_PARAMETERS)
"""Common functions that run the module's own code."""


@dataclass(frozen=True)
class _Command:
    head: Head
    envelope: CallEnvelope
    arguments: bytes
    request: Request
    came_ns: int


@dataclass
class _Tick:
    handler: Handler
    period_ns: int
    due_ns: int
    is_queued: bool = False


class Hosted:
    """One module under one name."""

    def __init__(
        self,
        name: Name,
        module: Module,
        now_ns: int,
        incarnation: int,
        send: Callable[[int, Package], None],
        clock: Callable[[int], SystemTime],
        work: WorkQueue,
        monotonic_ns: Callable[[], int],
    ) -> None:
        if module.interface_.streams:
            raise Misuse(f"{type(module).__name__} has streams, which are written on the node alone (`rohrpost.run`)")
        self.name = name
        self.module = module
        self.interface = module.interface_
        self.work = work
        self.publisher = Publisher(name.raw, self._send_data)
        self.lost = 0
        self.state, self.error = State.Starting, ""
        self._send, self._clock = send, clock
        self._monotonic_ns = monotonic_ns
        self._incarnation, self._started_ns = incarnation, now_ns
        self._description = self.interface.description.to_bytes()
        self._hash = self.interface.description.hash
        self._served = Deduplicator(name, now_ns)
        self._refused = Refused()
        self._parameters = Parameters(module)
        outputs = [it for it in self.interface.outputs.values() if it.mark.rate_hz]
        self._ticks = [_Tick(it, int(1e9 / it.mark.rate_hz), now_ns) for it in outputs]
        self._ticks += [_Tick(it, int(1e9 * it.mark.period_s), now_ns) for it in self.interface.timed]
        self._switch(now_ns, True, None)

    # Commands.

    def take(self, now_ns: int, command: Package) -> None:
        """A package came to its mailbox of commands."""
        head = command.head
        try:
            envelope, arguments = CallEnvelope.split(command.body)
        except WireError:
            envelope = None
        if envelope is None or not head.is_command:
            self._refused.malformed += 1
            return
        number = head.kind
        own = self.interface.commands.get(number)
        idempotent = own.mark.idempotent if own else number < wire.FIRST_OWN
        redelivered = bool(head.options & wire.REDELIVERED)
        request = Request(
            head.sender, envelope.incarnation, envelope.sequence, envelope.valid_us * 1000, envelope.age_us * 1000,
            redelivered, idempotent,
        )  # fmt: skip
        if self.work.is_full and (number >= wire.FIRST_OWN or number in _WORK):
            return self._reply(now_ns, head, envelope, True, Fault(faults.MAILBOX_FULL).to_bytes())
        decision = self._served.decide(request, now_ns)
        if isinstance(decision, Fault):
            self._refused.no_place += decision.number == faults.BUSY
            self._reply(now_ns, head, envelope, True, decision.to_bytes())
        elif isinstance(decision, Again):
            self._reply(now_ns, head, envelope, decision.is_error, decision.body)
        elif decision != IGNORE:
            self._run(now_ns, _Command(head, envelope, arguments, request, now_ns), own)

    def _run(self, now_ns: int, command: _Command, own: Handler | None) -> None:
        number = command.head.kind
        is_of_interface = number >= wire.FIRST_OWN or number in _OF_INTERFACE
        server = self._hash if is_of_interface else wire.COMMON_HASH
        if command.envelope.interface != server:
            return self._fault(now_ns, command, Fault(faults.INTERFACE_DIFFERS, (server,)))
        if number >= wire.FIRST_OWN:
            return self._run_own(now_ns, command, own)
        try:
            value = self._common_arguments(number, command.arguments)
        except WalkError as error:
            return self._fault(now_ns, command, Fault(faults.ARGUMENTS, (str(error),)))
        if number in (wire.ON, wire.OFF):
            return self._switch(now_ns, number == wire.ON, command)
        if number == wire.SET_PARAMETERS:
            return self._set_parameters(value, command)
        result = self._common(now_ns, command, number, value)
        if isinstance(result, Fault):
            return self._fault(now_ns, command, result)
        self._done(now_ns, command, False, result)

    def _common_arguments(self, number: int, arguments: bytes) -> Any:
        if number == wire.SET_PARAMETERS:
            return self._parameters.read(arguments)
        return decode(_COMMON_ARGUMENTS.get(number, tree.UNIT), arguments)

    def _common(self, now_ns: int, command: _Command, number: int, value: Any) -> bytes | Fault:
        if number == wire.STATUS:
            return encode(type_of_class(Status), self._status(now_ns))
        if number == wire.GET_DATA:
            return self._get_data(value)
        if number == wire.SUBSCRIBE:
            return self._subscribe(now_ns, command, value)
        if number == wire.UNSUBSCRIBE:
            self.publisher.unsubscribe(command.head.sender & ~0xFF | value.mailbox, value.id)
            return b""
        if number == wire.OUTPUT_LEVEL:
            # Nobody collects lines of it.
            return b"\0" if value <= 4 else Fault(faults.ARGUMENTS, (f"variant number {value}, but only 5 known",))
        if number == wire.DESCRIBE:
            part = self._description[value : value + wire.DESCRIPTION_PART]
            return encode(type_of_class(DescriptionPart), DescriptionPart(len(self._description), part))
        if number == wire.PARAMETERS:
            return self._parameters.page(value)
        if number == wire.TIME:
            time = self._clock(now_ns)
            report = TimeReport(time.ns, time.epoch, time.error_ns, "master" if time.epoch else "local")
            return encode(type_of_class(TimeReport), report)
        if number == wire.EXCHANGE:
            return encode(type_of_class(ExchangePage), ExchangePage(0, []))
        return Fault(faults.UNKNOWN, (number,))

    def _status(self, now_ns: int) -> Status:
        uptime_ms = (now_ns - self._started_ns) // 1_000_000
        return Status(
            self.state, self.error, self._incarnation, uptime_ms, self.publisher.count, self.publisher.missed,
            self.lost, 0, 0, None, self._refused,
        )  # fmt: skip

    def _get_data(self, number: int) -> bytes | Fault:
        if number not in self.interface.outputs:
            return Fault(faults.UNKNOWN, (number,))
        newest = self.publisher.newest.get(number)
        if newest is None:
            return Fault(faults.NOTHING_YET)
        return varint(newest.stamp_ns) + newest.data

    def _subscribe(self, now_ns: int, command: _Command, wish: Subscribe) -> bytes | Fault:
        if wish.number not in self.interface.outputs:
            return Fault(faults.UNKNOWN, (wish.number,))
        if wish.mailbox < 2:
            return Fault(faults.ARGUMENTS, (f"mailbox {wish.mailbox} takes no data",))
        asked = Package(command.head, b"")
        if self.publisher.subscribe(now_ns, asked, command.envelope.incarnation, wish):
            return b""
        self._refused.no_place += 1
        return Fault(faults.BUSY)

    def _run_own(self, now_ns: int, command: _Command, own: Handler | None) -> None:
        off = self._off_fault()
        if own is None or off is not None:
            unknown = Fault(faults.UNKNOWN, (command.head.kind,))
            return self._fault(now_ns, command, unknown if own is None or off is None else off)
        function = next(it for it in self.interface.description.functions if it.number == command.head.kind)
        try:
            values = self._arguments(function.arguments, command.arguments)
        except WalkError as error:
            return self._fault(now_ns, command, Fault(faults.ARGUMENTS, (str(error),)))
        bound = getattr(self.module, own.name)

        def finish(now_ns: int, value: Any, error: BaseException | None) -> None:
            self._finish_own(now_ns, command, function.result, own, value, error)

        self.work.add(Work(lambda: self._guarded(command, bound, values), finish))

    @staticmethod
    def _arguments(fields: tuple[tree.Field, ...], data: bytes) -> tuple[Any, ...]:
        values: tuple[Any, ...] = decode(Tuple(tuple(field.type for field in fields)), data)
        return values

    def _guarded(self, command: _Command, bound: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        """Runs it unless it has become too old, or the module was switched off."""
        off = self._off_fault()
        if off is not None:
            raise _Late(off)
        request = command.request
        if request.age_ns + self._monotonic_ns() - command.came_ns > request.validity_ns:
            raise _Late(Fault(faults.EXPIRED))
        return bound(*values)

    def _off_fault(self) -> Fault | None:
        if self.state is State.Error:
            return Fault(faults.MODULE_ERROR, (self.error,))
        return None if self.state is State.On else Fault(faults.MODULE_OFF)

    def _finish_own(
        self, now_ns: int, command: _Command, type: Type, own: Handler, value: Any, error: BaseException | None
    ) -> None:
        has_own_error = own.mark.error is not None
        try:
            if isinstance(error, _Late):
                return self._fault(now_ns, command, error.fault)
            if isinstance(error, FunctionError) and has_own_error:
                result = encode(type, tree.Variant("Err", error.value))
            elif error is not None:
                return self._fault(now_ns, command, self.failed(error))
            else:
                result = encode(type, tree.Variant("Ok", value) if has_own_error else value)
        except WalkError as wrong:
            text = f"its result cannot be written: {wrong}"
            return self._fault(now_ns, command, Fault(faults.MODULE_ERROR, (text,)))
        self._done(now_ns, command, False, result)

    def failed(self, error: BaseException) -> Fault:
        """The module's own code has failed: it takes no commands until it is switched on again."""
        text = plain(f"{type(error).__name__}: {error}")[:900]
        self.state, self.error = State.Error, text
        return Fault(faults.MODULE_ERROR, (text,))

    def _switch(self, now_ns: int, on: bool, command: _Command | None) -> None:
        target = State.On if on else State.Off
        if command is not None and self.state is target:
            return self._done(now_ns, command, False, b"")
        hook = self.module.switched_on if on else self.module.switched_off

        def run() -> Any:
            return None if self.state is target else hook()

        def finish(now_ns: int, _: Any, error: BaseException | None) -> None:
            if error is None:
                self.state, self.error = target, ""
                if command is not None:
                    self._done(now_ns, command, False, b"")
                return
            fault = self.failed(error)
            if command is not None:
                self._fault(now_ns, command, fault)

        self.work.add(Work(run, finish))

    def _set_parameters(self, wish: Any, command: _Command) -> None:
        def finish(now_ns: int, value: Any, error: BaseException | None) -> None:
            if error is not None:
                return self._fault(now_ns, command, self.failed(error))
            self._done(now_ns, command, False, value)

        self.work.add(Work(lambda: self._parameters.set(wish), finish))

    # Answers.

    def _fault(self, now_ns: int, command: _Command, fault: Fault) -> None:
        self._done(now_ns, command, True, fault.to_bytes())

    def _done(self, now_ns: int, command: _Command, is_error: bool, body: bytes) -> None:
        if len(body) > wire.BODY_BYTES_MAX - 8:
            is_error, body = True, Fault(faults.TOO_LARGE, (len(body),)).to_bytes()
        self._served.done(command.request, is_error, body)
        self._reply(now_ns, command.head, command.envelope, is_error, body)

    def _reply(self, now_ns: int, head: Head, envelope: CallEnvelope, is_error: bool, body: bytes) -> None:
        if not head.sender:
            return
        front = ReplyEnvelope(envelope.incarnation, envelope.sequence).to_bytes()
        options = wire.ERROR if is_error else 0
        reply = package(head.sender, head.to, -head.kind, head.id, front + body, head.priority, options)
        try:
            self._send(now_ns, reply)
        except NotSent:
            # The caller repeats, and is answered from memory.
            return

    # Data.

    def _send_data(self, now_ns: int, data: Package) -> None:
        try:
            self._send(now_ns, data)
        except NotSent:
            # The subscriber sees the gap in the numbers.
            return

    def publish(self, now_ns: int, data: str, value: Any, stamp_ns: int | None) -> None:
        """Publishes data by its name. Raises :class:`Misuse` if there is none, or the value does not fit."""
        item = self.interface.description.data_item(data)
        if item is None:
            names = ", ".join(it.name for it in self.interface.description.data)
            raise Misuse(f"{type(self.module).__name__} has no data `{data}`; it has: {names or 'none'}")
        try:
            encoded = encode(item.field.type, value)
        except WalkError as error:
            raise Misuse(f"{type(self.module).__name__}.{data}: {error.within('value')}") from None
        most = wire.BODY_BYTES_MAX - wire.DataHead.BYTES
        if len(encoded) > most:
            raise Misuse(f"{type(self.module).__name__}.{data}: {len(encoded)} bytes, and a package holds {most}")
        stamp = self._clock(now_ns).ns if stamp_ns is None else stamp_ns
        self.publisher.publish(now_ns, item.number, Value(stamp, encoded))

    def received(self, handler: Handler, value: Any) -> None:
        """Data came that one of its functions follows. What comes while too much waits is lost, and counted."""
        if self.state is not State.On:
            return
        if self.work.is_full:
            self.lost += 1
            return
        bound = getattr(self.module, handler.name)
        run = lambda: bound(value) if self.state is State.On else None  # noqa: E731
        self.work.add(Work(run, lambda now_ns, _, error: self._noticed(error)))

    def _noticed(self, error: BaseException | None) -> None:
        if error is not None:
            self.failed(error)

    def poll(self, now_ns: int) -> int | None:
        """Adds what is due to its work; when to look again, ns."""
        due = []
        for tick in self._ticks if self.state is State.On else []:
            if now_ns >= tick.due_ns:
                passed = (now_ns - tick.due_ns) // tick.period_ns
                tick.due_ns += (passed + 1) * tick.period_ns
                if not tick.is_queued:
                    self._tick(now_ns, tick)
            due.append(tick.due_ns)
        published = self.publisher.poll(now_ns)
        return min([*due, *([] if published is None else [published])], default=None)

    def _tick(self, now_ns: int, tick: _Tick) -> None:
        tick.is_queued = True
        stamp_ns = self._clock(now_ns).ns
        bound = getattr(self.module, tick.handler.name)

        def finish(now_ns: int, value: Any, error: BaseException | None) -> None:
            tick.is_queued = False
            try:
                mark = tick.handler.mark
                if error is None and self.state is State.On and isinstance(mark, DataOut):
                    self.publish(now_ns, mark.name or tick.handler.name, value, stamp_ns)
            except Misuse as wrong:
                error = wrong
            self._noticed(error)

        self.work.add(Work(bound, finish))


class _Late(Exception):
    """A command that is not run any more."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(str(fault))
        self.fault = fault
