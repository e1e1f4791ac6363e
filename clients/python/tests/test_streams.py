"""Records over real sockets, at a router of this test that sends streams."""

from __future__ import annotations

import time
import unittest
import zlib
from collections.abc import Callable
from typing import Any

import rohrpost as rp
from rohrpost import remote
from rohrpost.names import Name
from rohrpost.remote.streams import BeyondNode, BeyondStream, BeyondStreams
from rohrpost.schema import DataItem, Description, Field
from rohrpost.schema.encode import encode
from rohrpost.schema.tree import U64
from rohrpost.types import Image

from . import parts
from .router import Server
from .test_client import wait

ROBOT = remote.Installation(7, {"camera": 112, "probe": 96, "tcp": 64, "tool": 16}, 7, 1)
LABEL = "node laptop of robot"
CLIENT = Name.of(7, 64, 1).raw
CAMERA = Name.of(7, 112, 0).raw
IMAGE = getattr(Image, "__rohrpost_type__")
DESCRIPTION = Description(
    "Camera", "camera", (), (DataItem(1, Field("image", IMAGE), True), DataItem(2, Field("count", U64), True))
).to_bytes()
CHECK = zlib.crc32(DESCRIPTION)
PATIENCE_S = 30.0
PICTURE = rp.Image(2, 1, 6, rp.ImageFormat.Rgb8, b"\x01\x02\x03\x04\x05\x06")


class TcpRouter(rp.Module, klass="tcp"):
    """What of the TCP router's module matters here."""

    sends = BeyondStreams(
        [BeyondNode("desk", Name.of(7, 64, 2).raw), BeyondNode("laptop", CLIENT)],
        [
            BeyondStream(3, CAMERA, "image", 5_000_000, [0, 1]),
            BeyondStream(4, CAMERA, "count", 10, [1]),
            BeyondStream(5, CAMERA, "other", 10, [0]),
        ],
    )

    @rp.data_out(5, rate_hz=50)
    def streams(self) -> BeyondStreams:
        """What it sends."""
        return self.sends


class Looker(rp.Module, klass="probe"):
    """Follows a stream."""

    def __init__(self) -> None:
        self.seen: list[Any] = []

    @rp.on_record("camera.0", "image")
    def look(self, image: rp.Image) -> None:
        self.seen.append(image)


