"""Messages of a team, and a robot that takes part in one. Written from docs/src/wire.md, "Messages of a team".

Times are ns of the robot's own clock; a version is the pair of incarnation and counter.
"""

import pathlib
import struct
import sys
from typing import NamedTuple

sys.path.append(str(pathlib.Path(__file__).parents[3] / "clients" / "python" / "src"))

from rohrpost.siphash import siphash  # noqa: E402

HEAD = struct.Struct("<2sBBIIBBhQQ8IiihHIqQ")
ENTRY = struct.Struct("<BII3s")
RECORDS_HEAD = struct.Struct("<2sBBIQ")
LEDGER = struct.Struct("<BBII")
RECORD = struct.Struct("<IIBBBBii")
NAME = struct.Struct("<BIIII")
AGREES, HAS_POSE, HAS_REFERENCE = 1, 2, 4
AGE_UNIT_NS, AGE_UNITS_MAX, HOPS_MAX = 128_000, (1 << 18) - 1, 31
RECORDS_BYTES_MAX, SYNCHRO_BYTES_MAX, RECORDS_MAX, NAMES_MAX = 16_384, 8_192, 32, 8
SEEN, UNCERTAIN, EMPTY, GONE = range(4)
PARTS = 8


class Malformed(ValueError):
    """Bytes that are no message of a team."""


class Entry(NamedTuple):
    robot: int
    version: tuple
    age_ns: int
    hops: int
    agrees: bool


class Hello(NamedTuple):
    sender: int
    version: tuple
    map: int
    sent_ns: int
    digests: tuple
    agrees: bool
    # x, y in mm, heading in mrad, speed in mm/s.
    pose: tuple | None
    # Digest of its tree of events; 0: none.
    tree: int
    # Robot, incarnation, offset and bound in ns.
    reference: tuple | None
    entries: tuple


class Record(NamedTuple):
    """Compared in this order: of two records with one number the greater stands."""

    version: tuple
    state: int
    kind: int
    position: tuple
    may_be: int
    # Observer, number, version.
    names: tuple


class Records(NamedTuple):
    sender: int
    map: int
    is_synchro: bool
    # By observer: floor, and by number a record and its age in ms.
    ledgers: dict


def check(holds, what):
    if not holds:
        raise Malformed(what)


class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, form):
        check(self.at + form.size <= len(self.data), f"ends at byte {self.at}")
        fields = form.unpack_from(self.data, self.at)
        self.at += form.size
        return fields

    def end(self):
        check(self.at == len(self.data), f"goes on at byte {self.at}")


def is_robot(number):
    return 1 <= number <= 254


def decode_hello(data):
    reader = Reader(data)
    (magic, flags, sender, incarnation, counter, count, robot, speed, map, sent_ns, *rest) = reader.take(HEAD)
    digests, (x, y, heading, tree, its_incarnation, offset_ns, bound_ns) = tuple(rest[:PARTS]), rest[PARTS:]
    check(magic == b"H\x01" and flags < 8 and is_robot(sender), "no hello of layout 1")
    pose, reference = (x, y, heading, speed), (robot, its_incarnation, offset_ns, bound_ns)
    check(flags & HAS_POSE or not any(pose), "a pose without its flag")
    check(is_robot(robot) if flags & HAS_REFERENCE else not any(reference), "a reference without its flag")
    entries, last = [], 0
    for _ in range(count):
        other, its_incarnation, its_counter, bits = reader.take(ENTRY)
        bits = int.from_bytes(bits, "little")
        units = bits & AGE_UNITS_MAX
        check(is_robot(other) and last < other != sender and units < AGE_UNITS_MAX, f"entry of {other}")
        age_ns, last = units * AGE_UNIT_NS, other
        entries.append(Entry(other, (its_incarnation, its_counter), age_ns, bits >> 18 & HOPS_MAX, bits >> 23 == 1))
    reader.end()
    return Hello(
        sender, (incarnation, counter), map, sent_ns, digests, flags & AGREES != 0,
        pose if flags & HAS_POSE else None, tree, reference if flags & HAS_REFERENCE else None, tuple(entries),
    )  # fmt: skip


