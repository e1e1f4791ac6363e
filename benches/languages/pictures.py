"""Pictures of one byte a pixel, for all contenders alike: a line of each is written, and its mean read in place."""

import os

import numpy

from ping_pong import Stopwatch

# Of one line, whatever the size of the picture.
LINE = 1920


class Pictures:
    """Their size, and where the line is that is looked at. Arguments: width, height."""

    def __init__(self, turn):
        self.width, self.height = int(turn.own[0]), int(turn.own[1])
        self.bytes = self.width * self.height
        self.begin = self.width * (self.height // 2)
        self._turn, self._watch = turn, Stopwatch(turn)

    def line_of(self, number):
        """What is written into picture ``number``."""
        return bytes([number & 0xFF]) * LINE

    def mean(self, pixels):
        """Of the line, in place."""
        return float(numpy.frombuffer(pixels, numpy.uint8, LINE, self.begin).mean())

    def took(self, sent_ns, back_ns, mean, number):
        """One more was read; false when there are enough, which are saved then."""
        if mean != number & 0xFF:
            raise ValueError(f"the mean is {mean}, not {number & 0xFF}")
        goes_on = self._watch.took(sent_ns, back_ns)
        if not goes_on:
            self._watch.save()
        return goes_on

    @property
    def is_over(self):
        """Whether enough were read."""
        return os.path.exists(self._turn.samples)
