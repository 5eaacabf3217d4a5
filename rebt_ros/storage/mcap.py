"""mcap files, read from their records alone (https://mcap.dev/spec).

Indexes and summaries are not needed, so that a file is read whose recorder was killed, or in which
they are missing or wrong, and so that they cannot send the reader to the same place over and over.
What a file says of itself in its statistics is kept, to be compared with what was found.
"""

from __future__ import annotations

import contextlib
import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

from rebt_ros.storage.packing import unlz4, unzstd

MAGIC: Final = b"\x89MCAP0\r\n"

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _STATISTICS = 2, 3, 4, 5, 6, 7, 11
#: Channel, sequence, log time, publish time: before the data of a message.
_MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
_RECORD_HEAD: Final = struct.Struct("<BQ")
_INDEX_HEAD: Final = struct.Struct("<HI")
#: Stamp and place of one message in an index (bytes).
_INDEX_ENTRY: Final = 16
#: Records outside of chunks are handled in parts of about this size (bytes).
_PART: Final = 1 << 20


_UNPACKING: Final[Mapping[str, Callable[[bytes], bytes]]] = {
    "": bytes,
    "zstd": unzstd,
    "lz4": unlz4,
}


@dataclass(frozen=True, slots=True)
class McapChannel:
    """What a channel carries."""

    topic: str
    kind: str
    """Name of the messages' type; empty where there is none."""
    encoding: str
    """Of the messages: cdr for those of ROS 2."""


@dataclass(frozen=True, slots=True)
class McapMessage:
    """A message of a channel."""

    channel: int
    stamp: int
    """When it was recorded (nanoseconds), unsigned 64 bits."""
    data: bytes


@dataclass(slots=True)
class Survey:
    """What is in a file."""

    channels: dict[int, McapChannel] = field(default_factory=dict)
    found: Counter[int] = field(default_factory=Counter)
    """Messages by channel."""
    stated: dict[int, int] | None = None
    """The same as the file's statistics say it; None where there are none."""
    indexed: Counter[int] = field(default_factory=Counter)
    """The same as the indexes of chunks say it; chunks may lack theirs."""
    damaged: int = 0
    """Chunks that cannot be unpacked."""
    cut: int = 0
    """Chunks that end inside of a record."""
    is_complete: bool = False
    """Whether the file has its end."""
    in_order: bool = True
    """Whether chunks follow each other in time."""

    @property
    def undeclared(self) -> int:
        """Messages of channels that the file does not describe."""
        return sum(count for channel, count in self.found.items() if channel not in self.channels)

    def stated_of(self, channel: int) -> int:
        """Messages of a channel that the file says it holds, or that it was found to hold."""
        if self.stated is not None:
            return self.stated.get(channel, 0)
        return max(self.found[channel], self.indexed[channel])


