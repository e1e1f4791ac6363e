"""Calls a module through the TCP router, by the client that is Python alone. Arguments: address, digests, module."""

import time

from ping_pong import Stopwatch, Turn
from rohrpost import CallError, remote

turn = Turn()
server, digests, module = turn.own
# A system of its own, which no file describes.
installation = remote.Installation.with_digests(3, digests, {"motor": 200, "tool": 16})


def until_it_answers(motor):
    give_up = time.monotonic() + 20
    while True:
        try:
            return motor.halt()
        except CallError:
            if time.monotonic() > give_up:
                raise


with remote.connect(server, "tool.64", installation, label="bench", timeout_s=20) as client:
    drive = client.proxy(module, timeout_s=5).drive
    until_it_answers(client.proxy(module))
    watch = Stopwatch(turn)
    goes_on = True
    while goes_on:
        turn.pause()
        sent_ns = time.monotonic_ns()
        drive(0.5, 0.25)
        goes_on = watch.took(sent_ns, time.monotonic_ns())
watch.save()
