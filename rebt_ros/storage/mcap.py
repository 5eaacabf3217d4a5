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
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import BinaryIO, Final, NamedTuple

from rebt_ros.storage.message_definitions import differ
from rebt_ros.storage.packing import unlz4, unzstd
from rebt_ros.storage.time_order import by_time

#: Channel of what stands for messages that are missing.
GAP: Final = -1

MAGIC: Final = b"\x89MCAP0\r\n"

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _CHUNK_INDEX, _STATISTICS = *range(2, 9), 11
#: What stands where no record does.
_NO_RECORD: Final = -1
#: Records of kinds from the first on are for later versions of the format, to be passed over; from
#: the second on, they are a program's own.
_RESERVED, _PRIVATE = 0x10, 0x80
#: Encodings of definitions that are read: as `.msg` and `.idl` files have them.
_DEFINITIONS: Final = ("ros2msg", "ros2idl")
#: Channel, sequence, log time, publish time: before the data of a message.
_MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
_RECORD_HEAD: Final = struct.Struct("<BQ")
_INDEX_HEAD: Final = struct.Struct("<HI")
#: First and last stamp of a chunk, and its place.
_CHUNK_INDEX_HEAD: Final = struct.Struct("<QQQ")
#: Where the summary begins, where its offsets begin, and a checksum: the content of a footer.
_FOOTER_CONTENT: Final = struct.Struct("<QQI")
_FOOTER_SIZE: Final = _RECORD_HEAD.size + _FOOTER_CONTENT.size
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


class McapMessage(NamedTuple):
    """A message of a channel."""

    channel: int
    stamp: int
    """When it was recorded (nanoseconds), unsigned 64 bits."""
    data: bytes


@dataclass(slots=True)
class Survey:
    """What is in a file."""

    channels: dict[int, McapChannel] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    """Definitions of types as `.msg` or `.idl` files have them, by name."""
    redefined: set[str] = field(default_factory=set)
    """Names of types that have several of them, which differ."""
    elsehow: dict[str, str] = field(default_factory=dict)
    """How types are defined otherwise, by name."""
    found: Counter[int] = field(default_factory=Counter)
    """Messages by channel."""
    stated: dict[int, int] | None = None
    """The same as the file's statistics say it; None where there are none."""
    indexed: Counter[int] = field(default_factory=Counter)
    """The same as the indexes of chunks say it; chunks may lack theirs."""
    total: int | None = None
    """Messages as the statistics count them where they do so for all channels together only."""
    damaged: int = 0
    """Chunks that cannot be unpacked."""
    packed_by: Counter[str] = field(default_factory=Counter)
    """Chunks by the compression of theirs that is not known here."""
    gaps: list[tuple[int, int]] = field(default_factory=list)
    """Where there are no records amid the file: places of the first byte and of the next record."""
    cut: set[int] = field(default_factory=set)
    """Numbers of the parts that end inside of a record."""
    is_complete: bool = False
    """Whether the file has its end."""
    unknown: Counter[int] = field(default_factory=Counter)
    """Records outside of chunks by their kind, of kinds that the format has not had so far."""
    behind: int = 0
    """Bytes behind that, unless the first of them are zero."""
    in_order: bool = True
    """Whether chunks follow each other in time."""
    set_back: bool = False
    """Whether the clock was set back between messages that were read."""

    @property
    def undeclared(self) -> int:
        """Messages of channels that the file does not describe."""
        return sum(count for channel, count in self.found.items() if channel not in self.channels)

    @property
    def is_short(self) -> bool:
        """Whether the file says that it holds messages that were not found."""
        return any(self.stated_of(channel) > self.found[channel] for channel in self.channels)

    def stated_of(self, channel: int) -> int:
        """Messages of a channel that the file says it holds, or that it was found to hold."""
        if self.stated is not None:
            return self.stated.get(channel, 0)
        return max(self.found[channel], self.indexed[channel])


