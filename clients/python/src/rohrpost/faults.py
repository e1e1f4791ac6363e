"""Why a server or a router did not run a command, in the words that Rust uses."""

from __future__ import annotations

from dataclasses import dataclass

from .schema.binary import varint
from .schema.decode import decode_front
from .schema.encode import encode
from .schema.errors import plain
from .schema.tree import TEXT, U16, U32, Type
from .wire import COMMON_HASH

MODULE_OFF, MODULE_ERROR, INTERRUPTED, INTERFACE_DIFFERS, UNKNOWN, ARGUMENTS, EXPIRED, BUSY = range(8)
NOTHING_YET, TOO_LARGE, NO_MAILBOX, MAILBOX_FULL, COMMAND_TOO_LARGE, NO_ROUTE, NODE_SILENT = range(8, 15)
NODE_DEAF, NODE_REFUSES, ROUTER_FULL, DELAYED, NOT_ALLOWED, EARLIER_INCARNATION = range(15, 21)

_CARRIES: dict[int, tuple[Type, ...]] = {
    MODULE_ERROR: (TEXT,), INTERFACE_DIFFERS: (U32,), UNKNOWN: (U16,), ARGUMENTS: (TEXT,), TOO_LARGE: (U32,),
    COMMAND_TOO_LARGE: (U32,), NODE_SILENT: (TEXT,), NODE_DEAF: (TEXT,), NODE_REFUSES: (TEXT, TEXT),
    NOT_ALLOWED: (TEXT, TEXT),
}  # fmt: skip
_WORDS = {
    MODULE_OFF: "the module is off; switch it on first",
    MODULE_ERROR: "the module is in error: {0}",
    INTERRUPTED: "interrupted, outcome unknown: the server was restarted while it had this command",
    UNKNOWN: "the module has no function or data with number {0}; `describe` lists what it has",
    ARGUMENTS: "the arguments cannot be read: {0}",
    EXPIRED: "the command was older than its validity, or than the minute for which a server runs it, when its turn "
    "came",
    BUSY: "the server has no place for another caller or subscription from there: its share is used up, or all are "
    "taken; end some, try again later, or name the server in the caller's `calls`, which keeps places for it",
    NOTHING_YET: "no such data has been made yet",
    TOO_LARGE: "the result of {0} bytes does not fit in a package",
    NO_MAILBOX: "its node has no such mailbox: does it run there? (`rohrpost start`, on that node, starts it)",
    MAILBOX_FULL: "its mailbox was full; it is slow or stopped, or has too few slots",
    COMMAND_TOO_LARGE: "its mailbox takes bodies of at most {0} bytes; raise its `size` in the configuration",
    NO_ROUTE: "no router knows a way there; are all nodes launched with the same configuration, one that has this "
    "module?",
    NODE_SILENT: "node {0} is silent; is it on, does its router run, and is it reached at its address? "
    "(`rohrpost net`, on both)",
    NODE_DEAF: "node {0} is heard, but does not hear this one; is a firewall in between, or a cable half broken? "
    "(`rohrpost net`, on both)",
    NODE_REFUSES: "node {0} takes nothing from this one: {1}",
    ROUTER_FULL: "the router had no room for it: this module sends more than `quota` of [network] lets wait, or the "
    "network is slower than what is sent (`rohrpost net`)",
    DELAYED: "it waited too long for the network; more important packages used up its rate (`rohrpost net`)",
    NOT_ALLOWED: "node {0} refuses it: {1}, [access], lists the classes that may command this one, and the caller's is "
    "not among them",
    EARLIER_INCARNATION: "a later incarnation of this caller has called it already: two programs have this name, or "
    "the computer's clock was set back before the node was launched; this passes 2 s after the later one's last call "
    "was over",
}
_OF_ONE_TRY = {BUSY, *range(NO_MAILBOX, EARLIER_INCARNATION + 1)}


@dataclass(frozen=True)
class Fault:
    """A fault: its number and what belongs to it. Shown, what others wrote in it stays in its line."""

    number: int
    values: tuple[int | str, ...] = ()

    def to_bytes(self) -> bytes:
        """As it stands in a reply."""
        types = _CARRIES.get(self.number, ())
        return varint(self.number) + b"".join(encode(type, value) for type, value in zip(types, self.values))

    @staticmethod
    def from_bytes(data: bytes) -> Fault:
        """Reads what a reply has. Raises :class:`rohrpost.schema.WalkError`."""
        number, left = decode_front(U32, data)
        if number > EARLIER_INCARNATION:
            from .schema.errors import WalkError

            raise WalkError(f"variant number {number}, but only {EARLIER_INCARNATION + 1} variants known")
        values = []
        for type in _CARRIES.get(number, ()):
            value, left = decode_front(type, data[len(data) - left :])
            values.append(value)
        return Fault(number, tuple(values))

    @property
    def is_of_one_try(self) -> bool:
        """Whether it speaks of one try of a command alone: another try of the same may be run, or have been."""
        return self.number in _OF_ONE_TRY

    def __str__(self) -> str:
        if self.number == INTERFACE_DIFFERS:
            return _differs(int(self.values[0]))
        return _WORDS[self.number].format(*(plain(str(value)) for value in self.values))


def _differs(server: int) -> str:
    """A version of the common functions is a small number."""
    if server <= 0xFFFF:
        return (
            f"the module has common functions of version {server}, this program has {COMMON_HASH}: run programs of the "
            "same version of Rohrpost (`rohrpost version`)"
        )
    return (
        f"interface differs: the module has {server:#010x}; build caller and module from the same version of the "
        "interface and of Rohrpost (`rohrpost version`)"
    )
