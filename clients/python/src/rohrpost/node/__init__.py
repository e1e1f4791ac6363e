"""Modules on the node: launched, watched, switched, restarted and called like those in Rust.

::

    import rohrpost as rp

    class Gripper(rp.Module, klass="gripper"): ...

    rp.run(Gripper)
"""

from __future__ import annotations

import contextlib
import importlib
import os
import signal
import sys
import threading
from typing import NoReturn

from ..errors import Misuse
from ..interface import Module

__all__ = ["is_available", "run"]

_runs = False


def is_available() -> bool:
    """Whether this package has its part in Rust, and that loads, so that modules run on the node."""
    return missing() is None


def missing() -> str | None:
    """Why there are no modules on the node."""
    try:
        importlib.import_module("rohrpost._node")
    except ModuleNotFoundError:
        return (
            "this package was installed without its part in Rust, so it has no modules on the node: on Linux, with "
            "Rust installed, `pip install ./clients/python` builds it; `rohrpost.remote` takes part from anywhere"
        )
    except ImportError as error:
        return f"the part of this package that is Rust does not load, so it has no modules on the node: {error}"
    return None


def run(module: type[Module], arguments: list[str] | None = None) -> NoReturn:
    """Runs a module until it is told to end, and ends the process: the last line of its program.

    Launch tells it by its environment what it is; by hand say ``--config FILE --name CLASS.INSTANCE``, or give it as
    ``arguments``. Raises :class:`rohrpost.Misuse` where it cannot run at all.
    """
    why = missing()
    if why is not None:
        raise Misuse(why)
    if threading.current_thread() is not threading.main_thread():
        raise Misuse("`rohrpost.run` is for the main thread: it takes the signals that end a module")
    global _runs
    if _runs:
        raise Misuse(
            "a module runs in this process, or in the one that it was forked from; `rohrpost.run` is the last line of "
            'a program, behind `if __name__ == "__main__":` where worker processes read it, too'
        )
    from .. import _node
    from .bridge import Bridge
    from .output import hear, listen

    bridge = Bridge(module)
    _runs = True
    hear_forks()
    # Its runtime goes to the safe state at these, and ends then. Python's own would raise in the middle of that. Under
    # `nohup` SIGHUP stays ignored.
    for ends in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if ends != signal.SIGHUP or signal.getsignal(ends) != signal.SIG_IGN:
            signal.signal(ends, signal.SIG_DFL)
    listen()
    given = sys.argv[1:] if arguments is None else arguments
    settings = list(module.interface_.settings)
    try:
        code = _node.run(given, module.interface_.description.to_bytes(), bridge.parameters(), settings, bridge)
    finally:
        _runs = False
        hear(False)
    sys.exit(code)


_hears_forks = False


def hear_forks() -> None:
    """From now on a forked child has no part in what this process has on the node."""
    global _hears_forks
    if not _hears_forks:
        os.register_at_fork(after_in_child=_forked)
        _hears_forks = True


def _forked() -> None:
    """A child has no part in its parent's module; locks that it kept would tell that the module lives."""
    from .. import _node
    from .output import leave

    leave()
    place = os.path.join(os.path.realpath(_node.forked()), "")
    nothing = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for number in map(int, os.listdir("/proc/self/fd")):
        with contextlib.suppress(OSError):  # That of the list itself is closed by now.
            if os.readlink(f"/proc/self/fd/{number}").startswith(place):
                # Its number stays taken: nothing else gets it that the parent's objects could meet.
                os.dup2(nothing, number, inheritable=False)
    os.close(nothing)
