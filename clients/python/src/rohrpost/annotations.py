"""Types from Python's annotations.

| annotation | type |
| --- | --- |
| ``bool``, ``int``, ``float``, ``str``, ``bytes``, ``None`` | bool, i64, f64, text, bytes, unit |
| :data:`U8` to :data:`U128`, :data:`I8` to :data:`I128`, :data:`F32`, :data:`Char` | themselves |
| ``T | None``, ``list[T]``, ``dict[K, V]``, ``tuple[A, B]`` | option, list, map, tuple |
| ``Annotated[list[T], Length(3)]`` | array |
| a class with :func:`data`: with fields, or an ``enum.Enum`` | struct, enum |
| a :class:`Choice` | enum of which variants carry something |
| ``Annotated[float, wrapped("Meters")]``, ``Annotated[tuple[A, B], wrapped("Pair"), inline]`` | struct without names |
| ``Annotated[T | None, maybe]`` | option of an option |

``Annotated[float, said(unit="m/s", min=0.0, text="Forward.")]`` says more of a field or an argument.
"""

from __future__ import annotations

import dataclasses
import enum
import inspect
import operator
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
    range and the text do not. ``name``: what others know it by, where Python cannot have that name, such as `from`."""

    unit: str = ""
    min: Any = None
    max: Any = None
    text: str = ""
    name: str = ""


@dataclass(frozen=True)
class wrapped:
    """A struct of this name around one value that has no name: it adds no byte, and values are as without it. With
    :data:`inline` behind it, around the elements of a ``tuple``."""

    name: str
    text: str = ""


class _Marker(enum.Enum):
    INLINE = "inline"
    MAYBE = "maybe"


inline = _Marker.INLINE
"""Of a struct by :class:`wrapped`, or a variant of a :class:`Choice`: it has the elements of the ``tuple``, or the
fields of the class, as its own members."""
maybe = _Marker.MAYBE
"""An option of this, which may itself be ``None``: its values are ``None`` and ``Variant("Some", value)``."""


class Choice:
    """An enum of which variants carry something; its annotations are the variants::

        class DriveError(rp.Choice):
            NotFinite: None
            Hardware: str

        DriveError("Hardware", "no answer")

    ``name``: what others know it by, if not the class's own name. ``variants``: instead of annotations, where Python
    cannot have the names: ``variants={"None": None, "turn-left": float}``.
    """

    def __init_subclass__(cls, name: str | None = None, variants: dict[str, Any] | None = None) -> None:
        super().__init_subclass__()
        hints = _hints(cls) if variants is None else variants
        made = tuple(_variant(cls, *it) for it in hints.items())
        setattr(cls, _ATTRIBUTE, tree.Enum(name or cls.__name__, made, _text(cls), cls))

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
            variants = tuple(map(Named, cls.__members__))
            made: Type = tree.Enum(known, variants, _text(cls), tree.Members(cls.__members__))
        else:
            made_class: Any = cls if "__dataclass_fields__" in cls.__dict__ else dataclass(cls)
            hints = _hints(made_class)
            fields = tuple(field_of(it.name, hints[it.name], cls.__name__) for it in dataclasses.fields(made_class))
            own = {field.name: it.name for field, it in zip(fields, dataclasses.fields(made_class))}
            made = tree.Struct(Named(known, 3 if fields else 0, fields, _text(cls)), _made_by(made_class, own))
        setattr(cls, _ATTRIBUTE, made)
        return cls

    return decorate if cls is None else decorate(cls)


def _made_by(cls: Any, own: dict[str, str]) -> Any:
    """What makes values of a struct: its class; where that has other names than others know, they are put in place."""
    renamed = {known: name for known, name in own.items() if known != name}
    if not renamed:
        return cls
    cls.__rohrpost_names__ = {name: known for known, name in renamed.items()}
    for known, name in renamed.items():
        if known.startswith("__") and known.endswith("__"):
            continue  # A class of Python has its own meaning of it.
        setattr(cls, known, property(operator.attrgetter(name)))
    return lambda **members: cls(**{own[known]: value for known, value in members.items()})


def _variant(cls: type, name: str, annotation: Any) -> Named:
    where = f"{cls.__name__}.{name}"
    if annotation in (None, type(None)):
        return Named(name)
    if typing.get_origin(annotation) is Annotated and typing.get_args(annotation)[1:] == (inline,):
        base = typing.get_args(annotation)[0]
        members = base.__dict__.get(_ATTRIBUTE) if isinstance(base, type) else None
        if isinstance(members, tree.Struct) and members.named.kind == 3:
            return Named(name, 3, members.named.fields)
        return Named(name, 2, _elements(base, where))
    return Named(name, 1, (field_of("", annotation, where),))


def _elements(annotation: Any, where: str) -> tuple[Field, ...]:
    """Fields without names of a tuple's elements."""
    arguments = typing.get_args(annotation)
    if typing.get_origin(annotation) is not tuple or Ellipsis in arguments:
        raise Misuse(f"{where}: `inline` is for a tuple or a class with fields")
    return tuple(field_of("", argument, where) for argument in arguments)


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
    place = f"{where}.{name}" if name else where
    if typing.get_origin(annotation) is not Annotated:
        return Field(name, type_of(annotation, place))
    return _said_of(name, _annotated(typing.get_args(annotation), place), place)


def _said_of(name: str, made: tuple[Type, said], where: str) -> Field:
    type, words = made
    least, most = (bound_of(type, bound, where) for bound in (words.min, words.max))
    return Field(words.name or name, type, words.text, words.unit, least, most)


def bound_of(type: Type, bound: Any, where: str) -> bytes | None:
    """Postcard of the end of a range."""
    try:
        return None if bound is None else encode(type, bound)
    except WalkError as error:
        raise Misuse(f"{where}: its range: {error}") from None


def type_of(annotation: Any, where: str = "the annotation") -> Type:
    """The type of an annotation. Raises :class:`Misuse` with ``where``, if it has none."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _annotated(arguments, where)[0]
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


def _annotated(arguments: tuple[Any, ...], where: str) -> tuple[Type, said]:
    """From the inside out: what stands behind a type is of all before it."""
    base, extras = arguments[0], arguments[1:]
    made, words = type_of(base, where), said()
    for at, extra in enumerate(extras):
        if isinstance(extra, tree.Plain):
            made = extra
        elif isinstance(extra, said):
            words = extra
        elif isinstance(extra, wrapped):
            several = inline in extras[at + 1 : at + 2]
            fields = _elements(base, where) if several else (_said_of("", (made, words), where),)
            made, words = tree.Struct(Named(extra.name, 2 if several else 1, fields, extra.text)), said()
        elif isinstance(extra, Length):
            if not isinstance(made, tree.List):
                raise Misuse(f"{where}: `Length` is for a list")
            made = tree.Array(extra.elements, made.element)
        elif extra is maybe:
            made = tree.Option(made)
    return made, words
