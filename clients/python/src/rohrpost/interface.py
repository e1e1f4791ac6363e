"""Modules: the class is the interface. Its description comes from annotations and docstrings."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, ContextManager, Protocol

from .annotations import bound_of, field_of, first_paragraph, hints_of, said, type_of
from .common import result_of
from .errors import Misuse
from .hosts import NodeHost
from .marks import MARK, Command, DataOut, Every, OnData, OnRecord, StreamOut
from .schema import tree
from .schema.decode import decode
from .schema.description import DataItem, Description, Function
from .schema.encode import encode
from .schema.errors import WalkError
from .schema.text import describe_type, show
from .schema.tree import Field, Type

if TYPE_CHECKING:
    from .node.streams import StreamReader

class Parameter:
    """A value that tools read and set, see :func:`parameter`."""

    def __init__(self, default: Any, words: said) -> None:
        self.default = default
        self._words = words
        self.name = ""
        self.field = Field("", tree.UNIT)
        self._range: tuple[Any, Any] = (None, None)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def resolve(self, owner: str, annotation: Any) -> None:
        """Its type is known."""
        if annotation is None:
            raise Misuse(
                f"{owner}.{self.name}: a parameter needs its type, such as `{self.name}: float = parameter(…)`"
            )
        type = type_of(annotation, f"{owner}.{self.name}")
        if not tree.is_of_parameters(type):
            raise Misuse(
                f"{owner}.{self.name}: a parameter is bool, an integer of at most 64 bits, F32, float, str, or an enum "
                f"of words, not {describe_type(type)}"
            )
        least, most = (bound_of(type, it, f"{owner}.{self.name}") for it in (self._words.min, self._words.max))
        self.field = Field(self.name.replace("_", "-"), type, self._words.text, self._words.unit, least, most)
        self._range = (None if least is None else decode(type, least), None if most is None else decode(type, most))
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
        """Whether a value of its type is in its range; what is not a finite number is in none."""
        least, most = self._range
        if isinstance(self.field.type, tree.Plain):
            # As others get it, and its range: an `F32` has fewer digits than a `float`.
            value = decode(self.field.type, encode(self.field.type, value))
        if isinstance(value, float) and not math.isfinite(value):
            return False
        return (least is None or value >= least) and (most is None or value <= most)

    @property
    def range_text(self) -> str:
        """Its range in words."""
        least, most = (None if it is None else show(self.field.type, it) for it in (self._words.min, self._words.max))
        if least is not None and most is not None:
            return f"{least}..={most}"
        if least is None and most is None:
            return describe_type(self.field.type)
        return f"at least {least}" if most is None else f"at most {most}"

    def __get__(self, instance: Any, owner: type) -> Any:
        return self if instance is None else instance.__dict__.get(self.name, self.default)

    def __set__(self, instance: Any, value: Any) -> None:
        self.check(value, type(instance).__name__)
        host = instance.__dict__.get("_host")
        if isinstance(host, NodeHost):
            host.parameter_set(instance, self, value)
        # What others read is not refused by now.
        instance.__dict__[self.name] = value


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
    the other, so they need no locks among themselves. A class below another has its interface, and gives functions that
    it has bodies of its own; what stands at them in the base holds.
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
            interface = interface or base.description.name
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
        need not run yet. One on another node, of which nothing is known here, is asked what it offers, at most
        ``timeout_s`` seconds."""
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


def _marks(cls: type) -> list[tuple[str, Any, Any]]:
    """Names of marked functions, what stands at each, and the function at which it stands: of a base, where the class
    gives it another body."""
    found = {}
    for base in reversed(cls.__mro__):
        for key, value in vars(base).items():
            if hasattr(value, MARK):
                found[key] = (key, getattr(value, MARK), value)
            elif key in found and not callable(value):
                del found[key]
    return sorted(found.values(), key=lambda it: it[0])


