"""Modules: the class is the interface. Its description comes from annotations and docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, ContextManager, Protocol, TypeVar

from .annotations import bound_of, field_of, first_paragraph, hints_of, said, type_of
from .common import result_of
from .errors import Misuse
from .hosts import NodeHost
from .schema import tree
from .schema.description import DataItem, Description, Function
from .schema.encode import encode
from .schema.errors import WalkError
from .schema.text import show
from .schema.tree import Field, Type
from .wire import COMMAND_MAX, DATA_MAX, FIRST_OWN

if TYPE_CHECKING:
    from .node.streams import StreamReader

F = TypeVar("F", bound=Callable[..., Any])
_MARK = "__rohrpost__"
RECORD_BYTES_MAX = 64 << 20
"""Larger records are not taken, unless a program says so."""


@dataclass(frozen=True)
class Command:
    """What :func:`command` says."""

    number: int
    idempotent: bool
    error: Any


@dataclass(frozen=True)
class DataOut:
    """What :func:`data_out` says. ``rate_hz``: how often it is asked for and published; none: by ``publish`` alone."""

    number: int
    rate_hz: float | None
    unit: str


@dataclass(frozen=True)
class OnData:
    """What :func:`on_data` says. ``period_s``: none: each value; else the newest once in so many seconds."""

    publisher: str
    data: str
    period_s: float
    newest: bool


@dataclass(frozen=True)
class OnRecord:
    """What :func:`on_record` says."""

    publisher: str
    stream: str
    most_bytes: int


@dataclass(frozen=True)
class StreamOut:
    """What :func:`stream` says."""

    number: int
    unit: str


@dataclass(frozen=True)
class Every:
    """What :func:`every` says."""

    period_s: float


def command(number: int, *, idempotent: bool = False, error: Any = None) -> Callable[[F], F]:
    """A function that others call, by its number, 16 and above.

    ``idempotent``: running it twice does no harm. ``error``: the type of its own errors, which it returns by raising
    :class:`rohrpost.FunctionError`.
    """
    if not FIRST_OWN <= number <= COMMAND_MAX:
        raise Misuse(f"command {number}: numbers of own commands are {FIRST_OWN} to {COMMAND_MAX}")
    return _marked(Command(number, idempotent, error))


def data_out(number: int, *, rate_hz: float | None = None, unit: str = "") -> Callable[[F], F]:
    """Data that others ask for and subscribe to. With ``rate_hz`` the function is run so often while the module is on,
    and what it returns is published; else ``self.publish`` does."""
    if not 0 <= number <= DATA_MAX:
        raise Misuse(f"data {number}: numbers of data are 0 to {DATA_MAX}")
    if rate_hz is not None and not 0 < rate_hz <= 10_000:
        raise Misuse(f"data {number}: `rate_hz` is above 0 and at most 10000, not {rate_hz}")
    return _marked(DataOut(number, rate_hz, unit))


def stream(number: int, *, unit: str = "") -> Callable[[F], F]:
    """A stream that others read, by its name and the type that the function returns; it is never run. ``self.write``
    and ``self.begin`` write its records. For modules on the node alone."""
    if not 0 <= number <= DATA_MAX:
        raise Misuse(f"stream {number}: numbers of streams are 0 to {DATA_MAX}")
    return _marked(StreamOut(number, unit))


def every(period_s: float) -> Callable[[F], F]:
    """A function without arguments that is run once in so many seconds while the module is on."""
    if not 0.0001 <= period_s <= 86_400:
        raise Misuse(f"a period of {period_s} s: it is 0.0001 to 86400")
    return _marked(Every(period_s))


def on_data(publisher: str, data: str, *, period_s: float = 0.0, newest: bool = False) -> Callable[[F], F]:
    """A function that is run with each value of another module's data, such as ``"odometry.0", "odometry"``.

    ``period_s``: the newest value once in so many seconds. ``newest``: of values that wait only the newest counts. If
    the function's argument has an annotation, the data must be of that type.
    """
    return _marked(OnData(publisher, data, period_s, newest))


def on_record(publisher: str, stream: str, *, most_bytes: int = RECORD_BYTES_MAX) -> Callable[[F], F]:
    """A function that is run with the records of another module's stream, such as ``"camera.0", "image"``: with the
    newest, whenever its turn comes. Records of more than ``most_bytes`` are not taken. If the function's argument has
    an annotation, the records must be of that type."""
    return _marked(OnRecord(publisher, stream, most_bytes))


def _marked(mark: Command | DataOut | OnData | OnRecord | StreamOut | Every) -> Callable[[F], F]:
    def decorate(function: F) -> F:
        setattr(function, _MARK, mark)
        return function

    return decorate


class Parameter:
    """A value that tools read and set, see :func:`parameter`."""

    def __init__(self, default: Any, words: said) -> None:
        self.default = default
        self._words = words
        self.name = ""
        self.field = Field("", tree.UNIT)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def resolve(self, owner: str, annotation: Any) -> None:
        """Its type is known."""
        if annotation is None:
            raise Misuse(
                f"{owner}.{self.name}: a parameter needs its type, such as `{self.name}: float = parameter(…)`"
            )
        type = type_of(annotation, f"{owner}.{self.name}")
        least, most = (bound_of(type, it, owner, self.name) for it in (self._words.min, self._words.max))
        self.field = Field(self.name.replace("_", "-"), type, self._words.text, self._words.unit, least, most)
        self.check(self.default, owner)

    def check(self, value: Any, owner: str) -> None:
        """Whether a value is of its type and in its range."""
        try:
            encode(self.field.type, value)
        except WalkError as error:
            raise Misuse(f"{owner}.{self.name}: {error}") from None
        if not self.is_in_range(value):
            raise Misuse(f"{owner}.{self.name}: {show(self.field.type, value)} is not in its range, {self.range_text}")

    def is_in_range(self, value: Any) -> bool:
        """Whether a value of its type is in its range; what is not a number is in none."""
        least, most = self._words.min, self._words.max
        return (least is None or value >= least) and (most is None or value <= most)

    @property
    def range_text(self) -> str:
        """Its range in words."""
        least, most = (None if it is None else show(self.field.type, it) for it in (self._words.min, self._words.max))
        if least is not None and most is not None:
            return f"{least}..={most}"
        return f"at least {least}" if most is None else f"at most {most}"

    def __get__(self, instance: Any, owner: type) -> Any:
        return self if instance is None else instance.__dict__.get(self.name, self.default)

    def __set__(self, instance: Any, value: Any) -> None:
        self.check(value, type(instance).__name__)
        instance.__dict__[self.name] = value
        host = instance.__dict__.get("_host")
        if isinstance(host, NodeHost):
            host.parameter_set(instance, self, value)


def parameter(default: Any, *, min: Any = None, max: Any = None, unit: str = "", text: str = "") -> Any:
    """A parameter of a module: ``speed_m_s: float = rp.parameter(0.05, min=0.0, max=0.2, unit="m/s")``.

    Tools read and set it; ``self.speed_m_s`` is its present value.
    """
    return Parameter(default, said(unit, min, max, text))


class Host(Protocol):
    """What runs a module, as the module sees it."""

    def publish(self, module: Module, data: str, value: Any, time_ns: int | None) -> None:
        """See :meth:`Module.publish`."""

    def proxy(self, module: Module, name: str) -> Any:
        """See :meth:`Module.proxy`."""


@dataclass(frozen=True)
class Handler:
    """A function of a module, by its name, and what stands at it. ``type``: of the argument of data; none: any."""

    name: str
    mark: Any
    type: Type | None = None


@dataclass
class Interface:
    """What a class of modules offers and follows."""

    description: Description
    commands: dict[int, Handler] = field(default_factory=dict)
    outputs: dict[int, Handler] = field(default_factory=dict)
    inputs: list[Handler] = field(default_factory=list)
    records: list[Handler] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    streams: dict[int, Handler] = field(default_factory=dict)
    timed: list[Handler] = field(default_factory=list)
    settings: tuple[str, ...] = ()


class Module:
    """Base of modules::

        class Gripper(rp.Module, klass="gripper"):
            \"\"\"Holds things.\"\"\"

            @rp.command(16)
            def close(self, force_n: float) -> Grip: ...

    ``klass``: the class in the configuration. ``interface``: name of the interface, if not that of the class.
    ``settings``: names of settings besides its parameters, for the node (:attr:`settings`). Its functions run one after
    the other, so they need no locks among themselves.
    """

    interface_: ClassVar[Interface]
    _host: Host | None = None

    def __init_subclass__(
        cls, klass: str | None = None, interface: str | None = None, settings: tuple[str, ...] = (), **rest: Any
    ) -> None:
        super().__init_subclass__(**rest)
        base: Interface | None = getattr(cls, "interface_", None)
        if klass is None and base is not None:
            klass = base.description.klass
        if klass is None:
            raise Misuse(f'{cls.__name__}: of which class is it? write `class {cls.__name__}(Module, klass="…")`')
        cls.interface_ = _interface(cls, klass, interface or cls.__name__)
        cls.interface_.settings = tuple(settings) or (base.settings if base is not None else ())

    def switched_on(self) -> Any:
        """Its work begins. Yours to write; with asyncio it may be a coroutine."""

    def switched_off(self) -> Any:
        """It goes to its safe state. Yours to write; with asyncio it may be a coroutine."""

    def parameters_set(self) -> None:
        """Parameters were set. Yours to write, never as a coroutine; what it raises takes them back, and its words are
        told."""

    def publish(self, data: str, value: Any, time_ns: int | None = None) -> None:
        """Publishes data by its name. ``time_ns``: when it was true, ns since 1970; none: now."""
        self._hosted().publish(self, data, value, time_ns)

    def proxy(self, name: str) -> Any:
        """The functions of another module, such as ``motor.0``: ``self.proxy("motor.0").drive(0.3, 0.0)``. Where this
        module is hosted by asyncio, each is to be awaited."""
        return self._hosted().proxy(self, name)

    # On the node alone.

    @property
    def settings(self) -> dict[str, Any]:
        """What the configuration says under ``settings``, without parameters."""
        return self._on_node().settings

    def now_ns(self) -> int:
        """System time now, ns since 1970."""
        return self._on_node().now_ns()

    def write(self, stream: str, value: Any, time_ns: int | None = None) -> None:
        """Writes a record of a stream by its name. ``time_ns``: when it was true, ns since 1970; none: now."""
        self._on_node().write(self, stream, value, time_ns)

    def begin(self, stream: str, value: Any, length: int, time_ns: int | None = None) -> ContextManager[memoryview]:
        """A record that is filled in place: ``with self.begin("image", image, 6_220_800) as pixels: …``. The last field
        of ``value`` is bytes, and empty; ``pixels`` is a writable view of so many. After the block it is a record; an
        exception in the block gives it up."""
        return self._on_node().begin(self, stream, value, length, time_ns)

    def stream(self, module: str, stream: str, expected: Any = None, timeout_s: float = 1.0) -> StreamReader:
        """A stream of another module, such as ``"camera.0", "image", rp.Image``, to look at when this one likes.
        ``expected``: the type that its values must have; without it they are dicts, lists and numbers. The other module
        is asked what it offers, at most ``timeout_s`` seconds."""
        return self._on_node().stream(self, module, stream, expected, timeout_s)

    def watch(self, file: Any, ready: Callable[[], Any], *, write: bool = False) -> int:
        """Waits for a descriptor too, or for what has one (``fileno``): a serial line, a socket. While the module is on,
        ``ready`` is run when there is something to read (``write``: room to write), again as long as there is. Returns
        what :meth:`unwatch` takes."""
        return self._on_node().watch(self, file, ready, write)

    def unwatch(self, watch: int) -> bool:
        """Waits for it no longer; false when it was not waited for."""
        return self._on_node().unwatch(self, watch)

    def _on_node(self) -> NodeHost:
        host = self._hosted()
        if not isinstance(host, NodeHost):
            raise Misuse(f"{type(self).__name__} is not on the node: it has streams, settings and time there alone")
        return host

    def _hosted(self) -> Host:
        if self._host is None:
            raise Misuse(
                f'{type(self).__name__} is hosted by nobody yet; `client.host("name.0", module)` does it, or '
                "`rohrpost.run` on the node"
            )
        return self._host


def _interface(cls: type, klass: str, name: str) -> Interface:
    marked = [(key, getattr(value, _MARK)) for key, value in inspect.getmembers(cls) if hasattr(value, _MARK)]
    commands = [(key, mark) for key, mark in marked if isinstance(mark, Command)]
    outputs = [(key, mark) for key, mark in marked if isinstance(mark, DataOut)]
    streams = [(key, mark) for key, mark in marked if isinstance(mark, StreamOut)]
    functions = tuple(_function(cls, key, mark) for key, mark in sorted(commands, key=lambda it: it[1].number))
    given: list[tuple[str, DataOut | StreamOut]] = [*outputs, *streams]
    given.sort(key=lambda it: it[1].number)
    data = tuple(_data(cls, key, mark) for key, mark in given)
    for what, numbers in (("command", [it.number for it in functions]), ("data", [it.number for it in data])):
        twice = {number for number in numbers if numbers.count(number) > 1}
        if twice:
            raise Misuse(f"{cls.__name__}: {what} {min(twice)} is there twice")
    made = Interface(Description(name, klass, functions, data, first_paragraph(cls.__doc__)))
    made.commands = {mark.number: Handler(key, mark) for key, mark in commands}
    made.outputs = {mark.number: Handler(key, mark) for key, mark in outputs}
    made.inputs = [Handler(key, mark, _input(cls, key)) for key, mark in marked if isinstance(mark, OnData)]
    made.streams = {mark.number: Handler(key, mark) for key, mark in streams}
    made.timed = [Handler(key, mark) for key, mark in marked if isinstance(mark, Every) and not _arguments(cls, key)[0]]
    made.records = [Handler(key, mark, _input(cls, key)) for key, mark in marked if isinstance(mark, OnRecord)]
    hints = hints_of(cls) if any(isinstance(it, Parameter) for it in vars(cls).values()) else {}
    for base in reversed(cls.__mro__):
        for value in vars(base).values():
            if isinstance(value, Parameter):
                if base is cls:
                    value.resolve(cls.__name__, hints.get(value.name))
                made.parameters.append(value)
    return made


def _arguments(cls: type, name: str) -> tuple[list[str], dict[str, Any]]:
    function = getattr(cls, name)
    arguments = list(inspect.signature(function).parameters.values())[1:]
    for argument in arguments:
        if argument.kind not in (argument.POSITIONAL_ONLY, argument.POSITIONAL_OR_KEYWORD):
            raise Misuse(f"{cls.__name__}.{name}: `{argument}` cannot be sent; take arguments by position")
    return [argument.name for argument in arguments], hints_of(function)


def _function(cls: type, name: str, mark: Command) -> Function:
    arguments, hints = _arguments(cls, name)
    where = f"{cls.__name__}.{name}"
    for argument in (*arguments, "return"):
        if argument not in hints:
            raise Misuse(f"{where}: `{argument}` needs an annotation")
    fields = tuple(field_of(argument, hints[argument], where) for argument in arguments)
    result = type_of(hints["return"], where)
    if mark.error is not None:
        result = result_of(result, type_of(mark.error, where))
    text = first_paragraph(getattr(cls, name).__doc__)
    return Function(mark.number, name, fields, result, text, mark.idempotent)


def _data(cls: type, name: str, mark: DataOut | StreamOut) -> DataItem:
    arguments, hints = _arguments(cls, name)
    where = f"{cls.__name__}.{name}"
    if arguments or "return" not in hints:
        raise Misuse(f"{where}: data take no arguments, and need the annotation of what they return")
    text = first_paragraph(getattr(cls, name).__doc__)
    field = Field(name, type_of(hints["return"], where), text, mark.unit)
    return DataItem(mark.number, field, isinstance(mark, StreamOut))


def _input(cls: type, name: str) -> Type | None:
    arguments, hints = _arguments(cls, name)
    if len(arguments) != 1:
        raise Misuse(f"{cls.__name__}.{name}: it takes one argument, the value")
    annotation = hints.get(arguments[0])
    return None if annotation is None or annotation is Any else type_of(annotation, f"{cls.__name__}.{name}")
