"""SQLite files of rosbag2, with what their write-ahead log still holds.

A file that is damaged or cut off is read page by page: see `sqlite_pages`.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
import struct
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final
from urllib.parse import quote

from rebt_ros.storage.sqlite_pages import SqlitePages
from rebt_ros.storage.time_order import by_time, set_back

MAGIC: Final = b"SQLite format 3\0"

#: Number of the topic of what stands for messages that are missing.
GAP: Final = -1

#: SQLite instructions that are granted per byte of a file, and to any file: the shortest real
#: messages, empty ones, need 1 for each byte.
_STEPS_PER_BYTE: Final = 20
_STEPS: Final = 1_000_000
_STEPS_AT_ONCE: Final = 10_000
_LEAST_LENGTH: Final = 1 << 16

#: What a page may hold beside the data of a row (bytes): what is reserved on it, the page's own
#: and the row's head, and its numbers.
_BESIDE_DATA: Final = 400
_ROWS_AT_ONCE: Final = 4096

_JOURNAL: Final = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
_LOG_HEAD: Final = 32
_FRAME_HEAD: Final = 24


@dataclass(frozen=True, slots=True)
class SqliteTopic:
    """A topic as a file has it."""

    number: int
    name: str
    kind: str
    encoding: str


@dataclass(slots=True)
class SqliteFile:
    """A file; see `opened` and `messages`."""

    path: Path
    topics: tuple[SqliteTopic, ...] = ()
    found: Counter[int] = field(default_factory=Counter)
    """Messages by the number of their topic."""
    notes: list[str] = field(default_factory=list)
    """What is wrong with it, in words that follow the file's name; no full stops."""
    is_damaged: bool = False
    """Whether it is read page by page."""
    set_back: bool = False
    """Whether the clock was set back between messages that were read."""
    _in_order: bool = False
    """Whether the messages stand by their stamps, which are integers."""
    _long: set[int] = field(default_factory=set)
    """Topics with messages that may go on on pages which `survey` does not read."""

    @property
    def undeclared(self) -> int:
        """How many messages belong to no topic of the file."""
        known = {topic.number for topic in self.topics}
        return sum(count for number, count in self.found.items() if number not in known)

    def definitions(self) -> list[tuple[str, str]]:
        """Types with their definitions, those of `.msg` or `.idl` files, if they can be read."""
        with (
            contextlib.suppress(sqlite3.Error),
            contextlib.closing(_connected(self.path)) as connection,
        ):
            found = connection.execute(
                "SELECT topic_type, encoded_message_definition FROM message_definitions "
                "WHERE encoding IN ('ros2msg', 'ros2idl') LIMIT 1000"
            ).fetchall()
            return [
                (kind, text)
                for kind, text in found
                if isinstance(kind, str) and isinstance(text, str)
            ]
        return []

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Topic, stamp and data of the messages of some topics, by their stamps.

        Among them are messages of the topic `GAP` where others are missing.
        """
        was_given = False
        if not self.is_damaged:
            try:
                for message in self._by_sqlite(numbers):
                    was_given = True
                    yield message
            except sqlite3.DatabaseError as err:
                _refuse_interrupted(err)
                if was_given:
                    # Damage is found before the first one is given, unless it came since then.
                    raise
                self._survey_pages(str(err))
            else:
                return
        yield from self._from_pages(numbers)

    def _from_pages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        with self.path.open("rb") as file:
            found = sorted(SqlitePages(file).messages(), key=lambda message: message.number)
        wanted: list[tuple[int, int, bytes]] = []
        expected, is_gap = 1, False
        for one in found:
            is_gap = is_gap or one.number > expected
            expected = one.number + 1
            if one.topic in numbers:
                if is_gap:
                    wanted.append((GAP, one.stamp, b""))
                    is_gap = False
                wanted.append((one.topic, one.stamp, one.data))
        yield from by_time(wanted, lambda stamp: (GAP, stamp, b""), self._note_set_back)

    def _note_set_back(self) -> None:
        self.set_back = True

    def survey(self) -> None:
        """Notes the topics and counts the messages.

        Raises:
            sqlite3.Error: The topics cannot be read.
        """
        with contextlib.closing(_connected(self.path)) as connection:
            self._survey(connection)

    def _survey(self, connection: sqlite3.Connection) -> None:
        rows = connection.execute(
            "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        )
        self.topics = tuple(
            SqliteTopic(int(number), str(name), str(kind), str(encoding))
            for number, name, kind, encoding in rows
        )
        if _has_journal(self.path):
            # Pages may be there to which no others lead yet.
            self._survey_pages("its recorder was killed while it wrote")
            return
        if _is_cut(self.path):
            # SQLite would take what is missing of a page for zeros.
            self._survey_pages("it ends before its end")
            return
        try:
            self._survey_messages(connection)
            [(highest,)] = connection.execute("SELECT max(id) FROM messages NOT INDEXED")
            if isinstance(highest, int) and highest > (count := self.found.total()):
                # Recorders number messages from 1.
                self.notes.append(
                    f"holds {count} messages, and their numbers go up to {highest}: others were "
                    "deleted or are damaged"
                )
        except sqlite3.DatabaseError as err:
            _refuse_interrupted(err)
            self._survey_pages(str(err))

    def _survey_messages(self, connection: sqlite3.Connection) -> None:
        """Counts the messages, and notes whether they can be given as they stand."""
        [(page,)] = connection.execute("PRAGMA page_size")
        # An index may be damaged where the table is not.
        rows = connection.execute(
            "SELECT topic_id, timestamp, length(data) > ? FROM messages NOT INDEXED ORDER BY id",
            (int(page) - _BESIDE_DATA,),
        )
        kinds: Counter[tuple[object, object]] = Counter()
        self._in_order, last = True, -(1 << 63)
        while some := rows.fetchmany(_ROWS_AT_ONCE):
            numbers, stamps, are_long = zip(*some, strict=True)
            kinds.update(zip(numbers, are_long, strict=True))
            if self._in_order:
                told = set(map(type, stamps)) == {int}
                self._in_order = told and stamps[0] >= last and stamps == (*sorted(stamps),)
                last = stamps[-1]
        for (number, is_long), count in kinds.items():
            self.found[_number(number)] += count
            if is_long:
                self._long.add(_number(number))

    def _by_sqlite(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        of_topics = f"FROM messages NOT INDEXED WHERE topic_id IN ({', '.join('?' * len(numbers))})"
        with contextlib.closing(_connected(self.path)) as connection:
            if not self._long.isdisjoint(numbers):
                # With their data, so that damage is found before the first message is given.
                whole = f"SELECT count(*) {of_topics} AND data IS x''"
                connection.execute(whole, tuple(numbers)).fetchall()
            places, order = set[int](), "id"
            if not self._in_order:
                stamps = connection.execute(
                    f"SELECT topic_id, timestamp {of_topics} ORDER BY id", tuple(numbers)
                ).fetchall()
                places, order = self._order_of(stamps)
            messages: Iterable[tuple[int, int, bytes]] = connection.execute(
                f"SELECT topic_id, timestamp, data {of_topics} ORDER BY {order}", tuple(numbers)
            )
            for place, (number, stamp, data) in enumerate(messages):
                if place in places:
                    yield GAP, stamp, b""
                # A number or a text there is no message; `bytes` would make one of as many zeros.
                usable = isinstance(data, bytes) and isinstance(stamp, int)
                yield int(number), stamp if usable else 0, data if usable else b""

    def _order_of(self, stamps: list[tuple[int, int]]) -> tuple[set[int], str]:
        """Before which messages the clock was set back, and by what they are to be ordered."""
        told = [one for one in stamps if isinstance(one[1], int)]
        all_told = len(told) == len(stamps)
        places = set(set_back(told)) if all_told else set()
        self.set_back |= bool(places)
        in_order = all_told and all(one[1] <= other[1] for one, other in pairwise(told))
        # To sort them takes SQLite as long as to read them several times.
        return places, "id" if places or in_order else "timestamp, id"

    def _survey_pages(self, why: str) -> None:
        """Counts the messages on pages, as SQLite cannot read all of them."""
        self.is_damaged = True
        self.found.clear()
        with self.path.open("rb") as file:
            pages = SqlitePages(file)
            self.found.update(message.topic for message in pages.messages())
        count = self.found.total()
        # Recorders number messages from 1.
        lost = f" of at least {pages.highest}" if pages.highest > count else ""
        self.notes.append(f"is damaged ({why}): {count}{lost} messages could be read")


@contextlib.contextmanager
def opened(path: Path) -> Iterator[SqliteFile]:
    """A file of rosbag2, for reading only.

    A write-ahead log beside it is read on a copy, as SQLite writes to a file that has one.

    Raises:
        sqlite3.Error: It is no such file, or so damaged that its topics cannot be read.
        ValueError: There is something in it that computes.
        OSError: It cannot be read, or there is no room for the copy.
    """
    log = path.with_name(f"{path.name}-wal")
    with contextlib.ExitStack() as stack:
        notes: list[str] = []
        if log.is_file() and log.stat().st_size:
            directory = stack.enter_context(tempfile.TemporaryDirectory())
            copy = Path(directory, "bag.db3")
            shutil.copyfile(path, copy)
            notes, path = _with_log(copy, log), copy
        file = SqliteFile(path, notes=notes)
        # Each time it is read it is opened: not all files can be where there are thousands.
        file.survey()
        yield file


def _with_log(copy: Path, log: Path) -> list[str]:
    """Moves what a write-ahead log holds into a copy of its file; notes what does not go."""
    begin = copy.with_name(f"{copy.name}-wal")
    shutil.copyfile(log, begin)
    frames = _frames_of(log)
    moved = 0
    with (
        contextlib.closing(sqlite3.connect(copy)) as connection,
        contextlib.suppress(sqlite3.DatabaseError),
    ):
        connection.execute("PRAGMA writable_schema = ON")
        [(_, moved, _)] = connection.execute("PRAGMA wal_checkpoint(FULL)")
    moved = max(moved, 0)
    begin.unlink(missing_ok=True)
    if frames is None:
        size = log.stat().st_size
        return [f"has a write-ahead log of {size} bytes that is damaged: it was not read"]
    if moved < frames:
        return [
            f"has a write-ahead log whose last {frames - moved} of {frames} pages are not complete "
            "or damaged: they were not read"
        ]
    return []


def _frames_of(log: Path) -> int | None:
    """Pages of the last generation in a log; None where its head is damaged."""
    with log.open("rb") as file:
        head = file.read(_LOG_HEAD)
        if len(head) < _LOG_HEAD:
            return None
        magic, _, page, _ = struct.unpack_from(">IIII", head)
        if magic not in (0x377F0682, 0x377F0683) or page < 512 or page & (page - 1):
            return None
        end = file.seek(0, os.SEEK_END)
        frames = int(-(-(end - _LOG_HEAD) // (_FRAME_HEAD + page)))
        for number in range(frames):
            file.seek(_LOG_HEAD + number * (_FRAME_HEAD + page))
            frame = file.read(_FRAME_HEAD)
            if frame[8:16] != head[16:24]:
                return number
    return frames


def _has_journal(path: Path) -> bool:
    """Whether there is a journal of a transaction that has not ended."""
    journal = path.with_name(f"{path.name}-journal")
    if not journal.is_file():
        return False
    with journal.open("rb") as file:
        return file.read(len(_JOURNAL)) == _JOURNAL


def _is_cut(path: Path) -> bool:
    """Whether a file is shorter than it says."""
    with path.open("rb") as file:
        head = file.read(32)
        end = file.seek(0, os.SEEK_END)
    (page,) = struct.unpack_from(">H", head, 16)
    (pages,) = struct.unpack_from(">I", head, 28)
    return bool(end < pages * (65536 if page == 1 else page))


def _number(value: object) -> int:
    """The number of a topic; one that no topic has where it is none."""
    return value if isinstance(value, int) else -1


def is_interrupted(err: Exception) -> bool:
    """Whether a file makes SQLite compute too much."""
    # Errors of Python's own have no code.
    return getattr(err, "sqlite_errorcode", None) == sqlite3.SQLITE_INTERRUPT


def _refuse_interrupted(err: sqlite3.DatabaseError) -> None:
    """Passes on that a file makes SQLite compute too much, which is no damage.

    Raises:
        sqlite3.DatabaseError: It does.
    """
    if is_interrupted(err):
        raise err


def _connected(path: Path) -> sqlite3.Connection:
    size = path.stat().st_size
    address = quote(os.fsencode(path.absolute()))
    connection = sqlite3.connect(f"file:{address}?mode=ro&immutable=1", uri=True)
    connection.text_factory = partial(str, encoding="utf-8", errors="replace")
    left = _STEPS + _STEPS_PER_BYTE * size

    def too_long() -> bool:
        nonlocal left
        left -= _STEPS_AT_ONCE
        return left < 0

    # What a file makes SQLite compute is bounded by its size, and so is what one value can be.
    connection.set_progress_handler(too_long, _STEPS_AT_ONCE)
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(size, _LEAST_LENGTH))
    try:
        # Else a file that was cut off is not opened at all; nothing is written to it.
        connection.execute("PRAGMA writable_schema = ON")
        _check_schema(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def _check_schema(connection: sqlite3.Connection) -> None:
    """Refuses a file with anything in it that computes.

    Raises:
        ValueError: It is refused.
    """
    objects = connection.execute("SELECT type, name, rootpage FROM sqlite_master").fetchall()
    for kind, name, root in objects:
        # Tables without a page of their own are virtual.
        if kind not in ("table", "index") or not root:
            raise ValueError(f"it holds {kind} {name!r}, which no recorder makes")
        if kind == "table":
            columns = connection.execute("SELECT hidden FROM pragma_table_xinfo(?)", (name,))
            if any(hidden for (hidden,) in columns):
                raise ValueError(f"its table {name!r} has computed columns")
    if not {"messages", "topics"} <= {name for kind, name, _ in objects if kind == "table"}:
        raise ValueError("it has no tables of messages and topics")
