"""What stands for memory that is shared, where there is no part in Rust."""

from __future__ import annotations


class Memory(bytearray):
    """As ``rohrpost._node.Shared``, but for its being writable, and for new views after its end."""

    @property
    def length(self) -> int:
        return len(self)

    def end(self) -> bool:
        """Whether no view is left."""
        try:
            self.append(0)
        except BufferError:
            return False
        del self[-1]
        return True
