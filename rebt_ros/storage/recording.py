"""The recorder's own durable format: one CSV file per demonstration.

The first line is `# rebt_ros recording` with JSON that says where the columns come from, the second
one names the columns, and every further line is one row.  A row is on disk once `write` returns,
so that a recorder that is killed loses none, and a recording can be read while it grows.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import secrets
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np

from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import StorageError, sync_directory
from rebt_ros.storage.read import Read
from rebt_ros.storage.text import unreadable

VERSION = 1

_MARK = "# rebt_ros recording "
_COLUMNS = ("stamp", "channel", "action", "last_action")
#: Lines before the first row.
_HEAD = 2
#: Longer first lines are refused, so that a file that is no recording is not read as a whole.
_LONGEST_HEAD = 1 << 24


class RecordingError(StorageError):
    """A recording cannot be written; what was acknowledged before is on disk."""


class RecordingWriter:
    """Writes one demonstration, row by row, to a new file.

    Args:
        directory: Where to create the file; created itself where it is missing.
        features: Columns of the state.
        channels: Action topics that rows may come on.
        sample_rate: Rows per second and channel if the demonstration is sampled, else None.

    Raises:
        RecordingError: The file cannot be created.
    """

    path: Path
    """The file: its name begins with the time (UTC), so that names sort by time."""
    rows: int
    """How many rows were written."""

    def __init__(
        self,
        directory: Path,
        features: tuple[Feature, ...],
        channels: Sequence[str],
        *,
        sample_rate: float | None = None,
    ) -> None:
        self.rows = 0
        self._width = len(features)
        self._channels = frozenset(channels)
        self._size = 0
        self._descriptor: int | None = None
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self.path, self._descriptor = _create(directory)
        except OSError as err:
            raise RecordingError(
                f"no recording can be created in {directory} ({err.strerror or err}): "
                "name a directory with room where you may write."
            ) from err
        try:
            self._append(_head(features, tuple(channels), sample_rate))
        except RecordingError:
            self.discard()
            raise

    def write(self, row: Row) -> None:
        """Appends a row; it is in the file once this returns.

        Raises:
            RecordingError: It could not be written, and the file ends with the row before it.
            ValueError: The row is not one of this demonstration, or the recording is closed.
        """
        if len(row.state) != self._width or row.channel not in self._channels:
            raise ValueError(
                f"a row on {row.channel!r} with {len(row.state)} values does not fit "
                f"{self._width} features and the channels {sorted(self._channels)}"
            )
        in_range = all(abs(value) <= LARGEST_VALUE for value in row.state)
        if not in_range or not _is_label(row.action):
            raise ValueError(f"{row} could not be read back")
        self._append(
            _line(
                (
                    row.stamp,
                    row.channel,
                    row.action,
                    row.last_action or "",
                    *(repr(float(value)) for value in row.state),
                )
            )
        )
        self.rows += 1

    def close(self) -> None:
        """Ends the recording; one without rows is removed.

        Raises:
            RecordingError: The disk refused to keep what was written.
        """
        if self._descriptor is None:
            return
        if self.rows == 0:
            self.discard()
            return
        descriptor, self._descriptor = self._descriptor, None
        try:
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            sync_directory(self.path.parent)
        except OSError as err:
            raise RecordingError(
                f"{self.path} may not be complete ({err.strerror or err}): check the disk."
            ) from err

    def discard(self) -> None:
        """Ends the recording and removes its file.

        Raises:
            RecordingError: The file cannot be removed.
        """
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        with contextlib.suppress(OSError):
            os.close(descriptor)
        try:
            self.path.unlink(missing_ok=True)
        except OSError as err:
            raise RecordingError(
                f"{self.path} cannot be removed ({err.strerror or err}): remove it by hand."
            ) from err

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _append(self, line: bytes) -> None:
        if self._descriptor is None:
            raise ValueError(f"{self.path} is closed")
        try:
            if os.fstat(self._descriptor).st_nlink == 0:
                raise RecordingError(
                    f"{self.path} was removed while it was written: start a new demonstration."
                )
            # A part of a line that an earlier failure left could not be cut off: try again first.
            if os.fstat(self._descriptor).st_size > self._size:
                os.ftruncate(self._descriptor, self._size)
            written = os.write(self._descriptor, line)
        except OSError as err:
            raise self._failure(err.strerror or str(err)) from err
        if written < len(line):
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise self._failure("the disk is full")
        self._size += written

    def _failure(self, reason: str) -> RecordingError:
        return RecordingError(
            f"{self.path} cannot be written ({reason}): make room and record again; "
            f"its first {self.rows} rows are kept."
        )


def recordings(directory: Path) -> tuple[Path, ...]:
    """The recordings in a directory, oldest first; other files are passed over.

    Raises:
        InputError: There is no such directory, or there is no recording in it.
    """
    try:
        files = sorted(one for one in directory.glob("*.csv") if one.is_file())
    except NotADirectoryError as err:
        raise InputError(f"{directory} is not a directory: name one with recordings.") from err
    except OSError as err:
        raise unreadable(directory, err) from err
    found = tuple(one for one in files if is_recording(one))
    if not found:
        raise InputError(f"{directory} holds no recordings: record a demonstration first.")
    return found


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording.

    One whose recorder was killed before it had written the two first lines does not.
    """
    try:
        with path.open("rb") as file:
            if file.read(len(_MARK)) != _MARK.encode():
                return False
            return all(file.readline(_LONGEST_HEAD).endswith(b"\n") for _ in range(_HEAD))
    except OSError:
        return False


