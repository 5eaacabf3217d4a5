"""Arrays that may be larger than memory: large ones are mapped files.

The files have no name, so they vanish with the process that made them, however it ends.
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
from array import array
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Final

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, in_parts
from rebt_ros.errors import InputError

#: Arrays of at least this size are on disk (bytes).
ON_DISK: Final = 1 << 28

#: How many numbers are written to disk at a time.
_PASSING: Final = 1 << 20

#: For large files that need not survive a restart (see hier(7)): /tmp may be in memory.
_ROOM: Final = Path("/var/tmp")


def roomy(shape: tuple[int, ...]) -> FloatArray:
    """An array to be filled, in memory or on disk.

    Raises:
        InputError: There is no room for it on disk.
    """
    size = 8 * math.prod(shape)
    if size < ON_DISK:
        return np.empty(shape)
    directory = _directory()
    try:
        with tempfile.TemporaryFile(dir=directory) as file:
            # Running out of room later would end the process.
            os.posix_fallocate(file.fileno(), 0, size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as err:
        raise _no_room(size, directory, err) from err
    return np.ndarray(shape, dtype=np.float64, buffer=mapped)


def _directory() -> str | Path:
    return os.environ.get("TMPDIR") or (_ROOM if _ROOM.is_dir() else tempfile.gettempdir())


def _no_room(size: int, directory: str | Path, err: OSError) -> InputError:
    return InputError(
        f"there is no room for {size / 1e9:.1f} GB of states in {directory} "
        f"({err.strerror or err}): make room, or name another directory in TMPDIR."
    )


def rows_of(states: FloatArray, rows: BoolArray) -> FloatArray:
    """Some rows of an array as an array of their own, shape (rows, columns)."""
    places = np.flatnonzero(rows)
    found = roomy((len(places), states.shape[1]))
    for part in in_parts(len(places)):
        found[part] = states[places[part]]
    return found


class GrowingArray:
    """Numbers that arrive one after another: in memory while they are few, on disk after that.

    >>> growing = GrowingArray()
    >>> growing.extend((0.5, 2.0))
    >>> growing.values().tolist()
    [0.5, 2.0]
    """

    def __init__(self) -> None:
        self._recent = array("d")
        self._file: IO[bytes] | None = None
        self._on_disk = 0
        self._most = ON_DISK // 8

    def extend(self, values: Iterable[float]) -> None:
        """Adds numbers.

        Raises:
            InputError: There is no room for them on disk.
        """
        self._recent.extend(values)
        if len(self._recent) >= self._most:
            self._to_disk()

    def values(self) -> FloatArray:
        """All numbers, shape (numbers,); nothing can be added after that.

        Raises:
            InputError: There is no room for them on disk.
        """
        if self._file is None:
            return np.frombuffer(self._recent)
        self._to_disk()
        with self._file:
            mapped = mmap.mmap(self._file.fileno(), 8 * self._on_disk)
        return np.ndarray((self._on_disk,), dtype=np.float64, buffer=mapped)

    def _to_disk(self) -> None:
        directory = _directory()
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=directory)  # noqa: SIM115
                # From here on, numbers only pass through memory.
                self._most = _PASSING
            for part in in_parts(len(self._recent)):
                self._file.write(memoryview(self._recent)[part])
            self._file.flush()
        except OSError as err:
            size = 8 * (self._on_disk + len(self._recent))
            raise _no_room(size, directory, err) from err
        self._on_disk += len(self._recent)
        self._recent = array("d")


class Spool:
    """Keeps arrays: in memory while their total size is small, on disk after that."""

    def __init__(self) -> None:
        self._in_memory = 0
        self._room: FloatArray = np.empty(0)

    def take(self, values: FloatArray) -> FloatArray:
        """The same values, in the array itself or in another one.

        Raises:
            InputError: There is no room for them on disk.
        """
        if is_mapped(values):
            return values
        if self._in_memory + values.nbytes < ON_DISK:
            self._in_memory += values.nbytes
            return values
        if self._room.size < values.size:
            self._room = roomy((max(values.size, ON_DISK // 8),))
        taken, self._room = self._room[: values.size], self._room[values.size :]
        taken = taken.reshape(values.shape)
        taken[...] = values
        return taken


def is_mapped(values: FloatArray | IntArray) -> bool:
    """Whether an array is part of a mapped file."""
    base: object = values
    while isinstance(base, np.ndarray):
        base = base.base
    return isinstance(base.obj if isinstance(base, memoryview) else base, mmap.mmap)
