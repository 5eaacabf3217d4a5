"""Files that are replaced as a whole: a reader sees the old file or the new one, never a part."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Callable
from pathlib import Path

from rebt_ros.errors import RebtError


class StorageError(RebtError):
    """A file cannot be written."""


def write_text_atomically(path: Path, text: str) -> None:
    """Writes a UTF-8 file and its missing parent directories; see `write_bytes_atomically`.

    Names of files need not be UTF-8.  What stands for their bytes is written as an escape, which
    JSON reads back.
    """
    write_bytes_atomically(path, text.encode("utf-8", "backslashreplace"))


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Writes a file and its missing parent directories.

    Args:
        path: File to create or replace; a symbolic link is followed, not replaced.
        content: All of it.

    Raises:
        StorageError: It could not be written; what was there before is untouched.
    """

    def write(temporary: Path) -> None:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())

    try:
        target = path.resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        replace_with(target, write)
        sync_directory(target.parent)
    except OSError as err:
        raise StorageError(
            f"{path} cannot be written ({err.strerror or err}): "
            "name a place with room where you may write."
        ) from err


def replace_with(path: Path, write: Callable[[Path], object]) -> None:
    """Creates or replaces a file with one that is written under a temporary name beside it.

    Args:
        path: File to create or replace; its directory exists.
        write: Writes the new file to the path that it is given.

    Raises:
        OSError: It could not be written; what was there before is untouched.
    """
    # In the same directory, because a file cannot be renamed across file systems.
    temporary = path.with_name(f".{path.name[:16]}.{os.getpid()}.{secrets.token_hex(4)}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        # After success, the temporary name is gone.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def sync_directory(directory: Path) -> None:
    """Makes the names of new files in a directory survive a power failure.

    Raises:
        OSError: The directory cannot be opened or written.
    """
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