class McapFile:
    """An open file; see `survey` and `messages`.

    Args:
        file: Open for reading in binary.
        survey: What is in it, where that is known.
    """

    def __init__(self, file: BinaryIO, survey: Survey | None = None) -> None:
        self._file = file
        self._schemas: dict[int, str] = {}
        self.survey = self._surveyed() if survey is None else survey

    def messages(self, channels: Collection[int]) -> Iterator[McapMessage]:
        """The messages of some channels by the time at which they were recorded.

        Among them are messages of the channel `GAP` where others are missing.
        """
        wanted = frozenset(channels)
        if self.survey.in_order:
            latest = 0
            for part in self._parts_of(wanted):
                if part is None:
                    yield McapMessage(GAP, latest, b"")
                elif part:
                    found = self._by_time(part)
                    latest = found[-1].stamp
                    yield from found
            return
        everything: list[McapMessage] = []
        is_gap = False
        for part in self._parts_of(wanted):
            if part and is_gap:
                everything.append(McapMessage(GAP, part[0].stamp, b""))
            is_gap = part is None or (is_gap and not part)
            everything += part or ()
        yield from self._by_time(everything)

    def _by_time(self, messages: list[McapMessage]) -> list[McapMessage]:
        def told() -> None:
            self.survey.set_back = True

        return by_time(messages, lambda stamp: McapMessage(GAP, stamp, b""), told)

    def _parts_of(self, wanted: frozenset[int]) -> Iterator[list[McapMessage] | None]:
        """The messages of some channels in each part; None where some are missing."""
        for number, part in enumerate(self._parts()):
            yield None if part is None else self._of(part, wanted)
            if number in self.survey.cut:
                yield None

    def _of(self, part: bytes, wanted: frozenset[int]) -> list[McapMessage]:
        # Every message passes here: a generator of records would cost as much as all else.
        found, place, end = [], 0, len(part)
        record, head = _RECORD_HEAD.unpack_from, _MESSAGE_HEAD.unpack_from
        while place + _RECORD_HEAD.size <= end:
            kind, length = record(part, place)
            begin = place + _RECORD_HEAD.size
            place = begin + length
            if place > end:
                break
            if kind == _MESSAGE and length >= _MESSAGE_HEAD.size:
                channel, _, stamp, _ = head(part, begin)
                if channel in wanted:
                    data = part[begin + _MESSAGE_HEAD.size : place]
                    found.append(McapMessage(channel, stamp, data))
        return found

    def _surveyed(self) -> Survey:
        self.survey = survey = Survey()
        before = latest = 0
        record, head = _RECORD_HEAD.unpack_from, _MESSAGE_HEAD.unpack_from
        for number, part in enumerate(self._parts()):
            if part is None:
                continue
            before, place, end = latest, 0, len(part)
            # As in `_of`, without a generator.
            while place + _RECORD_HEAD.size <= end:
                kind, length = record(part, place)
                begin = place + _RECORD_HEAD.size
                if begin + length > end:
                    break
                place = begin + length
                if kind == _MESSAGE and length >= _MESSAGE_HEAD.size:
                    channel, _, stamp, _ = head(part, begin)
                    survey.found[channel] += 1
                    if stamp > latest:
                        latest = stamp
                    if stamp < before:
                        survey.in_order = False
                elif kind == _SCHEMA:
                    self._note_schema(memoryview(part)[begin:place])
                elif kind == _CHANNEL:
                    self._note_channel(memoryview(part)[begin:place])
            if place < end:
                survey.cut.add(number)
        return survey

    def _parts(self) -> Iterator[bytes | None]:
        """The records of each chunk, and those between chunks, in the order of the file.

        None stands where some are missing.
        """
        survey, loose = self.survey, bytearray()
        survey.damaged = 0
        survey.packed_by.clear()
        survey.gaps.clear()
        survey.indexed.clear()
        survey.unknown.clear()
        for kind, start, length in _records(self._file):
            if kind == _CHUNK:
                if loose:
                    yield bytes(loose)
                    loose.clear()
                try:
                    yield _unpacked(self._content(start, length))
                except _PackedElsehowError as err:
                    survey.packed_by[str(err)] += 1
                    yield None
                except _DamagedError:
                    survey.damaged += 1
                    yield None
            elif kind in (_SCHEMA, _CHANNEL, _MESSAGE):
                loose += _RECORD_HEAD.pack(kind, length) + self._content(start, length)
                if len(loose) >= _PART:
                    yield bytes(loose)
                    loose.clear()
            elif kind == _INDEX and length >= _INDEX_HEAD.size:
                channel, size = _INDEX_HEAD.unpack(self._content(start, _INDEX_HEAD.size))
                survey.indexed[channel] += min(size, length) // _INDEX_ENTRY
            elif kind == _STATISTICS:
                content = self._content(start, length)
                survey.stated = _stated(content)
                survey.total = None if survey.stated else _total(content)
            elif _is_reserved(kind):
                survey.unknown[kind] += 1
                if survey.is_short:
                    # It may have been one of messages.
                    if loose:
                        yield bytes(loose)
                        loose.clear()
                    yield None
            elif kind == _NO_RECORD:
                survey.gaps.append((start, start + length))
                if loose:
                    yield bytes(loose)
                    loose.clear()
                yield None
            elif kind == _FOOTER:
                survey.is_complete = True
                end = start + length + len(MAGIC)
                if any(self._content(end, len(MAGIC))):
                    survey.behind = self._file.seek(0, os.SEEK_END) - end
        if loose:
            yield bytes(loose)

    def _content(self, start: int, length: int) -> bytes:
        self._file.seek(start)
        return self._file.read(length)

    def _note_schema(self, content: memoryview) -> None:
        with contextlib.suppress(struct.error, UnicodeDecodeError):
            (number,) = struct.unpack_from("<H", content)
            self._schemas[number], place = _text(content, 2)
            encoding, place = _text(content, place)
            name = self._schemas[number]
            if encoding in _DEFINITIONS:
                text, _ = _text(content, place)
                if differ(name, self.survey.definitions.setdefault(name, text), text):
                    self.survey.redefined.add(name)
            elif encoding:
                self.survey.elsehow[name] = encoding

    def _note_channel(self, content: memoryview) -> None:
        with contextlib.suppress(struct.error, UnicodeDecodeError):
            number, schema = struct.unpack_from("<HH", content)
            topic, place = _text(content, 4)
            encoding, _ = _text(content, place)
            kind = self._schemas.get(schema, "")
            self.survey.channels[number] = McapChannel(topic, kind, encoding)


