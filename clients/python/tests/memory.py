"""What stands for memory that is shared, where there is no part in Rust."""

from __future__ import annotations


class Memory(bytearray):
    """As ``rohrpost._node.Shared``, but for its being writable."""

    @property
    def length(self) -> int:
        return len(self)

    @property
    def views(self) -> int:
        """At least so many."""
        try:
            self.append(0)
        except BufferError:
            return 1
        del self[-1]
        return 0
