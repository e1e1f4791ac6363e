"""Parameters of a hosted module, as others read and set them."""

from __future__ import annotations

from typing import Any

from ..common import Change, ParameterPage, Refusal, SetParameters, result_of, type_of_class
from ..interface import Module, Parameter
from ..schema.binary import field_to_bytes
from ..schema.decode import decode
from ..schema.encode import encode
from ..schema.errors import WalkError
from ..schema.text import show
from ..schema.tree import List, Variant

_PAGE_BYTES = 768
_SET = result_of(List(type_of_class(Change)), type_of_class(Refusal))


class Parameters:
    """All of one module."""

    def __init__(self, module: Module) -> None:
        self._module = module
        self._all = module.interface_.parameters
        self._changes = 0

    def page(self, first: int) -> bytes:
        """Those from this one on, as many as fit, but at least one."""
        chosen: list[tuple[bytes, bytes]] = []
        length = 0
        for parameter in self._all[first:]:
            one = field_to_bytes(parameter.field), self._value(parameter)
            length += len(one[0]) + len(one[1])
            if chosen and length > _PAGE_BYTES:
                break
            chosen.append(one)
        return encode(type_of_class(ParameterPage), ParameterPage(len(self._all), self._changes, chosen))

    def _value(self, parameter: Parameter) -> bytes:
        return encode(parameter.field.type, getattr(self._module, parameter.name))

    @staticmethod
    def read(arguments: bytes) -> SetParameters:
        """The arguments of the function that sets them."""
        wish: SetParameters = decode(type_of_class(SetParameters), arguments)
        return wish

    def set(self, wish: SetParameters) -> bytes:
        """Sets all or none; the result as its caller reads it. Runs the module's own code."""
        new: dict[str, tuple[Parameter, Any]] = {}
        for name, data in wish.values:
            refusal = self._refusal(name, data, new)
            if refusal is not None:
                return encode(_SET, Variant("Err", refusal))
        changes = [
            Change(name, self._value(parameter), encode(parameter.field.type, value))
            for name, (parameter, value) in new.items()
        ]
        if not wish.only_check and new:
            old = {parameter.name: getattr(self._module, parameter.name) for parameter, _ in new.values()}
            try:
                for parameter, value in new.values():
                    setattr(self._module, parameter.name, value)
                self._module.parameters_set()
            except Exception as error:  # It is the author's word, whatever its class.
                for name, value in old.items():
                    setattr(self._module, name, value)
                return encode(_SET, Variant("Err", Refusal("Module", str(error))))
            self._changes += 1
        return encode(_SET, Variant("Ok", changes))

    def _refusal(self, name: str, data: bytes, new: dict[str, tuple[Parameter, Any]]) -> Refusal | None:
        if not self._all:
            return Refusal("NoParameters")
        parameter = next((it for it in self._all if it.field.name == name), None)
        if parameter is None:
            known = ", ".join(it.field.name for it in self._all)
            return Refusal("Unknown", {"name": name, "known": known})
        if name in new:
            return Refusal("Twice", name)
        try:
            value = decode(parameter.field.type, data)
        except WalkError as error:
            return Refusal("Type", {"name": name, "text": str(error)})
        if not parameter.is_in_range(value):
            shown = show(parameter.field.type, value)
            return Refusal("Range", {"name": name, "value": shown, "range": parameter.range_text})
        # Negative zero becomes zero, as in Rust.
        new[name] = parameter, value + 0.0 if isinstance(value, float) else value
        return None
