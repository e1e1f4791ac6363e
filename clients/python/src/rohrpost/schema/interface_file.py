"""An interface as a file, of which ``rohrpost interface generate`` makes code of other languages. It is what
``rohrpost interface export --json`` writes of a module that runs."""

from __future__ import annotations

import json
from typing import Any

from .decode import decode
from .description import DataItem, Description, Function
from .errors import WalkError
from .text import to_json
from .tree import Array, Field, List, Map, Named, Option, Plain, Struct, Tuple, Type

FORMAT = 1
"""Raised when older programs would misunderstand a file."""


def to_file(description: Description) -> str:
    """The file of an interface."""
    told = {
        "format": FORMAT,
        "hash": f"{description.hash:#010x}",
        "name": description.name,
        "class": description.klass,
        "text": description.text,
        "functions": [_function(function) for function in description.functions],
        "data": [_data_item(item) for item in description.data],
    }
    return json.dumps(told, indent=2, ensure_ascii=False)


def _function(function: Function) -> dict[str, Any]:
    return {
        "number": function.number,
        "name": function.name,
        "text": function.text,
        "idempotent": function.idempotent,
        "arguments": [_field(argument) for argument in function.arguments],
        "result": _type(function.result),
    }


def _data_item(item: DataItem) -> dict[str, Any]:
    return {"number": item.number, "kind": "stream" if item.is_stream else "data", **_field(item.field)}


def _field(field: Field) -> dict[str, Any]:
    words = {"name": field.name, "text": field.text, "unit": field.unit}
    told: dict[str, Any] = {key: word for key, word in words.items() if word}
    told["type"] = _type(field.type)
    for key, bound in (("min", field.least), ("max", field.most)):
        try:
            told |= {} if bound is None else {key: to_json(field.type, decode(field.type, bound))}
        except WalkError:
            continue
    return told


def _named(named: Named) -> dict[str, Any]:
    members: Any = "none"
    if named.kind == 1:
        members = {"one": _field(named.fields[0])}
    elif named.kind > 1:
        members = {"tuple" if named.kind == 2 else "fields": [_field(field) for field in named.fields]}
    return {"name": named.name, **({"text": named.text} if named.text else {}), "members": members}


def _type(type: Type) -> Any:
    if isinstance(type, Plain):
        return type.name
    if isinstance(type, Option):
        return {"option": _type(type.inner)}
    if isinstance(type, List):
        return {"list": _type(type.element)}
    if isinstance(type, Array):
        return {"array": [type.length, _type(type.element)]}
    if isinstance(type, Map):
        return {"map": [_type(type.key), _type(type.value)]}
    if isinstance(type, Tuple):
        return {"tuple": [_type(element) for element in type.elements]}
    if isinstance(type, Struct):
        return {"struct": _named(type.named)}
    text = {"text": type.text} if type.text else {}
    return {"enum": {"name": type.name, **text, "variants": [_named(variant) for variant in type.variants]}}
