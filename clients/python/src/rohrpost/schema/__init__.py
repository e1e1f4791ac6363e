"""Types of what travels between modules, as descriptions and as bytes. ``docs/src/wire.md`` is exact."""

from .binary import type_from_bytes, type_hash, type_to_bytes
from .decode import decode
from .description import DataItem, Description, Function
from .encode import encode, parse_argument
from .errors import SchemaError, WalkError
from .interface_file import to_file
from .text import describe_field, describe_result, describe_type, is_result, show, to_json
from .tree import Array, Enum, Field, List, Map, Named, Option, Plain, Struct, Tuple, Type, Variant

__all__ = [
    "Array", "DataItem", "Description", "Enum", "Field", "Function", "List", "Map", "Named", "Option", "Plain",
    "SchemaError", "Struct", "Tuple", "Type", "Variant", "WalkError", "decode", "describe_field", "describe_result",
    "describe_type", "encode", "is_result", "parse_argument", "show", "to_file", "to_json", "type_from_bytes",
    "type_hash", "type_to_bytes",
]  # fmt: skip
