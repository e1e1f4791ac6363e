"""The client of asyncio does all that the synchronous one does, by the same tests; and what only it does."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import unittest
from collections.abc import Callable
from typing import Any

import rohrpost as rp
from rohrpost import remote
from rohrpost.remote import aio

from . import in_loop, test_client, test_streams
from .modules import INSTALLATION, Probe
from .router import Server


class AsyncClients(test_client.Clients):
    connect = staticmethod(in_loop.connect)

    def by_the_host(self, function: Callable[..., Any]) -> Callable[..., Any]:
        host: Any = self.host
        return host.waits(function)  # type: ignore[no-any-return]


class AsyncStreams(test_streams.Streams):
    connect = staticmethod(in_loop.connect)


class Both(unittest.TestCase):
    """Beside a synchronous client."""

    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.close)
        self.host = self.connected("probe.0")
        self.host.host("probe.0", Probe())
        self.client = self.connected("tool.1")

    def connected(self, own: str) -> remote.Client:
        client = remote.connect(self.server.address, own, INSTALLATION, timeout_s=20)
        self.addCleanup(client.close)
        return client

    def test_asyncio_speaks_over_the_same_core(self) -> None:
        class Twice(rp.Module, klass="probe"):
            @rp.command(16)
            async def twice(self, by: rp.U32) -> rp.U64:
                counted: int = await self.proxy("probe.0").count(by)
                return 2 * counted

            @rp.data_out(1, rate_hz=50)
            async def beat(self) -> int:
                return 5

        async def main() -> None:
            server = self.server.address
            async with await aio.connect(server, "tool.8", INSTALLATION, timeout_s=20, big_endian=True) as client:
                client.host("probe.2", Twice())
                counted = await asyncio.gather(*(client.call("probe.0", "count", 1, timeout_s=20) for _ in range(8)))
                self.assertEqual(sorted(counted), [1, 2, 3, 4, 5, 6, 7, 8])
                async with await aio.connect(server, "tool.9", INSTALLATION, timeout_s=20) as other:
                    self.assertEqual(await other.proxy("probe.2", 20).twice(2), 20)
                    async with other.subscribe("probe.2", "beat") as beats:
                        self.assertEqual([(await beats.next(20)).value for _ in range(3)], [5, 5, 5])
                        await asyncio.to_thread(self.server.drop_all)
                        while other._core.session.connections < 2 or not other.is_up:
                            await asyncio.sleep(0.01)
                        self.assertEqual((await beats.next(20)).value, 5)
                with self.assertRaises(rp.CallTimeout):
                    await client.status("probe.9", timeout_s=0.2)

                def elsewhere() -> None:
                    asyncio.run(client.status("probe.0"))

                with self.assertRaisesRegex(rp.Misuse, "belongs to another event loop"):
                    await asyncio.to_thread(elsewhere)
            with self.assertRaisesRegex(rp.Misuse, "this client is closed"):
                await client.status("probe.0")

        asyncio.run(main())

    def test_what_leaves_or_cancels_itself_is_a_module_in_error(self) -> None:
        class Odd:
            def __repr__(self) -> str:
                raise KeyError("odd")

        class Leaves(rp.Module, klass="probe"):
            @rp.command(16)
            def leave(self) -> None:
                sys.exit(3)

            @rp.command(17)
            def odd(self) -> rp.Pose:
                return Odd()  # type: ignore[return-value]

        class AsyncLeaves(Leaves, klass="probe"):
            @rp.command(18)
            async def cancel(self) -> None:
                task = asyncio.get_running_loop().create_task(asyncio.sleep(20))
                task.cancel()
                await task

            @rp.command(19)
            async def go(self) -> None:
                sys.exit(4)

            @rp.command(20)
            async def hang(self) -> None:
                await asyncio.sleep(60)

        async def hosted_in_a_loop() -> None:
            async with await aio.connect(self.server.address, "tool.8", INSTALLATION, timeout_s=20) as client:
                client.host("probe.2", AsyncLeaves())
                for function, why in {**told, "cancel": "CancelledError", "go": "SystemExit: 4"}.items():
                    with self.assertRaisesRegex(rp.CallFault, f"the module is in error: {why}"):
                        await client.call("probe.2", function, timeout_s=20)
                    for on in (False, True):
                        await client.switch("probe.2", on, 20)
                with self.assertRaises(rp.CallTimeout):
                    await client.call("probe.2", "hang", timeout_s=0.1)
            # Its own end is no failure, and waits for nobody.

        told = {"leave": "SystemExit: 3", "odd": "RuntimeError: what it returns cannot be told: KeyError"}
        self.host.host("probe.1", Leaves())
        for function, why in told.items():
            with self.assertRaisesRegex(rp.CallFault, f"the module is in error: {why}"):
                self.client.call("probe.1", function, timeout_s=5)
            for on in (False, True):
                self.client.switch("probe.1", on, 20)
        asyncio.run(hosted_in_a_loop())

    def test_both_clients_have_the_same_methods_and_each_has_a_text(self) -> None:
        def public(cls: type) -> dict[str, Any]:
            return {name: getattr(cls, name) for name in dir(cls) if not name.startswith("_")}

        both = public(remote.Client), public(aio.AsyncClient)
        self.assertEqual(both[0].keys(), both[1].keys())
        for name in both[0]:
            self.assertTrue(all(cls[name].__doc__ for cls in both), name)

    def test_an_interpreter_ends_with_a_client_open(self) -> None:
        code = (
            "from rohrpost import remote\n"
            ""
            "it = remote.Installation(7, {'tool': 16}, 7, 1)\n"
            f"client = remote.connect('{self.server.address}', 'tool.3', it, timeout_s=20)\n"
        )
        said = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, timeout=60)
        self.assertEqual((said.returncode, said.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main()
