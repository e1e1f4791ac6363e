"""SipHash with key 0: of digests (2-4) and of interfaces (1-3)."""

_MASK = (1 << 64) - 1


def _left(number: int, bits: int) -> int:
    return (number << bits | number >> (64 - bits)) & _MASK


def siphash(data: bytes, compression: int, finalization: int) -> int:
    """64 bits, by so many rounds for each eight bytes and so many at the end.

    >>> hex(siphash(b"", 2, 4))
    '0x1e924b9d737700d7'
    """
    a, b, c, d = 0x736F6D6570736575, 0x646F72616E646F6D, 0x6C7967656E657261, 0x7465646279746573

    def rounds(times: int) -> None:
        nonlocal a, b, c, d
        for _ in range(times):
            a = (a + b) & _MASK
            b = _left(b, 13) ^ a
            a = _left(a, 32)
            c = (c + d) & _MASK
            d = _left(d, 16) ^ c
            a = (a + d) & _MASK
            d = _left(d, 21) ^ a
            c = (c + b) & _MASK
            b = _left(b, 17) ^ c
            c = _left(c, 32)

    whole = len(data) - len(data) % 8
    last = data[whole:] + bytes(7 - len(data) % 8) + bytes([len(data) & 0xFF])
    for word in [*(data[at : at + 8] for at in range(0, whole, 8)), last]:
        number = int.from_bytes(word, "little")
        d ^= number
        rounds(compression)
        a ^= number
    c ^= 0xFF
    rounds(finalization)
    return a ^ b ^ c ^ d
