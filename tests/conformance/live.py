"""The live cases: the suite takes part at a TCP router itself, and is the other side of the client under test.

It speaks by `wire.py` of the end-to-end tests, which was written from `docs/src/wire.md` alone, so that no client is
measured by its own code. Both programs are of system 7, which no file describes.
"""

import pathlib
import random
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "e2e" / "python"))

import wire  # noqa: E402

OWN, PEER = "7.96.0.0", "7.97.0.0"
PATIENCE_S = 20.0
"""What comes at once on a computer that is not busy has this long; so have calls and leases that are not to end."""
LONG_MS = 20_000
COMMON = 4
DOUBLE, COUNT, REFUSE, AGAIN, BEAT = 16, 17, 18, 19, 1
MODULE_OFF, INTERRUPTED, INTERFACE_DIFFERS, UNKNOWN, ARGUMENTS, BUSY, EARLIER = 0, 2, 3, 4, 5, 7, 20
UNSUBSCRIBE, REDELIVERED, NEWEST = 6, 8, 16

U32, U64, TEXT, PLAIN = b"\x04", b"\x05", b"\x0f", b"\x00"


def function(number, name, idempotent, arguments, result):
    fields = b"".join(wire.text(of) + PLAIN + type for of, type in arguments)
    head = wire.varint(number) + wire.text(name) + wire.text("") + bytes([idempotent])
    return head + wire.varint(len(arguments)) + fields + result


RESULT = b"\x17" + wire.text("Result") + b"\x00\x02" + b"".join(
    wire.text(name) + b"\x00\x01\x00\x00" + type for name, type in (("Ok", U32), ("Err", TEXT))
)  # fmt: skip
DESCRIPTION = (
    b"\x02" + wire.text("Probing") + wire.text("probe") + wire.text("") + wire.varint(4)
    + function(DOUBLE, "double", 0, [("number", U32)], U64)
    + function(COUNT, "count", 0, [], U64)
    + function(REFUSE, "refuse", 0, [("why", TEXT)], RESULT)
    + function(AGAIN, "again", 1, [], U64)
    + wire.varint(1) + wire.varint(BEAT) + b"\x00" + wire.text("beat") + PLAIN + U64
)
FAULTS = {
    0: b"", 1: wire.text("broken"), 2: b"", 3: wire.varint(7), 4: wire.varint(16), 5: wire.text("none"), 6: b"",
    7: b"", 8: b"", 9: wire.varint(70_000), 10: b"", 11: b"", 12: wire.varint(1024), 13: b"", 14: wire.text("arm"),
    15: wire.text("arm"), 16: wire.text("arm") + wire.text("why"), 17: b"", 18: b"",
    19: wire.text("arm") + wire.text("a rule"), 20: b"",
}  # fmt: skip


class Wrong(Exception):
    """What does not conform."""


def require(is_so, what):
    if not is_so:
        raise Wrong(what)


class Package:
    """A package that came."""

    def __init__(self, fields):
        self.to, self.sender, _, self.kind, self.id, self.priority, options, self.body = fields
        self.options = options
        if 0 < self.kind < 16384:
            envelope = struct.unpack("<5I", self.body[:20])
            self.interface, self.incarnation, self.sequence, self.valid_us, self.age_us = envelope
            self.arguments = self.body[20:]


