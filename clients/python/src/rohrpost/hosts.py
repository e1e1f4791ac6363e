"""What runs a module on the node, as the module's class sees it; :mod:`rohrpost.node.bridge` is it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ContextManager

if TYPE_CHECKING:
    from .interface import Module, Parameter
    from .node.streams import StreamReader


class NodeHost(ABC):
    """What runs a module on the node, as the module sees it."""

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """See :attr:`Module.settings`."""

    @abstractmethod
    def publish(self, module: Module, data: str, value: Any, time_ns: int | None) -> None:
        """See :meth:`Module.publish`."""

    @abstractmethod
    def proxy(self, module: Module, name: str) -> Any:
        """See :meth:`Module.proxy`."""

    @abstractmethod
    def now_ns(self) -> int:
        """See :meth:`Module.now_ns`."""

    @abstractmethod
    def write(self, module: Module, stream: str, value: Any, time_ns: int | None) -> None:
        """See :meth:`Module.write`."""

    @abstractmethod
    def begin(
        self, module: Module, stream: str, value: Any, length: int, time_ns: int | None
    ) -> ContextManager[memoryview]:
        """See :meth:`Module.begin`."""

    @abstractmethod
    def stream(self, module: Module, name: str, stream: str, expected: Any, timeout_s: float) -> StreamReader:
        """See :meth:`Module.stream`."""

    @abstractmethod
    def watch(self, module: Module, file: Any, ready: Callable[[], Any], write: bool) -> int:
        """See :meth:`Module.watch`."""

    @abstractmethod
    def unwatch(self, module: Module, watch: int) -> bool:
        """See :meth:`Module.unwatch`."""

    @abstractmethod
    def parameter_set(self, module: Module, parameter: Parameter, value: Any) -> None:
        """The module itself has set a parameter."""
