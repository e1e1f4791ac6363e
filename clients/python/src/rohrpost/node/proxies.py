"""Functions of other modules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .. import _node
from ..errors import BadReply, CallFault
from ..faults import INTERFACE_DIFFERS
from ..names import Name
from ..remote.calling import Prepared, function_of, prepare, prepare_get, value_of
from ..schema.description import Description
from ..schema.errors import SchemaError
from ..schema.tree import U16
from ..schema.decode import decode_front


class NodeProxy:
    """The functions of a module as methods, by its own description: ``self.proxy("motor.0").drive(0.3, 0.0)``."""

    def __init__(self, module: str, timeout_s: float) -> None:
        self._module, self._timeout_s = module, timeout_s
        self._known: tuple[Name, Description] | None = None

    def __getattr__(self, function: str) -> Callable[..., Any]:
        if function.startswith("__"):
            raise AttributeError(function)

        def call(*values: Any, **named: Any) -> Any:
            def its(to: Name, described: Description) -> Prepared:
                return prepare(described, function_of(to, described, function), values, named)

            def send(it: Prepared) -> bytes:
                return _node.call(self._module, it.interface, it.number, it.arguments, self._timeout_s)

            return self._asked(its, send)

        return call

    def get(self, data: str) -> tuple[int, Any]:
        """Its newest data of this name: their time, ns since 1970, and the value."""

        def send(it: Prepared) -> bytes:
            number, _ = decode_front(U16, it.arguments)
            return _node.get(self._module, it.interface, number, self._timeout_s)

        found: tuple[int, Any] = self._asked(lambda to, described: prepare_get(to, described, data), send)
        return found

    def _asked(self, make: Callable[[Name, Description], Prepared], send: Callable[[Prepared], bytes]) -> Any:
        for is_last in (False, True):
            prepared = make(*self._described())
            try:
                answer = send(prepared)
            except CallFault as error:
                if error.fault.number != INTERFACE_DIFFERS or is_last:
                    raise
                # It is another by now, as it says itself or as another proxy has met it, and nothing was run.
                self._known = None
                _node.forget(self._module)
                continue
            return value_of(prepared, self._described()[0], answer)

    def _described(self) -> tuple[Name, Description]:
        if self._known is None:
            raw, described = _node.peer(self._module, self._timeout_s)
            try:
                self._known = Name(raw), Description.from_bytes(described)
            except SchemaError as error:
                raise BadReply(Name(raw), str(error)) from None
        return self._known