class Peer(wire.Session):
    """The suite's own program, `probe` under another instance of the system."""

    sequence = 100

    def package(self):
        """As in `wire.py`, with the priority too, and not for ever."""
        until = time.monotonic() + PATIENCE_S
        while True:
            kind, rest = self.frame(until)
            require(kind is not None, "nothing more came from the client")
            require(kind != wire.REFUSAL, f"the TCP router refuses the suite: {rest[24:]!r}")
            if kind == wire.PACKAGE:
                head, body = rest[8:24], rest[24:]
                order = ">" if head[15] & wire.BIG_ENDIAN else "<"
                return Package(struct.unpack(order + "IIHhH", head[:14]) + (head[14], head[15], body))

    def next(self, is_it):
        """The next package that is the one, answering `describe` on the way."""
        while True:
            its = self.package()
            if its.kind == wire.DESCRIBE and its.to == self.own:
                at, _ = wire.unvarint(its.arguments)
                part = DESCRIPTION[at : at + 768]
                self.reply(its, wire.varint(len(DESCRIPTION)) + wire.varint(len(part)) + part)
            elif is_it(its):
                return its

    def command(self, number=None):
        return self.next(lambda its: its.kind > 0 and number in (None, its.kind))

    def reply(self, its, result, options=0, sequence=None, incarnation=None, sender=None):
        envelope = struct.pack("<II", incarnation or its.incarnation, sequence or its.sequence)
        self.send(its.sender, sender or its.to, -its.kind, its.id, envelope + result, its.priority, options)

    def begin(
        self, to, number, interface, arguments=b"", incarnation=None, sequence=None, age_us=0, options=0, valid=LONG_MS * 1000
    ):
        if sequence is None:
            self.sequence += 1
            sequence = self.sequence
        body = struct.pack("<5I", interface, incarnation or self.incarnation, sequence, valid, age_us) + arguments
        self.send(to, self.own | 1, number, sequence & 0xFFFF, body, self.own >> 16 & 0xFF, options)
        return sequence

    def answer(self, number, sequence):
        """The fault's number or none, and the rest; and the package."""
        its = self.next(lambda its: its.kind == -number and struct.unpack("<I", its.body[4:8])[0] == sequence)
        rest = its.body[8:]
        return (wire.unvarint(rest) if its.options & wire.ERROR else (None, rest)), its

    def ask(self, to, number, interface, arguments=b"", **how):
        return self.answer(number, self.begin(to, number, interface, arguments, **how))[0]


