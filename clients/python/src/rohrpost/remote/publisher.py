"""The publishing side of continuous data: subscribers, their rates and leases. Knows no clock and no socket."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..common import Subscribe
from ..names import Name
from ..wire import LEASE_MS_MAX, NEWEST, STAMPED, DataHead, Package, data_kind, package
from .places import allows

SUBSCRIPTIONS_MAX = 64
_PERIOD_US_MIN = 100
_MS = 1_000_000


@dataclass(frozen=True)
class Value:
    """A value that was published: when it was true, ns since 1970, and its bytes."""

    stamp_ns: int
    data: bytes


@dataclass
class _Subscription:
    wish: Subscribe
    by: int
    to: int
    incarnation: int
    priority: int
    newest: int
    ends_ns: int
    due_ns: int
    sequence: int = 0
    missed: int = 0
    fresh: Value | None = None


class Publisher:
    """All subscriptions to the data of the module ``own``."""

    def __init__(self, own: int, send: Callable[[int, Package], None]) -> None:
        self._own = own
        self._send = send
        self._list: list[_Subscription] = []
        self._missed_before = 0
        self.newest: dict[int, Value] = {}
        """The newest value of each number."""

    def subscribe(self, now_ns: int, command: Package, incarnation: int, wish: Subscribe) -> bool:
        """Begins or renews; false when there is no place."""
        head = command.head
        to = head.sender & ~0xFF | wish.mailbox
        self._retain(lambda its: its.by != head.sender or its.incarnation == incarnation)
        ends_ns = now_ns + min(wish.lease_ms, LEASE_MS_MAX) * _MS
        period_us = max(wish.period_us, _PERIOD_US_MIN) if wish.period_us else 0
        wish = Subscribe(wish.number, wish.id, period_us, wish.lease_ms, wish.mailbox)
        known = next((its for its in self._list if its.to == to and its.wish.id == wish.id), None)
        if known is None:
            held = [its.by for its in self._list if its.ends_ns > now_ns]
            if not allows(Name(self._own), head.sender, held, SUBSCRIPTIONS_MAX):
                return False
            known = _Subscription(wish, head.sender, to, incarnation, head.priority, 0, ends_ns, now_ns)
            self._list.append(known)
        elif (known.wish.number, known.wish.period_us) != (wish.number, wish.period_us):
            known.due_ns, known.fresh = now_ns, None
        known.wish, known.ends_ns, known.by = wish, ends_ns, head.sender
        known.incarnation, known.priority, known.newest = incarnation, head.priority, head.options & NEWEST
        return True

    def unsubscribe(self, to: int, id: int) -> None:
        """Ends one."""
        self._retain(lambda its: its.to != to or its.wish.id != id)

    def _retain(self, keep: Callable[[_Subscription], bool]) -> None:
        self._missed_before += sum(its.missed for its in self._list if not keep(its))
        self._list = [its for its in self._list if keep(its)]

    @property
    def count(self) -> int:
        """Subscriptions at present."""
        return len(self._list)

    @property
    def missed(self) -> int:
        """Periods in which nothing could be delivered, of all."""
        return self._missed_before + sum(its.missed for its in self._list)

    def publish(self, now_ns: int, number: int, value: Value) -> None:
        """A new value of this kind of data."""
        self.newest[number] = value
        self._retain(lambda its: its.ends_ns > now_ns)
        for subscription in self._list:
            if subscription.wish.number == number:
                if subscription.wish.period_us:
                    subscription.fresh = value
                else:
                    self._deliver(now_ns, subscription, value)

    def poll(self, now_ns: int) -> int | None:
        """Delivers what is due and drops those with an ended lease; when to look again, ns."""
        self._retain(lambda its: its.ends_ns > now_ns)
        for its in self._list:
            period_ns = its.wish.period_us * 1000
            if period_ns and now_ns >= its.due_ns:
                passed = (now_ns - its.due_ns) // period_ns
                its.due_ns += (passed + 1) * period_ns
                its.missed += passed
                if its.fresh is None:
                    its.missed += 1
                else:
                    value, its.fresh = its.fresh, None
                    self._deliver(now_ns, its, value)
        due = [its.due_ns for its in self._list if its.wish.period_us]
        return min([*due, *(its.ends_ns for its in self._list)], default=None)

    def _deliver(self, now_ns: int, its: _Subscription, value: Value) -> None:
        head = DataHead(value.stamp_ns, its.sequence, min(its.missed, 0xFFFFFFFF), its.incarnation)
        its.sequence = its.sequence + 1 & 0xFFFFFFFF
        body = head.to_bytes() + value.data
        kind, options = data_kind(its.wish.number), STAMPED | its.newest
        self._send(now_ns, package(its.to, self._own, kind, its.wish.id, body, its.priority, options))
