"""A robot of a team that is no node: takes part at a TCP router, or by multicast. Written from docs/src/wire.md, with
the standard library and a SipHash.

Arguments: its own name (`9.120.0.0`), beat and MAX_AGE in ms, the place of an intruder that it sees (x and y in mm);
then `tcp`, address and port of the TCP router and both digests (hex, with `-` between), or `group`, its own address,
address and port of the multicast group, and the file of the team's keys, without which nothing is sealed. Each beat it
prints a JSON object: leader, group, digest of its view, and whether all have that view.
"""

import json
import sys
import time

from team import Hello, Malformed, Robot, decode, encode
from team_radio import ALL_SYSTEMS, Radio
from wire import PACKAGE, REFUSAL, STAMPED, Session, connect, data, fields, name, package

HELLO, RECORDS = 2, 3
MESSAGES = 3
DATA_HEAD = bytes(20)


# Its clock never goes back, and is that of people when it starts.
AHEAD_NS = time.time_ns() - time.monotonic_ns()


def clock_ns():
    return time.monotonic_ns() + AHEAD_NS


def number_of(message):
    return HELLO if isinstance(message, Hello) else RECORDS


class Member:
    """A robot of a team behind packages, whichever way these go."""

    def __init__(self, own, beat_ms, max_age_ms):
        # It has no store: if a robot of its number was there before, others tell it that one's incarnation.
        self.robot = Robot(own >> 24, 1, 0, beat_ms * 1_000_000, max_age_ms * 1_000_000)
        self.own, self.to = own, ALL_SYSTEMS << 24 | own & 0xFFFF00 | MESSAGES
        self.malformed = 0

    def packages(self, now_ns):
        """What it sends in a beat: type and body of each."""
        messages = self.robot.beat(now_ns, (1000 * self.robot.own, 0, 0, 0))
        return [(data(number_of(message)), DATA_HEAD + encode(message)) for message in messages]

    def take(self, now_ns, fields):
        _, sender, _, kind, _, _, body = fields
        try:
            message = decode(body[len(DATA_HEAD) :])
            if kind != data(number_of(message)) or sender >> 24 != message.sender:
                raise Malformed("of another number, or in the name of another robot")
            self.robot.hear(now_ns, message)
        except Malformed:
            self.malformed += 1

    def tell(self, now_ns):
        leader, group = self.robot.pair(now_ns)
        digest = "".join(f"{part:08x}" for part in self.robot.digests())
        told = {
            "robot": self.robot.own, "incarnation": self.robot.version[0], "leader": leader, "group": group,
            "view_digest": digest, "views_equal": self.robot.agrees(now_ns), "malformed": self.malformed,
            "members": [{"robot": robot, "fresh": True} for robot in self.robot.fresh(now_ns)],
        }  # fmt: skip
        print(json.dumps(told), flush=True)


def by_tcp(member, session, priority):
    """Beats for ever."""
    session.meet([(member.own, member.own | 0xFF)], "a robot in Python")
    session.stream.settimeout(0.02)
    due = time.monotonic()
    while True:
        kind, rest = session.frame(due)
        now_ns = clock_ns()
        if kind == PACKAGE:
            member.take(now_ns, fields(rest[8:]))
        elif kind == REFUSAL:
            raise SystemExit(f"refused, reason {rest[5]}: {rest[24:].decode()}")
        elif kind is None:
            due += member.robot.beat_ns / 1e9
            for kind, body in member.packages(now_ns):
                session.send(member.to, member.own, kind, 0, body, priority, STAMPED)
            member.tell(now_ns)


def by_group(member, radio):
    """Beats for ever."""
    due, priority = time.monotonic(), member.own >> 16 & 0xFF
    while True:
        came = radio.receive(due)
        if came is None:
            now_ns, due = clock_ns(), due + member.robot.beat_ns / 1e9
            for kind, body in member.packages(now_ns):
                radio.send(package(member.to, member.own, kind, 0, body, priority, STAMPED))
            member.tell(now_ns)
        elif came[0] & 0xFFFFFF == member.to & 0xFFFFFF:
            member.take(clock_ns(), came)


def key_in(file):
    """Id and secret of the newest key of a team."""
    with open(file) as lines:
        _, key_id, secret = next(line for line in lines if line.startswith("key ")).split()
    return int(key_id), bytes.fromhex(secret)


def main():
    own, beat_ms, max_age_ms, x, y, way, *rest = sys.argv[1:]
    own = name(own)
    member = Member(own, int(beat_ms), int(max_age_ms))
    member.robot.see(clock_ns(), (int(x), int(y)))
    if way == "tcp":
        address, port, digests = rest
        digests = [int(digest, 16) for digest in digests.split("-")]
        # The class is the priority.
        by_tcp(member, Session(connect(address, int(port), None), own, digests, "big"), own >> 16 & 0xFF)
    else:
        own_address, address, port, *keys = rest
        key = key_in(keys[0]) if keys else None
        by_group(member, Radio(own >> 24, own_address, address, int(port), key))


if __name__ == "__main__":
    main()
