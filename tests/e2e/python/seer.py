#!/usr/bin/env python3
"""Looks at a camera's pictures."""

import sys

sys.path.insert(0, "PACKAGE")
sys.dont_write_bytecode = True

import rohrpost as rp  # noqa: E402


class Seer(rp.Module, klass="seer"):
    """Looks at a camera's pictures in Python."""

    def __init__(self) -> None:
        self.pictures = 0

    @rp.command(16)
    def seen(self) -> rp.U64:
        """How many whole pictures it has seen."""
        return self.pictures

    @rp.on_record("camera.0", "image")
    def look(self, image: rp.Image) -> None:
        first = image.pixels[0]
        for row in range(image.height_px):
            begin = row * image.row_bytes
            whole = b"".join(bytes((first, row & 255, column & 255)) for column in range(image.width_px))
            if bytes(image.pixels[begin : begin + len(whole)]) != whole:
                raise ValueError(f"row {row} is of two pictures")
        self.pictures += 1


rp.run(Seer)