def encode_hello(hello):
    flags = hello.agrees * AGREES | (hello.pose is not None) * HAS_POSE | (hello.reference is not None) * HAS_REFERENCE
    x, y, heading, speed = hello.pose or (0, 0, 0, 0)
    robot, incarnation, offset_ns, bound_ns = hello.reference or (0, 0, 0, 0)
    out = HEAD.pack(
        b"H\x01", flags, hello.sender, *hello.version, len(hello.entries), robot, speed, hello.map, hello.sent_ns,
        *hello.digests, x, y, heading, hello.tree, incarnation, offset_ns, bound_ns,
    )  # fmt: skip
    for entry in hello.entries:
        bits = entry.age_ns // AGE_UNIT_NS | entry.hops << 18 | entry.agrees << 23
        out += ENTRY.pack(entry.robot, *entry.version, bits.to_bytes(3, "little"))
    return out


def decode_record(reader):
    incarnation, counter, state, kind, may_be, count, x, y = reader.take(RECORD)
    check(state <= GONE and kind <= 1 and may_be < 255 and count <= NAMES_MAX, "a record")
    names = []
    for _ in range(count):
        observer, *rest = reader.take(NAME)
        name = observer, tuple(rest[:2]), tuple(rest[2:])
        check(is_robot(observer) and (not names or names[-1] < name), "names ascend")
        names.append(name)
    return Record((incarnation, counter), state, kind, (x, y), may_be, tuple(names))


def encode_record(record):
    """All that stands behind the age."""
    out = RECORD.pack(
        *record.version, record.state, record.kind, record.may_be, len(record.names), *record.position
    )  # fmt: skip
    return out + b"".join(NAME.pack(observer, *number, *version) for observer, number, version in record.names)


def decode_records(data):
    check(len(data) <= RECORDS_BYTES_MAX, "too long")
    reader = Reader(data)
    magic, sender, count, synchro, map = reader.take(RECORDS_HEAD)
    check(magic == b"R\x01" and is_robot(sender) and synchro <= 1, "no records of layout 1")
    ledgers, last = {}, 0
    for _ in range(count):
        observer, number_of, *floor = reader.take(LEDGER)
        check(is_robot(observer) and last < observer and number_of <= RECORDS_MAX, f"ledger of {observer}")
        last, floor, records = observer, tuple(floor), {}
        for _ in range(number_of):
            *number, age_ms = reader.take(struct.Struct("<III"))
            number = tuple(number)
            check(not records or max(records) < number, "numbers ascend")
            record = decode_record(reader)
            check(record.version >= max(number, floor), "a version is not below number and floor")
            records[number] = record, age_ms
        ledgers[observer] = floor, records
    reader.end()
    return Records(sender, map, synchro == 1, ledgers)


def encode_records(message):
    out = RECORDS_HEAD.pack(b"R\x01", message.sender, len(message.ledgers), message.is_synchro, message.map)
    return out + b"".join(encode_ledger(observer, *message.ledgers[observer]) for observer in sorted(message.ledgers))


def encode_ledger(observer, floor, records):
    out = LEDGER.pack(observer, len(records), *floor)
    for number in sorted(records):
        record, age_ms = records[number]
        out += struct.pack("<III", *number, age_ms) + encode_record(record)
    return out


def digest(observer, floor, records):
    """Of a ledger."""
    if floor == (0, 0) and not records:
        return 0
    each = (struct.pack("<II", *number) + encode_record(records[number][0]) for number in sorted(records))
    return siphash(struct.pack("<BII", observer, *floor) + b"".join(each), 1, 3) & 0xFFFFFFFF


def decode(data):
    return decode_hello(data) if data[:1] == b"H" else decode_records(data)


def encode(message):
    return encode_hello(message) if isinstance(message, Hello) else encode_records(message)


class Member:
    """What a robot knows of another one."""

    def __init__(self, version, sent_ns, hops, agrees):
        self.version, self.sent_ns, self.hops, self.agrees = version, sent_ns, hops, agrees
        # Its last hello that came here, and when.
        self.hello, self.heard_ns = None, 0
        # It does not know its own newest counter.
        self.is_behind = False


