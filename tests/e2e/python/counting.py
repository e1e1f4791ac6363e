#!/usr/bin/env python3
"""A camera that counts."""

import rohrpost as rp


class Camera(rp.Module, klass="camera"):
    """Counts from 7 on."""

    def __init__(self) -> None:
        self.number = 6

    @rp.stream(1)
    def count(self) -> rp.U32:
        """How far it is."""

    @rp.every(0.01)
    def counts(self) -> None:
        """The next number."""
        self.number += 1
        self.write("count", self.number)


if __name__ == "__main__":
    rp.run(Camera)
