"""SQLite files of rosbag2, with what their write-ahead log still holds."""

from __future__ import annotations

import contextlib
import shutil
import sqlite3
import tempfile
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import quote

MAGIC: Final = b"SQLite format 3\0"

#: SQLite instructions that are granted per byte of a file, and to any file.
_STEPS_PER_BYTE: Final = 20
_STEPS: Final = 1_000_000
_STEPS_AT_ONCE: Final = 10_000
_LEAST_LENGTH: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class SqliteTopic:
    """A topic as a file has it."""

    number: int
    name: str
    kind: str
    encoding: str
    messages: int


@contextlib.contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A file of rosbag2, for reading only.

    A write-ahead log beside it is read on a copy, as SQLite writes to a file that has one.

    Raises:
        sqlite3.Error: It is no such file, or a damaged one.
        ValueError: There is something in it that computes.
    """
    log = path.with_name(f"{path.name}-wal")
    if not (log.is_file() and log.stat().st_size):
        with contextlib.closing(_connected(path, "mode=ro&immutable=1")) as connection:
            yield connection
        return
    with tempfile.TemporaryDirectory() as directory:
        copy = Path(directory, "bag.db3")
        shutil.copyfile(path, copy)
        shutil.copyfile(log, copy.with_name(f"{copy.name}-wal"))
        with contextlib.closing(_connected(copy, "mode=rw")) as connection:
            yield connection


def topics(connection: sqlite3.Connection) -> tuple[SqliteTopic, ...]:
    """The topics of a file, with how many messages each has."""
    rows = connection.execute(
        "SELECT topics.id, name, type, serialization_format, count(messages.id) FROM topics "
        "LEFT JOIN messages ON topics.id == messages.topic_id GROUP BY topics.id ORDER BY topics.id"
    )
    return tuple(
        SqliteTopic(int(number), str(name), str(kind), str(encoding), int(count))
        for number, name, kind, encoding, count in rows
    )


def undeclared(connection: sqlite3.Connection) -> int:
    """How many messages belong to no topic of the file."""
    [(count,)] = connection.execute(
        "SELECT count(*) FROM messages WHERE topic_id NOT IN (SELECT id FROM topics)"
    )
    return int(count)


def messages(
    connection: sqlite3.Connection, numbers: Collection[int]
) -> Iterator[tuple[int, int, bytes]]:
    """Topic, stamp and data of the messages of some topics, by their stamps."""
    marks = ", ".join("?" * len(numbers))
    for number, stamp, data in connection.execute(
        f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) "
        "ORDER BY timestamp, id",
        tuple(numbers),
    ):
        # A number or a text there is no message; `bytes` would make one of as many zeros.
        yield int(number), int(stamp), data if isinstance(data, bytes) else b""


def _connected(path: Path, how: str) -> sqlite3.Connection:
    size = path.stat().st_size
    connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{how}", uri=True)
    left = _STEPS + _STEPS_PER_BYTE * size

    def too_long() -> bool:
        nonlocal left
        left -= _STEPS_AT_ONCE
        return left < 0

    # What a file makes SQLite compute is bounded by its size, and so is what one value can be.
    connection.set_progress_handler(too_long, _STEPS_AT_ONCE)
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(size, _LEAST_LENGTH))
    try:
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
