"""What the columns of a table are called, and whether its first record says so.

A first record that is a row of data is told from names by what stands below it: numbers, amounts,
dates or truths in all of a column, or texts that recur.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import FloatArray
from rebt_ros.storage.cells import is_missing, is_number, is_value_like, numbers
from rebt_ros.storage.records import Records

#: So many records tell whether the first one holds a row.
_TELLING = 200

#: Columns of these names, in any case, number or date the rows.
_NUMBERING = frozenset({"stamp", "time", "timestamp", "index", "unnamed: 0", "#"})
#: Columns of these names do where their values rise from every row to the next.
_COUNTING = re.compile(r"(?:.*[._/])?seq|id|nr|no|n|row|step|sequence|frame|tick|.*(?:index|_id)")
#: Columns of these names do where their values rise or stay: clocks are coarse.
_DATING = re.compile(r"t|elapsed|.*(?:time|stamp|date|clock)")
#: Fewer rows do not tell whether values rise.
FEWEST_RISING = 3
#: Columns of these names hold a part of a ROS stamp, whatever its values: `header.stamp.nanosec`.
_PART_OF_STAMP = re.compile(r"(?:.*[._/])?(?:n(?:ano)?secs?|(?:stamp|time)[._/]secs?)")
#: And columns of these names do where they never fall.
_SECONDS = frozenset({"sec", "secs"})
#: What a name may say behind what it is: a unit of time.
_UNIT_OF_TIME = re.compile(
    r"[ _]*[\[(]?(?:s|secs?|seconds?|m?secs?|[mun]s|n(?:ano)?secs?|utc|unix|epoch)[\])]?\Z"
)
_LINE_BREAKS = re.compile(r"\s*[\r\n]\s*")

#: The column of one of these names holds the actions, wherever it stands.
_ACTIONS = frozenset({"action", "actions"})
#: And that of one of these may do.
_MAYBE_ACTIONS = frozenset(
    {
        *("label", "labels", "class", "command", "cmd", "behavior", "behaviour"),
        *("decision", "skill", "choice", "target"),
    }
)


@dataclass(frozen=True, slots=True)
class ColumnNames:
    """What the columns are called, and how that is known."""

    names: tuple[str, ...]
    said: bool
    """Whether the first record says so; else it is a row."""
    notes: tuple[str, ...] = ()
    """What a person should know about it; no full stops."""


def column_names(records: Records, labels: Sequence[str], *, header: bool) -> ColumnNames:
    """Names the columns of a table.

    Args:
        records: The table.
        labels: Columns that hold the actions.
        header: Whether the first record is said to name the columns.
    """
    # Spreadsheets break names into lines.
    first = [_LINE_BREAKS.sub(" ", cell.strip()) for cell in records.rows[0]]
    width = len(first)
    numbered = tuple(f"x{place}" for place in range(width))
    if not header:
        return ColumnNames(numbered, said=False)
    if not set(labels).isdisjoint(first):
        return _said(records.rows, first)
    comment = tuple(cell.strip() for cell in records.comment)
    named_above = len(comment) == width and all(comment) and len(set(comment)) == width
    if _first_is_data(records.rows, labels) or (named_above and _recurs(records.rows, width - 1)):
        if named_above and not all(map(is_number, comment)):
            note = "the columns are called what the comment above the table says"
            return ColumnNames(comment, said=False, notes=(note,))
        note = "the first line holds data, so the columns are named x0, x1, and so on"
        return ColumnNames(numbered, said=False, notes=(note,))
    return _said(records.rows, first)


def counts_rows(name: str, parts: Sequence[Sequence[str]]) -> bool:
    """Whether a column numbers or dates the rows of every demonstration of a table.

    Args:
        name: Of the column.
        parts: Its cells in each demonstration.  Those of too few rows do not tell, unless none
            has more.
    """
    telling = [cells for cells in parts if len(cells) >= FEWEST_RISING] or parts
    return all(numbers_rows(name, cells) or tells_time(cells) for cells in telling)


def numbers_rows(name: str, cells: Sequence[str]) -> bool:
    """Whether a column numbers or dates the rows, by its name and by its values."""
    plain = name.strip().lower()
    if plain in _NUMBERING or _PART_OF_STAMP.fullmatch(plain):
        return True
    counts = _COUNTING.fullmatch(plain) is not None
    dates = _DATING.fullmatch(plain) or _DATING.fullmatch(_UNIT_OF_TIME.sub("", plain))
    if not (counts or dates or plain in _SECONDS):
        return False
    values = numbers([cell.strip() for cell in cells])
    if values is None or len(values) < FEWEST_RISING:
        return False
    if counts:
        return bool(np.all(values[1:] > values[:-1]))
    if not _never_falls(values):
        return False
    return plain in _SECONDS or 2 * len(np.unique(values)) > len(values)


def tells_time(cells: Sequence[str]) -> bool:
    """Whether the values of a column are those of a clock, whatever it is called.

    They are times between 2001 and 2096 in seconds, or in thousandths, millionths or billionths of
    them, and never fall.
    """
    values = numbers([cell.strip() for cell in cells])
    if values is None or len(values) < FEWEST_RISING or not _never_falls(values):
        return False
    begin, end = values[0], values[-1]
    return begin < end and any(
        1e9 * unit <= begin and end < 4e9 * unit for unit in (1.0, 1e3, 1e6, 1e9)
    )


def _never_falls(values: FloatArray) -> bool:
    return bool(np.all(values[1:] >= values[:-1]))


def of_the_actions(names: Sequence[str]) -> int | None:
    """The position of the only column that is called after the actions; None if there is none."""
    found = [place for place, name in enumerate(names) if name.lower() in _ACTIONS]
    return found[0] if len(found) == 1 else None


def names_actions(name: str, last: str) -> bool:
    """Whether a column's name says rather than that of the last one that it holds the actions."""
    return name.lower() in _MAYBE_ACTIONS and last.lower() not in _MAYBE_ACTIONS


