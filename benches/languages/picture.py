"""Writes pictures in place as one module, reads them in place as another.

Arguments: width, height; the stream, ``image`` or ``bare``, which has the pixels alone; a configuration.
"""

import os
import signal
import time

import rohrpost as rp

from ping_pong import Turn, ends_when_it_fails
from pictures import Pictures

turn = Turn()
pictures = Pictures(turn)
stream = turn.own[2]
is_bare = stream == "bare"


class Camera(rp.Module, klass="camera"):
    """Sees."""

    def __init__(self) -> None:
        self.number = 0
        width, height = pictures.width, pictures.height
        self.picture = b"" if is_bare else rp.Image(width, height, width, rp.ImageFormat.Gray8, b"")

    @rp.stream(1)
    def image(self) -> rp.Image:
        """What it sees."""

    @rp.stream(2)
    def bare(self) -> bytes:
        """Its pixels alone."""

    @rp.every(0.001)
    @ends_when_it_fails
    def see(self) -> None:
        line = pictures.line_of(self.number)
        with self.begin(stream, self.picture, pictures.bytes) as pixels:
            pixels[pictures.begin : pictures.begin + len(line)] = line
        self.number += 1
        if pictures.is_over:
            os.kill(os.getpid(), signal.SIGTERM)


class Looker(rp.Module, klass="looker"):
    """Looks."""

    def __init__(self) -> None:
        self.images, self.last = None, -1

    @rp.every(0.002)
    @ends_when_it_fails
    def look(self) -> None:
        if self.images is None:
            try:
                self.images = self.stream("camera.0", stream, bytes if is_bare else rp.Image)
            except rp.RohrpostError:
                return  # It is not there yet.
        sent_ns = time.monotonic_ns()
        try:
            with self.images.newest() as record:
                mean = pictures.mean(record.value if is_bare else record.value.pixels)
                sequence = record.sequence
        except rp.RohrpostError:
            return  # It has no record yet.
        back_ns = time.monotonic_ns()
        if sequence == self.last:
            return
        self.last = sequence
        if not pictures.took(sent_ns, back_ns, mean, sequence):
            os.kill(os.getpid(), signal.SIGTERM)


role, name = (Looker, "looker.0") if turn.is_ping else (Camera, "camera.0")
rp.run(role, ["--config", turn.own[3], "--name", name])
