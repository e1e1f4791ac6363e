"""Types from Python's annotations.

| annotation | type |
| --- | --- |
| ``bool``, ``int``, ``float``, ``str``, ``bytes``, ``None`` | bool, i64, f64, text, bytes, unit |
| :data:`U8` to :data:`U128`, :data:`I8` to :data:`I128`, :data:`F32`, :data:`Char` | themselves |
| ``T | None``, ``list[T]``, ``dict[K, V]``, ``tuple[A, B]`` | option, list, map, tuple |
| ``Annotated[list[T], Length(3)]`` | array |
| a class with :func:`data`: with fields, or an ``enum.Enum`` | struct, enum |
| a :class:`Choice` | enum of which variants carry something |

``Annotated[float, said(unit="m/s", min=0.0, text="Forward.")]`` says more of a field or an argument.
"""

from __future__ import annotations

import dataclasses
import enum
import inspect
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, Union, overload

from .errors import Misuse
from .schema import tree
from .schema.encode import encode
from .schema.errors import WalkError
from .schema.tree import Field, Named, Type

if TYPE_CHECKING:
    from typing_extensions import dataclass_transform
else:

    def dataclass_transform(**_: Any) -> Callable[[Any], Any]:
        """Only for type checkers."""
        return lambda decorated: decorated


T = TypeVar("T")

U8 = Annotated[int, tree.U8]
U16 = Annotated[int, tree.U16]
U32 = Annotated[int, tree.U32]
U64 = Annotated[int, tree.U64]
U128 = Annotated[int, tree.U128]
I8 = Annotated[int, tree.I8]
I16 = Annotated[int, tree.I16]
I32 = Annotated[int, tree.I32]
I64 = Annotated[int, tree.I64]
I128 = Annotated[int, tree.I128]
F32 = Annotated[float, tree.F32]
F64 = Annotated[float, tree.F64]
Char = Annotated[str, tree.CHAR]

_PLAIN: dict[Any, Type] = {
    bool: tree.BOOL, int: tree.I64, float: tree.F64, str: tree.TEXT, bytes: tree.BYTES, type(None): tree.UNIT,
    None: tree.UNIT,
}  # fmt: skip
_ATTRIBUTE = "__rohrpost_type__"


@dataclass(frozen=True)
class Length:
    """Of a list: that it always has so many elements."""

    elements: int


@dataclass(frozen=True)
class said:
    """What an author says of a field or an argument besides its type. ``unit`` counts in the interface's hash, the
    range and the text do not."""

    unit: str = ""
    min: Any = None
    max: Any = None
    text: str = ""


class Choice:
    """An enum of which variants carry something; its annotations are the variants::

        class DriveError(rp.Choice):
            NotFinite: None
            Hardware: str

        DriveError("Hardware", "no answer")

    ``name``: what others know it by, if not the class's own name.
    """

    def __init_subclass__(cls, name: str | None = None) -> None:
        super().__init_subclass__()
        variants = tuple(_variant(cls, *it) for it in _hints(cls).items())
        setattr(cls, _ATTRIBUTE, tree.Enum(name or cls.__name__, variants, _text(cls), cls))

    def __init__(self, name: str, value: Any = None) -> None:
        variants = getattr(self, _ATTRIBUTE).variants
        variant = next((it for it in variants if it.name == name), None)
        if variant is None:
            known = ", ".join(it.name for it in variants)
            raise Misuse(f"{type(self).__name__} has no variant `{name}`; there are: {known}")
        self.name = name
        """Name of the variant."""
        self.value = value
        """What it carries."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        assert isinstance(other, Choice)
        return (self.name, self.value) == (other.name, other.value)

    def __hash__(self) -> int:
        return hash((self.name, repr(self.value)))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}{'' if self.value is None else f', {self.value!r}'})"


@overload
def data(cls: type[T]) -> type[T]: ...
@overload
def data(*, name: str) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform()
def data(cls: type[T] | None = None, *, name: str | None = None) -> Any:
    """A class that travels between modules: with fields (it becomes a dataclass), or an ``enum.Enum``. ``name``: what
    others know it by, if not the class's own name. Its docstring becomes its text."""

    def decorate(cls: type[T]) -> type[T]:
        known = name or cls.__name__
        if issubclass(cls, enum.Enum):
            variants = tuple(Named(member) for member in cls.__members__)
            made: Type = tree.Enum(known, variants, _text(cls), lambda chosen, _: cls[chosen])
        else:
            made_class: Any = cls if "__dataclass_fields__" in cls.__dict__ else dataclass(cls)
            hints = _hints(made_class)
            fields = tuple(field_of(it.name, hints[it.name], cls.__name__) for it in dataclasses.fields(made_class))
            made = tree.Struct(Named(known, 3 if fields else 0, fields, _text(cls)), made_class)
        setattr(cls, _ATTRIBUTE, made)
        return cls

    return decorate if cls is None else decorate(cls)