def packed_chunks(file: BinaryIO) -> Iterator[tuple[str, int, int]]:
    """Compression, place and size of what each chunk of a file packs."""
    for kind, start, length in _records(file):
        if kind == _CHUNK:
            with contextlib.suppress(struct.error, UnicodeDecodeError):
                file.seek(start)
                head = memoryview(file.read(min(length, 128)))
                compression, place = _text(head, 28)
                (size,) = struct.unpack_from("<Q", head, place)
                yield compression, start + place + 8, min(size, length)


def _records(file: BinaryIO) -> Iterator[tuple[int, int, int]]:
    """Kind, place and length of each whole record; of `_NO_RECORD` where there are none.

    Where the heads of records are damaged the next chunk, or the summary, is found by the summary.
    """
    end = file.seek(0, os.SEEK_END)
    known = _known_places(file, end)
    place = len(MAGIC)
    while place + _RECORD_HEAD.size <= end:
        file.seek(place)
        kind, length = _RECORD_HEAD.unpack(file.read(_RECORD_HEAD.size))
        following = place + _RECORD_HEAD.size + length
        later = bisect_right(known, place)
        bound = known[later] if later < len(known) else end
        if following <= bound and _is_record(file, kind, following, bound):
            yield kind, place + _RECORD_HEAD.size, length
            if kind == _FOOTER:
                return
            place = following
        elif later < len(known):
            yield _NO_RECORD, place, bound - place
            place = bound
        else:
            if not kind or _is_reserved(kind):
                yield _NO_RECORD, place, end - place
            return


def _is_reserved(kind: int) -> bool:
    return _RESERVED <= kind < _PRIVATE


