"""Both clients over real sockets, at a router of this test."""

from __future__ import annotations

import os
import socket
import threading
import time
import unittest
from collections.abc import Callable
from typing import Any

import rohrpost as rp
from rohrpost import remote
from rohrpost.common import SetParameters, type_of_class
from rohrpost.faults import ARGUMENTS, INTERFACE_DIFFERS, INTERRUPTED, MODULE_ERROR, MODULE_OFF
from rohrpost.remote.parameters import _SET
from rohrpost.schema import decode, encode

from .modules import INSTALLATION, Probe, Refused
from .router import Server


def wait(is_so: Callable[[], Any]) -> Any:
    """Until it is so; a busy computer takes its time."""
    until = time.monotonic() + 30
    while time.monotonic() < until:
        found = is_so()
        if found:
            return found
        time.sleep(0.005)
    raise AssertionError("waited in vain")


class Clients(unittest.TestCase):
    connect: Callable[..., Any] = staticmethod(remote.connect)
    """The client under test; :mod:`.test_aio` has the other one."""

    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.close)
        self.probe = Probe()
        self.host = self.connected("probe.0")
        self.host.host("probe.0", self.probe)
        self.client = self.connected("tool.1")

    def connected(self, own: str, **how: Any) -> remote.Client:
        client: remote.Client = self.connect(self.server.address, own, INSTALLATION, timeout_s=20, **how)
        self.addCleanup(client.close)
        return client

    def by_the_host(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of the hosted module, to be called from here."""
        return function

    def call(self, function: str, *values: Any) -> Any:
        return self.client.call("probe.0", function, *values, timeout_s=20)

    def test_faults_and_errors_are_exceptions(self) -> None:
        self.assertEqual(self.call("count", 2), 2)
        self.assertEqual(self.client.proxy("probe.0", 20).count(by=3), 5)
        with self.assertRaises(rp.FunctionError) as refused:
            self.call("refuse", "no")
        value = refused.exception.value
        self.assertEqual(Refused(value.name, value.value), Refused("Because", "no"))
        for values, why in [((), "takes by"), ((-1,), "by: -1 is out of range"), ((1, 2), "takes by")]:
            with self.assertRaisesRegex(rp.BadArguments, why):
                self.call("count", *values)
        with self.assertRaisesRegex(remote.NoSuchFunction, "it has: count, refuse, fail, wait, wrong"):
            self.call("fly")
        with self.assertRaisesRegex(rp.CallFault, "its result cannot be written: 300 is out of range"):
            self.call("wrong")
        with self.assertRaises(rp.CallTimeout) as late:
            self.client.status("probe.9", timeout_s=0.2)
        self.assertEqual(
            str(late.exception), "no answer from 7.96.9.0 within 200ms; does it run, and is it not too busy?"
        )
        with self.assertRaises(rp.CallFault) as fault:
            self.client.command("probe.0", 16, self.client.describe("probe.0").hash, b"", 20)
        self.assertEqual(fault.exception.fault.number, ARGUMENTS)

    def test_nothing_that_comes_ends_a_client(self) -> None:
        # A mistake of this package, say, that one package brings out.
        received, kept = self.host._core.received, threading.Event()

        def fails(now_ns: int, data: bytes) -> None:
            if not kept.is_set():
                kept.set()
                raise ZeroDivisionError("unforeseen")
            received(now_ns, data)

        with self.assertLogs("rohrpost", "ERROR"):
            self.host._core.received = fails  # type: ignore[method-assign]
            wait(kept.is_set)
            wait(lambda: self.host._core.session.is_up)
        self.assertEqual(self.call("count", 2), 2)

    def test_what_fails_when_it_is_due_costs_a_connection_and_no_client(self) -> None:
        def failing_once(works: Any) -> Any:
            has_failed: list[bool] = []

            def fails(*values: Any) -> Any:
                if not has_failed:
                    has_failed.append(True)
                    raise ZeroDivisionError("unforeseen")
                return works(*values)

            return fails

        core = self.host._core
        for of, name in [(core.own.caller, "poll"), (core.session, "ready")]:
            before = self.host.connections
            with self.assertLogs("rohrpost", "ERROR"):
                setattr(of, name, failing_once(getattr(of, name)))
                wait(lambda: self.host.connections > before and self.host.is_up)
        self.assertEqual(self.call("count", 2), 2)

    def test_the_reason_of_such_a_failure_is_told_and_it_is_tried_again_with_pauses(self) -> None:
        core, polls = self.client._core, 0

        def fails(now_ns: int) -> int | None:
            nonlocal polls
            polls += 1
            raise ZeroDivisionError("unforeseen")

        with self.assertLogs("rohrpost", "ERROR"):
            core.own.caller.poll = fails  # type: ignore[method-assign]
            wait(lambda: "what is due cannot be done: ZeroDivisionError: unforeseen" in self.client.words)
            # One that fails without a connection, too, is no loop without a pause.
            until_ns = time.monotonic_ns() + 300_000_000
            wait(lambda: time.monotonic_ns() > until_ns)
        self.assertLess(polls, 20)

    def test_what_is_lost_or_doubled_on_the_way_runs_once(self) -> None:
        turn = iter(range(10**9))
        # Each package is lost, comes once or comes twice.
        self.server.router.sees = lambda package: next(turn) % 3
        answered = 0
        for _ in range(30):
            try:
                self.client.call("probe.0", "count", 1, timeout_s=0.6)
                answered += 1
            except rp.CallTimeout:
                continue
            except rp.CallFault as error:
                # A server that has just begun cannot know whether one before it has run a repeat.
                self.assertEqual(error.fault.number, INTERRUPTED)
        self.server.router.sees = lambda package: 1
        counted = self.call("count", 0)
        self.assertGreater(answered, 0)
        self.assertTrue(answered <= counted <= 30, f"{answered} answered, {counted} run")

    def test_a_module_that_fails_takes_no_commands_until_it_is_switched(self) -> None:
        with self.assertRaises(rp.CallFault) as fault:
            self.call("fail")
        self.assertEqual(fault.exception.fault.number, MODULE_ERROR)
        self.assertEqual(str(fault.exception), "7.96.0.0: the module is in error: RuntimeError: broken\\n\\u{1b}[31m")
        with self.assertRaises(rp.CallFault):
            self.call("count", 1)
        status = self.client.status("probe.0", 20)
        self.assertEqual((status.state, status.error), (rp.State.Error, "RuntimeError: broken\\n\\u{1b}[31m"))
        self.client.switch("probe.0", False, 20)
        with self.assertRaises(rp.CallFault) as fault:
            self.call("count", 1)
        self.assertEqual(fault.exception.fault.number, MODULE_OFF)
        self.client.switch("probe.0", True, 20)
        self.assertEqual(self.call("count", 1), 1)
        self.assertEqual(self.probe.changes, ["on", "off", "on"])

    def test_a_command_that_waited_too_long_behind_another_is_not_run(self) -> None:
        busy = threading.Thread(target=lambda: self.call("wait"))
        busy.start()
        wait(lambda: self.probe.waits)
        other = self.connected("tool.2")
        with self.assertRaises(rp.CallTimeout):
            other.call("probe.0", "count", 1, timeout_s=0.3)
        over_ns = time.monotonic_ns() + 300_000_000
        wait(lambda: time.monotonic_ns() > over_ns)
        self.probe.may_go.set()
        busy.join()
        self.assertEqual(self.call("count", 0), 0)

    def test_threads_share_a_client(self) -> None:
        wrong: list[object] = []

        def work() -> None:
            proxy = self.client.proxy("probe.0", 20)
            for _ in range(50):
                try:
                    proxy.count(1)
                except rp.TooManyCalls:
                    wrong.append("too many")
                except BaseException as error:  # Whatever it is, the test has to see it.
                    wrong.append(error)

        threads = [threading.Thread(target=work) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(wrong, [])
        self.assertEqual(self.call("count", 0), 400)

    def test_more_calls_than_a_server_remembers_are_refused(self) -> None:
        calls = [threading.Thread(target=lambda: self.call("wait")) for _ in range(8)]
        self.client.describe("probe.0", 20)
        for call in calls:
            call.start()
        wait(lambda: len(self.client._core.own.caller._calls) == 8)
        with self.assertRaisesRegex(rp.TooManyCalls, "too many calls to 7.96.0.0 are under way"):
            self.call("count", 1)
        self.probe.may_go.set()
        for call in calls:
            call.join()

    def test_data_come_and_go_on_after_an_outage(self) -> None:
        with self.client.subscribe("probe.0", "beat") as beats:
            self.assertEqual([beats.next(20).sequence for _ in range(3)], [0, 1, 2])
            self.server.drop_all()
            wait(lambda: self.client.connections > 1 and self.host.connections > 1)
            before = self.call("count", 7)
            wait(lambda: beats.next(20).value == before)

    def test_what_is_closed_ends_there_and_here(self) -> None:
        def subscribers() -> int:
            count: int = self.client.status("probe.0", 20).subscribers
            return count

        with self.client.subscribe("probe.0", "beat") as beats:
            beats.next(20)
            self.assertEqual(subscribers(), 1)
        wait(lambda: subscribers() == 0)
        beats.close()
        with self.assertRaisesRegex(rp.Misuse, "this subscription is closed"):
            while True:
                beats.next(20)
        self.client.close()
        beats.close()

    def test_what_a_module_publishes_itself_is_its_newest_data(self) -> None:
        publish = self.by_the_host(self.probe.publish)
        publish("word", "hello", 123)
        self.assertEqual(self.client.get("probe.0", "word", 20), (123, "hello"))
        for data, value, why in [
            ("text", "", "Probe has no data `text`; it has: beat, word"),
            ("word", 5, "value: expected text, got `5`"),
            ("word", "x" * 70_000, "Probe.word: 70003 bytes"),
        ]:
            with self.assertRaisesRegex(rp.Misuse, why):
                publish(data, value)

    def test_a_module_that_was_replaced_by_one_with_another_interface_is_asked_anew(self) -> None:
        class First(rp.Module, klass="probe"):
            @rp.data_out(1, rate_hz=50)
            def beat(self) -> int:
                return 1

            @rp.command(16)
            def one(self) -> int:
                return 1

        class Second(rp.Module, klass="probe"):
            @rp.data_out(7, rate_hz=50)
            def beat(self) -> str:
                return "two"

            @rp.command(20)
            def one(self) -> str:
                return "two"

        first = self.connected("probe.3")
        first.host("probe.3", First())
        with self.client.subscribe("probe.3", "beat") as beats:
            self.assertEqual(beats.next(20).value, 1)
            self.assertEqual(self.client.call("probe.3", "one", timeout_s=20), 1)
            first.close()
            self.connected("probe.3").host("probe.3", Second())
            with self.assertRaises(rp.CallFault) as fault:
                self.client.call("probe.3", "one", timeout_s=20)
            self.assertEqual(fault.exception.fault.number, INTERFACE_DIFFERS)
            self.assertEqual(self.client.call("probe.3", "one", timeout_s=20), "two")
            wait(lambda: beats.next(20).value == "two")

    def test_data_of_another_type_are_told(self) -> None:
        with self.client.subscribe("probe.0", "beat", expected=rp.Odometry) as wrong:
            with self.assertRaisesRegex(remote.NoSuchData, "data `beat` are u64, and not {pose"):
                wait(lambda: wrong.next(0.2))
        with self.client.subscribe("probe.0", "heat") as missing:
            with self.assertRaisesRegex(remote.NoSuchData, "no data `heat`; it has: beat, word"):
                wait(lambda: missing.next(0.2))

    @unittest.skipUnless(hasattr(os, "fork"), "no fork here")
    def test_a_forked_child_is_told_to_open_its_own(self) -> None:
        read, write = os.pipe()
        pid = os.fork()
        if pid == 0:
            try:
                self.client.status("probe.0")
            except rp.Misuse as error:
                os.write(write, str(error).encode())
            os._exit(0)
        os.waitpid(pid, 0)
        self.assertIn(b"was opened before a fork", os.read(read, 1000))
        self.assertEqual(self.call("count", 1), 1, "the parent's goes on")

    def test_a_closed_client_says_so_and_ends_its_calls(self) -> None:
        found: list[BaseException] = []

        def call() -> None:
            try:
                self.call("wait")
            except rp.CallError as error:
                found.append(error)

        thread = threading.Thread(target=call)
        thread.start()
        wait(lambda: self.probe.waits)
        self.client.close()
        thread.join()
        self.probe.may_go.set()
        self.assertEqual(str(found[0]), "this client is closed")
        with self.assertRaisesRegex(rp.Misuse, "this client is closed"):
            self.client.status("probe.0")

    def test_what_is_in_the_way_of_a_connection_is_told(self) -> None:
        free = socket.create_server(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
        free.close()
        with self.assertRaisesRegex(rp.NoConnection, f"the TCP router at {address} is not reached"):
            self.connect(address, "tool.1", INSTALLATION, timeout_s=1)
        nowhere = "x" * 64 + ".invalid:1"
        with self.assertRaisesRegex(rp.NoConnection, "is not reached: .*label"):
            self.connect(nowhere, "tool.1", INSTALLATION, timeout_s=1)
        with self.connect(address, "tool.1", INSTALLATION, timeout_s=0) as ends:
            threading.Timer(0.1, ends.close).start()
            with self.assertRaisesRegex(rp.Misuse, "this client is closed"):
                ends.wait_until_up(20)
        other = remote.Installation(7, {"tool": 16}, 8, 1)
        with self.assertRaisesRegex(rp.NoConnection, "the common digest here is 0000000000000008"):
            self.connect(self.server.address, "tool.1", other, timeout_s=1)
        with self.assertRaisesRegex(rp.NoConnection, "there is no .*ca.pem"):
            self.connect(self.server.address, "tool.1", INSTALLATION, tls=remote.Tls("nowhere", "x"))
        with self.assertRaisesRegex(rp.BadName, "no class `motor` is known here; there are: probe, tool"):
            self.client.proxy("motor.0")
        with self.assertRaisesRegex(rp.Misuse, "is not of this client's system"):
            self.client.host("8.96.0.0", Probe())
        with self.assertRaisesRegex(rp.Misuse, "Probe is hosted already"):
            self.host.host("probe.1", self.probe)

    def test_parameters_are_set_all_or_none(self) -> None:
        for values, name in [
            ([("gain", b"\x03")], "Ok"),
            ([("gain", b"\x0a")], "Range"),
            ([("gain", b"")], "Type"),
            ([("pain", b"\x03")], "Unknown"),
            ([("gain", b"\x04"), ("gain", b"\x05")], "Twice"),
            ([("gain", b"\x07")], "Module"),
        ]:
            wish = encode(type_of_class(SetParameters), SetParameters(values, False))
            answer = decode(_SET, self.client.command("probe.0", 10, 4, wish, 20))
            self.assertEqual(answer.name if answer.name == "Ok" else answer.value.name, name)
        self.assertEqual(self.probe.gain, 3)
        with self.assertRaisesRegex(rp.Misuse, "Probe.gain: 10 is not in its range, 1..=9"):
            self.probe.gain = 10


if __name__ == "__main__":
    unittest.main()
