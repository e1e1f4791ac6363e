"""Standard types. Frames are right-handed: x forward or east, y left or north; angles are counter-clockwise from x."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from . import picture
from .annotations import F32, U32, data, said


@data(name="rohrpost.Pose")
class Pose:
    """A place and a heading in the plane."""

    x_m: Annotated[float, said(unit="m", text="Metres along x.")] = 0.0
    y_m: Annotated[float, said(unit="m", text="Metres along y.")] = 0.0
    heading_rad: Annotated[
        float, said(unit="rad", text="Radians, counter-clockwise from x; any multiple of a turn may be added.")
    ] = 0.0


@data(name="rohrpost.Twist")
class Twist:
    """How fast a body moves in its own frame."""

    speed_m_s: Annotated[float, said(unit="m/s", text="Metres a second, forward.")] = 0.0
    turn_rate_rad_s: Annotated[float, said(unit="rad/s", text="Radians a second, counter-clockwise.")] = 0.0


@data(name="rohrpost.Odometry")
class Odometry:
    """What a base says of its own motion: counted from where it started, and drifting."""

    pose: Annotated[Pose, said(text="Where the base believes to be, in the frame in which it started.")]
    twist: Annotated[Twist, said(text="How it moves now.")]


@data(name="rohrpost.LaserScan")
class LaserScan:
    """One sweep of a range scanner."""

    start_rad: Annotated[F32, said(unit="rad")]
    step_rad: Annotated[F32, said(unit="rad")]
    range_max_m: Annotated[F32, said(unit="m")]
    ranges_m: Annotated[list[F32], said(unit="m")]
    pose: Pose | None = None


@data(name="rohrpost.ImageFormat")
class ImageFormat(enum.Enum):
    """What the bytes of a pixel are."""

    Gray8 = 0
    Gray16 = 1
    Rgb8 = 2
    Rgba8 = 3
    Bgr8 = 4
    DepthF32 = 5
    Depth16 = 6
    Jpeg = 7
    Png = 8


@data(name="rohrpost.Image")
class Image:
    """A picture: what a camera sees, or how far away it is."""

    width_px: Annotated[U32, said(unit="px")]
    height_px: Annotated[U32, said(unit="px")]
    row_bytes: Annotated[U32, said(unit="B")]
    format: ImageFormat
    pixels: bytes

    def check(self) -> None:
        """Whether its sizes fit together; what a file holds is not looked at. Raises :class:`rohrpost.BadPicture`."""
        picture.check(self)

    def rows(self) -> Iterator[memoryview]:
        """The pixels of each row, from top to bottom, without the gaps. Raises :class:`rohrpost.BadPicture`."""
        return picture.rows(self)

    def to_png(self) -> bytes:
        """A PNG file of it: brightness and distance as grey, of 8 or 16 bits, distance in mm (0: not known; 65535:
        that far, or further). What is a PNG file stays as it is. Raises :class:`rohrpost.BadPicture`."""
        return picture.to_png(self)

    def save_png(self, path: str | Path) -> None:
        """Writes :meth:`to_png` into a file."""
        Path(path).write_bytes(self.to_png())
