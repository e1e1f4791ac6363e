"""Between a module's class and the runtime in Rust, which calls :class:`Bridge`."""

from __future__ import annotations

import functools
import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from .. import _node
from ..errors import FunctionError, Misconfigured, Misuse
from ..hosts import NodeHost
from ..interface import Handler, Module, Parameter
from ..marks import DataOut, OnRecord
from ..schema import tree
from ..schema.binary import field_from_bytes, field_to_bytes, type_to_bytes
from ..schema.decode import decode
from ..schema.description import DataItem
from ..schema.encode import encode
from ..schema.errors import WalkError
from ..schema.text import describe_type
from ..schema.tree import Tuple, Type
from ..remote.calling import expected_type
from .failures import words_of
from .output import hear
from .proxies import NodeProxy
from .streams import OpenedStream, StreamReader
from .timed import Timed
from .views import Held, View, kept

if TYPE_CHECKING:
    from .._node import Shared

_LOG = logging.getLogger(__name__)
_HOPELESS = (Misconfigured, Misuse, ImportError, SyntaxError)
"""Of the configuration, of the program, and of what is installed."""
F = TypeVar("F", bound=Callable[..., Any])


def _told(method: F) -> Callable[..., str | None]:
    """Runs the author's code: what it raises becomes the text with which the module is in error."""

    @functools.wraps(method)
    def run(self: Bridge, *arguments: Any) -> str | None:
        failed = None
        try:
            method(self, *arguments)
        except BaseException as error:  # Also `sys.exit`: a module ends when launch says so.
            failed = self._failed(error)
        # The exception is gone by now, and with it what its frames held.
        return self._settled(failed)

    return run


@dataclass(frozen=True, eq=False)
class _Opened:
    """A record of a stream that is being filled; ``view``: in place."""

    stream: str
    view: View | None


