"""Ping-pong, for all contenders in Python alike: the messages, what is measured of them, and what is checked.

Arguments of each program: ``ping`` or ``pong``, bytes, messages, warm-up, pause before each (ns), cap (ms), file for
samples, and its own.
"""

import array
import functools
import os
import sys
import time
import traceback

STOP = 2**64 - 1
# Before a turn begins, where ends must find each other first.
HANDSHAKE = STOP - 1
# As the bench's own turns: with fewer samples a turn goes on after its cap.
SAMPLES_MIN = 50


class Turn:
    """What the bench asks for."""

    def __init__(self):
        self.end, count, messages, warm_up, pause_ns, cap_ms, self.samples, *self.own = sys.argv[1:]
        self.bytes, self.messages, self.warm_up = int(count), int(messages), int(warm_up)
        self.pause_ns, self.cap_ns = int(pause_ns), int(cap_ms) * 1_000_000
        self.is_ping = self.end == "ping"

    def meet(self):
        """Waits until the other end has come as far."""
        print("ready", flush=True)
        if not sys.stdin.readline():
            raise EOFError("the bench has gone")

    def pause(self):
        """Before a message: the far end has gone to sleep by then."""
        until_ns = time.monotonic_ns() + self.pause_ns
        while time.monotonic_ns() < until_ns:
            pass


class Stopwatch:
    """Round trips: which count, and when there are enough."""

    def __init__(self, turn):
        self._turn, self._round_trips, self._done = turn, array.array("Q"), 0
        self._is_warm = turn.warm_up == 0
        self._began_ns = time.monotonic_ns()

    def took(self, sent_ns, back_ns):
        """One more; false when there are enough."""
        turn = self._turn
        self._done += 1
        if self._is_warm:
            self._round_trips.append(back_ns - sent_ns)
        spent_ns = back_ns - self._began_ns
        self._is_warm = self._is_warm or self._done >= turn.warm_up or spent_ns > turn.cap_ns // 4
        counted = len(self._round_trips)
        is_late = spent_ns > turn.cap_ns and counted >= min(SAMPLES_MIN, turn.messages)
        return self._done < turn.warm_up + turn.messages and not is_late

    def save(self):
        """Hands the round trips to the bench."""
        if sys.byteorder == "big":
            self._round_trips.byteswap()
        with open(self._turn.samples, "wb") as file:
            self._round_trips.tofile(file)


def ends_when_it_fails(function):
    """For functions of modules: a module in error goes on, and the bench would wait for it."""

    @functools.wraps(function)
    def run(*arguments):
        try:
            return function(*arguments)
        except BaseException:
            traceback.print_exc(file=sys.__stderr__)
            os._exit(1)

    return run


def message_of(number, count):
    """A message: its number, then bytes that follow from it."""
    return number.to_bytes(8, "little") + bytes([number & 0xFF]) * (count - 8)


class Ping:
    """The end that measures."""

    def __init__(self, turn):
        self._turn, self._number, self._watch = turn, 0, Stopwatch(turn)
        self._message, self._sent_ns, self.is_done = b"", 0, False

    def first(self):
        """The first message."""
        # The far end waits for it by then.
        time.sleep(0.01)
        self._message = message_of(0, self._turn.bytes)
        self._turn.pause()
        self._sent_ns = time.monotonic_ns()
        return self._message

    def came(self, echo):
        """The next message after this echo; the last one stops the other end, and nothing comes back."""
        back_ns = time.monotonic_ns()
        if echo != self._message:
            raise ValueError(f"answer {bytes(echo[:16])!r} to {self._message[:16]!r}")
        goes_on = self._watch.took(self._sent_ns, back_ns)
        self._number += 1
        self._message = message_of(self._number if goes_on else STOP, self._turn.bytes)
        self.is_done = not goes_on
        self._turn.pause()
        self._sent_ns = time.monotonic_ns()
        return self._message

    def save(self):
        """Hands the round trips to the bench."""
        self._watch.save()


class Pong:
    """The end that echoes."""

    def __init__(self):
        self._expected, self.is_done = 0, False

    def came(self, message):
        """Sees that none is missing, doubled or out of order."""
        number = int.from_bytes(message[:8], "little")
        self.is_done = number == STOP
        if number not in (self._expected, STOP):
            raise ValueError(f"message {number} came when {self._expected} was due")
        self._expected += 1
        return message

    def save(self):
        """It measures nothing."""


def play(turn, send, receive):
    """A whole turn of an end that sends, and receives when it likes."""
    if turn.is_ping:
        ping = Ping(turn)
        send(ping.first())
        while not ping.is_done:
            send(ping.came(receive()))
        ping.save()
        return
    pong = Pong()
    while True:
        message = pong.came(receive())
        if pong.is_done:
            return
        send(message)
