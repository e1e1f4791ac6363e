"""A hostile node of the LAN with the key: it runs in the place of `desk` of the demo, for so many seconds.

Arguments: seconds, digest of the LAN (hex), port, the file of keys, the hash of the laser's interface, its own place
among the nodes, and the addresses of all nodes in their order. Prints its attempts, as one JSON object.
"""

import collections
import json
import os
import struct
import sys
import time
import zlib

from attacks import Attacks
from lan import FOR_PACKAGES, FRAGMENT, TIME_PORT, Node
from wire import name, package


def junk(node, to):
    """Datagrams that nobody sealed, at both ports."""
    head = struct.pack(
        "<2sBBBBBBQQQ", b"Rp", 2, 1, 1, node.own, to, 0, node.digest, node.incarnation + 2, 2**48 - 1
    )  # fmt: skip
    body = package(name("1.140.0.2"), name("1.150.0.0"), -16385, 0, os.urandom(64), 255)
    check = struct.pack("<I", zlib.crc32(head + body))
    for datagram in (os.urandom(200), head + bytes(4) + body, head + check + body):
        node.emit(to, datagram)
        node.emit(to, datagram, TIME_PORT)
    return 6


# On a busy computer there are few turns, and a flood may find no room.
FLOOD_EVERY_S = 4


def flood(node, to, attacks):
    """Some thousand lines at once, as many in a datagram as fit."""
    tries = 0
    for _ in range(200):
        lines = [attacks.all()["line-flood"] for _ in range(12)]
        node.send(to, *(package(*line) for line in lines))
        tries += len(lines)
    return tries


def part(node, to):
    """The first of many parts of a package that never becomes whole."""
    head = package(name("1.96.0.2"), name("1.16.64.0"), -16385, 0, b"", 255)
    whole = head[:8] + struct.pack("<H", 60_000) + head[10:]
    first = node.peers[to].sequences[FOR_PACKAGES]
    node.emit(to, node.seal(to, FRAGMENT, struct.pack("<QHHI", first, 0, 50, 0) + whole + bytes(1200)))


def main():
    seconds, digest, port, keys, laser, own, *addresses = sys.argv[1:]
    with open(keys) as file:
        _, key_id, secret = next(line for line in file if line.startswith("key ")).split()
    node = Node(int(digest, 16), 1, int(own), addresses, int(port), int(key_id), bytes.fromhex(secret))
    for to in node.peers:
        node.meet(to)
    print("takes part", flush=True)
    attacks = Attacks([name(f"1.16.{instance}.0") for instance in range(64, 128)], int(laser, 16))
    until, tried, turn = time.monotonic() + float(seconds), collections.Counter(), 0
    flood_at = time.monotonic()
    while time.monotonic() < until:
        if time.monotonic() >= flood_at:
            flood_at = time.monotonic() + FLOOD_EVERY_S
            tried["line-flood"] += sum(flood(node, to, attacks) for to in node.peers)
        turn += 1
        for to in node.peers:
            for attack, (receiver, sender, kind, id, body, priority, options) in attacks.all().items():
                node.send(to, package(receiver, sender, kind, id, body, priority, options))
                tried[attack] += 1
            if turn % 4 == 0:
                tried["junk"] += junk(node, to)
                part(node, to)
                tried["part"] += 1
                node.hello(to, node.peers[to].challenge, 0)
                tried["question"] += 1
            node.alive(to)
        node.listen(0.02)
    print(json.dumps(tried), flush=True)


main()