class Live:
    """The cases; each method that begins with `case_` is one."""

    def __init__(self, client, peer, hash, hosts):
        self.client, self.peer, self.hash, self.to = client, peer, hash, wire.name(hosts)

    def call(self, timeout_ms=LONG_MS, number=DOUBLE, arguments=b"\x15"):
        self.client.tell({
            "do": "call", "to": PEER, "function": number, "interface": self.hash, "arguments": arguments.hex(),
            "timeout_ms": timeout_ms,
        })  # fmt: skip

    def heard(self, expected):
        got = self.client.hear()
        require(got == {"ok": expected}, f"expected {expected}, got {got}")

    def case_a_call_has_the_bytes_of_the_page_and_its_result_comes_back(self):
        self.call()
        its = self.peer.command(DOUBLE)
        require(its.sender & 0xFF == 1, "it is sent from local id 1")
        require(its.id == its.sequence & 0xFFFF, "the id is the lower half of the sequence")
        require(its.priority == its.sender >> 16 & 0xFF, f"the priority is the class, not {its.priority}")
        require(its.age_us == 0, "a first try has age 0")
        require(its.valid_us == LONG_MS * 1000, f"it is valid for 20 s, not {its.valid_us} us")
        require((its.interface, its.arguments) == (self.hash, b"\x15"), "interface and arguments")
        self.peer.reply(its, wire.varint(42))
        self.heard({"result": "2a"})

    def case_a_call_is_repeated_with_the_same_number_until_its_answer_comes(self):
        self.call(timeout_ms=6000)
        first, second = self.peer.command(DOUBLE), self.peer.command(DOUBLE)
        require((first.incarnation, first.sequence) == (second.incarnation, second.sequence), "the same call")
        require(first.arguments == second.arguments and second.age_us > 0, f"an age: {second.age_us}")
        self.peer.reply(second, wire.varint(42))
        self.heard({"result": "2a"})

    def case_a_call_without_an_answer_ends_after_three_tries(self):
        self.call(timeout_ms=1800)
        ages = [self.peer.command(DOUBLE).age_us for _ in range(3)]
        require(ages == sorted(ages) and ages[0] == 0, f"{ages}")
        self.heard({"timeout": True})

    def case_each_fault_is_told_by_its_number(self):
        for number, carries in FAULTS.items():
            self.call()
            self.peer.reply(self.peer.command(DOUBLE), wire.varint(number) + carries, wire.ERROR)
            self.heard({"fault": number})

    def case_a_fault_of_one_try_does_not_end_a_call_that_was_repeated(self):
        self.call(timeout_ms=6000)
        self.peer.command(DOUBLE)
        again = self.peer.command(DOUBLE)
        self.peer.reply(again, wire.varint(BUSY), wire.ERROR)
        self.peer.reply(again, wire.varint(42))
        self.heard({"result": "2a"})

    def case_what_answers_another_call_is_dropped(self):
        self.call()
        its = self.peer.command(DOUBLE)
        self.peer.reply(its, wire.varint(1), sequence=its.sequence + 1)
        self.peer.reply(its, wire.varint(2), incarnation=its.incarnation ^ 1)
        self.peer.reply(its, wire.varint(3), sender=wire.name(PEER) | 0x100)
        its.kind += 1
        self.peer.reply(its, wire.varint(4))
        its.kind -= 1
        self.peer.reply(its, wire.varint(42))
        self.heard({"result": "2a"})

    def case_eight_calls_to_one_server_may_be_under_way_and_each_gets_its_own_answer(self):
        # A client may send them in any order: threads of it have begun them.
        for number in range(8):
            self.client.tell({
                "do": "begin", "to": PEER, "function": DOUBLE, "interface": self.hash, "arguments": f"{number:02x}",
                "timeout_ms": LONG_MS,
            })  # fmt: skip
        commands = [self.peer.command(DOUBLE) for _ in range(8)]
        require(len({its.sequence for its in commands}) == 8, "each has a number of its own")
        for its in random.Random(7).sample(commands, 8):
            self.peer.reply(its, its.arguments)
        for number in range(8):
            self.client.tell({"do": "wait"})
            self.heard({"result": f"{number:02x}"})

    def case_its_module_answers_and_describes_itself(self):
        (fault, rest), its = self.peer.answer(DOUBLE, self.peer.begin(self.to, DOUBLE, self.hash, wire.varint(21)))
        require((fault, rest) == (None, b"\x2a"), f"{fault} {rest!r}")
        require(its.priority == 97, f"a reply has the priority of its command, not {its.priority}")
        described, total = b"", 1
        while len(described) < total:
            fault, rest = self.peer.ask(self.to, wire.DESCRIBE, COMMON, wire.varint(len(described)))
            total, rest = wire.unvarint(rest)
            described += wire.unvarint(rest)[1]
        known = self.client.ask({"do": "interface", "bytes": described.hex()})
        require(known["ok"]["hash"] == self.hash, f"it describes another interface: {known}")

    def case_its_module_returns_its_own_error_as_a_result(self):
        answer = self.peer.ask(self.to, REFUSE, self.hash, wire.text("no"))
        require(answer == (None, b"\x01\x02no"), f"{answer}")

    def case_its_module_refuses_what_it_does_not_have(self):
        for what, answer, number in [
            ("a function", self.peer.ask(self.to, 99, self.hash), UNKNOWN),
            ("another interface", self.peer.ask(self.to, DOUBLE, self.hash ^ 1, b"\x15"), INTERFACE_DIFFERS),
            ("another version", self.peer.ask(self.to, wire.STATUS, COMMON - 1), INTERFACE_DIFFERS),
            ("bytes behind the arguments", self.peer.ask(self.to, DOUBLE, self.hash, b"\x15\x00"), ARGUMENTS),
            ("too few arguments", self.peer.ask(self.to, DOUBLE, self.hash), ARGUMENTS),
            ("bytes behind those of status", self.peer.ask(self.to, wire.STATUS, COMMON, b"\x00"), ARGUMENTS),
        ]:
            require(answer[0] == number, f"{what}: {answer}")
        fault, rest = self.peer.ask(self.to, DOUBLE, self.hash ^ 1, b"\x15")
        require(wire.unvarint(rest)[0] == self.hash, "it tells its own hash")

    def case_a_command_runs_at_most_once(self):
        first = self.peer.begin(self.to, COUNT, self.hash)
        (_, counted), _ = self.peer.answer(COUNT, first)
        again = self.peer.ask(self.to, COUNT, self.hash, sequence=first, age_us=100)
        require(again == (None, counted), f"it is answered from memory: {again}")
        fault, rest = self.peer.ask(self.to, COUNT, self.hash)
        require(wire.unvarint(rest)[0] == wire.unvarint(counted)[0] + 1, "the repeat was not run")

    def case_what_may_have_run_before_is_interrupted(self):
        old_us = 3_600_000_000
        answer = self.peer.ask(self.to, COUNT, self.hash, age_us=old_us, valid=old_us)
        require(answer[0] == INTERRUPTED, f"first tried before it lived: {answer}")
        answer = self.peer.ask(self.to, COUNT, self.hash, options=REDELIVERED)
        require(answer[0] == INTERRUPTED, f"redelivered: {answer}")
        answer = self.peer.ask(self.to, AGAIN, self.hash, options=REDELIVERED)
        require(answer[0] is None, f"idempotent: {answer}")

    def case_a_repeat_that_is_too_old_is_answered_by_nothing(self):
        # Idempotent, so that it is not interrupted; what comes behind it is answered.
        sequence = self.peer.begin(self.to, AGAIN, self.hash, age_us=2_000_000, valid=1_000_000)
        other = self.peer.begin(self.to, wire.STATUS, COMMON)
        its = self.peer.next(lambda its: its.kind in (-AGAIN, -wire.STATUS))
        require(struct.unpack("<I", its.body[4:8])[0] == other, f"call {sequence} is answered")

    def case_an_earlier_incarnation_learns_why_it_is_not_served(self):
        later = self.peer.incarnation + 1000
        require(self.peer.ask(self.to, COUNT, self.hash, incarnation=later)[0] is None, "a later one is served")
        answer = self.peer.ask(self.to, COUNT, self.hash)
        require(answer[0] == EARLIER, f"{answer}")
        self.peer.incarnation = later

    def case_it_is_switched_off_and_on(self):
        require(self.peer.ask(self.to, wire.OFF, COMMON) == (None, b""), "off")
        require(self.peer.ask(self.to, DOUBLE, self.hash, b"\x15")[0] == MODULE_OFF, "it is off")
        fault, status = self.peer.ask(self.to, wire.STATUS, COMMON)
        require((fault, status[:2]) == (None, b"\x01\x00"), f"status: off, no error: {status!r}")
        require(self.peer.ask(self.to, wire.ON, COMMON) == (None, b""), "on")
        require(self.peer.ask(self.to, DOUBLE, self.hash, b"\x15") == (None, b"\x2a"), "it is on")
        require(self.peer.ask(self.to, wire.STATUS, COMMON)[1][0] == 2, "status: on")

    def data(self):
        return self.peer.next(lambda its: its.kind == wire.data(BEAT) and its.sender == self.to)

    def wish(self, id, period_us=0, lease_ms=LONG_MS):
        return wire.varint(BEAT) + wire.varint(id) + wire.varint(period_us) + wire.varint(lease_ms) + b"\x02"

    def case_it_publishes_to_its_subscribers(self):
        for options in (0, NEWEST):
            self.publishes(options)

    def publishes(self, options):
        require(self.peer.ask(self.to, wire.SUBSCRIBE, self.hash, self.wish(5), options=options)[0] is None, "taken")
        beats = [self.data() for _ in range(3)]
        numbers = [struct.unpack("<QIII", its.body[:20]) for its in beats]
        counts = [number[1] for number in numbers]
        # Of the newest alone some may have been replaced on the way.
        require(counts == [0, 1, 2] if not options else counts == sorted(set(counts)), f"counted from 0: {numbers}")
        require(all(number[3] == self.peer.incarnation for number in numbers), "the request's incarnation")
        require(all(its.id == 5 and its.to == self.peer.own | 2 for its in beats), "its id, and local id 2")
        require(all(its.options & (wire.STAMPED | NEWEST) == wire.STAMPED | options for its in beats), "options")
        require(all(its.priority == 97 for its in beats), "the priority of the request")
        values = [wire.unvarint(its.body[20:])[0] for its in beats]
        require(values == sorted(set(values)), f"{values}")
        got = self.peer.ask(self.to, wire.GET_DATA, self.hash, wire.varint(BEAT))
        require(got[0] is None and wire.unvarint(wire.unvarint(got[1])[1])[0] >= values[-1], f"the newest: {got}")
        require(self.peer.ask(self.to, UNSUBSCRIBE, COMMON, wire.varint(5) + b"\x02")[0] is None, "ended")
        self.none_left()

    def none_left(self):
        """Waits until nobody subscribes: behind state, error, incarnation and uptime stands their number."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            _, status = self.peer.ask(self.to, wire.STATUS, COMMON)
            if wire.unvarint(wire.unvarint(wire.unvarint(status[2:])[1])[1])[0] == 0:
                return
        raise Wrong("it still has subscribers")

    def case_a_subscription_ends_with_its_lease(self):
        require(self.peer.ask(self.to, wire.SUBSCRIBE, self.hash, self.wish(6, lease_ms=1000))[0] is None, "taken")
        self.data()
        self.none_left()

    def case_a_period_bounds_how_often_data_come(self):
        wish = self.wish(7, period_us=300_000)
        require(self.peer.ask(self.to, wire.SUBSCRIBE, self.hash, wish)[0] is None, "taken")
        values = [wire.unvarint(self.data().body[20:])[0] for _ in range(2)]
        # A client that stands still makes fewer values, so that now and then none is left out.
        while values[-1] <= values[-2] + 1 and len(values) < 20:
            values.append(wire.unvarint(self.data().body[20:])[0])
        require(values[-1] > values[-2] + 1, f"only the newest: {values}")
        self.peer.ask(self.to, UNSUBSCRIBE, COMMON, wire.varint(7) + b"\x02")
        refused = self.peer.ask(self.to, wire.SUBSCRIBE, self.hash, self.wish(7)[:-1] + b"\x01")
        require(refused[0] is not None, "mailbox 1 takes no data")

    def case_it_subscribes_renews_and_takes_only_what_it_asked_for(self):
        self.client.tell({"do": "follow", "to": PEER, "data": "beat", "count": 3})
        first = self.peer.command(wire.SUBSCRIBE)
        self.peer.reply(first, b"")
        number, rest = wire.unvarint(first.arguments)
        id, rest = wire.unvarint(rest)
        period, rest = wire.unvarint(rest)
        lease_ms, mailbox = wire.unvarint(rest)
        require(first.interface == self.hash, "the interface with those data")
        require((number, period) == (BEAT, 0) and mailbox[0] >= 2, f"{first.arguments!r}")
        self.beat(first, id, mailbox[0], 0, 10)
        self.beat(first, id, mailbox[0], 1, 98, incarnation=first.incarnation ^ 1)
        self.beat(first, id ^ 1, mailbox[0], 1, 99)
        self.beat(first, id, mailbox[0], 1, 97, number=2)
        self.beat(first, id, mailbox[0], 3, 11)
        # One that stands still may be late once.
        for _ in range(4):
            began = time.monotonic()
            again = self.peer.command(wire.SUBSCRIBE)
            if time.monotonic() - began < lease_ms / 1000:
                break
            self.peer.reply(again, b"")
        else:
            raise Wrong("it is renewed after the lease has ended")
        require(again.arguments == first.arguments and again.sequence != first.sequence, "the same, a new call")
        self.peer.reply(again, b"")
        self.beat(again, id, mailbox[0], 4, 12)
        self.heard([[0, "0a"], [3, "0b"], [4, "0c"]])
        ended = self.peer.command(UNSUBSCRIBE)
        self.peer.reply(ended, b"")

    def beat(self, asked, id, mailbox, sequence, value, incarnation=None, number=BEAT):
        body = struct.pack("<QIII", 1, sequence, 0, incarnation or asked.incarnation) + wire.varint(value)
        to = asked.sender & ~0xFF | mailbox
        self.peer.send(to, self.peer.own, wire.data(number), id, body, asked.priority, wire.STAMPED)

    def case_it_knows_system_time_as_well_as_its_bound_says(self):
        got = self.client.ask({"do": "time"})["ok"]
        require(got["error_ns"] >= 0, f"{got}")
        off = abs(got["ns"] - time.time_ns())
        # Of this computer, or of one that is set by the same clocks.
        require(off < 10_000_000_000, f"{off / 1e9} s off this computer's clock")


def take_part(server, digests, order):
    host, port = server.rsplit(":", 1)
    peer = Peer(wire.connect(host, int(port), []), wire.name(PEER), [int(digests.split("-")[0], 16), 1], order)
    peer.meet([(peer.own, peer.own | 0x1FF)], "the conformance suite")
    return peer


def check(client, server, digests):
    """Name and problem of each case, in both byte orders of the client's heads. (The TCP router reads both, and writes
    its own.)"""
    digests = f"{digests.split('-')[0]}-{1:016x}"
    hash = client.ask({"do": "interface", "bytes": DESCRIPTION.hex()})["ok"]["hash"]
    for order in ("little", "big"):
        peer = take_part(server, digests, order)
        how = {"do": "connect", "server": server, "own": OWN, "digests": digests, "order": order}
        got = client.ask(how)
        if "ok" not in got:
            yield f"it takes part, {order}", f"{got}"
            return
        told = got["ok"] if isinstance(got["ok"], dict) else {}
        live = Live(client, peer, hash, told.get("hosts", OWN))
        for name in [name for name in dir(live) if name.startswith("case_")]:
            problem = ""
            try:
                getattr(live, name)()
            except Wrong as wrong:
                problem = str(wrong)
            yield f"{name[5:].replace('_', ' ')} (heads {order}-endian)", problem
            if problem:
                # What comes next would be measured by what is left of this.
                return
        client.ask({"do": "close"})
        peer.stream.close()
