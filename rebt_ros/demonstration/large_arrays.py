"""Arrays that may be larger than memory: from a size on they are on disk, and mapped.

Their files have no name: they are gone with the process that made them, whatever way that ends.
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, in_parts
from rebt_ros.errors import InputError

#: Arrays of that size and more are on disk (bytes).
ON_DISK: Final = 1 << 28

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
    directory = os.environ.get("TMPDIR") or (_ROOM if _ROOM.is_dir() else tempfile.gettempdir())
    try:
        with tempfile.TemporaryFile(dir=directory) as file:
            # What finds no room later would end the process.
            os.posix_fallocate(file.fileno(), 0, size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as err:
        raise InputError(
            f"there is no room for {size / 1e9:.1f} GB of states in {directory} "
            f"({err.strerror or err}): make room, or name another directory in TMPDIR."
        ) from err
    return np.ndarray(shape, dtype=np.float64, buffer=mapped)


def rows_of(states: FloatArray, rows: BoolArray) -> FloatArray:
    """Some rows of an array as one of their own, shape (rows, columns)."""
    places = np.flatnonzero(rows)
    found = roomy((len(places), states.shape[1]))
    for part in in_parts(len(places)):
        found[part] = states[places[part]]
    return found


class Spool:
    """Takes over arrays: into memory while they are small together, and onto disk after that."""

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


def is_mapped(values: FloatArray) -> bool:
    """Whether an array is a part of a mapped file."""
    base: object = values
    while isinstance(base, np.ndarray):
        base = base.base
    return isinstance(base.obj if isinstance(base, memoryview) else base, mmap.mmap)