class Streams(unittest.TestCase):
    connect: Callable[..., Any] = staticmethod(remote.connect)
    """The client under test; :mod:`.test_aio` has the other one."""

    def setUp(self) -> None:
        self.server = Server()
        self.server.router.is_strict = True
        self.addCleanup(self.server.close)
        self.host = self.connected("tcp.255", label="the router")
        self.host.host("tcp.255", TcpRouter())

    def connected(self, own: str, label: str = LABEL) -> remote.Client:
        client: remote.Client = self.connect(self.server.address, own, ROBOT, timeout_s=20, label=label)
        self.addCleanup(client.close)
        return client

    def send(self, *frames: bytes) -> None:
        """To the host of the laptop's name, once there is one."""
        connection = wait(lambda: self.server.router.host_of(CLIENT))
        for frame in frames:
            connection.write(frame)

    def describe(self, *places: int) -> None:
        for place in places:
            self.send(*parts.described(DESCRIPTION, place=place))

    def picture(self, sequence: int, image: rp.Image = PICTURE) -> None:
        self.send(*parts.record(encode(IMAGE, image), sequence, CHECK))

    def count(self, sequence: int, **how: Any) -> None:
        self.send(*parts.record(encode(U64, sequence), sequence, CHECK, place=4, **how))

    def test_records_come_and_the_newest_counts(self) -> None:
        client = self.connected("tool.1")
        with client.stream("camera.0", "image", expected=rp.Image) as images:
            self.describe(3, 4)
            self.picture(5)
            first = images.newest(20)
            self.assertEqual((first.sequence, first.incarnation, first.epoch, first.value), (5, 9, 1, PICTURE))
            self.assertEqual(images.newest(20), first, "again, while there is no newer one")
            self.picture(6)
            self.picture(9)
            wait(lambda: images.newest(20).sequence == 9)
            self.assertEqual(images.missed.lost, 2)
            with self.assertRaisesRegex(TimeoutError, "no record came within 0.1 s"):
                images.next(0.1)
        wait(lambda: self.server.router.host_of(CLIENT) is None)
        with self.assertRaisesRegex(rp.Misuse, "this stream is closed"):
            images.next(1)

    def test_each_record_comes_where_there_is_room_and_what_is_not_wanted_is_dropped(self) -> None:
        client = self.connected("tool.1")
        counts = client.stream("camera.0", "count", room=4)
        self.describe(3, 4)
        self.picture(1)
        for number in (1, 2, 4):
            self.count(number, sampled=number // 4)
        self.assertEqual([counts.next(20).value for _ in range(3)], [1, 2, 4])
        self.assertEqual((counts.missed, counts.refused), (remote.Missed(sampled=1), {}))
        for number in range(5, 11):
            self.count(number)
        wait(lambda: counts.missed.passed_over == 2)
        self.assertEqual([counts.next(20).value for _ in range(4)], [7, 8, 9, 10])

    def test_a_stream_that_is_opened_later_gets_description_and_newest_record_at_once(self) -> None:
        client = self.connected("tool.1")
        counts = client.stream("camera.0", "count")
        self.describe(3, 4)
        self.count(1)
        self.assertEqual(counts.next(20).value, 1)
        connection = self.server.router.host_of(CLIENT)
        assert connection is not None

        def hosted() -> list[bool]:
            return [any(first == CLIENT for first, _ in ranges) for ranges in connection.registered]

        self.assertEqual(hosted(), [False, True])
        images = client.stream("camera.0", "image")
        # A real one begins with description and newest record whenever the name has a host again.
        wait(lambda: hosted() == [False, True, False, True])
        self.describe(3, 4)
        self.picture(1)
        self.count(1)
        self.count(2)
        self.assertEqual(images.next(20).sequence, 1)
        self.assertEqual((counts.next(20).value, counts.refused), (2, {"duplicate": 1}))

    def test_an_outage_costs_a_gap(self) -> None:
        client = self.connected("tool.1")
        counts = client.stream("camera.0", "count")
        self.describe(4)
        self.count(1)
        self.assertEqual(counts.next(20).value, 1)
        before = self.server.router.host_of(CLIENT)
        self.server.drop_all()
        wait(lambda: self.server.router.host_of(CLIENT) not in (None, before))
        self.count(7)
        self.assertEqual((counts.next(20).value, counts.missed.lost), (7, 5))

    def test_what_the_robot_does_not_send_is_told_at_once(self) -> None:
        client, began = self.connected("tool.1"), time.monotonic()
        with self.assertRaises(remote.NoSuchStream) as missing:
            client.stream("camera.0", "other").newest(PATIENCE_S)
        self.assertLess(time.monotonic() - began, PATIENCE_S, "at once, and not when the time is over")
        self.assertEqual(
            str(missing.exception),
            "the robot sends node laptop no stream camera.0/other; its file needs a [[replica]] with `stream = "
            '"camera.0/other"` and "laptop" in `to`. What it sends: camera.0/image, camera.0/count',
        )  # fmt: skip
        elsewhere = self.connected("tool.2", label="node brain of robot")
        with self.assertRaisesRegex(remote.NoSuchStream, "sends node brain no stream .* What it sends: none"):
            elsewhere.stream("camera.0", "image").next(PATIENCE_S)
        for label, why in [("a laptop", "does not say which one it is on")]:
            with self.assertRaisesRegex(rp.Misuse, why):
                self.connected("tool.3", label=label).stream("camera.0", "image")
        robot = remote.Installation(7, {"camera": 112, "tool": 16}, 7, 1)
        with self.connect(self.server.address, "tool.4", robot, label=LABEL, timeout_s=20) as other:
            with self.assertRaisesRegex(rp.Misuse, "the id of class `tcp` must be known"):
                other.stream("camera.0", "image")

    def test_one_program_of_a_node_has_its_streams_and_the_other_goes_on(self) -> None:
        first, second = self.connected("tool.1"), self.connected("tool.2")
        first.stream("camera.0", "image")
        wait(lambda: self.server.router.host_of(CLIENT))
        with self.assertRaisesRegex(rp.RohrpostError, "do not come here: another client hosts .*: another; one pro"):
            images = second.stream("camera.0", "image")
            wait(lambda: images.problem)
            images.next(0.1)
        self.assertEqual(second.status("tcp.255", 20).state, rp.State.On, "its calls go on")

    def test_streams_are_bounded(self) -> None:
        client = self.connected("tool.1")
        for _ in range(64):
            client.stream("camera.0", "image")
        with self.assertRaisesRegex(rp.Misuse, "at most 64 streams"):
            client.stream("camera.0", "image")

    def test_a_hosted_module_is_run_with_the_newest_record(self) -> None:
        client, looker = self.connected("tool.1"), Looker()
        client.host("probe.0", looker)
        self.describe(3)
        self.picture(1)
        wait(lambda: looker.seen)
        self.assertEqual(looker.seen, [PICTURE])
        self.send(*parts.record(b"\xff", 2, CHECK))
        wait(lambda: self.host.status("probe.0", 20).lost == 1)
        self.picture(3)
        wait(lambda: len(looker.seen) == 2)
        self.assertEqual(self.host.status("probe.0", 20).state, rp.State.On, "no picture is no fault of the module")

    def test_a_module_that_cannot_have_records_is_not_hosted(self) -> None:
        client, looker = self.connected("tool.1", label="a laptop"), Looker()
        for _ in range(2):
            with self.assertRaisesRegex(rp.Misuse, "does not say which one it is on"):
                client.host("probe.0", looker)


if __name__ == "__main__":
    unittest.main()
