"""A hostile program with a valid certificate of another system: at the TCP router of the demo, for so many seconds.

Arguments: seconds, address and port of the TCP router, both digests (hex, with `-` between), its own system, the hash
of the laser's interface, the folder of certificates, and the name of its own. Prints its attempts, as one JSON
object. Its own module SYSTEM.96.0 describes itself with escape sequences.
"""

import collections
import json
import random
import ssl
import struct
import sys
import time

from attacks import Attacks
from wire import DESCRIBE, ERROR, PACKAGE, REGISTERED, Session, connect, name, text, unvarint, varint

EVIL = "\x1b[2J\x1b]0;owned\x07\r\u202eevil\x9b31m"
DESCRIPTION = text(EVIL) + text("mapper") + text(EVIL) + varint(0) + varint(0)
MODULE_IN_ERROR = 1


class Teammate(Session):
    def listen(self, seconds, tried):
        """Takes what comes for so long, and answers commands in words that no terminal should see."""
        until = time.monotonic() + seconds
        self.stream.settimeout(0.01)
        while time.monotonic() < until:
            kind, rest = self.frame(until)
            if kind == PACKAGE:
                self.serve(rest)
            elif kind == REGISTERED and rest[4]:
                tried["registration refused"] += 1

    def serve(self, rest):
        to, sender, _, kind, id = struct.unpack("<IIHhH", rest[8:22])
        body = rest[24:]
        if not 0 < kind < 16384 or len(body) < 20:
            return
        if kind == DESCRIBE:
            part = DESCRIPTION[unvarint(body[20:])[0] :]
            result, options = varint(len(DESCRIPTION)) + varint(len(part)) + part, 0
        else:
            result, options = varint(MODULE_IN_ERROR) + text(EVIL), ERROR
        self.send(sender, to, -kind, id, body[4:12] + result, 255, options)


def take_names(session, number, own):
    """Names of others, names inside those of others, and as many of its own as there are."""
    system = session.own & 0xFF000000
    others = [(name("1.140.0.0"), name("1.140.0.255")), (name("3.96.0.0"), name("3.96.0.255"))]
    routers = [(system | 64 << 16, system | 64 << 16 | 0xFF)]
    many = [(system | 97 << 16 | at << 4, system | 97 << 16 | at << 4) for at in range(2000)]
    session.register(number, random.choice([own + others, own + routers, own + many]))


def connections(session, arguments, number, tried):
    """So many at once, of which none says hello. The session goes on meanwhile: a busy computer takes its time."""
    opened = []
    for _ in range(number):
        try:
            opened.append(connect(*arguments))
        except (OSError, ssl.SSLError):
            pass
        session.listen(0.001, tried)
    for stream in opened:
        stream.close()


def main():
    seconds, address, port, digests, system, laser, folder, own = sys.argv[1:]
    at = (address, int(port), [folder, own])
    module = name(f"{system}.96.0.0")
    session = Teammate(connect(*at), module, [int(digest, 16) for digest in digests.split("-")], "little")
    modules = [name(f"{system}.16.{instance}.0") for instance in range(128)]
    ranges = [(module, module | 0xFF), (modules[0], modules[-1] | 0xFF)]
    session.meet(ranges, "a hostile teammate")
    print("takes part", flush=True)
    attacks = Attacks(modules, int(laser, 16))
    until, tried, turn = time.monotonic() + float(seconds), collections.Counter(), 0
    while time.monotonic() < until:
        turn += 1
        for attack, (receiver, sender, kind, id, body, priority, options) in attacks.all().items():
            session.send(receiver, sender, kind, id, body, priority, options)
            tried[attack] += 1
        if turn % 16 == 0:
            take_names(session, turn, ranges)
            tried["names of others"] += 1
        if turn % 64 == 0:
            connections(session, at, 20, tried)
            tried["connections"] += 20
        session.listen(0.02, tried)
    print(json.dumps(tried), flush=True)
    # Its words are to be read until somebody ends it.
    session.register(turn + 1, ranges)
    while True:
        session.listen(1.0, tried)


main()
