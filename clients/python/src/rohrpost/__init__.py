"""Rohrpost for Python: modules of robots, on the node (:func:`run`) and from any computer: :mod:`rohrpost.remote` takes
part at a TCP router."""

from .annotations import (
    F32, F64, I8, I16, I32, I64, I128, U8, U16, U32, U64, U128, Char, Choice, Length, data, said,
)  # fmt: skip
from .common import OutputLevel, State, Status
from .errors import (
    BadArguments, BadReply, CallError, CallFault, CallTimeout, FunctionError, Misuse, NoConnection, NotSent,
    RohrpostError, TooManyCalls,
)  # fmt: skip
from .faults import Fault
from .interface import Module, command, data_out, every, on_data, on_record, parameter, stream
from .names import BadName, Installation, Name
from .node import is_available, run
from .schema import Variant
from .types import Image, ImageFormat, LaserScan, Odometry, Pose, Twist

__all__ = [
    "BadArguments", "BadName", "BadReply", "CallError", "CallFault", "CallTimeout", "Char", "Choice", "F32", "F64",
    "Fault", "FunctionError", "I8", "I16", "I32", "I64", "I128", "Image", "ImageFormat", "Installation", "LaserScan",
    "Length", "Misuse", "Module", "Name", "NoConnection", "NotSent", "Odometry", "OutputLevel", "Pose",
    "RohrpostError", "State", "Status", "TooManyCalls", "Twist", "U8", "U16", "U32", "U64", "U128", "Variant",
    "command", "data", "data_out", "every", "is_available", "on_data", "on_record", "parameter", "run", "said", "stream",
]  # fmt: skip