def _is_record(file: BinaryIO, kind: int, following: int, bound: int) -> bool:
    """Whether what begins like a record that fits is one; it may be damage where it is unknown."""
    if not _is_reserved(kind):
        return kind > 0
    file.seek(following)
    head = file.read(_RECORD_HEAD.size)
    if following == bound or len(head) < _RECORD_HEAD.size:
        return True
    its, length = _RECORD_HEAD.unpack(head)
    return bool(its > 0 and following + _RECORD_HEAD.size + length <= bound)


def _known_places(file: BinaryIO, end: int) -> list[int]:
    """Where chunks and the summary begin, as the summary has it; nothing where there is none."""
    try:
        file.seek(max(0, end - len(MAGIC) - _FOOTER_SIZE))
        kind, length = _RECORD_HEAD.unpack(file.read(_RECORD_HEAD.size))
        summary, _, _ = _FOOTER_CONTENT.unpack(file.read(_FOOTER_CONTENT.size))
        if kind != _FOOTER or length != _FOOTER_CONTENT.size or file.read() != MAGIC:
            return []
        footer = end - len(MAGIC) - _FOOTER_SIZE
        if not len(MAGIC) <= summary < footer:
            return [footer]
        places, place = {summary, footer}, summary
        while place + _RECORD_HEAD.size <= footer:
            file.seek(place)
            kind, length = _RECORD_HEAD.unpack(file.read(_RECORD_HEAD.size))
            if kind == _CHUNK_INDEX:
                _, _, chunk = _CHUNK_INDEX_HEAD.unpack(file.read(_CHUNK_INDEX_HEAD.size))
                if len(MAGIC) <= chunk < summary and _begins_chunk(file, chunk, summary):
                    places.add(chunk)
            place += _RECORD_HEAD.size + length
        return sorted(places)
    except struct.error:
        return []


def _begins_chunk(file: BinaryIO, place: int, end: int) -> bool:
    file.seek(place)
    kind, length = _RECORD_HEAD.unpack(file.read(_RECORD_HEAD.size))
    return bool(kind == _CHUNK and place + _RECORD_HEAD.size + length <= end)


class _DamagedError(Exception):
    """A chunk cannot be unpacked."""


class _PackedElsehowError(Exception):
    """A chunk is packed in a way that is not known here, which is the text."""


def _unpacked(chunk: bytes) -> bytes:
    """The records of a chunk.

    Raises:
        _DamagedError: They cannot be had.
        _PackedElsehowError: Nor can they, by the means that are here.
        ImportError: The library that unpacks them is missing.
    """
    try:
        view = memoryview(chunk)
        _, _, _, check = struct.unpack_from("<QQQI", view)
        compression, place = _text(view, 28)
        (size,) = struct.unpack_from("<Q", view, place)
        packed = chunk[place + 8 : place + 8 + size]
    except (struct.error, UnicodeDecodeError) as err:
        raise _DamagedError from err
    unpack = _UNPACKING.get(compression)
    if unpack is None:
        raise _PackedElsehowError(compression)
    try:
        records = unpack(packed)
    except ImportError:
        raise
    except Exception as err:  # of zstd or lz4: whatever the bytes provoke
        raise _DamagedError from err
    if check and zlib.crc32(records) != check:
        raise _DamagedError
    return records


def _text(content: memoryview, place: int) -> tuple[str, int]:
    """A text, and where the next value begins."""
    (length,) = struct.unpack_from("<I", content, place)
    place += 4
    if place + length > len(content):
        raise struct.error("the text is longer than its record")
    return bytes(content[place : place + length]).decode(), place + length


def _total(content: bytes) -> int | None:
    """Messages, as a file's statistics count them."""
    with contextlib.suppress(struct.error):
        (count,) = struct.unpack_from("<Q", content)
        return int(count)
    return None


def _stated(content: bytes) -> dict[int, int] | None:
    """Messages by channel, as a file's statistics count them; None where they do not."""
    with contextlib.suppress(struct.error):
        (length,) = struct.unpack_from("<I", content, 42)
        counts = {}
        for place in range(46, 46 + length, 10):
            channel, count = struct.unpack_from("<HQ", content, place)
            counts[channel] = count
        return counts or None
    return None
