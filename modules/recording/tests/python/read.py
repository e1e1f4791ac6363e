"""Reads MCAP files by their index and from front to back, with all checksums; says how many messages there are."""

import sys
from collections import Counter

from mcap.reader import NonSeekingReader, make_reader


def read(path):
    with open(path, "rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    statistics = summary.statistics
    with open(path, "rb") as file:
        by_index = count(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    with open(path, "rb") as file:
        by_stream = count(NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))
    by_statistics = Counter({channel.topic: 0 for channel in summary.channels.values()})
    for number, messages in statistics.channel_message_counts.items():
        by_statistics[summary.channels[number].topic] += messages
    found = +by_statistics
    if not (by_index == by_stream == found and found.total() == statistics.message_count):
        sys.exit(f"{path}: {by_index} by the index, {by_stream} from front to back, {found} by the statistics")
    topics = "".join(f" {topic}={messages}" for topic, messages in sorted(by_statistics.items()))
    print(f"{statistics.message_count}{topics}")


def count(messages):
    return Counter(channel.topic for _, channel, _ in messages)


for name in sys.argv[1:]:
    read(name)
