"""A hostile node of the LAN with the key, at the port of replicas: it sends parts of a stream that it does not write,
and datagrams that are not sealed, sealed for another port, altered, or sent again; until it is ended.

Arguments: digest of the LAN (hex), port, the file of keys, its own place among the nodes, the place of the node that
has the replica, and the addresses of all nodes in their order.
"""

import os
import struct
import sys

from lan import DESCRIPTION, FOR_REPLICAS, RECORD_PART, REPLICA_PORT, Node


def record_part(number):
    """A whole record of the first replica, far ahead of all that its writer has written."""
    bytes = os.urandom(40)
    return struct.pack("<HHIIIIQQQQII", 0, 0, 1, 1, len(bytes), 0, 10**6 + number, 1, 1, 0, 0, 0) + bytes


def description():
    """Of a module that has another interface."""
    bytes = os.urandom(40)
    return struct.pack("<HHIIIQ", 0, 0, 1, len(bytes), 0, 10**6) + bytes


def main():
    digest, port, keys, own, to, *addresses = sys.argv[1:]
    with open(keys) as file:
        _, key_id, secret = next(line for line in file if line.startswith("key ")).split()
    node = Node(int(digest, 16), 1, int(own), addresses, int(port), int(key_id), bytes.fromhex(secret))
    to = int(to)
    node.meet(to)
    print("takes part", flush=True)
    number = 0
    while True:
        number += 1
        part = node.seal(to, RECORD_PART, record_part(number), FOR_REPLICAS)
        altered = bytearray(node.seal(to, RECORD_PART, record_part(number), FOR_REPLICAS))
        altered[-20] ^= 1
        unsealed = bytearray(part)
        unsealed[7] = 0
        for datagram in (
            part,
            part,
            node.seal(to, DESCRIPTION, description(), FOR_REPLICAS),
            node.seal(to, RECORD_PART, record_part(number)),
            node.checked(altered),
            node.checked(unsealed),
            os.urandom(200),
        ):
            node.emit(to, datagram, REPLICA_PORT)
        node.alive(to)
        node.listen(0.05)


main()
