"""What a module tells of itself: its functions and data."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from .binary import Reader, Writer, hash_of
from .tree import Field, Type


@dataclass(frozen=True)
class Function:
    """A function that can be called."""

    number: int
    name: str
    arguments: tuple[Field, ...]
    result: Type
    text: str = ""
    idempotent: bool = False


@dataclass(frozen=True)
class DataItem:
    """Data that can be asked for or subscribed to."""

    number: int
    field: Field
    is_stream: bool = False

    @property
    def name(self) -> str:
        """Name of its field."""
        return self.field.name


@dataclass(frozen=True)
class Description:
    """What an interface offers. A module answers ``describe`` with it."""

    name: str
    klass: str
    functions: tuple[Function, ...]
    data: tuple[DataItem, ...]
    text: str = ""

    def to_bytes(self) -> bytes:
        """As it is sent."""
        return self._written(bare=False)

    @staticmethod
    def from_bytes(data: bytes) -> Description:
        """Reads what :meth:`to_bytes` wrote. Raises :class:`SchemaError`."""
        return Reader.whole(data, _description)

    @cached_property
    def hash(self) -> int:
        """Tells interfaces apart: callers and servers must have the same."""
        return hash_of(self._written(bare=True))

    def function(self, name: str) -> Function | None:
        """A function by its name."""
        return next((function for function in self.functions if function.name == name), None)

    def data_item(self, name: str) -> DataItem | None:
        """Data or a stream by its name."""
        return next((item for item in self.data if item.name == name), None)

    def _written(self, bare: bool) -> bytes:
        writer = Writer(bare)
        writer.text(self.name)
        writer.text(self.klass)
        writer.said(self.text)
        writer.number(len(self.functions))
        for function in self.functions:
            writer.number(function.number)
            writer.text(function.name)
            writer.said(function.text)
            writer.byte(int(function.idempotent))
            writer.fields(function.arguments)
            writer.type(function.result)
        writer.number(len(self.data))
        for item in self.data:
            writer.number(item.number)
            writer.byte(int(item.is_stream))
            writer.field(item.field)
        return bytes(writer.bytes)


def _description(reader: Reader) -> Description:
    name, klass, text = reader.text(), reader.text(), reader.text()
    functions = reader.many(_function)
    return Description(name, klass, functions, reader.many(_data_item), text)


def _function(reader: Reader) -> Function:
    number, name, text, idempotent = reader.number(16), reader.text(), reader.text(), reader.flag("yes or no")
    arguments = reader.many(Reader.field)
    return Function(number, name, arguments, reader.type(), text, idempotent)


def _data_item(reader: Reader) -> DataItem:
    number, is_stream = reader.number(16), reader.flag("kind of data")
    return DataItem(number, reader.field(), is_stream)
