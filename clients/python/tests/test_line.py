"""Which thread of a synchronous client waits for its socket: its own, or one that calls."""

from __future__ import annotations

import os
import signal
import threading
import unittest
from collections.abc import Callable
from typing import Any
from unittest import mock

import rohrpost as rp
from rohrpost import remote
from rohrpost.remote import line

from .modules import INSTALLATION, Probe
from .router import Server
from .test_client import wait


class Interrupted(Exception):
    """Raised by a handler of signals."""


class Lines(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.close)
        self.probe = Probe()
        self.host = self.connected("probe.0")
        self.host.host("probe.0", self.probe)
        self.client = self.connected("tool.1")
        self.client.describe("probe.0", 20)

    def connected(self, own: str) -> remote.Client:
        client = remote.connect(self.server.address, own, INSTALLATION, timeout_s=20)
        self.addCleanup(client.close)
        return client

    def waiting(self) -> tuple[threading.Thread, list[Any]]:
        """A thread that calls and listens; and what comes of it."""
        found: list[Any] = []

        def call() -> None:
            try:
                found.append(self.client.call("probe.0", "wait", timeout_s=20))
            except (rp.CallError, Interrupted) as error:
                found.append(error)

        thread = threading.Thread(target=call)
        thread.start()
        wait(lambda: self.probe.waits and self.client._ears.listener)
        return thread, found

    def published(self, word: str) -> bool:
        self.probe.publish("word", word)
        return True

    def test_one_that_listens_reads_for_all(self) -> None:
        thread, found = self.waiting()
        own = self.client._ears.line
        assert own is not None
        self.assertEqual(own.watched, 0, "the client's own thread is left alone")
        with self.client.subscribe("probe.0", "word") as words:
            wait(lambda: self.published("later") and words._values)
            self.assertEqual(words.next(20).value, "later")
        self.assertEqual(self.client.status("probe.0", 20).state, rp.State.On)
        with self.assertRaises(rp.CallTimeout):
            self.client.status("probe.9", timeout_s=0.05)
        self.probe.may_go.set()
        thread.join()
        self.assertEqual(found, [None])
        self.assertIsNone(self.client._ears.listener)
        self.assertNotEqual(own.watched, 0)

    def test_one_that_listens_is_told_of_the_end_of_its_time(self) -> None:
        own = self.client._ears.line
        for connection in self.server.router.connections:
            connection.write = lambda data: None
        with self.assertRaises(rp.CallTimeout):
            self.client.status("probe.9", timeout_s=0.05)
        self.assertIs(self.client._ears.line, own, "long before the router counts as silent")

    def test_an_outage_while_one_listens(self) -> None:
        thread, found = self.waiting()
        self.server.drop_all()
        both = (self.client, self.host)
        wait(lambda: all(it.connections > 1 and it.is_up for it in both))
        self.probe.may_go.set()
        self.assertEqual(self.client.status("probe.0", 20).state, rp.State.On)
        thread.join()
        self.assertEqual(found, [None])

    def test_a_client_that_is_closed_while_one_listens_leaves_nothing_open(self) -> None:
        thread, found = self.waiting()
        self.client.close()
        thread.join()
        self.probe.may_go.set()
        self.assertEqual(str(found[0]), "this client is closed")
        ears = self.client._ears
        self.assertEqual([bell.rings.fileno() for bell in (ears._wake, ears._kick)], [-1, -1])

    def signalled(self, handler: Callable[[], None]) -> None:
        """Calls, and has a handler of signals run meanwhile, in this thread."""
        before = signal.signal(signal.SIGUSR1, lambda *_: handler())
        self.addCleanup(signal.signal, signal.SIGUSR1, before)

        def send() -> None:
            wait(lambda: self.probe.waits and self.client._ears.listener)
            os.kill(os.getpid(), signal.SIGUSR1)

        sender = threading.Thread(target=send)
        sender.start()
        self.addCleanup(sender.join)
        self.client.call("probe.0", "wait", timeout_s=20)

    @unittest.skipUnless(hasattr(signal, "SIGUSR1"), "no such signals here")
    def test_a_handler_of_signals_calls_while_the_call_that_it_interrupts_goes_on(self) -> None:
        states: list[Any] = []

        def handler() -> None:
            states.append(self.client.status("probe.0", 20).state)
            self.probe.may_go.set()
            # The answer to what was interrupted comes to the call of the handler.
            states.append(self.client.call("probe.0", "count", 2, timeout_s=20))

        self.signalled(handler)
        self.assertEqual(states, [rp.State.On, 2])

    @unittest.skipUnless(hasattr(signal, "SIGUSR1"), "no such signals here")
    def test_a_call_that_is_interrupted_leaves_the_client_well(self) -> None:
        def handler() -> None:
            raise Interrupted

        with self.assertRaises(Interrupted):
            self.signalled(handler)
        self.assertIsNone(self.client._ears.listener)
        self.assertEqual(self.client._core.own.caller._calls, [])
        self.probe.may_go.set()
        self.assertEqual(self.client.call("probe.0", "count", 1, timeout_s=20), 1)

    def test_what_is_interrupted_while_it_reads_begins_anew(self) -> None:
        received = self.client._core.received

        def interrupted(now_ns: int, data: bytes) -> None:
            if threading.current_thread() is not thread:
                return received(now_ns, data)
            raise Interrupted

        thread, found = self.waiting()
        with mock.patch.object(self.client._core, "received", interrupted), self.client.subscribe("probe.0", "word"):
            wait(lambda: self.published("comes") and found)
            thread.join()
            self.assertIsInstance(found[0], Interrupted)
            wait(lambda: self.client.connections > 1 and self.client.is_up)
        self.probe.may_go.set()
        self.assertEqual(self.client.call("probe.0", "count", 1, timeout_s=20), 1)

    def test_where_nothing_can_be_lent_calls_are_answered_even_so(self) -> None:
        with mock.patch.object(line, "_CAN_LEND", False):
            for count in range(1, 4):
                self.assertEqual(self.client.call("probe.0", "count", 1, timeout_s=20), count)


if __name__ == "__main__":
    unittest.main()
