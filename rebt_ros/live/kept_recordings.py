"""Recordings that were read once, and are not read again as long as they stay what they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from rebt_ros.demonstration.large_arrays import Spool
from rebt_ros.storage.read import Read, on_spool
from rebt_ros.storage.text import unreadable

#: What changes where somebody writes to a file: its number, size and times (nanoseconds).
_State: TypeAlias = tuple[int, int, int, int]


class KeptRecordings:
    """What was read of recordings, for who reads the same ones again and again.

    Args:
        read: Reads a recording.
    """

    def __init__(self, read: Callable[[Path], Read]) -> None:
        self._read = read
        self._spool = Spool()
        self._kept: dict[Path, tuple[_State, Read]] = {}

    def read(
        self, paths: Sequence[Path], tell: Callable[[float], None] = lambda share: None
    ) -> list[Read]:
        """Reads those recordings that are new, or were written to, and forgets all others.

        Args:
            paths: All recordings.
            tell: Told which share of the reading is behind.

        Returns:
            What was read of each.

        Raises:
            InputError: One cannot be read.
        """
        states = {path: _state_of(path) for path in paths}
        kept = {
            path: known
            for path, state in states.items()
            if (known := self._kept.get(path)) is not None and known[0] == state
        }
        # What is not wanted any more makes room first.
        self._kept = kept
        tell(0.0)
        new = [path for path in states if path not in kept]
        for done, path in enumerate(new, start=1):
            # Of a recording that grows meanwhile, the state is one that it is not in any more.
            kept[path] = states[path], on_spool(self._read(path), self._spool)
            tell(done / len(new))
        return [kept[path][1] for path in paths]


def _state_of(path: Path) -> _State:
    try:
        status = os.stat(path)
    except OSError as err:
        raise unreadable(path, err) from err
    return status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
