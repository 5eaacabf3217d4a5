"""Whether another process writes to a directory, too."""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
from enum import IntEnum
from pathlib import Path
from typing import Final

#: `struct flock`: type, whence, start, length, process.
_LOCK: Final = struct.Struct("hhqqi4x")


class Use(IntEnum):
    """What a directory is used for; the byte that is locked for it."""

    RECORDINGS = 0
    TREES = 1


class SharedDirectory:
    """Marks a directory as used, and tells whether others have marked it.

    The mark is a lock on the directory itself, so nothing is left when a process is killed.  Where
    the file system has no such locks, nobody is seen.

    Args:
        use: What for; other uses do not count.
    """

    def __init__(self, use: Use) -> None:
        self._use = use
        self._descriptor: int | None = None

    def is_shared(self, directory: Path) -> bool:
        """Marks the directory, if it is there, and tells whether somebody else has."""
        try:
            self._open(directory)
            if self._descriptor is None:
                return False
            found = fcntl.fcntl(self._descriptor, fcntl.F_OFD_GETLK, self._lock(fcntl.F_WRLCK))
        except OSError:
            return False
        return bool(_LOCK.unpack(found)[0] != fcntl.F_UNLCK)

    def close(self) -> None:
        """Takes the mark off."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def _open(self, directory: Path) -> None:
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                if os.path.samestat(directory.stat(), os.fstat(self._descriptor)):
                    return
            # Another one is meant, or it was moved away.
            self.close()
        with contextlib.suppress(FileNotFoundError):
            self._descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            fcntl.fcntl(self._descriptor, fcntl.F_OFD_SETLK, self._lock(fcntl.F_RDLCK))

    def _lock(self, kind: int) -> bytes:
        return _LOCK.pack(kind, os.SEEK_SET, self._use, 1, 0)