class McapFile:
    """An open file; see `survey` and `messages`.

    Args:
        file: Open for reading in binary.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._schemas: dict[int, str] = {}
        self.survey = self._surveyed()

    def messages(self, channels: Collection[int]) -> Iterator[McapMessage]:
        """The messages of some channels by the time at which they were recorded."""
        wanted = frozenset(channels)
        parts = (self._of(part, wanted) for part in self._parts())
        if self.survey.in_order:
            for part in parts:
                yield from sorted(part, key=_stamp)
        else:
            yield from sorted((one for part in parts for one in part), key=_stamp)

    def _of(self, part: bytes, wanted: frozenset[int]) -> list[McapMessage]:
        found = []
        for kind, content in _records_in(part):
            if kind == _MESSAGE and len(content) >= _MESSAGE_HEAD.size:
                channel, _, stamp, _ = _MESSAGE_HEAD.unpack_from(content)
                if channel in wanted:
                    found.append(McapMessage(channel, stamp, bytes(content[_MESSAGE_HEAD.size :])))
        return found

    def _surveyed(self) -> Survey:
        self.survey = survey = Survey()
        before = latest = 0
        for part in self._parts():
            before, whole = latest, 0
            for kind, content in _records_in(part):
                whole += _RECORD_HEAD.size + len(content)
                if kind == _SCHEMA:
                    self._note_schema(content)
                elif kind == _CHANNEL:
                    self._note_channel(content)
                elif kind == _MESSAGE and len(content) >= _MESSAGE_HEAD.size:
                    channel, _, stamp, _ = _MESSAGE_HEAD.unpack_from(content)
                    survey.found[channel] += 1
                    latest = max(latest, stamp)
                    if stamp < before:
                        survey.in_order = False
            survey.cut += whole < len(part)
        return survey

    def _parts(self) -> Iterator[bytes]:
        """The records of each chunk, and those between chunks, in the order of the file."""
        survey, loose = self.survey, bytearray()
        survey.damaged = 0
        survey.indexed.clear()
        for kind, start, length in self._records():
            if kind == _CHUNK:
                if loose:
                    yield bytes(loose)
                    loose.clear()
                chunk = _unpacked(self._content(start, length))
                if chunk is None:
                    survey.damaged += 1
                else:
                    yield chunk
            elif kind in (_SCHEMA, _CHANNEL, _MESSAGE):
                loose += _RECORD_HEAD.pack(kind, length) + self._content(start, length)
                if len(loose) >= _PART:
                    yield bytes(loose)
                    loose.clear()
            elif kind == _INDEX and length >= _INDEX_HEAD.size:
                channel, size = _INDEX_HEAD.unpack(self._content(start, _INDEX_HEAD.size))
                survey.indexed[channel] += min(size, length) // _INDEX_ENTRY
            elif kind == _STATISTICS:
                survey.stated = _stated(self._content(start, length))
            elif kind == _FOOTER:
                survey.is_complete = True
        if loose:
            yield bytes(loose)

    def _records(self) -> Iterator[tuple[int, int, int]]:
        """Kind, place and length of each whole record."""
        end = self._file.seek(0, os.SEEK_END)
        place = len(MAGIC)
        while place + _RECORD_HEAD.size <= end:
            self._file.seek(place)
            kind, length = _RECORD_HEAD.unpack(self._file.read(_RECORD_HEAD.size))
            place += _RECORD_HEAD.size
            if place + length > end:
                return
            yield kind, place, length
            place += length
            if kind == _FOOTER:
                return

    def _content(self, start: int, length: int) -> bytes:
        self._file.seek(start)
        return self._file.read(length)

    def _note_schema(self, content: memoryview) -> None:
        with contextlib.suppress(struct.error, UnicodeDecodeError):
            (number,) = struct.unpack_from("<H", content)
            self._schemas[number], _ = _text(content, 2)

    def _note_channel(self, content: memoryview) -> None:
        with contextlib.suppress(struct.error, UnicodeDecodeError):
            number, schema = struct.unpack_from("<HH", content)
            topic, place = _text(content, 4)
            encoding, _ = _text(content, place)
            kind = self._schemas.get(schema, "")
            self.survey.channels[number] = McapChannel(topic, kind, encoding)


def _stamp(message: McapMessage) -> int:
    return message.stamp


def packed_chunks(file: BinaryIO) -> Iterator[tuple[str, int, int]]:
    """Compression, place and size of what each chunk of a file packs."""
    end = file.seek(0, os.SEEK_END)
    place = len(MAGIC)
    with contextlib.suppress(struct.error, UnicodeDecodeError):
        while place + _RECORD_HEAD.size <= end:
            file.seek(place)
            kind, length = _RECORD_HEAD.unpack(file.read(_RECORD_HEAD.size))
            place += _RECORD_HEAD.size
            if kind == _FOOTER or place + length > end:
                return
            if kind == _CHUNK:
                head = memoryview(file.read(min(length, 128)))
                compression, start = _text(head, 28)
                (size,) = struct.unpack_from("<Q", head, start)
                yield compression, place + start + 8, size
            place += length


def _unpacked(chunk: bytes) -> bytes | None:
    """The records of a chunk; None where they cannot be had."""
    try:
        view = memoryview(chunk)
        _, _, _, check = struct.unpack_from("<QQQI", view)
        compression, place = _text(view, 28)
        (size,) = struct.unpack_from("<Q", view, place)
        packed = chunk[place + 8 : place + 8 + size]
        records = _UNPACKING[compression](packed)
    except Exception:  # of struct, zstd, lz4, ...: whatever the bytes provoke
        return None
    return None if check and zlib.crc32(records) != check else records


def _records_in(part: bytes) -> Iterator[tuple[int, memoryview]]:
    """Kind and content of each whole record."""
    view = memoryview(part)
    place = 0
    while place + _RECORD_HEAD.size <= len(view):
        kind, length = _RECORD_HEAD.unpack_from(view, place)
        place += _RECORD_HEAD.size
        if place + length > len(view):
            return
        yield kind, view[place : place + length]
        place += length


def _text(content: memoryview, place: int) -> tuple[str, int]:
    """A text, and where the next value begins."""
    (length,) = struct.unpack_from("<I", content, place)
    place += 4
    if place + length > len(content):
        raise struct.error("the text is longer than its record")
    return bytes(content[place : place + length]).decode(), place + length


def _stated(content: bytes) -> dict[int, int] | None:
    """Messages by channel, as a file's statistics count them."""
    with contextlib.suppress(struct.error):
        (length,) = struct.unpack_from("<I", content, 42)
        counts = {}
        for place in range(46, 46 + length, 10):
            channel, count = struct.unpack_from("<HQ", content, place)
            counts[channel] = count
        return counts
    return None


def is_mcap(path: Path) -> bool:
    """Whether a file begins like one."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
