"""A module that calls one in Rust, one call after the other. Argument: a configuration."""

import os
import signal
import time

import rohrpost as rp

from ping_pong import Stopwatch, Turn, ends_when_it_fails

turn = Turn()


class Caller(rp.Module, klass="caller"):
    """Calls."""

    @rp.every(0.01)
    @ends_when_it_fails
    def play(self) -> None:
        motor = self.proxy("motor.0")
        give_up = time.monotonic() + 20
        while True:
            try:
                motor.halt()
                break
            except rp.CallError:
                if time.monotonic() > give_up:
                    raise
        drive, watch, goes_on = motor.drive, Stopwatch(turn), True
        while goes_on:
            turn.pause()
            sent_ns = time.monotonic_ns()
            drive(0.5, 0.25)
            goes_on = watch.took(sent_ns, time.monotonic_ns())
        watch.save()
        os.kill(os.getpid(), signal.SIGTERM)


rp.run(Caller, ["--config", turn.own[0], "--name", "caller.0"])
