"""A program asks a TCP router for names that are not its own, and prints each answer. Written from docs/src/wire.md.

Arguments: address and port of the TCP router, both digests (hex, with `-` between), its own name, and ranges,
`1.96.0.0-1.96.0.255`.
"""

import sys

from wire import REGISTERED, Session, connect, name


def main():
    address, port, digests, own, *ranges = sys.argv[1:]
    digests = [int(digest, 16) for digest in digests.split("-")]
    session = Session(connect(address, int(port), []), name(own), digests, "little")
    session.meet([], "a hijacker")
    for number, range in enumerate(ranges, 2):
        session.register(number, [tuple(map(name, range.split("-")))])
        kind, rest = session.frame()
        while kind != REGISTERED:
            kind, rest = session.frame()
        print(f"{range}: {rest[4]} {rest[16:].decode()}".strip(), flush=True)


main()
