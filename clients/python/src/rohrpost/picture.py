"""What pixels of pictures are, and how they become files."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING

from .errors import RohrpostError
from .png import GREY, RGB, RGBA, SIDE_MAX, SIGNATURE, png

if TYPE_CHECKING:
    from .types import Image

PIXEL_BYTES = {"Gray8": 1, "Gray16": 2, "Rgb8": 3, "Rgba8": 4, "Bgr8": 3, "DepthF32": 4, "Depth16": 2}
"""Bytes of a pixel by format; those that are not here are files, in which pixels have no place of their own."""
_COLOUR = {
    "Gray8": (GREY, 8), "Gray16": (GREY, 16), "Rgb8": (RGB, 8), "Rgba8": (RGBA, 8), "Bgr8": (RGB, 8),
    "DepthF32": (GREY, 16), "Depth16": (GREY, 16),
}  # fmt: skip
_FAR_MM = 0xFFFF


class BadPicture(RohrpostError):
    """The sizes of a picture do not fit together, or it is of a format that cannot be what is asked for."""


def check(image: Image) -> None:
    """Whether its sizes fit together; what a file holds is not looked at. Raises :class:`BadPicture`."""
    width, height, row, format = image.width_px, image.height_px, image.row_bytes, image.format.name
    if not width or not height:
        raise BadPicture(f"an image of {width} by {height} pixels; both must be at least 1")
    pixel = PIXEL_BYTES.get(format)
    if pixel is None and row:
        raise BadPicture(f"a {format} file with rows of {row} bytes; `row_bytes` must be 0")
    if pixel is None and not len(image.pixels):
        raise BadPicture(f"a {format} file of 0 bytes")
    if pixel is None:
        return
    if row < width * pixel:
        raise BadPicture(f"a row of {row} bytes; {width} pixels of {format} need at least {width * pixel}")
    if len(image.pixels) != row * height:
        words = f"{height} rows of {row} bytes are {row * height}"
        raise BadPicture(f"{len(image.pixels)} bytes of pixels; {words}")


def rows(image: Image) -> Iterator[memoryview]:
    """The pixels of each row, from top to bottom, without the gaps. Raises :class:`BadPicture`."""
    check(image)
    pixel = PIXEL_BYTES.get(image.format.name)
    if pixel is None:
        raise BadPicture(f"the pixels of a {image.format.name} file have no place of their own; decode it first")
    pixels, shown, row = memoryview(image.pixels).cast("B"), image.width_px * pixel, image.row_bytes
    return (pixels[at : at + shown] for at in range(0, row * image.height_px, row))


def to_png(image: Image) -> bytes:
    """See :meth:`rohrpost.Image.to_png`."""
    format = image.format.name
    if format not in _COLOUR:
        check(image)
        if format != "Png":
            raise BadPicture(f"the picture is a {format} file already; write its `pixels` as they are")
        if bytes(image.pixels[: len(SIGNATURE)]) != SIGNATURE:
            raise BadPicture("the picture should be a PNG file, and does not begin as one")
        return bytes(image.pixels)
    if max(image.width_px, image.height_px) > SIDE_MAX:
        raise BadPicture(f"an image of {image.width_px} by {image.height_px} pixels; a PNG file has at most {SIDE_MAX}")
    colour, depth = _COLOUR[format]
    return png(image.width_px, image.height_px, colour, depth, (_as_png(format, row) for row in rows(image)))


def _as_png(format: str, row: memoryview) -> bytes:
    if format in ("Gray16", "Depth16"):
        return _picked(row, (1, 0))
    if format == "Bgr8":
        return _picked(row, (2, 1, 0))
    if format == "DepthF32":
        return struct.pack(f">{len(row) // 4}H", *(_millimetres(m) for (m,) in struct.iter_unpack("<f", row)))
    return bytes(row)


def _picked(row: memoryview, order: tuple[int, ...]) -> bytes:
    """The bytes of each sample or pixel in another order."""
    out, step = bytearray(len(row)), len(order)
    for at, taken in enumerate(order):
        out[at::step] = row[taken::step]
    return bytes(out)


def _millimetres(metres: float) -> int:
    """0 where it is not known; what is further away than can be written is as far as can be."""
    if math.isnan(metres) or metres <= 0.0:
        return 0
    return min(_FAR_MM, round(metres * 1000.0)) if metres < _FAR_MM else _FAR_MM
