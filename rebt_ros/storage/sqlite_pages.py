"""Messages on the pages of a damaged file of rosbag2 (https://sqlite.org/fileformat2.html).

SQLite gives up at the first page that is missing or malformed.  Here every page that is there is
read by itself, without the tree that leads to it.  A row of the table of messages is told by its
columns: no number (which is that of the row), two integers, and the data.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, Final

_HEAD_SIZE: Final = 100
_INTERIOR, _LEAF = 5, 13
#: Bytes before the places of cells.
_LEAF_HEAD: Final = 8
_INTERIOR_HEAD: Final = 12
#: Bytes of the integers of each type of value.
_INTEGERS: Final = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}
_FLOAT: Final = 7
#: Types of values from here on are data (even numbers) and texts (odd ones) of some length.
_DATA: Final = 12


@dataclass(frozen=True, slots=True)
class PageMessage:
    """A message as it stands on a page."""

    number: int
    """Of its row."""
    topic: int
    stamp: int
    data: bytes
    """Empty where what stands there is no data."""


@dataclass(slots=True)
class SqlitePages:
    """The pages of an open file; see `messages`.

    Raises:
        ValueError: The file does not say how long its pages are.
    """

    file: BinaryIO
    highest: int = 0
    """The largest number of a row that was seen, also of rows that could not be read."""
    _size: int = field(init=False)
    _usable: int = field(init=False)
    _count: int = field(init=False)
    _taken: set[int] = field(default_factory=set)
    """Pages that hold the rest of a row, or nothing."""

    def __post_init__(self) -> None:
        end = self.file.seek(0, os.SEEK_END)
        self.file.seek(0)
        head = self.file.read(_HEAD_SIZE)
        if len(head) < _HEAD_SIZE:
            raise ValueError("it ends inside of its first line")
        (size,) = struct.unpack_from(">H", head, 16)
        self._size = 65536 if size == 1 else size
        self._usable = self._size - head[20]
        if self._size < 512 or self._size & (self._size - 1) or self._usable < 480:
            raise ValueError(f"it has pages of {self._size} bytes")
        # Of the last page there may be a part.
        self._count = -(-end // self._size)
        self._note_free(*struct.unpack_from(">II", head, 32))

    def messages(self) -> Iterator[PageMessage]:
        """The messages on all pages, each once, as they stand in the file."""
        seen: set[int] = set()
        for number in range(1, self._count + 1):
            page = self._page(number)
            if number in self._taken or not page:
                continue
            begin = _HEAD_SIZE if number == 1 else 0
            if page[begin : begin + 1] == bytes([_INTERIOR]):
                for place in _places(page, begin, _INTERIOR_HEAD):
                    with contextlib.suppress(IndexError):
                        self.highest = max(self.highest, _varint(page, place + 4)[0])
            elif page[begin : begin + 1] == bytes([_LEAF]):
                for place in _places(page, begin, _LEAF_HEAD):
                    message = self._message(page, place)
                    if message is not None and message.number not in seen:
                        seen.add(message.number)
                        self.highest = max(self.highest, message.number)
                        yield message

    def _page(self, number: int) -> bytes:
        """A page; short or empty where the file ends before it does."""
        self.file.seek((number - 1) * self._size)
        return self.file.read(self._size)

    def _note_free(self, trunk: int, count: int) -> None:
        """Passes over the pages that hold what was deleted."""
        while 0 < trunk <= self._count and trunk not in self._taken and count > 0:
            self._taken.add(trunk)
            page = self._page(trunk)[: self._usable]
            if len(page) < 8:
                return
            following, leaves = struct.unpack_from(">II", page)
            leaves = min(leaves, len(page) // 4 - 2)
            self._taken.update(struct.unpack_from(f">{leaves}I", page, 8))
            trunk, count = following, count - leaves - 1

    def _message(self, page: bytes, place: int) -> PageMessage | None:
        """The message in a cell; None where there is none, or not the whole of it."""
        try:
            length, place = _varint(page, place)
            number, place = _varint(page, place)
            payload = self._payload(page, place, length)
            return None if payload is None else _message_of(number, payload)
        except (IndexError, struct.error):
            return None

    def _payload(self, page: bytes, place: int, length: int) -> bytes | None:
        """The bytes of a row, which go on on other pages where they are many."""
        largest = self._usable - 35
        local = length
        if length > largest:
            least = (self._usable - 12) * 32 // 255 - 23
            local = least + (length - least) % (self._usable - 4)
            local = local if local <= largest else least
        part = page[place : place + local]
        if len(part) < local:
            return None
        if local == length:
            return part
        if length > self._count * self._size:
            return None
        parts, left = [part], length - local
        (following,) = struct.unpack_from(">I", page, place + local)
        while left > 0:
            # No page belongs to two rows.
            if not 0 < following <= self._count or following in self._taken:
                return None
            self._taken.add(following)
            page = self._page(following)[: self._usable]
            part = page[4 : 4 + left]
            if len(part) < min(left, self._usable - 4):
                return None
            (following,) = struct.unpack_from(">I", page)
            parts.append(part)
            left -= len(part)
        return b"".join(parts)


def _places(page: bytes, begin: int, head: int) -> Iterator[int]:
    """Where the cells of a page begin, each place once."""
    (count,) = struct.unpack_from(">H", page, begin + 3) if len(page) >= begin + head else (0,)
    count = min(count, (len(page) - begin - head) // 2)
    places = struct.unpack_from(f">{count}H", page, begin + head)
    yield from (place for place in dict.fromkeys(places) if begin + head <= place < len(page) - 4)


def _varint(data: bytes, place: int) -> tuple[int, int]:
    """A number of variable length, and where the next value begins."""
    value = 0
    for count in range(9):
        byte = data[place + count]
        if count == 8:
            value = value << 8 | byte
            break
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            break
    return value - (1 << 64) if value >> 63 else value, place + count + 1


def _message_of(number: int, payload: bytes) -> PageMessage | None:
    """The message that a row is; None where it is none."""
    end, place = _varint(payload, 0)
    kinds: list[int] = []
    while place < end and len(kinds) <= 4:
        kind, place = _varint(payload, place)
        kinds.append(kind)
    if place != end or len(kinds) != 4 or kinds[0] or not {*kinds[1:3]} <= _INTEGERS.keys():
        return None
    topic, place = _integer(payload, place, kinds[1])
    stamp, place = _integer(payload, place, kinds[2])
    kind = kinds[3]
    if kind < _DATA:
        known = kind in _INTEGERS or kind in (0, _FLOAT)
        return PageMessage(number, topic, stamp, b"") if known else None
    length = (kind - _DATA) // 2
    data = payload[place : place + length]
    if len(data) < length:
        return None
    return PageMessage(number, topic, stamp, b"" if kind % 2 else data)


def _integer(data: bytes, place: int, kind: int) -> tuple[int, int]:
    size = _INTEGERS[kind]
    if not size:
        return int(kind == 9), place
    return int.from_bytes(data[place : place + size], "big", signed=True), place + size
