"""The recorder's own durable format: one file per demonstration, which only ever grows.

The first line is `# rebt_ros recording` with JSON that says where the columns come from (see
`recording_head`), and what follows are records of one fixed length (see `recording_rows`).  A row
is handed to the operating system by the time `write` returns, so that a recorder that is killed
loses none, and a recording can be read while it grows.  Against a loss of power there is `sync`.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Final

from rebt_ros.demonstration.builder import LARGEST_VALUE, is_label
from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.atomic import StorageError, sync_directory
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording_files import SUFFIX
from rebt_ros.storage.recording_head import Origin, head_line, read_head
from rebt_ros.storage.recording_rows import RowEncoder, read_rows
from rebt_ros.storage.text import unreadable

#: Follows the name of a recording that is kept, but not learned from.
ASIDE: Final = ".failed"


class RecordingError(StorageError):
    """A recording cannot be written; what was acknowledged before is on disk."""


class RecordingWriter:
    """Writes one demonstration, row by row, to a new file.

    Args:
        directory: Where to create the file; created itself where it is missing.
        features: Columns of the state.
        channels: Action topics that rows may come on.
        sample_rate: Rows per second and channel if the demonstration is sampled, else None.
        origin: Why it was shown.
        robot: Where the features are in messages; None where they are arrays of numbers.
        categories: Those of the features by name, where there is a robot file; may grow.

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
        origin: Origin = Origin.DEMONSTRATION,
        robot: RobotFile | None = None,
        categories: Mapping[str, Categories] | None = None,
    ) -> None:
        if not features:
            raise ValueError("a recording needs at least one feature")
        self.rows = 0
        self._width = len(features)
        self._channels = frozenset(channels)
        self._may_miss = robot is not None
        texts = {
            place: (categories or {})[feature.name]
            for place, feature in enumerate(features)
            if feature.name in (categories or {}) and (categories or {})[feature.name].is_open
        }
        self._encoder = RowEncoder(channels, self._width, texts)
        self._size = 0
        self._named = False
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
            head = head_line(
                features, channels, sample_rate, origin, texts=texts.keys(), robot=robot
            )
            self._append(head)
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
        in_range = all(
            abs(value) <= LARGEST_VALUE or (self._may_miss and value != value)
            for value in row.state
        )
        labels = (row.action, row.last_action) if row.last_action is not None else (row.action,)
        if not in_range or not all(map(is_label, labels)):
            raise ValueError(f"{row} could not be read back")
        known = self._encoder.labels
        try:
            self._append(self._encoder.encode(row))
        except RecordingError:
            self._encoder.forget(known)
            raise
        self.rows += 1

    def sync(self) -> None:
        """Makes the rows written so far survive a loss of power; takes as long as the disk does.

        Raises:
            RecordingError: The disk refused to keep what was written.
        """
        if self._descriptor is None:
            return
        try:
            os.fsync(self._descriptor)
            if not self._named:
                sync_directory(self.path.parent)
                self._named = True
        except OSError as err:
            raise self._incomplete(err) from err

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
        try:
            self.sync()
            if not self._is_there():
                raise RecordingError(
                    f"{self.path} was moved or removed while it was written: its {self.rows} rows "
                    "are not there."
                )
        finally:
            descriptor, self._descriptor = self._descriptor, None
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def set_aside(self) -> None:
        """Ends the recording like `close`, under a name that `recordings` passes over.

        Raises:
            RecordingError: The disk refused to keep what was written, or the name to be changed.
        """
        if self._descriptor is None:
            return
        self.close()
        if self.rows == 0:
            return
        aside = self.path.with_name(self.path.name + ASIDE)
        try:
            self.path.rename(aside)
        except OSError as err:
            raise RecordingError(
                f"{self.path} cannot be set aside ({err.strerror or err}): move it elsewhere."
            ) from err
        self.path = aside

    def discard(self) -> None:
        """Ends the recording and removes its file; one that has ended is removed as well.

        Raises:
            RecordingError: The file cannot be removed.
        """
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
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

    def _is_there(self) -> bool:
        """Whether the file is still where it was created."""
        assert self._descriptor is not None
        try:
            return os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
        except OSError:
            return False

    def _append(self, content: bytes) -> None:
        if self._descriptor is None:
            raise ValueError(f"{self.path} is closed")
        try:
            status = os.fstat(self._descriptor)
            if status.st_nlink == 0:
                raise RecordingError(
                    f"{self.path} was removed while it was written: start a new demonstration."
                )
            # A part of a row that an earlier failure left could not be cut off: try again first.
            if status.st_size > self._size:
                os.ftruncate(self._descriptor, self._size)
            written = os.write(self._descriptor, content)
        except OSError as err:
            raise self._failure(err.strerror or str(err)) from err
        if written < len(content):
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise self._failure("the disk is full")
        self._size += written

    def _incomplete(self, err: OSError) -> RecordingError:
        return RecordingError(
            f"{self.path} may not be complete ({err.strerror or err}): check the disk."
        )

    def _failure(self, reason: str) -> RecordingError:
        return RecordingError(
            f"{self.path} cannot be written ({reason}): make room and record again; "
            f"its first {self.rows} rows are kept."
        )


def read_recording(path: Path) -> Read:
    """Reads a recording, finished or not.

    Of LAT only that of the first row is read back: the others follow from the actions.

    Raises:
        InputError: The file cannot be read, is no recording, or is damaged.
    """
    try:
        with path.open("rb") as file:
            return read_rows(path, file, read_head(path, file))
    except OSError as err:
        raise unreadable(path, err) from err


def _create(directory: Path) -> tuple[Path, int]:
    """A new file that no other recorder has or gets."""
    while True:
        now = datetime.now(UTC)
        name = f"{now:%Y%m%dT%H%M%S.%fZ}-{os.getpid()}-{secrets.token_hex(3)}{SUFFIX}"
        path = directory / name
        with contextlib.suppress(FileExistsError):
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            return path, os.open(path, flags, 0o666)
