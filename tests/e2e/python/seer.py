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
        self.jumped = 0
        self.ahead = None
        self.images = None

    @rp.command(16)
    def seen(self) -> rp.U64:
        """How many whole pictures it has seen."""
        return self.pictures

    @rp.command(17)
    def jumps(self) -> rp.U64:
        """How often pictures and records were not counted alike; once for each restart of the camera."""
        return self.jumped

    def compare(self) -> None:
        """The newest record's number with its picture's."""
        try:
            self.images = self.images or self.stream("camera.0", "image", rp.Image)
            with self.images.newest() as record:
                ahead = record.value.pixels[0] - record.sequence & 255
        except rp.RohrpostError:
            return  # The camera was killed, and does not say what it offers.
        self.jumped += self.ahead not in (None, ahead)
        self.ahead = ahead

    @rp.on_record("camera.0", "image")
    def look(self, image: rp.Image) -> None:
        first = image.pixels[0]
        for row in range(image.height_px):
            begin = row * image.row_bytes
            whole = b"".join(bytes((first, row & 255, column & 255)) for column in range(image.width_px))
            if bytes(image.pixels[begin : begin + len(whole)]) != whole:
                raise ValueError(f"row {row} is of two pictures")
        self.compare()
        self.pictures += 1


rp.run(Seer)