def _variant(cls: type, name: str, annotation: Any) -> Named:
    field = field_of("", annotation, f"{cls.__name__}.{name}")
    return Named(name) if field.type == tree.UNIT else Named(name, 1, (field,))


def _text(cls: type) -> str:
    """The docstring; not the one that a dataclass makes of its fields, nor that of a base."""
    text = cls.__dict__.get("__doc__") or ""
    return "" if text.startswith(f"{cls.__name__}(") else first_paragraph(text)


def first_paragraph(text: str | None) -> str:
    """What tools show of a docstring."""
    return " ".join(inspect.cleandoc(text or "").split("\n\n")[0].split())


def _hints(cls: Any) -> dict[str, Any]:
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except (NameError, TypeError, SyntaxError) as error:
        raise Misuse(
            f"{cls.__name__}: an annotation cannot be read: {error}; define what it names before it"
        ) from error
    return hints


def hints_of(function: Any) -> dict[str, Any]:
    """A function's annotations by its arguments' names, and ``return``."""
    return _hints(function)


def field_of(name: str, annotation: Any, where: str) -> Field:
    """A field of this annotation, with what :class:`said` says of it."""
    made = type_of(annotation, f"{where}.{name}" if name else where)
    extras = typing.get_args(annotation)[1:] if typing.get_origin(annotation) is Annotated else ()
    words = next((extra for extra in extras if isinstance(extra, said)), said())
    least, most = (bound_of(made, bound, where, name) for bound in (words.min, words.max))
    return Field(name, made, words.text, words.unit, least, most)


def bound_of(type: Type, bound: Any, where: str, name: str) -> bytes | None:
    """Postcard of the end of a range."""
    try:
        return None if bound is None else encode(type, bound)
    except WalkError as error:
        raise Misuse(f"{where}.{name}: its range: {error}") from None


def type_of(annotation: Any, where: str = "the annotation") -> Type:
    """The type of an annotation. Raises :class:`Misuse` with ``where``, if it has none."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _annotated(arguments, where)
    if annotation in _PLAIN if isinstance(annotation, (type, types.NoneType)) else False:
        return _PLAIN[annotation]
    if isinstance(annotation, type) and _ATTRIBUTE in annotation.__dict__:
        found: Type = annotation.__dict__[_ATTRIBUTE]
        return found
    if origin in (Union, types.UnionType) and len(arguments) == 2 and type(None) in arguments:
        return tree.Option(type_of(arguments[0] if arguments[1] is type(None) else arguments[1], where))
    if origin is list and arguments:
        return tree.List(type_of(arguments[0], where))
    if origin is dict and arguments:
        return tree.Map(type_of(arguments[0], where), type_of(arguments[1], where))
    if origin is tuple and arguments and Ellipsis not in arguments:
        return tree.Tuple(tuple(type_of(argument, where) for argument in arguments))
    shown = getattr(annotation, "__name__", annotation)
    raise Misuse(
        f"{where}: `{shown}` has no description, so it cannot travel between modules; write `@rohrpost.data` before a "
        "class, or take one of bool, int, float, str, bytes, U8…I128, F32, Char, list, dict, tuple and `… | None`"
    )


def _annotated(arguments: tuple[Any, ...], where: str) -> Type:
    base, extras = arguments[0], arguments[1:]
    plain = next((extra for extra in extras if isinstance(extra, tree.Plain)), None)
    made = plain if plain is not None else type_of(base, where)
    length = next((extra for extra in extras if isinstance(extra, Length)), None)
    if length is None:
        return made
    if not isinstance(made, tree.List):
        raise Misuse(f"{where}: `Length` is for a list")
    return tree.Array(length.elements, made.element)