class Bridge(NodeHost):
    """One module. Its public functions without a module as argument are for the runtime, and raise nothing."""

    def __init__(self, module: type[Module]) -> None:
        self._class = module
        self._interface = module.interface_
        self._items = {item.name: item for item in self._interface.description.data}
        self._numbered = {item.number: item for item in self._items.values()}
        self._functions = {function.number: function for function in self._interface.description.functions}
        self._arguments = {
            number: Tuple(tuple(field.type for field in its.arguments)) for number, its in self._functions.items()
        }
        self._module: Module | None = None
        self._settings: dict[str, Any] = {}
        self._followed: dict[int, Handler] = {}
        self._types: dict[tuple[str, bytes], Type] = {}
        self._timed = Timed([*self._interface.timed, *self._interface.outputs.values()])
        self._is_configuring = False
        self._is_hopeless = False
        """What failed last fails each time, however often the module is started."""
        self._watched: dict[int, Callable[[], Any]] = {}
        self._opened: _Opened | None = None
        self._kept: dict[str, View] = {}
        """Of records that were given up, by their streams: into their places somebody may still write."""
        self._given_up: set[str] = set()
        """Streams of those that the function which runs has given up."""

    def parameters(self) -> list[tuple[bytes, bytes]]:
        """Bytes of the field and of the default of each."""
        return [(field_to_bytes(it.field), encode(it.field.type, it.default)) for it in self._interface.parameters]

    # For the runtime.

    def make(self, name: str, settings: str, values: list[tuple[str, bytes]]) -> tuple[str, bool] | None:
        """Makes the module, switched off; or why it cannot be made, and whether that is so each time."""
        self._is_hopeless = False
        hear(True)
        failed = self._make(settings, values)
        return None if failed is None else (failed, self._is_hopeless)

    @_told
    def _make(self, settings: str, values: list[tuple[str, bytes]]) -> None:
        self._settings = json.loads(settings)
        # Before its own `__init__`, which may want its settings and parameters.
        module = self._module = self._class.__new__(self._class)
        module._host = self
        self._configure(values)
        module.__init__()  # type: ignore[misc]
        for handler in (*self._interface.inputs, *self._interface.records):
            its = handler.mark
            if isinstance(its, OnRecord):
                follow = _node.follow(its.publisher, its.stream, 0.0, False, True)
            else:
                follow = _node.follow(its.publisher, its.data, its.period_s, its.newest, False)
            self._followed[follow] = handler
        if self._timed.period_s is not None:
            _node.set_period(self._timed.period_s)

    @_told
    def on(self) -> None:
        """Its work begins."""
        self._timed.restart()
        self._its().switched_on()

    @_told
    def off(self) -> None:
        """It goes to its safe state."""
        self._its().switched_off()

    @_told
    def tick(self) -> None:
        """Runs what is due."""
        module = self._its()
        now_ns, _, epoch = _node.now()
        for handler in self._timed.due(now_ns, epoch):
            value = getattr(module, handler.name)()
            if isinstance(handler.mark, DataOut):
                item = self._numbered[handler.mark.number]
                _node.publish(item.number, now_ns, self._encoded(item, value))

    @_told
    def received(
        self, follow: int, field: bytes, data: bytes | Shared, stamp_ns: int, sequence: int, missed: int
    ) -> None:
        """Data or a record that one of its functions follows."""
        handler = self._followed[follow]
        its, length = handler.mark, len(data) if isinstance(data, bytes) else data.length
        if isinstance(its, OnRecord) and length > its.most_bytes:
            return
        type = self._types.get((handler.name, field)) or self._type(field, handler)
        try:
            held = Held(type, data)
        except WalkError as error:
            raise Misuse(f"{_followed(handler)} cannot be read: {error}") from None
        try:
            getattr(self._its(), handler.name)(held.value)
        except BaseException:
            held.release(is_told=False)
            raise
        if not held.release():
            raise kept(f"record {sequence} of {_followed(handler)}")

    @_told
    def ready(self, watch: int, readable: bool, writable: bool) -> None:
        """A descriptor is ready, or at its end."""
        if watch in self._watched:
            self._watched[watch]()

    def command(self, number: int, arguments: bytes) -> tuple[bytes | None, bool, str]:
        """Runs a function: its result; or none, whether the arguments are to blame, and why."""
        answer = self._answered(number, arguments)
        left = self._settled(answer[2] if answer[0] is None else None)
        return answer if left is None or answer[0] is None else (None, False, left)

    def _answered(self, number: int, arguments: bytes) -> tuple[bytes | None, bool, str]:
        function, handler = self._functions[number], self._interface.commands[number]
        try:
            values = decode(self._arguments[number], arguments)
        except WalkError as error:
            return None, True, str(error)
        has_error = handler.mark.error is not None
        try:
            value = getattr(self._its(), handler.name)(*values)
            result = tree.Variant("Ok", value) if has_error else value
        except BaseException as error:  # As above.
            if not (has_error and isinstance(error, FunctionError)):
                return None, False, self._failed(error)
            result = tree.Variant("Err", error.value)
        try:
            return encode(function.result, result), False, ""
        except WalkError as error:
            return None, False, f"the result of `{handler.name}` cannot be written: {error}"

    def parameters_set(self, values: list[tuple[str, bytes]]) -> str | None:
        """Parameters have new values; why the module does not want them."""
        module = self._its()
        old = {it.name: getattr(module, it.name) for it in self._interface.parameters}
        told = None
        try:
            self._configure(values)
            module.parameters_set()
        except BaseException as error:  # It is the author's word, whatever its class.
            told = str(error) or words_of(error)
        told = self._settled(told)
        if told is not None:
            module.__dict__.update(old)
        return told

    # For the module.

    @property
    def settings(self) -> dict[str, Any]:
        return self._settings

    def publish(self, module: Module, data: str, value: Any, time_ns: int | None) -> None:
        item = self._item(data, is_stream=False)
        _node.publish(item.number, time_ns, self._encoded(item, value))

    def write(self, module: Module, stream: str, value: Any, time_ns: int | None) -> None:
        item = self._written(stream)
        _node.publish(item.number, time_ns, self._encoded(item, value))

    @contextmanager
    def begin(
        self, module: Module, stream: str, value: Any, length: int, time_ns: int | None
    ) -> Iterator[memoryview]:
        item = self._written(stream)
        shared = _node.begin(item.number, time_ns, self._encoded(item, value), length)
        own = bytearray(length if shared is None else 0)
        view = None if shared is None else View(shared)
        opened = self._opened = _Opened(stream, view)
        try:
            yield memoryview(own) if view is None else view.whole
        except BaseException:
            if self._opened is opened:
                self._give_up(opened)
            raise
        if self._opened is not opened:
            raise Misuse(f"a record of `{stream}` was given up at the end of the function that began it")
        if view is not None and not view.release():
            self._give_up(opened)
            self._given_up.discard(stream)  # It is told here.
            raise _kept(stream)
        self._opened = None
        _node.finish(bytes(own))

    def proxy(self, module: Module, name: str) -> NodeProxy:
        return NodeProxy(name, 1.0)

    def now_ns(self) -> int:
        return _node.now()[0]

    def stream(self, module: Module, name: str, stream: str, expected: Any, timeout_s: float) -> StreamReader:
        what, ours = f"`{stream}` of {name}", expected_type(expected)

        def opened(timeout_s: float, is_late: bool) -> OpenedStream | None:
            found = _node.open_stream(name, stream, timeout_s, is_late)
            if found is None:
                return None
            its, field = found
            type = self._checked(field, ours, what, "it is opened for")
            return OpenedStream(its, type, field_from_bytes(field).unit, what)

        return StreamReader(opened, what, timeout_s)

    def watch(self, module: Module, file: Any, ready: Callable[[], Any], write: bool) -> int:
        number = _node.watch(file if isinstance(file, int) else file.fileno(), not write, write)
        self._watched[number] = ready
        return number

    def unwatch(self, module: Module, watch: int) -> bool:
        self._watched.pop(watch, None)
        return _node.unwatch(watch)

    def parameter_set(self, module: Module, parameter: Parameter, value: Any) -> None:
        if not self._is_configuring:
            _node.set_parameter(parameter.field.name, encode(parameter.field.type, value))

    # Its own.

    def _its(self) -> Module:
        assert self._module is not None
        return self._module

    def _failed(self, error: BaseException) -> str:
        self._is_hopeless = isinstance(error, _HOPELESS)
        _LOG.debug("in the module's code", exc_info=error)
        return words_of(error)

    def _give_up(self, opened: _Opened) -> None:
        _node.abandon()
        self._opened = None
        if opened.view is not None:
            self._kept[opened.stream] = opened.view
            self._given_up.add(opened.stream)

    def _is_free(self, stream: str, is_told: bool = True) -> bool:
        """Whether nobody can write any more into records of this stream that were given up, if that ``is_told``."""
        view = self._kept.get(stream)
        if view is not None and not view.release(is_told):
            return False
        self._kept.pop(stream, None)
        return True

    def _settled(self, failed: str | None) -> str | None:
        """A function has ended: a record that it left unfinished is given up. With what the module is in error."""
        if self._opened is not None:
            self._give_up(self._opened)
        while self._given_up:
            stream = self._given_up.pop()
            if not self._is_free(stream, is_told=failed is None):
                failed = failed or words_of(_kept(stream))
        return failed

    def _written(self, stream: str) -> DataItem:
        item = self._item(stream, is_stream=True)
        if not self._is_free(stream):
            raise _kept(stream)
        return item

    def _configure(self, values: list[tuple[str, bytes]]) -> None:
        by_name = {it.field.name: it for it in self._interface.parameters}
        self._is_configuring = True
        try:
            for name, data in values:
                setattr(self._module, by_name[name].name, decode(by_name[name].field.type, data))
        finally:
            self._is_configuring = False

    def _item(self, name: str, is_stream: bool) -> DataItem:
        item = self._items.get(name)
        if item is None or item.is_stream != is_stream:
            what = "stream" if is_stream else "data"
            names = ", ".join(it.name for it in self._items.values() if it.is_stream == is_stream)
            raise Misuse(f"{self._class.__name__} has no {what} `{name}`; it has: {names or 'none'}")
        return item

    def _encoded(self, item: DataItem, value: Any) -> bytes:
        try:
            return encode(item.field.type, value)
        except WalkError as error:
            raise Misuse(f"{self._class.__name__}.{item.name}: {error.within('value')}") from None

    def _type(self, field: bytes, handler: Handler) -> Type:
        """The type of what came for the first time, with the author's classes, if the function names one."""
        found = self._checked(field, handler.type, _followed(handler), f"`{handler.name}` takes")
        self._types[handler.name, field] = found
        return found

    @staticmethod
    def _checked(field: bytes, ours: Type | None, what: str, wants: str) -> Type:
        theirs = field_from_bytes(field).type
        if ours is None:
            return theirs
        if type_to_bytes(ours, True) != type_to_bytes(theirs, True):
            words = f"{what} is {describe_type(theirs)}, but {wants} {describe_type(ours)}"
            raise Misuse(f"{words}; names of types and units count, too")
        return ours


def _kept(stream: str) -> Misuse:
    return Misuse(
        f"a view of a record of `{stream}` that is being filled is kept, so `{stream}` takes no record until it is let "
        "go; copy what you keep: `bytes(…)`, `numpy.array(…)`"
    )


def _followed(handler: Handler) -> str:
    """What a function follows, in words."""
    its = handler.mark
    return f"`{its.stream if isinstance(its, OnRecord) else its.data}` of {its.publisher}"
