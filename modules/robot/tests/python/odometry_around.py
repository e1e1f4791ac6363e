"""Which two odometry records of a CARMEN log are around each of its scans, or why there are none.

    odometry_around.py LOG LATENESS_NS GAP_MAX_NS OFFSET_NS ...

Reads the log itself, and knows nothing of Rohrpost's code. For each scan and each offset from its stamp one line:
the scan's line in the log, the offset, and `at LINE`, `between LINE LINE`, or a reason with how far.
"""

import bisect
import decimal
import gzip
import math
import sys


def lines(path):
    with open(path, "rb") as file:
        data = file.read()
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    return data.decode("utf-8", "replace").split("\n")


def stamp_ns(fields):
    """The stamp is the third field from the end; fields before it, and the last one, are numbers."""
    numbers = [float(field) for field in fields[1:-2] + fields[-1:]]
    if not all(map(math.isfinite, numbers)):
        raise ValueError
    exact = decimal.Decimal(fields[-3]) * 10**9
    return int(exact.to_integral_value(decimal.ROUND_HALF_UP))


def records(path):
    for number, line in enumerate(lines(path), 1):
        fields = line.split()
        try:
            if fields[:1] == ["ODOM"] and len(fields) == 10:
                yield "odometry", number, stamp_ns(fields)
            elif fields[:1] == ["FLASER"] and len(fields) == int(fields[1]) + 11:
                yield "scan", number, stamp_ns(fields)
        except (ValueError, IndexError):
            pass


def answer(known, newest, lateness, gap_max, asked):
    """`known` is sorted; of records with one stamp, the last in the log answers."""
    after = bisect.bisect_left(known, (asked, 0))
    if not known:
        return "empty"
    if after == len(known):
        return f"not yet {asked + lateness - newest}"
    stamp = known[after][0]
    line = known[bisect.bisect_right(known, (stamp, math.inf)) - 1][1]
    if stamp + lateness > newest:
        return f"not yet {stamp + lateness - newest}"
    if stamp == asked:
        return f"at {line}"
    if after == 0:
        return f"before {stamp - asked}"
    before, before_line = known[after - 1]
    if stamp - before > gap_max:
        return f"gap {stamp - before}"
    return f"between {before_line} {line}"


def main(path, lateness, gap_max, *offsets):
    known, scans, newest, late = [], [], None, 0
    for kind, line, stamp in records(path):
        if kind == "scan":
            scans.append((line, stamp))
        elif newest is not None and stamp < newest and newest - stamp >= lateness:
            late += 1
        else:
            known.append((stamp, line))
            newest = stamp if newest is None else max(newest, stamp)
    known.sort()
    print(f"{len(known)} odometry records, {late} too late")
    for line, stamp in scans:
        for offset in offsets:
            print(f"{line} {offset:+} {answer(known, newest, lateness, gap_max, stamp + offset)}")


main(sys.argv[1], *map(int, sys.argv[2:]))
