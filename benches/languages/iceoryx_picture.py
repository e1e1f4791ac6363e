"""The same with iceoryx2 from PyPI. Arguments: width, height; a directory, and a prefix of names in shared memory."""

import ctypes
import time

import iceoryx2 as iox2

from ping_pong import Turn
from pictures import Pictures

iox2.set_log_level(iox2.LogLevel.Error)
turn = Turn()
pictures = Pictures(turn)
config = iox2.config.default()
config.global_cfg.prefix = iox2.FileName.new(turn.own[3])
config.global_cfg.root_path = iox2.Path.new(turn.own[2])
node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
builder = node.service_builder(iox2.ServiceName.new("image")).publish_subscribe(iox2.Slice[ctypes.c_uint8])
service = builder.history_size(0).subscriber_max_buffer_size(1).open_or_create()


def see(publisher):
    number = 0
    while not pictures.is_over:
        line = pictures.line_of(number)
        room = publisher.loan_slice_uninit(8 + pictures.bytes)
        # Its number stands before the pixels, as a stream has one for each record.
        ctypes.memmove(room.payload_ptr, number.to_bytes(8, "little"), 8)
        ctypes.memmove(room.payload_ptr + 8 + pictures.begin, line, len(line))
        room.assume_init().send()
        number += 1
        time.sleep(0.001)


def look(subscriber):
    goes_on = True
    while goes_on:
        time.sleep(0.002)
        sent_ns = time.monotonic_ns()
        sample = subscriber.receive()
        if sample is None:
            continue
        view = sample.payload().as_memory_view()
        number = int.from_bytes(view[:8].tobytes(), "little")
        mean = pictures.mean(view[8:])
        del view
        sample.delete()
        goes_on = pictures.took(sent_ns, time.monotonic_ns(), mean, number)


if turn.is_ping:
    subscriber = service.subscriber_builder().create()
    turn.meet()
    look(subscriber)
else:
    publisher = service.publisher_builder().initial_max_slice_len(8 + pictures.bytes).create()
    turn.meet()
    see(publisher)
