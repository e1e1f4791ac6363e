"""Writes files as others do, with the library of the makers of the format, into a folder: their names are printed."""

import sys
from pathlib import Path

from mcap.writer import CompressionType, IndexType, Writer

CASES = {
    "lz4": {"compression": CompressionType.LZ4, "chunk_size": 2000},
    "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 2000},
    "none": {"compression": CompressionType.NONE, "chunk_size": 2000},
    "flat": {"use_chunking": False},
    "bare": {"index_types": IndexType.NONE, "use_statistics": False, "compression": CompressionType.LZ4},
}
CHANNELS = [
    ("/imu", "sensor_msgs/msg/Imu", "ros2msg", b"float64 x\n", "cdr"),
    ("/pose", "foxglove.PoseInFrame", "protobuf", b"", "protobuf"),
    ("/state", "State", "jsonschema", b"{}", "json"),
]

for case, options in CASES.items():
    path = Path(sys.argv[1]) / f"{case}.mcap"
    with open(path, "wb") as file:
        writer = Writer(file, **options)
        writer.start(profile="ros2", library="foreign")
        ids = [
            writer.register_channel(topic, encoding, writer.register_schema(name, described, text))
            for topic, name, described, text, encoding in CHANNELS
        ]
        for number in range(300):
            writer.add_message(ids[number % 3], log_time=1000 * number, publish_time=number, data=b"[1]" * 20)
        writer.finish()
    print(path)
