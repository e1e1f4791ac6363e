"""Modules of one client: they call and hear each other, and the client them, with a connection and without."""

from __future__ import annotations

import asyncio
import unittest

import rohrpost as rp
from rohrpost import remote
from rohrpost.names import Name
from rohrpost.remote import aio
from rohrpost.remote.core import Core
from rohrpost.remote.session import Settings
from rohrpost.wire import package

from .modules import INSTALLATION, Probe
from .router import Server
from .test_client import wait


class Other(rp.Module, klass="probe"):
    """Follows one module of its client, and calls it."""

    def __init__(self) -> None:
        self.heard: list[int] = []

    @rp.on_data("probe.0", "beat")
    def hear(self, beat: rp.U64) -> None:
        self.heard.append(beat)

    @rp.command(16)
    def twice(self, by: rp.U32) -> rp.U64:
        """Counts twice."""
        return 2 * int(self.proxy("probe.0").count(by))


class AsyncOther(Other, klass="probe"):
    @rp.command(16)
    async def twice(self, by: rp.U32) -> rp.U64:  # type: ignore[override]
        counted: int = await self.proxy("probe.0").count(by)
        return 2 * counted


class OfOneClient(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.drop_all)

    def test_modules_of_one_client_call_and_hear_each_other_and_the_client_them(self) -> None:
        client = remote.connect(self.server.address, "tool.1", INSTALLATION, timeout_s=20)
        self.addCleanup(client.close)
        other = Other()
        client.host("probe.0", Probe())
        client.host("probe.1", other)
        self.assertEqual(client.call("probe.1", "twice", 3, timeout_s=20), 6)
        self.assertEqual(client.status("probe.0", 20).state, rp.State.On)
        with client.subscribe("probe.0", "beat") as beats:
            self.assertEqual(beats.next(20).value, 3)
        wait(lambda: 3 in other.heard)
        with self.assertRaisesRegex(rp.CallFault, "no such mailbox"):
            client.call("tool.1", "anything", timeout_s=20)
        # Nothing of this needs the TCP router.
        self.server.close()
        wait(lambda: not client.is_up)
        self.assertEqual(client.call("probe.1", "twice", 2, timeout_s=20), 10)
        wait(lambda: 5 in other.heard)

    def test_so_do_those_of_a_client_of_asyncio(self) -> None:
        async def main() -> None:
            async with await aio.connect(self.server.address, "tool.1", INSTALLATION, timeout_s=20) as client:
                other = AsyncOther()
                client.host("probe.0", Probe())
                client.host("probe.1", other)
                self.assertEqual(await client.call("probe.1", "twice", 3, timeout_s=20), 6)
                self.assertEqual((await client.subscribe("probe.0", "beat").next(20)).value, 3)
                while 3 not in other.heard:
                    await asyncio.sleep(0.005)

        asyncio.run(asyncio.wait_for(main(), 60))

    def test_what_waits_for_a_module_of_the_client_is_bounded(self) -> None:
        core = Core(
            Settings(INSTALLATION, "test", 1), Name.of(7, 16, 1), lambda: 0, lambda: 10**18
        )
        core.add(0, Name.of(7, 96, 0))
        sent = package(Name.of(7, 96, 0).raw, 0, 16, 1, b"", 16)
        with self.assertRaisesRegex(rp.NotSent, "1024 packages wait already"):
            for _ in range(1025):
                core._send(0, sent)


if __name__ == "__main__":
    unittest.main()
