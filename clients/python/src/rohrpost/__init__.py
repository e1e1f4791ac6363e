"""Rohrpost for Python: programs beside the robot (:func:`connect`), modules of it (:func:`run`), and from any computer
:mod:`rohrpost.remote`, which takes part at a TCP router."""

from .annotations import (
    F32, F64, I8, I16, I32, I64, I128, U8, U16, U32, U64, U128, Char, Choice, Length, data, inline, maybe, said,
    wrapped,
)  # fmt: skip
from .beside import Robot, connect
from .common import OutputLevel, State, Status
from .errors import (
    BadArguments, BadReply, CallError, CallFault, CallTimeout, FunctionError, Misconfigured, Misuse, NoConnection,
    NotSent, RohrpostError, TooManyCalls,
)  # fmt: skip
from .faults import Fault
from .interface import Module, parameter
from .marks import command, data_out, every, on_data, on_record, stream
from .names import BadName, Installation, Name
from .node import is_available, run
from .picture import BadPicture
from .schema import Variant
from .types import Image, ImageFormat, LaserScan, Odometry, Pose, Twist

__all__ = [
    "BadArguments", "BadName", "BadPicture", "BadReply", "CallError", "CallFault", "CallTimeout", "Char", "Choice",
    "F32", "F64", "Fault", "FunctionError", "I8", "I16", "I32", "I64", "I128", "Image", "ImageFormat", "Installation",
    "LaserScan", "Length", "Misconfigured", "Misuse", "Module", "Name", "NoConnection", "NotSent", "Odometry",
    "OutputLevel", "Pose", "Robot", "RohrpostError", "State", "Status", "TooManyCalls", "Twist", "U8", "U16", "U32",
    "U64", "U128", "Variant", "command", "connect", "data", "data_out", "every", "inline", "is_available", "maybe",
    "on_data", "on_record", "parameter", "run", "said", "stream", "wrapped",
]  # fmt: skip
