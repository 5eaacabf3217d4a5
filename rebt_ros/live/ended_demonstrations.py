"""Which demonstrations have ended since something was learned, without ROS."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from rebt_ros.storage.recording_files import is_named_so
from rebt_ros.storage.text import unreadable

#: A recording has ended that nothing was written to for so long (seconds).
QUIET: Final = 3.0


class EndedDemonstrations:
    """Watches a directory of recordings; what is there at the first look was learned from before.

    A recording does not say that it has ended: nothing is written to it any more.  One that goes
    on after a pause has ended anew.  May be used in any thread.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._directory: Path | None = None
        self._sizes: dict[str, tuple[int, float]] = {}
        self._learned: dict[str, int] = {}
        self.problem = ""
        """Why nothing can be counted, without a full stop; empty where it can be."""

    def look(self, directory: Path, now: float) -> int:
        """How many demonstrations have ended that nothing was learned from.

        Args:
            directory: Of the recordings; another one than before is a first look.
            now: Seconds of a clock that nobody sets.
        """
        self.problem = _problem(directory)
        found = dict(_sizes(directory))
        with self._lock:
            if directory != self._directory:
                self._directory, self._sizes, self._learned = directory, {}, found
            before, self._sizes = self._sizes, {}
            for name, size in found.items():
                known, since = before.get(name, (None, now))
                self._sizes[name] = (size, since if size == known else now)
            return sum(
                size != self._learned.get(name) and now - since >= QUIET
                for name, (size, since) in self._sizes.items()
            )

    def learn(self) -> None:
        """All that is there is about to be learned from."""
        with self._lock:
            if self._directory is not None:
                self._learned = dict(_sizes(self._directory))


def _problem(directory: Path) -> str:
    """Why a directory cannot be looked into; it need not be there yet."""
    try:
        next(directory.iterdir(), None)
    except FileNotFoundError:
        return ""
    except OSError as err:
        return str(unreadable(directory, err)).rstrip(".")
    return ""


def _sizes(directory: Path) -> Iterator[tuple[str, int]]:
    """The recordings in a directory, which need not be there, and their sizes in bytes."""
    with suppress(OSError):
        for path in directory.iterdir():
            with suppress(OSError):
                if is_named_so(path):
                    yield path.name, path.stat().st_size
