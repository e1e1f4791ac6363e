"""What ``python -m rohrpost`` prints of streams, and the pictures that it writes."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from . import remote
from .picture import PIXEL_BYTES
from .schema import show, to_json
from .schema.errors import plain
from .types import Image

_PATIENCE_S = 10.0
"""How long a first record is waited for, s."""
_CAUSES = {
    "lost": "lost on the way", "sampled": "left out by sampling",
    "passed_over": "passed over: newer records took their places before they were read",
}  # fmt: skip


class Wrong(Exception):
    """What a person typed cannot be meant."""


def read_stream(client: remote.Client, options: argparse.Namespace) -> None:
    """``stream read``: the newest record, or so many one after the other."""
    if options.next < 0 or options.bytes < 0:
        raise Wrong("--next and --bytes are at least 0")
    patience_s = max(_PATIENCE_S, options.timeout)
    with client.stream(options.what, options.item, room=max(1, min(options.next, 256))) as stream:
        # A file is made anew only when there is something to write.
        first = stream.next(patience_s) if options.next else stream.newest(patience_s)
        raw = open(options.raw, "wb") if options.raw else None
        told = stream.missed
        try:
            for count in range(max(1, options.next)):
                record = stream.next() if count else first
                told = _say_missed(stream, told, options)
                if raw is not None:
                    raw.write(record.data)
                print(_record(record, options, raw is None), flush=True)
        finally:
            if raw is not None:
                raw.close()


def _say_missed(stream: remote.RecordStream, told: remote.Missed, options: argparse.Namespace) -> remote.Missed:
    missed = stream.missed
    counts = {cause: getattr(missed, cause) - getattr(told, cause) for cause in _CAUSES}
    if not any(counts.values()):
        return missed
    if options.json:
        print(json.dumps(counts), flush=True)
    else:
        words = ", ".join(f"{count} {_CAUSES[cause]}" for cause, count in counts.items() if count)
        print(f"({sum(counts.values())} missed: {words})", flush=True)
    return missed


def _record(record: remote.Record, options: argparse.Namespace, is_whole: bool) -> str:
    if options.json:
        told = {"sequence": record.sequence, "stamp_ns": record.time_ns, "epoch": record.epoch}
        told["len_bytes"] = len(record.data)
        value = {"value": to_json(record.type, record.value, lambda data: _brief(data, options.bytes))}
        return json.dumps(told | value if is_whole else told)
    stamp = f"{record.time_ns // 10**9}.{record.time_ns % 10**9:09}"
    line = f"#{record.sequence}  {stamp}  {len(record.data)} B"
    return f"{line}  {show(record.type, record.value)}" if is_whole else line


def _brief(data: bytes, most: int) -> dict[str, Any]:
    return {"len_bytes": len(data), "hex": (data[:most] if most else data).hex()}


def save_picture(client: remote.Client, options: argparse.Namespace) -> None:
    """``picture``: the newest one, as a file."""
    with client.stream(options.what, options.item, expected=Image) as stream:
        record = stream.newest(max(_PATIENCE_S, options.timeout))
    image: Image = record.value
    path, format = Path(options.file), image.format.name
    if format == "Jpeg":
        if path.suffix.lower() not in (".jpg", ".jpeg"):
            raise Wrong(f"{options.what} makes JPEG files; name {path.with_suffix('.jpg')}")
        image.check()
        path.write_bytes(image.pixels)
    elif path.suffix.lower() != ".png":
        raise Wrong(f"the picture becomes a PNG file; name {path.with_suffix('.png')}")
    else:
        image.save_png(path)
    stamp = f"{record.time_ns // 10**9}.{record.time_ns % 10**9:09}"
    size = f"{image.width_px} x {image.height_px}" if format in PIXEL_BYTES else f"{len(image.pixels)} B"
    print(plain(f"{options.file}: #{record.sequence}  {stamp}  {size} {format}"))
