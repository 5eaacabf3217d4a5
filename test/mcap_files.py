"""mcap files as all sorts of writers make them, written to the specification (mcap.dev/spec)."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final

import lz4.frame
import numpy as np
from rosbags.typesys import Stores, get_typestore

from rebt_ros.storage import packing

ACTION, STATE = "std_msgs/msg/String", "std_msgs/msg/Float64MultiArray"
TYPES: Final = get_typestore(Stores.ROS2_JAZZY)
MAGIC: Final = b"\x89MCAP0\r\n"


class Compression(Enum):
    """Of chunks."""

    NONE = ""
    ZSTD = "zstd"
    LZ4 = "lz4"


_PACK: Final[Mapping[Compression, Callable[[bytes], bytes]]] = {
    Compression.NONE: bytes,
    Compression.ZSTD: lambda data: bytes(packing._zstd().compress(data)),
    Compression.LZ4: lambda data: bytes(lz4.frame.compress(data)),
}


@dataclass(frozen=True)
class Channel:
    """A topic with the type and the encoding of its messages."""

    topic: str
    kind: str
    encoding: str = "cdr"
    definition: str = ""
    """Of the type."""
    defined_in: str = "ros2msg"


@dataclass(frozen=True)
class Message:
    """A message of a channel, which the number of the latter names."""

    channel: int
    stamp: int
    data: bytes


def state(*values: float) -> bytes:
    """A serialized state."""
    layout = TYPES.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    message = TYPES.types[STATE](layout=layout, data=np.array(values))
    return bytes(TYPES.serialize_cdr(message, STATE))


def action(label: str) -> bytes:
    """A serialized action."""
    return bytes(TYPES.serialize_cdr(TYPES.types[ACTION](data=label), ACTION))


CHANNELS: Final = (Channel("/state", STATE), Channel("/action", ACTION))


def demonstration(count: int = 20) -> list[Message]:
    """As many states, each followed by an action."""
    messages = []
    for number in range(count):
        messages.append(Message(0, 2 * number + 1, state(number / 3, -number)))
        messages.append(Message(1, 2 * number + 2, action(("go", "turn", "wait")[number % 3])))
    return messages


def _text(text: str | bytes) -> bytes:
    data = text if isinstance(text, bytes) else text.encode()
    return struct.pack("<I", len(data)) + data


def record(kind: int, content: bytes) -> bytes:
    """A record of a kind."""
    return struct.pack("<BQ", kind, len(content)) + content


def write(
    path: Path,
    messages: Sequence[Message],
    channels: Sequence[Channel] = CHANNELS,
    *,
    per_chunk: int | None = 10,
    compression: Compression = Compression.NONE,
    index: bool = True,
    summary: bool = True,
    finished: bool = True,
    profile: str = "ros2",
    added: bytes = b"",
) -> Path:
    """Writes a file.

    Args:
        path: Where to.
        messages: In the order of the file.
        channels: Numbered from 0.
        per_chunk: Messages of a chunk; None: no chunks.
        compression: Of chunks.
        index: Whether chunks have indexes of their messages.
        summary: Whether there are statistics and indexes of chunks.
        finished: Whether the file has an end.
        profile: As its head says.
        added: Stands behind each chunk and its indexes, and in the summary.
    """
    declared = b"".join(
        record(
            3,
            struct.pack("<H", number + 1)
            + _text(one.kind)
            + _text(one.defined_in)
            + _text(one.definition),
        )
        + record(
            4,
            struct.pack("<HH", number, number + 1)
            + _text(one.topic)
            + _text(one.encoding)
            + struct.pack("<I", 0),
        )
        for number, one in enumerate(channels)
    )
    file = bytearray(MAGIC + record(1, _text(profile) + _text("by hand")))
    indexes = []
    size = per_chunk or len(messages) or 1
    parts = [messages[begin : begin + size] for begin in range(0, len(messages), size)]
    for part_number, part in enumerate(parts or [()]):
        records, places = bytearray(b"" if part_number else declared), {}
        for one in part:
            head = struct.pack("<HIQQ", one.channel, 0, one.stamp, one.stamp)
            places.setdefault(one.channel, []).append((one.stamp, len(records)))
            records += record(5, head + one.data)
        if per_chunk is None:
            file += records
            continue
        stamps = [one.stamp for one in part] or [0]
        packed = _PACK[compression](bytes(records))
        begin = len(file)
        file += record(
            6,
            struct.pack("<QQQI", min(stamps), max(stamps), len(records), zlib.crc32(records))
            + _text(compression.value)
            + struct.pack("<Q", len(packed))
            + packed,
        )
        indexes.append(
            struct.pack("<QQQQ", min(stamps), max(stamps), begin, len(file) - begin)
            + struct.pack("<IQ", 0, 0)
            + _text(compression.value)
            + struct.pack("<QQ", len(packed), len(records))
        )
        if index:
            for channel, entries in places.items():
                listed = b"".join(struct.pack("<QQ", *one) for one in entries)
                file += record(7, struct.pack("<HI", channel, len(listed)) + listed)
        file += added
    if finished:
        file += record(15, struct.pack("<I", 0))
        begin = len(file) if summary else 0
        if summary:
            counts = Counter(one.channel for one in messages)
            listed = b"".join(struct.pack("<HQ", *one) for one in counts.items())
            numbers = (len(messages), len(channels), len(channels), 0, 0, len(indexes), 0, 0)
            file += added + declared + b"".join(record(8, one) for one in indexes)
            file += record(
                11, struct.pack("<QHIIIIQQ", *numbers) + struct.pack("<I", len(listed)) + listed
            )
        file += record(2, struct.pack("<QQI", begin, 0, 0)) + MAGIC
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(file)
    return path