def read_recording(path: Path) -> Read:
    """Reads a recording, finished or not.

    LAT is not read back, because it follows from the actions.

    Raises:
        InputError: The file cannot be read, is no recording, or one of its lines is malformed.
    """
    try:
        with path.open("rb") as file:
            head = _read_head(path, file)
            lines = _Lines(file)
            demonstration = Demonstration.from_rows(
                path.name, head.features, _rows(path, head, lines)
            )
    except OSError as err:
        raise unreadable(path, err) from err
    _check_values(path, demonstration)
    notes = ("its last line is incomplete and left out",) if lines.torn else ()
    return Read(demonstration, notes)


@dataclass(frozen=True, slots=True)
class _Head:
    """What the first line says."""

    features: tuple[Feature, ...]
    channels: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> _Head:
        """Reads the JSON of the first line.

        Raises:
            ValueError: It is malformed; the message says how.
        """
        try:
            values = json.loads(text)
        except RecursionError as err:
            raise ValueError("its JSON is nested too deeply") from err
        if not isinstance(values, dict):
            raise ValueError("its JSON is not an object")
        if values.get("version") != VERSION:
            raise ValueError(f"its version is {values.get('version')!r}, not {VERSION}")
        features, channels = values.get("features"), values.get("channels")
        if not isinstance(features, list) or not isinstance(channels, list):
            raise ValueError("it lists no features or no channels")
        if not all(isinstance(one, str) for one in channels):
            raise ValueError("a channel is not text")
        read = tuple(map(_parse_feature, features))
        if len({feature.name for feature in read}) < len(read):
            raise ValueError("two features have the same name")
        return cls(read, tuple(channels))


def _parse_feature(value: object) -> Feature:
    if not isinstance(value, dict):
        raise ValueError(f"{value!r} is not a feature")
    name, topic, index = value.get("name"), value.get("topic"), value.get("index")
    if not (
        isinstance(name, str)
        and isinstance(topic, str | None)
        and isinstance(index, int | None)
        and not isinstance(index, bool)
    ):
        raise ValueError(f"{value!r} is not a feature")
    return Feature(name, topic=topic, index=index)


def _head(
    features: tuple[Feature, ...], channels: tuple[str, ...], sample_rate: float | None
) -> bytes:
    """The first two lines."""
    description = {
        "version": VERSION,
        "sample_rate": sample_rate,
        "features": [
            {"name": feature.name, "topic": feature.topic, "index": feature.index}
            for feature in features
        ],
        "channels": channels,
    }
    return f"{_MARK}{json.dumps(description)}\n".encode() + _header(features)


