"""Sealed datagrams between routers, from docs/src/security.md and docs/src/wire.md, with the standard library alone.

ChaCha20-Poly1305 is RFC 8439, in numbers of any size: slow, and short.
"""

import hashlib
import hmac
import os
import socket
import struct
import time
import zlib

PACKAGES, FRAGMENT, ALIVE, HELLO, RECORD_PART, DESCRIPTION = 1, 2, 3, 5, 6, 7
SALT = b"rohrpost datagrams, version 1"
# What a key is for. Ports are counted from that of packages.
FOR_HELLO, FOR_PACKAGES, FOR_REPLICAS = 1, 2, 5
TIME_PORT, REPLICA_PORT = 1, 3
WORD = 0xFFFFFFFF


def rotated(number, bits):
    return (number << bits | number >> 32 - bits) & WORD


def block(key, counter, nonce):
    """64 bytes of ChaCha20 (RFC 8439, 2.3)."""
    start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *struct.unpack("<8I", key), counter]
    start += struct.unpack("<3I", nonce)
    s = start[:]
    columns = [(0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15)]
    diagonals = [(0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)]
    for _ in range(10):
        for a, b, c, d in columns + diagonals:
            s[a] = s[a] + s[b] & WORD
            s[d] = rotated(s[d] ^ s[a], 16)
            s[c] = s[c] + s[d] & WORD
            s[b] = rotated(s[b] ^ s[c], 12)
            s[a] = s[a] + s[b] & WORD
            s[d] = rotated(s[d] ^ s[a], 8)
            s[c] = s[c] + s[d] & WORD
            s[b] = rotated(s[b] ^ s[c], 7)
    return struct.pack("<16I", *(x + y & WORD for x, y in zip(s, start)))