class Robot:
    def __init__(self, own, incarnation, map, beat_ns, max_age_ns):
        self.own, self.version, self.map = own, (incarnation, 0), map
        self.beat_ns, self.max_age_ns = beat_ns, max_age_ns
        self.members, self.has_raised = {}, False
        # By observer: floor, and by number a record and when it was seen.
        self.ledgers, self.newest, self.unsent = {}, (incarnation, 0), set()
        self.missing, self.last_synchro, self.cursor, self.synchros = {}, (0, 0), 0, 0

    # The group.

    def fresh(self, now_ns):
        known = self.members.items()
        return {robot: it for robot, it in known if now_ns - it.sent_ns <= self.max_age_ns + self.beat_ns * it.hops}

    def heard(self, now_ns):
        fresh = self.fresh(now_ns).items()
        return {robot: it for robot, it in fresh if it.hello and now_ns - it.heard_ns <= self.max_age_ns}

    def pair(self, now_ns):
        """Leader and group."""
        robots = {self.own, *self.fresh(now_ns)}
        return min(robots), max(robots)

    def hear_of_me(self, version):
        if version > self.version and not self.has_raised:
            self.has_raised, self.version = True, (version[0] + 1, 0)
            self.newest = max(self.newest, self.version)

    def advance(self, robot, version, sent_ns, hops, agrees):
        known = self.members.get(robot)
        if known is None or version > known.version:
            new = self.members[robot] = Member(version, sent_ns, hops, agrees)
            if known and known.version[0] == version[0]:
                new.hello, new.heard_ns = known.hello, known.heard_ns
        elif version == known.version:
            known.hops, known.sent_ns = min(known.hops, hops), min(known.sent_ns, sent_ns)

    def hear(self, now_ns, message):
        """Takes a message that was read."""
        if isinstance(message, Hello):
            self.hear_hello(now_ns, message)
        else:
            self.hear_records(now_ns, message)

    def hear_hello(self, now_ns, hello):
        known = self.members.get(hello.sender)
        if hello.sender == self.own:
            return self.hear_of_me(hello.version)
        if known and hello.version < known.version:
            known.is_behind = True
        if known and (hello.version[0] < known.version[0] or known.hello and hello.version <= known.hello.version):
            return None
        is_first = hello.sender not in self.heard(now_ns)
        self.advance(hello.sender, hello.version, now_ns, 0, hello.agrees)
        for entry in hello.entries:
            if entry.robot == self.own:
                self.hear_of_me(entry.version)
            elif entry.hops < HOPS_MAX:
                self.advance(entry.robot, entry.version, now_ns - entry.age_ns, entry.hops + 1, entry.agrees)
        known = self.members[hello.sender]
        known.hello, known.heard_ns = hello, now_ns
        of_me = next((it.version for it in hello.entries if it.robot == self.own and it.hops == 0), None)
        can_help = is_first or of_me is not None and of_me >= self.last_synchro
        own, theirs = self.digests(), hello.digests
        if hello.map == self.map:
            self.missing[hello.sender] = {part for part in range(PARTS) if can_help and own[part] != theirs[part]}
        else:
            self.missing.pop(hello.sender, None)
        return None

    # The view.

    def digests(self):
        out = [0] * PARTS
        for observer, ledger in self.ledgers.items():
            out[observer % PARTS] ^= digest(observer, *ledger)
        return tuple(out)

    def hear_records(self, now_ns, message):
        if message.map != self.map:
            return
        changed = {observer % PARTS for observer, its in message.ledgers.items() if self.join(now_ns, observer, *its)}
        whole = {observer % PARTS for observer in message.ledgers if message.is_synchro}
        sender = self.members.get(message.sender)
        hears = {it.robot for it in sender.hello.entries if it.hops == 0} if sender and sender.hello else set()
        for robot in self.missing.keys() - {message.sender}:
            self.missing[robot] = self.missing[robot] - whole if robot in hears else self.missing[robot] | changed

    def join(self, now_ns, observer, floor, records):
        own_floor, own = self.ledgers.setdefault(observer, ((0, 0), {}))
        has_changed = floor > own_floor
        floor = max(floor, own_floor)
        own = {number: its for number, its in own.items() if its[0].version >= floor}
        for number, (record, age_ms) in sorted(records.items()):
            seen_ns, known = now_ns - age_ms * 1_000_000, own.get(number)
            if known and known[0] == record:
                own[number] = record, min(known[1], seen_ns)
            elif known and record > known[0] or not known and len(own) < RECORDS_MAX and record.version >= floor:
                own[number], has_changed = (record, seen_ns), True
        self.ledgers[observer] = floor, own
        if observer == self.own:
            self.newest = max([self.newest, floor, *(record.version for record, _ in own.values())])
        return has_changed

    def see(self, now_ns, position):
        """Something is at a place; its number."""
        self.newest = self.newest[0], self.newest[1] + 1
        number = self.newest
        _, own = self.ledgers.setdefault(self.own, ((0, 0), {}))
        own[number] = Record(number, SEEN, 0, position, 0, ()), now_ns
        self.unsent.add(number)
        return number

    def aged(self, now_ns, observer, numbers=None):
        floor, records = self.ledgers[observer]
        ages = {number: (record, (now_ns - seen_ns) // 1_000_000) for number, (record, seen_ns) in records.items()}
        return floor, {number: its for number, its in ages.items() if numbers is None or number in numbers}

    def synchro(self, now_ns):
        """Ledgers of the parts that robots in range miss, as many as have room; the next one goes on from there."""
        parts = set().union(*(self.missing.get(robot, set()) for robot in self.heard(now_ns)))
        self.missing = dict.fromkeys(self.missing, set())
        ledgers, length = {}, RECORDS_HEAD.size
        for observer in sorted(self.ledgers, key=lambda it: (it <= self.cursor, it)):
            ledger = self.aged(now_ns, observer)
            if observer % PARTS in parts:
                length += len(encode_ledger(observer, *ledger))
                if length > SYNCHRO_BYTES_MAX:
                    break
                ledgers[observer] = ledger
        if ledgers:
            self.cursor = list(ledgers)[-1]
            self.last_synchro, self.synchros = self.version, self.synchros + 1
        return ledgers

    # The beat.

    def beat(self, now_ns, pose=None):
        """What is sent, in this order."""
        self.version = self.version[0], self.version[1] + 1
        entries = {
            robot: Entry(robot, it.version, now_ns - it.sent_ns, it.hops, it.agrees)
            for robot, it in self.fresh(now_ns).items()
            if it.hops <= HOPS_MAX and (now_ns - it.sent_ns) // AGE_UNIT_NS < AGE_UNITS_MAX
        }
        for robot, it in self.members.items():
            if it.is_behind:
                entries.setdefault(robot, Entry(robot, it.version, 0, HOPS_MAX, False))
            it.is_behind = False
        messages = []
        if self.unsent:
            new = {self.own: self.aged(now_ns, self.own, self.unsent)}
            messages.append(Records(self.own, self.map, False, new))
            self.unsent = set()
        if ledgers := self.synchro(now_ns):
            messages.append(Records(self.own, self.map, True, ledgers))
        digests = self.digests()
        heard = self.heard(now_ns).values()
        agrees = all(it.hello.map == self.map and it.hello.digests == digests for it in heard)
        # Its own clock is the only one that it knows.
        reference = (self.own, self.version[0], 0, 0) if self.pair(now_ns)[0] == self.own else None
        entries = tuple(entries[robot] for robot in sorted(entries))
        own = self.own, self.version, self.map, now_ns
        return [*messages, Hello(*own, digests, agrees, pose, 0, reference, entries)]

    def agrees(self, now_ns):
        """Whether its view is that of all fresh robots."""
        own = self.digests()
        heard = all(it.hello.map == self.map and it.hello.digests == own for it in self.heard(now_ns).values())
        return heard and all(it.agrees for it in self.fresh(now_ns).values())
