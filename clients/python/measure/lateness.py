#!/usr/bin/env python3
"""How late functions of modules run in Python, beside the same in Rust (`examples/lateness.rs`), on one node of this
computer: one of a period of 10 ms, and one for data of another module, which come as often. Each kind runs for 12 s;
`rohrpost` and `rohrpost._node` are those that Cargo has built.

    cargo build --release -p rohrpost-cli -p rohrpost-python && cargo build --release --example lateness
    python3 clients/python/measure/lateness.py target/release
"""

from __future__ import annotations

import collections
import gc
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import time

PACKAGE = pathlib.Path(__file__).resolve().parents[1] / "src"
# A launched module has that with the part in Rust before it.
sys.path.append(str(PACKAGE))

import rohrpost as rp  # noqa: E402

PERIOD_S, BEATS, FIRST = 0.01, 1000, 200
KINDS = {
    "rust": "Rust",
    "plain": "Python",
    "heap": "Python, makes and keeps objects",
    "frozen": "the same, gc.freeze() and gc.disable()",
    "thread": "Python, beside a thread that computes",
}
CONFIG = """
installation = "lateness"
[system]
name = "robot"
id = 1
[classes]
timing = { id = 110 }
output = { id = 32 }
tool = { id = 16 }
[scheduling]
real-time-from = 256
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
[[module]]
name = "timing.0"
program = "RUST"
[[module]]
name = "timing.1"
program = PROGRAM
calls = ["timing.0"]
settings = { SETTINGS }
"""


def figures(values: list[float]) -> str:
    """The middle, 99 of 100, and the worst."""
    values.sort()
    return " ".join(f"{values[(len(values) - 1) * of_100 // 100]:.0f}" for of_100 in (50, 99, 100))


def off(ticks_us: list[float]) -> list[float]:
    """By how much the times between them differ from the period."""
    return [abs(after - before - PERIOD_S * 1e6) for before, after in zip(ticks_us, ticks_us[1:])]


def compute() -> None:
    while True:
        sum(range(1000))


class Timing(rp.Module, klass="timing", settings=("kind", "report")):
    """Runs by time, and says how late."""

    def __init__(self) -> None:
        self.ticks_us: list[float] = []
        self.heard_us: list[float] = []
        self.kept: collections.deque[list[int]] = collections.deque(maxlen=200_000)
        self.kind = self.settings["kind"]
        if self.kind in ("heap", "frozen"):
            self.kept.extend([at] for at in range(200_000))
        if self.kind == "frozen":
            gc.freeze()
            gc.disable()
        if self.kind == "thread":
            threading.Thread(target=compute, daemon=True).start()

    @rp.every(PERIOD_S)
    def tick(self) -> None:
        self.ticks_us.append(time.monotonic_ns() / 1e3)
        if self.kind in ("heap", "frozen"):
            self.kept.extend([at] for at in range(500))

    @rp.on_data("timing.0", "beat")
    def heard(self, beat: rp.U64) -> None:
        self.heard_us.append((self.now_ns() - beat) / 1e3)
        if len(self.heard_us) == FIRST + BEATS:
            told = f"{figures(off(self.ticks_us[FIRST:]))} {figures(self.heard_us[FIRST:])}"
            pathlib.Path(self.settings["report"]).write_text(told)


def measured(built: pathlib.Path, folder: pathlib.Path, kind: str) -> list[str]:
    """What a module of this kind reports."""
    rust, report = built / "examples" / "lateness", folder / kind
    python = f'["{sys.executable}", "-B", "{pathlib.Path(__file__).resolve()}"]'
    program = f'"{rust}"' if kind == "rust" else python
    settings = f'{"follows" if kind == "rust" else "kind"} = "{"timing.0" if kind == "rust" else kind}"'
    config = CONFIG.replace("RUST", str(rust)).replace("PROGRAM", program)
    folder.joinpath("robot.toml").write_text(config.replace("SETTINGS", f'{settings}, report = "{report}"'))
    environment = {**os.environ, "PYTHONPATH": str(folder / "package")}
    command = [str(built / "rohrpost"), "launch", str(folder / "robot.toml")]
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as running:
        until = time.monotonic() + 120
        while running.poll() is None and time.monotonic() < until and not report.exists():
            time.sleep(0.1)
        running.terminate()
    return report.read_text().split()


def main(built: pathlib.Path) -> None:
    print("µs; period: p50, p99, worst; data: p50, p99, worst; load then")
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        package = folder / "package" / "rohrpost"
        package.mkdir(parents=True)
        for entry in PACKAGE.joinpath("rohrpost").iterdir():
            if entry.name != "__pycache__" and not entry.name.startswith("_node.abi3"):
                package.joinpath(entry.name).symlink_to(entry)
        package.joinpath("_node.abi3.so").symlink_to(built / "lib_node.so")
        for kind, words in KINDS.items():
            told = measured(built, folder, kind)
            print(f"| {words} | {' | '.join(told)} | {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    if "ROHRPOST_MODULE" in os.environ:
        rp.run(Timing)
    main(pathlib.Path(sys.argv[1]).resolve())
