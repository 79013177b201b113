"""Counts the messages of each topic of an MCAP file: count_messages.py FILE [--may-end-early]."""

import collections
import sys

from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

topics, counts = {}, collections.Counter()
with open(sys.argv[1], "rb") as file:
    try:
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                counts[topics[record.channel_id]] += 1
    except EndOfFile:
        if "--may-end-early" not in sys.argv:
            raise
for topic, count in counts.items():
    print(topic, count)
