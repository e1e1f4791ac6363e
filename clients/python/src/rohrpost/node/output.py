"""``logging`` as the module's output."""

from __future__ import annotations

import io
import logging
import sys

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


def listen() -> None:
    """From now on the root logger's records are output. Which of them are sent, the module's output level says."""
    # What is printed is output, too, line by line.
    for printed in (sys.stdout, sys.stderr):
        if isinstance(printed, io.TextIOWrapper):
            printed.reconfigure(line_buffering=True)
    root = logging.getLogger()
    if not any(isinstance(handler, OutputHandler) for handler in root.handlers):
        root.addHandler(OutputHandler())
        root.setLevel(logging.NOTSET + 1)
