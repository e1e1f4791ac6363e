"""The way between systems without a server, from docs/src/wire.md and docs/src/security.md: datagrams to a multicast
group, sealed with the key of the team or not.
"""

import os
import socket
import struct
import time
import zlib

from lan import check_rfc, cipher, derived, tag
from wire import fields

HEAD = struct.Struct("<2sBBBBBBQQQ")
HEAD_BYTES, TAG_BYTES = 36, 16
A_PACKAGE, A_BEAT = 1, 2
BEAT, ECHO = struct.Struct("<QQB7x"), struct.Struct("<BBxxQ")
ECHOES_MAX = 112
ALL_SYSTEMS = 255
# What a key is for.
FOR_TEAMS = 6
# Seconds: between two beats, until the beat that answers somebody new, and for which a challenge is said.
BEAT_S, SOON_S, CHALLENGE_S = 2.0, 0.15, 5.0
# Sequences behind the latest that are taken.
WINDOW = 1024


def challenge():
    return int.from_bytes(os.urandom(8), "little")


class Sender:
    """A node of another system, as it is heard."""

    def __init__(self):
        # Newest challenge of each incarnation, and when it came.
        self.challenges = {}
        # The incarnation that has proved that it lives; where nothing is sealed, the one that was heard last.
        self.incarnation, self.first = 0, 0
        self.came = set()

    def believe(self, incarnation, first):
        self.incarnation, self.first, self.came = incarnation, first, set()

    def is_new(self, sequence):
        latest = max(self.came, default=0)
        if sequence < max(self.first, latest - WINDOW) or sequence in self.came:
            return False
        self.came = {it for it in self.came if it > latest - WINDOW} | {sequence}
        return True


class Radio:
    """A program that is node 0 of its system. `key`: id and secret of the team's key; None: nothing is sealed."""

    def __init__(self, system, own_address, address, port, key):
        check_rfc()
        self.system, self.to = system, (address, port)
        self.key_id, self.secret = key or (0, None)
        self.incarnation, self.sequence = challenge() | 1, 0
        self.senders = {}
        self.present, self.before, self.since = challenge(), challenge(), time.monotonic()
        self.next_beat = self.last_beat = time.monotonic()
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.link.bind((address, port))
        group, own = socket.inet_aton(address), socket.inet_aton(own_address)
        self.link.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + own)
        self.link.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, own)

    def seal(self, head, text):
        """All that follows a head."""
        if not self.secret:
            return text
        key, nonce = self.key(self.system, 0, self.incarnation), bytes(4) + struct.pack("<Q", self.sequence)
        sealed = cipher(key, nonce, text)
        return sealed + tag(key, nonce, head, sealed)

    def open(self, datagram, system, node, incarnation, sequence):
        """What follows a head; None if no teammate has sealed it."""
        if not self.secret:
            return datagram[HEAD_BYTES:]
        key, nonce = self.key(system, node, incarnation), bytes(4) + struct.pack("<Q", sequence)
        sealed, signature = datagram[HEAD_BYTES:-TAG_BYTES], datagram[-TAG_BYTES:]
        return cipher(key, nonce, sealed) if tag(key, nonce, datagram[:32], sealed) == signature else None

    def key(self, system, node, incarnation):
        """Of one that sends, for all that hear it."""
        return derived(self.secret, FOR_TEAMS, system, node, 0, incarnation)

    def emit(self, kind, text):
        head = HEAD.pack(
            b"Rt", 1, kind, self.system, 0, ALL_SYSTEMS, self.key_id, 0, self.incarnation, self.sequence
        )  # fmt: skip
        rest = self.seal(head, text)
        self.link.sendto(head + struct.pack("<I", zlib.crc32(head + rest)) + rest, self.to)
        self.sequence += 1

    def send(self, package):
        self.emit(A_PACKAGE, package)

    def beat(self, now):
        """Says that it lives, and what it hears."""
        if now - self.since > CHALLENGE_S:
            self.present, self.before, self.since = challenge(), self.present, now
        heard = [
            ECHO.pack(*node, said)
            for node, sender in self.senders.items()
            for said, at in sender.challenges.values()
            if now - at < 2 * CHALLENGE_S
        ][:ECHOES_MAX]
        # All that this one sends is for all.
        self.emit(A_BEAT, BEAT.pack(self.present, self.sequence, len(heard)) + b"".join(heard))
        self.last_beat, self.next_beat = now, now + BEAT_S

    def receive(self, until):
        """The fields of the next package that another system sends to this one or to all; None by then."""
        while (now := time.monotonic()) < until:
            # Where nothing is sealed a program needs no beats.
            if self.secret and now >= self.next_beat:
                self.beat(now)
            self.link.settimeout(max(min(until, self.next_beat if self.secret else until) - now, 0.001))
            try:
                package = self.take(self.link.recv(65536))
            except TimeoutError:
                continue
            if package:
                return fields(package)
        return None

    def take(self, datagram):
        """The package in a datagram that is believed."""
        if len(datagram) < HEAD_BYTES + (TAG_BYTES if self.secret else 0):
            return None
        magic, version, kind, system, node, to, key, _, incarnation, sequence = HEAD.unpack_from(datagram)
        if (magic, version) != (b"Rt", 1) or to not in (self.system, ALL_SYSTEMS) or system == self.system:
            return None
        check = zlib.crc32(datagram[:32] + datagram[HEAD_BYTES:])
        if struct.pack("<I", check) != datagram[32:HEAD_BYTES] or key != self.key_id:
            return None
        text = self.open(datagram, system, node, incarnation, sequence)
        if text is None:
            return None
        sender = self.senders.setdefault((system, node), Sender())
        if kind == A_BEAT:
            self.hear(sender, incarnation, sequence, text)
        if not self.secret and sender.incarnation != incarnation:
            sender.believe(incarnation, 0)
        is_believed = sender.incarnation == incarnation and sender.is_new(sequence)
        return text if is_believed and kind == A_PACKAGE and len(text) >= 16 else None

    def hear(self, sender, incarnation, sequence, text):
        """A beat: by a challenge of this program an incarnation proves that it lives now."""
        said, _, count = BEAT.unpack_from(text)
        now = time.monotonic()
        if incarnation not in sender.challenges:
            self.next_beat = min(self.next_beat, self.last_beat + SOON_S)
        sender.challenges[incarnation] = said, now
        echoes = ECHO.iter_unpack(text[BEAT.size : BEAT.size + count * ECHO.size])
        lives = any(echo[:2] == (self.system, 0) and echo[2] in (self.present, self.before) for echo in echoes)
        if lives and sender.incarnation != incarnation:
            sender.believe(incarnation, sequence)
