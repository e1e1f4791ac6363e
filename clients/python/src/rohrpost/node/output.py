"""``logging``, and what is printed, as the module's output."""

from __future__ import annotations

import io
import logging
import os
import sys
import threading

from .. import _node
from .failures import errno_of


class OutputHandler(logging.Handler):
    """Says each record of ``logging`` as a line of the module's output, from any thread."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line; a trace of an exception stands behind it."""
        try:
            _node.say(_level(record.levelno), self.format(record), _errno(record))
        except Exception:  # As each handler does.
            self.handleError(record)


def _errno(record: logging.LogRecord) -> int | None:
    """The number of the kernel's error that it tells of: of its exception, or of one among its words."""
    words = record.args if isinstance(record.args, tuple) else ()
    errors = [record.exc_info[1] if record.exc_info else None, *(it for it in words if isinstance(it, BaseException))]
    return next((number for number in map(errno_of, errors) if number is not None), None)


def _level(number: int) -> int:
    levels = (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)
    return next((at for at, level in enumerate(levels) if number >= level), len(levels))


_PIECE = 1000
"""Characters of a longest line: launch cuts lines behind 4096 bytes, and would take the rest for another line."""
_SENT = "\x1e"
"""Begins a printed line that is output already: launch keeps it for what a process said last, and does not send it."""


class _Printed(io.TextIOWrapper):
    """The standard output of a launched module: while it runs, each line is output, in one order with what the module
    logs."""

    def __init__(self, printed: io.TextIOWrapper) -> None:
        super().__init__(printed.buffer, printed.encoding, printed.errors, line_buffering=True)
        self._lock = threading.RLock()
        self._rest = ""
        self.is_heard = False

    def write(self, text: str) -> int:
        with self._lock:
            if not self.is_heard:
                return super().write(text)
            *lines, rest = (self._rest + text).split("\n")
            whole = len(rest) - len(rest) % _PIECE
            self._rest = rest[whole:]
            for line in [*lines, *([rest[:whole]] if whole else [])]:
                for piece in [line[at : at + _PIECE] for at in range(0, len(line), _PIECE)] or [""]:
                    if piece.strip():
                        _node.say(_level(logging.INFO), piece.rstrip(), None)
                    super().write(f"{_SENT}{piece}\n")
        return len(text)

    def end(self) -> None:
        """Nobody hears it any more; what is no whole line is printed all the same."""
        with self._lock:
            rest, self._rest, self.is_heard = self._rest, "", False
            super().write(rest)
            self.flush()

    def leave(self) -> None:
        """In a child of a fork: what its parent did not say yet, the parent says; a lock may be that of a thread that
        is not here."""
        self._lock = threading.RLock()
        self._rest, self.is_heard = "", False


_printed: _Printed | None = None


def hear(is_heard: bool) -> None:
    """What is printed from now on is output, or is so no more."""
    if _printed is not None and is_heard:
        _printed.is_heard = True
    elif _printed is not None:
        _printed.end()


def leave() -> None:
    """A child of a fork prints for itself."""
    if _printed is not None:
        _printed.leave()


def listen() -> None:
    """From now on the root logger's records are output. Which of them are sent, the module's output level says."""
    # What is printed is output, too, line by line.
    for printed in (sys.stdout, sys.stderr):
        if isinstance(printed, io.TextIOWrapper):
            printed.reconfigure(line_buffering=True)
    global _printed
    # By hand, the terminal has what is printed.
    if isinstance(sys.stdout, io.TextIOWrapper) and "ROHRPOST_LAUNCHER" in os.environ:
        sys.stdout = _printed = _Printed(sys.stdout)
    root = logging.getLogger()
    if not any(isinstance(handler, OutputHandler) for handler in root.handlers):
        root.addHandler(OutputHandler())
        root.setLevel(logging.NOTSET + 1)
