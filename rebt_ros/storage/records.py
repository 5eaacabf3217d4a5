"""The records of a table: cells line by line, before anything is said about what they mean."""

from __future__ import annotations

import csv
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rebt_ros.errors import InputError
from rebt_ros.storage.dialect import COMMENT, Dialect, dialect_of
from rebt_ros.storage.text import read_text


class NoRow(Enum):
    """Why a record is no row."""

    EMPTY = "is empty", "are empty"
    COMMENT = "is a comment", "are comments"
    NAMES = "repeats the column names", "repeat the column names"

    def __init__(self, single: str, several: str) -> None:
        self.single = single
        self.several = several


@dataclass(frozen=True, slots=True)
class Records:
    """What a table's file holds."""

    path: Path
    rows: list[list[str]]
    """The cells of each record that holds something: one at least, of two cells or more."""
    lines: array[int]
    """Where each of them begins, counted from 1."""
    comment: tuple[str, ...]
    """The cells of the last comment before the table, which may name its columns."""
    left_out: Counter[NoRow]
    """How many other records there are among and behind them, by what they are."""
    notes: tuple[str, ...]
    """How it is read, where that is not plain; no full stops."""

    def without(self, cells: Sequence[str]) -> Records:
        """The first record, and those of the others that do not repeat its cells."""
        again = [
            place
            for place, row in enumerate(self.rows)
            if place and len(row) == len(cells) and [cell.strip() for cell in row] == [*cells]
        ]
        if not again:
            return self
        drop = set(again)
        kept = [place for place in range(len(self.rows)) if place not in drop]
        return Records(
            self.path,
            [self.rows[place] for place in kept],
            array("q", (self.lines[place] for place in kept)),
            self.comment,
            self.left_out + Counter({NoRow.NAMES: len(again)}),
            self.notes,
        )


def read_records(path: Path) -> Records:
    """Reads the file of a table.

    Raises:
        InputError: The file cannot be read, or holds no table.
    """
    text = read_text(path)
    dialect = dialect_of(text)
    rows, lines = _parsed(path, text, dialect)
    kept, left_out = [], Counter[NoRow]()
    width = len(next((cells for cells in rows if any(map(str.strip, cells))), ()))
    for place, cells in enumerate(rows):
        if not any(map(str.strip, cells)):
            left_out[NoRow.EMPTY] += bool(cells)
        elif cells[0].startswith(COMMENT) and len(cells) != width:
            left_out[NoRow.COMMENT] += 1
        else:
            kept.append(place)
    if not kept:
        raise InputError(f"{path} is empty: name a table with rows.")
    rows = [rows[place] for place in kept]
    if all(len(cells) == len(rows[0]) and not cells[-1].strip() for cells in rows):
        # Some programs end each line with a separator.
        rows = [cells[:-1] for cells in rows]
    if len(rows[0]) < 2:
        raise InputError(
            f"{path} has a single column: a table needs at least one value of the state and "
            "an action, separated by commas."
        )
    return Records(
        path,
        rows,
        array("q", (lines[place] for place in kept)),
        dialect.comment,
        +left_out,
        dialect.notes,
    )


def _parsed(path: Path, text: str, dialect: Dialect) -> tuple[list[list[str]], array[int]]:
    rows: list[list[str]] = []
    lines = array("q")
    line = before = 1 + text.count("\n", 0, dialect.begin)
    try:
        for cells, ended in dialect.records(text):
            rows.append(cells)
            lines.append(line)
            line = before + ended
    except csv.Error as err:
        raise InputError(
            f"{path}, line {line}: this is not CSV ({err}): check its quotes."
        ) from err
    return rows, lines