def cipher(key, nonce, text):
    stream = b"".join(block(key, 1 + at, nonce) for at in range((len(text) + 63) // 64))
    return bytes(x ^ y for x, y in zip(text, stream))


def tag(key, nonce, signed, sealed):
    """Poly1305 over both (RFC 8439, 2.5 and 2.8)."""
    once = block(key, 0, nonce)
    r = int.from_bytes(once[:16], "little") & 0x0FFFFFFC0FFFFFFC0FFFFFFC0FFFFFFF
    s = int.from_bytes(once[16:32], "little")
    padded = lambda part: part + bytes(-len(part) % 16)
    over = padded(signed) + padded(sealed) + struct.pack("<QQ", len(signed), len(sealed))
    sum = 0
    for at in range(0, len(over), 16):
        sum = (sum + int.from_bytes(over[at : at + 16] + b"\x01", "little")) * r % (2**130 - 5)
    return (sum + s & 2**128 - 1).to_bytes(16, "little")


def check_rfc():
    """The example of RFC 8439, 2.8.2."""
    key, nonce = bytes(range(0x80, 0xA0)), bytes.fromhex("070000004041424344454647")
    text = (
        b"Ladies and Gentlemen of the class of '99: If I could offer you only one tip for the future, "
        b"sunscreen would be it."
    )
    signed = bytes.fromhex("50515253c0c1c2c3c4c5c6c7")
    assert tag(key, nonce, signed, cipher(key, nonce, text)).hex() == "1ae10b594f09e26a7e902ecbd0600691"


def derived(secret, purpose, system, sender, receiver, of_sender=0, of_receiver=0):
    """HKDF (RFC 5869) of one block, which is as long as a key."""
    info = struct.pack("<BBBBQQ", purpose, system, sender, receiver, of_sender, of_receiver)
    extracted = hmac.digest(SALT, secret, hashlib.sha256)
    return hmac.digest(extracted, info + b"\x01", hashlib.sha256)


class Peer:
    def __init__(self):
        self.challenge, self.incarnation, self.hellos = 1, 0, 0
        self.begin(0, {FOR_PACKAGES: b"", FOR_REPLICAS: b""})

    def begin(self, incarnation, keys):
        self.incarnation, self.keys, self.sequences = incarnation, keys, dict.fromkeys(keys, 0)


class Node:
    """One node without modules: it has the installation's key, takes part, and seals the given datagrams."""

    def __init__(self, digest, system, own, addresses, port, key_id, secret):
        check_rfc()
        self.digest, self.system, self.own, self.port = digest, system, own, port
        self.addresses, self.key_id, self.secret = addresses, key_id, secret
        self.incarnation = int.from_bytes(os.urandom(8), "little") | 1
        self.peers = {at: Peer() for at in range(len(addresses)) if at != own}
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((addresses[own], port))
        self.socket.settimeout(0.01)

    def datagram(self, kind, to, sequence, rest, key, nonce):
        head = struct.pack(
            "<2sBBBBBBQQQ",
            b"Rp", 2, kind, self.system, self.own, to, self.key_id, self.digest, self.incarnation, sequence,
        )  # fmt: skip
        sealed = cipher(key, nonce, rest)
        sealed += tag(key, nonce, head, sealed)
        return self.checked(head + bytes(4) + sealed)

    def checked(self, datagram):
        """The same with the check that belongs to it."""
        head, sealed = bytes(datagram[:32]), bytes(datagram[36:])
        return head + struct.pack("<I", zlib.crc32(head + sealed)) + sealed

    def emit(self, to, datagram, port=0):
        try:
            self.socket.sendto(datagram, (self.addresses[to], self.port + port))
        except (BlockingIOError, TimeoutError):
            pass

    def hello(self, to, challenge, answer):
        peer = self.peers[to]
        peer.hellos += 1
        key = derived(self.secret, FOR_HELLO, self.system, self.own, to)
        nonce = struct.pack("<QI", self.incarnation, peer.hellos)
        rest = struct.pack("<QQQQ", challenge, answer, peer.sequences[FOR_PACKAGES], 0)
        self.emit(to, self.datagram(HELLO, to, peer.hellos, rest, key, nonce))

    def seal(self, to, kind, rest, purpose=FOR_PACKAGES):
        """A datagram that this incarnation seals to the peer's."""
        peer = self.peers[to]
        sequence = peer.sequences[purpose]
        peer.sequences[purpose] += 1
        return self.datagram(kind, to, sequence, rest, peer.keys[purpose], bytes(4) + struct.pack("<Q", sequence))

    def send(self, to, *packages):
        self.emit(to, self.seal(to, PACKAGES, b"".join(packages)))

    def listen(self, seconds):
        """Answers hellos for so long; what else comes is not opened."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            try:
                datagram, (address, _) = self.socket.recvfrom(65536)
            except (BlockingIOError, TimeoutError):
                continue
            if len(datagram) == 84 and datagram[3] == HELLO and address in self.addresses:
                self.handshake(datagram)

    def handshake(self, datagram):
        sender, incarnation, number = datagram[5], *struct.unpack("<QQ", datagram[16:32])
        peer = self.peers[sender]
        key = derived(self.secret, FOR_HELLO, self.system, sender, self.own)
        nonce = struct.pack("<QI", incarnation, number)
        sealed = datagram[36:-16]
        assert tag(key, nonce, datagram[:32], sealed) == datagram[-16:], "a hello of another key"
        challenge, answer, _, _ = struct.unpack("<QQQQ", cipher(key, nonce, sealed))
        if answer == peer.challenge:
            peer.challenge = int.from_bytes(os.urandom(8), "little") | 1
            if peer.incarnation != incarnation:
                ends = self.system, self.own, sender, self.incarnation, incarnation
                peer.begin(incarnation, {purpose: derived(self.secret, purpose, *ends) for purpose in peer.keys})
        if challenge:
            self.hello(sender, 0 if answer else peer.challenge, challenge)

    def alive(self, to):
        """Says that it is there and hears."""
        self.emit(to, self.seal(to, ALIVE, struct.pack("<QQQ", self.peers[to].incarnation, 0, 0)))

    def meet(self, to):
        """Until the peer has shown that it lives, for ten seconds at most."""
        until = time.monotonic() + 10
        while not self.peers[to].incarnation:
            assert time.monotonic() < until, f"node {to} does not answer"
            self.hello(to, self.peers[to].challenge, 0)
            self.listen(0.2)