def _header(features: tuple[Feature, ...]) -> bytes:
    return _line(_COLUMNS + tuple(feature.name for feature in features))


def _line(cells: Sequence[object]) -> bytes:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(cells)
    return buffer.getvalue().encode()


def _create(directory: Path) -> tuple[Path, int]:
    """A new file that no other recorder has or gets."""
    while True:
        now = datetime.now(UTC)
        name = f"{now:%Y%m%dT%H%M%S.%fZ}-{os.getpid()}-{secrets.token_hex(3)}.csv"
        path = directory / name
        with contextlib.suppress(FileExistsError):
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            return path, os.open(path, flags, 0o666)


def _read_head(path: Path, file: BinaryIO) -> _Head:
    first = file.readline(_LONGEST_HEAD)
    mark = _MARK.encode()
    if not first.startswith(mark) or not first.endswith(b"\n"):
        raise InputError(f"{path} is not a recording: name one that the recorder wrote.")
    try:
        head = _Head.parse(first.removeprefix(mark).decode())
    except ValueError as err:
        raise InputError(
            f"{path} is a recording that cannot be read, because {err}: "
            "use the version of rebt_ros that wrote it."
        ) from err
    header = _header(head.features)
    if file.read(len(header)) != header:
        raise InputError(
            f"{path}, line 2: the columns must be stamp, channel, action, last_action and the "
            "features of line 1: restore the line."
        )
    return head


class _Lines(Iterator[bytes]):
    """The complete lines of a file, without their ends."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.torn = False
        """Whether the file ended within a line."""

    def __next__(self) -> bytes:
        # Once a part of a line was seen there is nothing to come, even if the file grows.
        line = b"" if self.torn else self._file.readline()
        self.torn = self.torn or bool(line and not line.endswith(b"\n"))
        if not line or self.torn:
            raise StopIteration
        return line[:-1]


def _rows(path: Path, head: _Head, lines: _Lines) -> Iterator[Row]:
    channels = frozenset(head.channels)
    for number, line in enumerate(lines, _HEAD + 1):
        try:
            yield _row(line.decode(), len(head.features), channels)
        except (ValueError, csv.Error) as err:
            raise InputError(
                f"{path}, line {number}: this is not a row of the recording ({err}): "
                "remove the line."
            ) from err


def _row(line: str, width: int, channels: frozenset[str]) -> Row:
    """Reads one line.

    Raises:
        ValueError: It is malformed.
        csv.Error: Its quotes are.
    """
    # Only the cells before the numbers can be quoted, and few are: this is twice as fast as to
    # hand whole lines to the csv module.
    start, *numbers = line.rsplit(",", width)
    cells = next(csv.reader((start,), strict=True), []) if '"' in start else start.split(",")
    if len(numbers) != width or len(cells) != len(_COLUMNS):
        raise ValueError(f"it does not have {len(_COLUMNS) + width} cells")
    stamp, channel, action, _ = cells
    if channel not in channels:
        raise ValueError(f"{channel!r} is not one of its channels")
    if not _is_label(action):
        raise ValueError(f"{action!r} is not an action")
    nanoseconds = int(stamp)
    if not -(2**63) <= nanoseconds < 2**63:
        raise ValueError(f"{stamp} is not a stamp")
    return Row(nanoseconds, channel, action, None, tuple(map(float, numbers)))


def _is_label(action: str) -> bool:
    return bool(action) and action.isprintable()


def _check_values(path: Path, demonstration: Demonstration) -> None:
    wrong = np.argwhere(~(np.abs(demonstration.states) <= LARGEST_VALUE))
    for row, column in wrong[:1].tolist():
        raise InputError(
            f"{path}, line {row + _HEAD + 1}: {demonstration.features[column].name!r} is "
            f"{demonstration.states[row, column]}: replace it by a number within "
            f"±{LARGEST_VALUE:g}, or remove the line."
        )
