"""The demonstrations in a directory: what is in them, and which of them are learned from.

Nothing is destroyed before it can no longer be missed: what is left out or deleted gets another
name, which `recordings` passes over, and the files of what was deleted go after `UNDO_TIME`.
"""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import OptionError, RebtError
from rebt_ros.storage.atomic import StorageError
from rebt_ros.storage.recording import ASIDE, read_recording
from rebt_ros.storage.recording_files import SUFFIX, is_recording
from rebt_ros.storage.recording_head import Origin, read_head
from rebt_ros.storage.recording_parts import write_part
from rebt_ros.studio.tree_view import Json

#: Follows the name of a recording that is kept, but not learned from.
LEFT_OUT: Final = ".left-out"
#: Follows the name of one that goes soon.
DELETED: Final = ".deleted"

#: How long a deleted demonstration can be restored (seconds).
UNDO_TIME: Final = 600.0

_BACK: Final = f"for {UNDO_TIME / 60:.0f} minutes the whole one can be restored."

#: Points of a thumbnail's line, and features that have one.
_POINTS: Final = 60
_LINES: Final = 6
#: Stretches of one action in a thumbnail's band.
_BANDS: Final = 200


@dataclass(slots=True)
class Shelf:
    """The demonstrations of one directory.

    Args:
        directory: Where the recorder writes them; need not be there yet.
        clock: Tells the time, in seconds since the epoch.
    """

    directory: Path
    clock: Callable[[], float] = time.time
    _known: dict[Path, tuple[tuple[int, int], dict[str, Json] | None]] = field(default_factory=dict)

    def views(self) -> dict[str, dict[str, Json]]:
        """All demonstrations by name, oldest first, each with a thumbnail.

        A file that has not changed is not read again.
        """
        found = dict(self._files())
        self._known = {path: known for path, known in self._known.items() if path in found}
        views = {}
        for path, suffix in found.items():
            content = self._content_of(path)
            if content is not None:
                flags = {"kept": suffix == "", "deleted": suffix == DELETED}
                views[_name(path)] = content | flags
        return views

    def leave_out(self, name: str) -> str:
        """Keeps a demonstration, but does not learn from it.

        Raises:
            OptionError: There is none of this name.
            StorageError: Its file cannot be renamed.
        """
        self._rename(name, "", LEFT_OUT)
        return f"{name} is left out: the next tree is learned without it."

    def take_in(self, name: str) -> str:
        """Learns from a demonstration again that was left out.

        Raises:
            OptionError: There is none of this name.
            StorageError: Its file cannot be renamed.
        """
        suffix = self._suffix_of(name)
        if suffix not in {LEFT_OUT, ASIDE}:
            raise OptionError(f"{name} is not left out.")
        self._rename(name, suffix, "")
        return f"{name} is taken in again: the next tree is learned from it, too."

    def delete(self, name: str) -> str:
        """Deletes a demonstration, which can be restored for a while.

        Raises:
            OptionError: There is none of this name.
            StorageError: Its file cannot be renamed.
        """
        self._rename(name, self._suffix_of(name), DELETED)
        return f"{name} is deleted; for {UNDO_TIME / 60:.0f} minutes it can be restored."

    def restore(self, name: str) -> str:
        """Takes a deletion back, or the cuts that made parts of a demonstration.

        Its parts go: all that is in them is in the whole one, and nothing is learned from twice.

        Raises:
            OptionError: There is none of this name.
            StorageError: Its file cannot be renamed, or a part cannot be removed.
        """
        self._rename(name, DELETED, "")
        parts = [path for path, _ in self._files() if self._is_part(path, name)]
        for part in parts:
            try:
                part.unlink(missing_ok=True)
            except OSError as err:
                raise StorageError(f"{part} cannot be removed ({err.strerror}).") from err
        return f"{name} is {'whole again' if parts else 'back'}."

    def trim(self, name: str, first: float, end: float) -> str:
        """Keeps a stretch of a demonstration, as one of its own; the whole one is deleted.

        Args:
            name: Of the demonstration.
            first: Seconds since its first row.
            end: The same; rows up to it are kept.

        Raises:
            RebtError: There is none of this name, the stretch has no rows, or it cannot be written.
        """
        self._cut(name, ((first, math.nextafter(end, math.inf)),))
        return f"{name} is cut to {first:.1f} to {end:.1f} s; {_BACK}"

    def split(self, name: str, at: float) -> str:
        """Makes two demonstrations of one, which is deleted.

        Args:
            name: Of the demonstration.
            at: Seconds since its first row, where the second one begins.

        Raises:
            RebtError: There is none of this name, a part has no rows, or it cannot be written.
        """
        self._cut(name, ((-math.inf, at), (at, math.inf)))
        return f"{name} is split at {at:.1f} s; {_BACK}"

    def tidy(self) -> None:
        """Destroys what was deleted too long ago to be restored.

        Raises:
            StorageError: A file cannot be removed.
        """
        for path, suffix in self._files():
            try:
                # Renaming leaves the time of the last change to the content as it was.
                if suffix == DELETED and self.clock() - path.stat().st_ctime > UNDO_TIME:
                    path.unlink(missing_ok=True)
            except OSError as err:
                raise StorageError(f"{path} cannot be removed ({err.strerror}).") from err

    def _files(self) -> Iterator[tuple[Path, str]]:
        """The files that are called like recordings, and what follows their names."""
        try:
            paths = sorted(self.directory.iterdir())
        except OSError:
            return
        for path in paths:
            for suffix in ("", LEFT_OUT, ASIDE, DELETED):
                if path.name.endswith(SUFFIX + suffix):
                    yield path, suffix

    def _suffix_of(self, name: str) -> str:
        """What follows the name of a demonstration; nothing where there is none."""
        return next((suffix for path, suffix in self._files() if _name(path) == name), "")

    def _cut(self, name: str, stretches: Sequence[tuple[float, float]]) -> None:
        path = self._path(name, "")
        written: list[Path] = []
        try:
            for number, (first, end) in enumerate(stretches, start=1):
                written.append(write_part(path, first, end, f"{name}-{number}"))
        except RebtError:
            for part in written:
                part.unlink(missing_ok=True)
            raise
        self._rename(name, "", DELETED)

    def _is_part(self, path: Path, name: str) -> bool:
        """Whether a file is a part that `_cut` has made of a demonstration, or of a part of it."""
        if not re.fullmatch(rf"{re.escape(name)}(-[12])+", _name(path)):
            return False
        try:
            whole = read_recording(self.directory / f"{name}{SUFFIX}").demonstration
            part = read_recording(path).demonstration
        except RebtError:
            return False
        return _holds(whole, part)

    def _path(self, name: str, suffix: str) -> Path:
        """The file of a demonstration: a name comes from a browser, and may not lead elsewhere."""
        path = self.directory / f"{name}{SUFFIX}{suffix}"
        # Nor does every name name a file: some have a byte 0.
        if path.parent != self.directory or not path.is_file() or not is_recording(path):
            raise OptionError(f"there is no demonstration {name!r} any more, or it has changed.")
        return path

    def _rename(self, name: str, before: str, after: str) -> None:
        path = self._path(name, before)
        to = path.with_name(f"{name}{SUFFIX}{after}")
        if to.exists():
            raise OptionError(f"there is a file {to.name} already: move it elsewhere.")
        try:
            path.rename(to)
        except OSError as err:
            raise StorageError(f"{path} cannot be renamed ({err.strerror}).") from err

    def _content_of(self, path: Path) -> dict[str, Json] | None:
        """What is in a file; None where it is no recording, or gone."""
        try:
            status = path.stat()
        except OSError:
            return None
        mark = (status.st_mtime_ns, status.st_size)
        known = self._known.get(path)
        if known is None or known[0] != mark:
            known = (mark, _content(path) if is_recording(path) else None)
            self._known[path] = known
        return known[1]