def label_position(columns: Sequence[str], label: str, *, said: bool) -> int | None:
    """Where a label column stands: by its name, or by its index where the file names none."""
    name = label.strip()
    if name in columns:
        return columns.index(name)
    if not said and name.isdecimal() and int(name) < len(columns):
        return int(name)
    return None


def _said(rows: Sequence[Sequence[str]], first: Sequence[str]) -> ColumnNames:
    """The names in the first record; columns without one are called by their index."""
    notes = []
    names = list(first)
    for place, name in enumerate(first):
        if name:
            continue
        # Tables with an index are written by pandas so.
        names[place] = f"x{place}" if place else "Unnamed: 0"
        if place or not numbers_rows(names[place], [row[place] for row in rows[1:_TELLING]]):
            notes.append(f"column {place + 1} has no name and is called {names[place]}")
    if all(map(is_number, first[:-1])):
        line = ", ".join(first)
        notes.append(
            f"the first line, {line}, is taken for names, because its last cell recurs nowhere: "
            "say that there is no header if it holds data"
        )
    return ColumnNames(tuple(names), said=True, notes=tuple(notes))


def _first_is_data(rows: Sequence[Sequence[str]], labels: Sequence[str]) -> bool:
    """Whether the first record, which should name the columns, holds a row."""
    first = [cell.strip() for cell in rows[0]]
    names = [f"x{place}" for place in range(len(first))]
    found = (label_position(names, label, said=False) for label in labels)
    actions = {place for place in found if place is not None} or {len(first) - 1}
    others = [place for place in range(len(first)) if place not in actions]
    filled = [place for place in others if not is_missing(first[place])]
    named = [place for place in filled if not _is_value(rows, place)]
    if any(_holds_values(rows, place) for place in named):
        return False
    if len(named) == len(filled):
        return bool(named) and _all_recur(rows, (*actions, *named))
    if any(_recurs(rows, place) for place in (*actions, *named)):
        return True
    return not _count([first[place] for place in filled])


def _count(cells: Sequence[str]) -> bool:
    """Whether cells count, as names do: 0, 1, ... or 2024, 2025, ..."""
    return all(map(str.isdecimal, cells)) and [int(cell) for cell in cells] == [
        *range(int(cells[0]), int(cells[0]) + len(cells))
    ]


def _below(rows: Sequence[Sequence[str]], place: int) -> list[str]:
    """What stands in a column below its first cell, as far as it takes to tell."""
    return [row[place] for row in rows[1:_TELLING] if place < len(row)]


def _is_value(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Whether what stands first in a column is a number, or a value as all below it."""
    first = rows[0][place].strip()
    return is_number(first) or is_value_like(first, _below(rows, place))


def _holds_values(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a column holds numbers, dates, times or truths below its first cell."""
    below = [cell for one in _below(rows, place) if not is_missing(cell := one.strip())]
    return bool(below) and (numbers(below) is not None or is_value_like(below[0], below))


def _recurs(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Whether what stands first in a column stands there once more."""
    first = rows[0][place].strip()
    return any(place < len(row) and row[place].strip() == first for row in rows[1:])


def _all_recur(rows: Sequence[Sequence[str]], places: Sequence[int]) -> bool:
    """Whether each text of the first record is a value of its column.

    Where tables were put one behind the other, names recur too, but only all of them at once.
    """
    first = [cell.strip() for cell in rows[0]]
    others = [cells for row in rows[1:] if (cells := [cell.strip() for cell in row]) != first]
    return all(_recurs([first, *others], place) for place in places)
