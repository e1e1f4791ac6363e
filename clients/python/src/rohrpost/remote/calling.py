"""A call by a description: from Python's values to a command, and from the answer back."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from .. import wire
from ..annotations import type_of
from ..common import Status, type_of_class
from ..errors import BadArguments, BadReply, FunctionError, RohrpostError
from ..faults import INTERFACE_DIFFERS
from ..names import Name
from ..schema import tree
from ..schema.decode import decode
from ..schema.description import Description, Function
from ..schema.encode import encode
from ..schema.errors import WalkError, plain
from ..schema.text import is_result
from ..schema.tree import Field, Tuple, Type
from ..errors import CallFault
from .calls import Call


class NoSuchFunction(RohrpostError, AttributeError):
    """The module has no function of that name."""


@dataclass(frozen=True)
class Prepared:
    """A command that is to be sent, and the type of its result."""

    number: int
    interface: int
    arguments: bytes
    result: Type


def function_of(to: Name, description: Description, name: str) -> Function:
    """A function by its name. Raises :class:`NoSuchFunction`."""
    function = description.function(name)
    if function is None:
        names = ", ".join(plain(it.name) for it in description.functions)
        raise NoSuchFunction(f"{to} has no function `{name}`; it has: {names or 'none'}")
    return function


def prepare(description: Description, function: Function, values: tuple[Any, ...], named: dict[str, Any]) -> Prepared:
    """Raises :class:`BadArguments`, with the argument that does not fit, and what was expected."""
    fields = function.arguments
    if not named and len(values) == len(fields):
        data = b"".join(map(_argument, fields, values))
        return Prepared(function.number, description.hash, data, function.result)
    names = [field.name for field in fields]
    unknown = [name for name in named if name not in names[len(values) :]]
    if unknown or len(values) + len(named) != len(fields):
        raise BadArguments(f"`{plain(function.name)}` takes {', '.join(map(plain, names)) or 'nothing'}")
    given = dict(zip(names, values)) | named
    return prepare(description, function, tuple(given[name] for name in names), {})


def _argument(field: Field, value: Any) -> bytes:
    try:
        return encode(field.type, value)
    except WalkError as error:
        raise BadArguments(str(error.within(field.name))) from None


def prepare_get(to: Name, description: Description, data: str) -> Prepared:
    """The command that asks for the newest data."""
    item = description.data_item(data)
    if item is None:
        names = ", ".join(plain(it.name) for it in description.data)
        raise NoSuchFunction(f"{to} has no data `{data}`; it has: {names or 'none'}")
    arguments = encode(tree.U16, item.number)
    return Prepared(wire.GET_DATA, description.hash, arguments, Tuple((tree.U64, item.field.type)))


def prepare_common(number: int, arguments: bytes = b"", result: Type = tree.UNIT) -> Prepared:
    """A function that every module has."""
    return Prepared(number, wire.COMMON_HASH, arguments, result)


STATUS = prepare_common(wire.STATUS, b"", type_of_class(Status))


def result(prepared: Prepared, call: Call) -> Any:
    """The result. Raises what went wrong, and :class:`FunctionError` for the function's own error."""
    return value_of(prepared, call.to, call.outcome())


def value_of(prepared: Prepared, to: Name, answer: bytes) -> Any:
    """What an answer says. Raises :class:`FunctionError` for the function's own error."""
    try:
        value = decode(prepared.result, answer)
    except WalkError as error:
        raise BadReply(to, str(error)) from None
    if not is_result(prepared.result):
        return value
    if value.name == "Err":
        raise FunctionError(value.value, to)
    return value.value


def is_stale(call: Call) -> bool:
    """Whether the description by which it was called is not that of the module any more."""
    return isinstance(call.error, CallFault) and call.error.fault.number == INTERFACE_DIFFERS


def expected_type(annotation: Any) -> Type | None:
    """The type that data must have, by an annotation or a class; none: any."""
    return None if annotation is None else type_of(annotation, "the expected type")


def server_of(text: str) -> tuple[str, int]:
    """Host and port of ``host:port``, ``[::1]:port`` or ``host``, of which the port is 21119."""
    match = re.fullmatch(r"\[([^\]]+)\](?::(\d{1,5}))?|([^:]+)(?::(\d{1,5}))?", text)
    if not match:
        raise ValueError(f"`{text}` is no server; write host:port, such as robot.local:21119")
    port = int(match[2] or match[4] or 21119)
    if not 0 < port < 65536:
        raise ValueError(f"`{text}`: a port is 1 to 65535")
    return match[1] or match[3], port