def _holds(whole: Demonstration, part: Demonstration) -> bool:
    """Whether all rows of a part are in the whole one, with nothing in between."""
    if whole.features != part.features or not len(part):
        return False
    first = int(np.searchsorted(whole.stamps, part.stamps[0]))
    rows = slice(first, first + len(part))
    return (
        np.array_equal(whole.stamps[rows], part.stamps)
        and np.array_equal(whole.states[rows], part.states, equal_nan=True)
        and [whole.actions[code] for code in whole.chosen[rows]]
        == [part.actions[code] for code in part.chosen]
    )


def _name(path: Path) -> str:
    return path.name.rpartition(SUFFIX)[0]


def _content(path: Path) -> dict[str, Json]:
    """What is in a recording."""
    try:
        read = read_recording(path)
        with path.open("rb") as file:
            origin = read_head(path, file).origin
    except (RebtError, OSError) as err:
        return {**_NOTHING, "notes": [str(err)]}
    shown = read.demonstration
    if not len(shown):
        return {**_NOTHING, "notes": ["no rows yet"]}
    seconds = (shown.stamps - shown.stamps[0]) / 1e9
    return {
        "rows": len(shown),
        "seconds": round(float(seconds[-1]), 3),
        "start": float(shown.stamps[0]) / 1e9,
        "origin": origin.value,
        "actions": dict(Counter(shown.actions[code] for code in shown.chosen.tolist())),
        "bands": list(_bands(shown, seconds.tolist())),
        "series": _series(shown, seconds.tolist()),
        "notes": list(read.notes),
    }


_NOTHING: Final[dict[str, Json]] = {
    "rows": 0,
    "seconds": 0.0,
    "start": 0.0,
    "origin": Origin.DEMONSTRATION.value,
    "actions": {},
    "bands": [],
    "series": {},
}


def _bands(shown: Demonstration, seconds: list[float]) -> Iterator[list[Json]]:
    """Stretches of one action: from, to, label."""
    stretches = []
    for code, rows in groupby(range(len(shown)), key=shown.chosen.__getitem__):
        first, *_ = stretch = list(rows)
        end = min(stretch[-1] + 1, len(shown) - 1)
        stretches.append([seconds[first], seconds[end], shown.actions[code]])
    yield from stretches[:_BANDS]


def _series(shown: Demonstration, seconds: list[float]) -> dict[str, list[list[float]]]:
    """Some points of the numeric features that vary."""
    places = np.unique(np.linspace(0, len(shown) - 1, _POINTS).round().astype(int))
    series = {}
    for place, feature in enumerate(shown.features):
        column = shown.states[places, place]
        known = np.isfinite(column)
        if feature.kind is FeatureKind.NUMERIC and known.any() and np.ptp(column[known]) > 0:
            series[feature.name] = [
                [seconds[row], value]
                for row, value in zip(places[known].tolist(), column[known].tolist(), strict=True)
            ]
        if len(series) == _LINES:
            break
    return series