def _interface(cls: type, klass: str, name: str) -> Interface:
    all_marked = _marks(cls)
    hides = [key for key, *_ in all_marked] + [key for key, it in vars(cls).items() if isinstance(it, Parameter)]
    for key in hides:
        if key in vars(Module):
            raise Misuse(
                f"{cls.__name__}.{key}: each module has a `{key}` of its own, which this would hide; take another name "
                f"(`name=\"{key}\"` in the brackets of a command, data or a stream keeps this one for others)"
            )
    declared = {key: function for key, _, function in all_marked}
    marked = [(key, mark) for key, mark, _ in all_marked]
    commands = [(key, mark) for key, mark in marked if isinstance(mark, Command)]
    commands.sort(key=lambda it: it[1].number)
    given = [(key, mark) for key, mark in marked if isinstance(mark, (DataOut, StreamOut))]
    given.sort(key=lambda it: it[1].number)
    functions = tuple(_function(cls, key, mark, declared[key]) for key, mark in commands)
    data = tuple(_data(cls, key, mark, declared[key]) for key, mark in given)
    for what, numbers in (("command", [it.number for it in functions]), ("data", [it.number for it in data])):
        twice = {number for number in numbers if numbers.count(number) > 1}
        if twice:
            raise Misuse(f"{cls.__name__}: {what} {min(twice)} is there twice")
    made = Interface(Description(name, klass, functions, data, first_paragraph(cls.__doc__)))
    made.commands = {mark.number: Handler(key, mark) for key, mark in commands}
    made.outputs = {mark.number: Handler(key, mark) for key, mark in given if isinstance(mark, DataOut)}
    made.streams = {mark.number: Handler(key, mark) for key, mark in given if isinstance(mark, StreamOut)}
    followed = [(key, mark) for key, mark in marked if isinstance(mark, (OnData, OnRecord))]
    inputs = [Handler(key, mark, _input(cls, key, declared[key])) for key, mark in followed]
    made.inputs = [it for it in inputs if isinstance(it.mark, OnData)]
    made.records = [it for it in inputs if isinstance(it.mark, OnRecord)]
    timed = [(key, mark) for key, mark in marked if isinstance(mark, Every)]
    made.timed = [Handler(key, mark) for key, mark in timed if not _arguments(cls, key, declared[key])[0]]
    hints = hints_of(cls) if any(isinstance(it, Parameter) for it in vars(cls).values()) else {}
    for base in reversed(cls.__mro__):
        for value in vars(base).values():
            if isinstance(value, Parameter):
                if base is cls:
                    value.resolve(cls.__name__, hints.get(value.name))
                made.parameters.append(value)
    return made


def _arguments(cls: type, name: str, function: Any) -> tuple[list[str], dict[str, Any]]:
    arguments = list(inspect.signature(function).parameters.values())[1:]
    for argument in arguments:
        if argument.kind not in (argument.POSITIONAL_ONLY, argument.POSITIONAL_OR_KEYWORD):
            raise Misuse(f"{cls.__name__}.{name}: `{argument}` cannot be sent; take arguments by position")
    return [argument.name for argument in arguments], hints_of(function)


def _function(cls: type, name: str, mark: Command, function: Any) -> Function:
    arguments, hints = _arguments(cls, name, function)
    where = f"{cls.__name__}.{name}"
    for argument in (*arguments, "return"):
        if argument not in hints:
            raise Misuse(f"{where}: `{argument}` needs an annotation")
    fields = tuple(field_of(argument, hints[argument], where) for argument in arguments)
    result = type_of(hints["return"], where)
    if mark.error is not None:
        result = result_of(result, type_of(mark.error, where))
    text = first_paragraph(function.__doc__)
    return Function(mark.number, mark.name or name, fields, result, text, mark.idempotent)


def _data(cls: type, name: str, mark: DataOut | StreamOut, function: Any) -> DataItem:
    arguments, hints = _arguments(cls, name, function)
    where = f"{cls.__name__}.{name}"
    if arguments or "return" not in hints:
        raise Misuse(f"{where}: data take no arguments, and need the annotation of what they return")
    field = field_of(mark.name or name, hints["return"], where)
    text = field.text or first_paragraph(function.__doc__)
    return DataItem(mark.number, replace(field, text=text, unit=mark.unit or field.unit), isinstance(mark, StreamOut))


def _input(cls: type, name: str, function: Any) -> Type | None:
    arguments, hints = _arguments(cls, name, function)
    if len(arguments) != 1:
        raise Misuse(f"{cls.__name__}.{name}: it takes one argument, the value")
    annotation = hints.get(arguments[0])
    return None if annotation is None or annotation is Any else type_of(annotation, f"{cls.__name__}.{name}")
