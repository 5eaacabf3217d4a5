"""Rows of a recording of version 1: lines of CSV, which are read but no longer written."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from rebt_ros.demonstration.builder import LARGEST_VALUE, is_label
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording_head import Head

_COLUMNS: Final = ("stamp", "channel", "action", "last_action")

#: Lines before the first row.
_HEAD: Final = 2


def read_text_rows(path: Path, file: BinaryIO, head: Head) -> Read:
    """Reads what follows the first line.

    LAT is not read back, because it follows from the actions.

    Raises:
        InputError: A line is malformed.
    """
    header = _header(head.features)
    if file.read(len(header)) != header:
        raise InputError(
            f"{path}, line 2: the columns must be stamp, channel, action, last_action and the "
            "features of line 1: restore the line."
        )
    lines = _Lines(file)
    demonstration = Demonstration.from_rows(
        path.name, head.features, _rows(path, head, lines), head.row_kind
    )
    _check_values(path, demonstration)
    notes = ("its last line is incomplete and left out",) if lines.torn else ()
    return Read(demonstration, notes)


def _header(features: tuple[Feature, ...]) -> bytes:
    return _line(_COLUMNS + tuple(feature.name for feature in features))


def _line(cells: Sequence[object]) -> bytes:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerow(cells)
    return buffer.getvalue().encode()


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


def _rows(path: Path, head: Head, lines: _Lines) -> Iterator[Row]:
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
    if not is_label(action):
        raise ValueError(f"{action!r} is not an action")
    nanoseconds = int(stamp)
    if not -(2**63) <= nanoseconds < 2**63:
        raise ValueError(f"{stamp} is not a stamp")
    return Row(nanoseconds, channel, action, None, tuple(map(float, numbers)))


def _check_values(path: Path, demonstration: Demonstration) -> None:
    wrong = np.argwhere(~(np.abs(demonstration.states) <= LARGEST_VALUE))
    for row, column in wrong[:1].tolist():
        raise InputError(
            f"{path}, line {row + _HEAD + 1}: {demonstration.features[column].name!r} is "
            f"{demonstration.states[row, column]}: replace it by a number within "
            f"±{LARGEST_VALUE:g}, or remove the line."
        )
