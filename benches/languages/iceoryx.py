"""iceoryx2 from PyPI: publish and subscribe between two programs, each woken by an event.

Arguments: a directory, and a prefix of names in shared memory.
"""

import ctypes

import iceoryx2 as iox2

from ping_pong import Turn, play

iox2.set_log_level(iox2.LogLevel.Error)
turn = Turn()
directory, prefix = turn.own
config = iox2.config.default()
config.global_cfg.prefix = iox2.FileName.new(prefix)
config.global_cfg.root_path = iox2.Path.new(directory)
node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
out, back = ("there", "back") if turn.is_ping else ("back", "there")


def service(name):
    return node.service_builder(iox2.ServiceName.new(name))


def messages(name):
    builder = service(name).publish_subscribe(iox2.Slice[ctypes.c_uint8])
    return builder.enable_safe_overflow(False).history_size(0).open_or_create()


def bell(name):
    return service(f"{name}-bell").event().open_or_create()


publisher = messages(out).publisher_builder().initial_max_slice_len(turn.bytes).create()
subscriber = messages(back).subscriber_builder().create()
notifier = bell(out).notifier_builder().create()
listener = bell(back).listener_builder().create()
# What is published before the other end subscribes would be lost.
turn.meet()


def send(message):
    room = publisher.loan_slice_uninit(turn.bytes)
    # Its view takes no bytes: its elements are of a type of ctypes.
    ctypes.memmove(room.payload_ptr, message, turn.bytes)
    room.assume_init().send()
    notifier.notify()


def receive():
    while True:
        sample = subscriber.receive()
        if sample is not None:
            message = ctypes.string_at(sample.payload_ptr, turn.bytes)
            sample.delete()
            return message
        listener.blocking_wait()


play(turn, send, receive)
