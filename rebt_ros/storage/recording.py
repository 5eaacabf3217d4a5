"""The recorder's own durable format: one file per demonstration, which only ever grows.

The first line is `# rebt_ros recording` with JSON that says where the columns come from (see
`recording_head`), and what follows are records of one fixed length (see `recording_rows`).  A row
is handed to the operating system by the time `write` returns, so that a recorder that is killed
loses none, and a recording can be read while it grows.  Against a loss of power there is `sync`.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Callable, Mapping, Sequence
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

#: How a file is opened that no other recorder has; it is read where it was removed.
_NEW: Final = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC

#: A file that was removed is copied in parts of this size (bytes).
_PART: Final = 1 << 20


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
        told: Told in a sentence that the file was removed while it was written, and is there again.

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
        told: Callable[[str], object] = lambda _: None,
    ) -> None:
        if not features:
            raise ValueError("a recording needs at least one feature")
        self.rows = 0
        self._width = len(features)
        self._channels = frozenset(channels)
        self._may_miss = robot is not None
        self._told = told
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

    def look(self) -> None:
        """Writes the file again where it was removed, and notices where it was moved.

        Raises:
            RecordingError: It was moved, or could not be written again.
        """
        if self._descriptor is None or self._is_there():
            return
        if os.fstat(self._descriptor).st_nlink:
            raise self._moved()
        self._write_again()

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
            RecordingError: The disk refused to keep what was written, or the file was moved.
        """
        if self._descriptor is None:
            return
        if self.rows == 0:
            self.discard()
            return
        try:
            self.look()
            self.sync()
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
        moved = None
        if self._descriptor is not None and self.rows and not self._is_there():
            moved = self._moved() if os.fstat(self._descriptor).st_nlink else None
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with contextlib.suppress(OSError):
                os.close(descriptor)
        if moved is not None:
            raise moved
        try:
            self.path.unlink(missing_ok=descriptor is not None)
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
        except (FileNotFoundError, NotADirectoryError):
            return False
        except OSError:
            # Who may not look does not know better.
            return True

    def _moved(self) -> RecordingError:
        place = Path(f"/proc/self/fd/{self._descriptor}")
        with contextlib.suppress(OSError):
            place = place.readlink()
        elsewhere = "where it was moved to" if place in (self.path, self.path.resolve()) else place
        return RecordingError(
            f"{self.path} was moved while it was written: its {self.rows} rows are in {elsewhere}."
        )

    def _write_again(self) -> None:
        """Copies what is in the file, which has no name any more, to one that has."""
        assert self._descriptor is not None
        removed, made = self.path, None
        try:
            removed.parent.mkdir(parents=True, exist_ok=True)
            try:
                path, made = removed, os.open(removed, _NEW, 0o666)
            except FileExistsError:
                path, made = _create(removed.parent)
            for place in range(0, self._size, _PART):
                part = os.pread(self._descriptor, min(_PART, self._size - place), place)
                if os.write(made, part) < len(part):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as err:
            if made is not None:
                os.close(made)
                with contextlib.suppress(OSError):
                    path.unlink()
            raise RecordingError(
                f"{removed} was removed while it was written, and cannot be written again "
                f"({err.strerror or err}): its {self.rows} rows are lost."
            ) from err
        os.close(self._descriptor)
        self.path, self._descriptor, self._named = path, made, False
        self._told(
            f"{removed} was removed while it was written: its {self.rows} rows are in {path} again."
        )

    def _append(self, content: bytes) -> None:
        if self._descriptor is None:
            raise ValueError(f"{self.path} is closed")
        try:
            status = os.fstat(self._descriptor)
            if status.st_nlink == 0:
                self._write_again()
                status = os.fstat(self._descriptor)
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
            return path, os.open(path, _NEW, 0o666)
