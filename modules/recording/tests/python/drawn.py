"""Decodes what is drawn by the descriptions in the file alone; a line for each message, with its content."""

import struct
import sys
import zlib

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

NUMBERS = {1: "B", 7: "f"}


def motion(place, turn):
    return f"({place.x:g} {place.y:g} {place.z:g}) turned ({turn.x:g} {turn.y:g} {turn.z:.3f} {turn.w:.3f})"


def pose(its):
    return motion(its.position, its.orientation)


def points(cloud):
    count, rest = divmod(len(cloud.data), cloud.point_stride)
    assert rest == 0, f"{rest} bytes behind the last point"

    def point(number):
        at = number * cloud.point_stride
        fields = ((its.name, struct.unpack_from("<" + NUMBERS[its.type], cloud.data, at + its.offset)[0])
                  for its in cloud.fields)
        return "(" + " ".join(f"{name}={round(value, 5) + 0:g}" for name, value in fields) + ")"

    return " ".join(point(number) for number in range(count))


def content(name, its):
    match name:
        case "foxglove.FrameTransform":
            return f"{its.child_frame_id} in {its.parent_frame_id} at {motion(its.translation, its.rotation)}"
        case "foxglove.PoseInFrame":
            return f"in {its.frame_id} at {pose(its.pose)}"
        case "foxglove.PosesInFrame":
            return f"in {its.frame_id} at {', '.join(map(pose, its.poses))}"
        case "foxglove.PointCloud":
            is_short = len(its.data) < 100
            shown = points(its) if is_short else f"{len(its.data)} bytes, sum {zlib.crc32(its.data):08x}"
            return f"in {its.frame_id}: {shown}"
        case "foxglove.RawImage":
            rows = its.data[: its.step].hex(), its.data[its.step :].hex()
            pixels = f"rows {' '.join(rows)}" if len(its.data) < 100 else f"sum {zlib.crc32(its.data):08x}"
            return f"of {its.frame_id}: {its.width} by {its.height} {its.encoding}, {pixels}"
        case "foxglove.CompressedImage":
            return f"of {its.frame_id}: {its.format}, {its.data}"
        case "foxglove.Log":
            level = its.DESCRIPTOR.fields_by_name["level"].enum_type.values_by_number[its.level].name
            return f"{level} of {its.name}: {its.message}"


for path in sys.argv[1:]:
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        channels = reader.get_summary().channels.values()
        drawn = [channel.topic for channel in channels if "drawn" in channel.metadata]
        for schema, channel, message, its in reader.iter_decoded_messages(topics=drawn, log_time_order=False):
            assert its.timestamp.ToNanoseconds() == message.publish_time, channel.topic
            print(f"{channel.topic}: {schema.name} {content(schema.name, its)}")
