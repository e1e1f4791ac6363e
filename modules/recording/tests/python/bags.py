"""Writes files as rosbag2 and Foxglove do, into a folder, and prints their names: a bag by `rosbags`, plain and with
compressed chunks, and a file with attachments and metadata, out of order, from time 0 on, by `mcap`."""

import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

MESSAGES = 100
FOLDER = Path(sys.argv[1])


def bag(name, compressed):
    store = get_typestore(Stores.ROS2_HUMBLE)
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    scan, string = store.types["sensor_msgs/msg/LaserScan"], store.types["std_msgs/msg/String"]
    writer = Writer(FOLDER / name, version=9, storage_plugin=StoragePlugin.MCAP)
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        scans = writer.add_connection("/scan", scan.__msgtype__, typestore=store)
        texts = writer.add_connection("/text", string.__msgtype__, typestore=store)
        for number in range(MESSAGES):
            stamp = 1_000_000 * number
            ranges = np.full(200, number, dtype=np.float32)
            head = header(stamp=time(sec=0, nanosec=stamp), frame_id="laser")
            said = scan(
                header=head, angle_min=0.0, angle_max=1.0, angle_increment=0.1, time_increment=0.0, scan_time=0.1,
                range_min=0.0, range_max=9.0, ranges=ranges, intensities=ranges,
            )
            writer.write(scans, stamp, store.serialize_cdr(said, scan.__msgtype__))
            text = string(data=f"scan {number}")
            writer.write(texts, stamp + 1, store.serialize_cdr(text, string.__msgtype__))
    (path,) = (FOLDER / name).glob("*.mcap*")
    print(path)


def foxglove(name):
    path = FOLDER / f"{name}.mcap"
    with open(path, "wb") as file:
        writer = McapWriter(file, chunk_size=2000, compression=CompressionType.LZ4)
        writer.start(profile="", library="foxglove-sdk")
        schemas = [writer.register_schema(name, "jsonschema", b"{}") for name in ("foxglove.Log", "foxglove.Grid")]
        # Two programs publish on one topic, with two types.
        channels = [writer.register_channel("/scan", "json", schema) for schema in schemas]
        writer.add_attachment(create_time=1, log_time=2, name="calib.yaml", media_type="text/yaml", data=b"x: 1\n" * 99)
        writer.add_metadata("device", {"name": "theirs"})
        for number in range(2 * MESSAGES):
            # Each ten of them come from the last to the first.
            time = number - number % 10 + 9 - number % 10
            writer.add_message(channels[number % 2], log_time=time, publish_time=time, data=b'{"a": 1}' * 20)
        writer.finish()
    print(path)


bag("plain", False)
bag("packed", True)
foxglove("foxglove")
