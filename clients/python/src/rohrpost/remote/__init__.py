"""Takes part in a robot from anywhere: by TCP, with or without TLS, without anything of Rohrpost installed there.

::

    from rohrpost import remote

    robot = remote.Installation.with_digests(1, "0123456789abcdef-fedcba9876543210", {"motor": 200, "tool": 16})
    with remote.connect("robot.local", "tool.64", robot) as client:
        client.proxy("motor.0").drive(0.3, 0.0)
"""

from __future__ import annotations

import re
import ssl
import time

from ..names import Installation, Name
from .calling import NoSuchFunction
from .client import Client
from .following import Data, NoSuchData
from .handles import Proxy, RecordStream, Subscription
from .records import BadRecord, Missed, Record
from .session import Settings
from .streams import NoSuchStream
from .timing import SystemTime
from .transport import Tls

__all__ = [
    "BadRecord", "Client", "Data", "Installation", "Missed", "Name", "NoSuchData", "NoSuchFunction", "NoSuchStream",
    "Proxy", "Record", "RecordStream", "Subscription", "SystemTime", "Tls", "connect",
]  # fmt: skip


def prepare(
    own: str | Name, installation: Installation, tls: Tls | None, label: str, big_endian: bool, quota_bytes: int
) -> tuple[Name, Settings, ssl.SSLContext | None]:
    """What both kinds of client begin with."""
    if len(label.encode()) > 64 or not label.isprintable():
        raise ValueError("a label has at most 64 bytes, without control characters")
    if not 1 <= installation.system <= 254:
        raise ValueError(f"system {installation.system}: a system is 1 to 254")
    said = re.fullmatch(r"(.+)\.system-\d+", tls.own) if tls else re.fullmatch(r"node (\S+) of .+", label)
    node = said[1] if said else ""
    settings = Settings(installation, label, time.time_ns(), quota_bytes, big_endian, node)
    return installation.name(own), settings, None if tls is None else tls.context()


def connect(
    server: str,
    own: str | Name,
    installation: Installation,
    *,
    tls: Tls | None = None,
    label: str = "a program in Python",
    timeout_s: float = 5.0,
    big_endian: bool = False,
    quota_bytes: int = 1 << 20,
) -> Client:
    """Takes part at the TCP router ``server`` (``host:port``), under the name ``own``.

    The class of the name is the priority of all that is sent. ``label`` is for people. Waits ``timeout_s`` seconds
    until it takes part, and raises :class:`rohrpost.NoConnection`, if it does not; with 0 it does not wait, and goes on
    trying by itself. ``big_endian``: the byte order of its heads; ``quota_bytes``: of packages that wait for the
    stream.
    """
    name, settings, context = prepare(own, installation, tls, label, big_endian, quota_bytes)
    client = Client(server, name, settings, context)
    if timeout_s > 0:
        try:
            client.wait_until_up(timeout_s)
        except BaseException:
            client.close()
            raise
    return client
