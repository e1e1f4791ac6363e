"""Why calls have no result: the exceptions that ``rohrpost.remote`` raises, too."""

from __future__ import annotations

import ssl
import sys
import traceback
from types import TracebackType

from ..errors import BadArguments, BadReply, CallError, CallFault, CallTimeout, NotSent, TooManyCalls
from ..faults import Fault
from ..names import Name
from ..schema.errors import WalkError, plain

_OURS = __name__.rsplit(".", 2)[0]
_CAUSES_MAX = 16


def call_failure(kind: str, to: int, fault: bytes, text: str, seconds: float) -> CallError:
    """The exception for an error of Rust: its kind, the server, its fault, its words, and the time
    that the call had, s."""
    name = Name(to)
    if kind == "fault":
        try:
            return CallFault(name, Fault.from_bytes(fault))
        except WalkError as error:
            return BadReply(name, str(error))
    if kind == "timeout":
        return CallTimeout(name, seconds)
    if kind == "too many":
        return TooManyCalls(name)
    if kind == "bad reply":
        return BadReply(name, text.split(" cannot be read: ", 1)[-1])
    if kind == "bad arguments":
        return BadArguments(text.split(" cannot be written: ", 1)[-1])
    return NotSent(text)


class Words(str):
    """What went wrong, in one line. ``errno``: number of the kernel's error behind it, if there is one."""

    errno: int | None = None


def errno_of(error: BaseException | None) -> int | None:
    """The number of the kernel's error behind an exception: its own, or that of what it was raised from."""
    for _ in range(_CAUSES_MAX):
        if error is None:
            break
        number = error.errno if isinstance(error, OSError) else None
        # Those of names and of TLS count in other ways.
        if isinstance(number, int) and 0 < number < 1 << 16 and not isinstance(error, ssl.SSLError):
            return number
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return None


def words_of(error: BaseException) -> Words:
    """An exception in one line: its class, its text, and where the author's code raised it."""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    place = _place(error.__traceback__)
    words = Words(plain(f"{text} ({place})" if place else text)[:900])
    words.errno = errno_of(error)
    return words


def _place(trace: TracebackType | None) -> str:
    """File and line of the innermost frame that is not of this package."""
    frames = [frame for frame in traceback.extract_tb(trace) if not _is_ours(frame.filename)]
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""


def _is_ours(file: str) -> bool:
    package = sys.modules[_OURS].__file__ or ""
    return file.startswith(package.removesuffix("__init__.py"))
