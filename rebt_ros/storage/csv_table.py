"""CSV tables as demonstrations: one table is one demonstration, one row is one action.

What the cells of a column mean is told in `cells`.  Where several columns hold actions, a row is
one event on each of their channels.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.demonstration import (
    DEFAULT_CHANNEL,
    Demonstration,
    RowKind,
    in_sorted_order,
)
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage.account import Account
from rebt_ros.storage.cells import (
    NoFeature,
    codes,
    column,
    is_missing,
    is_number,
    numbers,
)
from rebt_ros.storage.dialect import Dialect, dialect_of
from rebt_ros.storage.read import Read
from rebt_ros.storage.text import read_text

#: A column of this name holds each row's stamp, in nanoseconds, and is not a feature.
STAMP = "stamp"

#: Columns of these names, in any case, number or date the rows, and are features only if they are
#: asked for.
_NUMBERING = frozenset({STAMP, "time", "timestamp", "index", "unnamed: 0"})

#: A column of the label column's name and this says how each action ended: "success" or "failure".
#: It is no feature, because it is known only afterwards.
OUTCOME_SUFFIX = ".outcome"

#: How many column names a message lists.
_LISTED = 8


def read_csv(
    path: Path,
    *,
    labels: Sequence[str] = (),
    header: bool = True,
    row_kind: RowKind | None = None,
    features: Set[str] = frozenset(),
    channels: Sequence[str] = (),
) -> Read:
    """Reads a CSV table.

    Args:
        path: The file: UTF-8 or UTF-16; cells are separated by commas, or else by semicolons, tabs
            or bars; one line of column names unless `header` says no.
        labels: Columns that hold the actions; without a header their names (`x24`) or indices
            (`24`); by default the last column.
        header: Whether the first line names the columns (`x0`, `x1`, ... if not).  A first line
            that holds data all the same is recognised by its numbers and noted.
        row_kind: What a row is; None: an event where a column says how actions ended, else a
            sample.
        features: Columns that are features even where their names say that they number or date the
            rows.
        channels: Label columns of a table that has all of them, where `labels` names none.

    Returns:
        The rows that have an action: on the channel `DEFAULT_CHANNEL` where there is one label
        column; where there are several, each is a channel of its own, named after the column, and
        a row of the table is one row on each channel that has an action there.  Stamps are those
        of the column `stamp` if it holds integers, else each row's position in the file.  Columns
        that say how the actions ended (`OUTCOME_SUFFIX`), or that number or date the rows, are left
        out.

    Raises:
        InputError: The file cannot be read or is not such a table.
    """
    notes: list[str] = []
    table = _open(path, labels or channels, header, notes, optional=not labels)
    labelled = _labelled(table, notes)
    cells = tuple(zip(*(table.rows[row] for row in labelled), strict=True))
    shown = _Shown(table, labelled, cells)
    stamps = shown.stamps(notes)
    left_out = _outcomes(table, notes)
    if row_kind is None:
        row_kind = RowKind.EVENT if left_out else RowKind.SAMPLE
    if stamps is not None:
        left_out.add(STAMP)
    left_out |= _numbering(table, left_out, features, notes)
    read, columns = _states(shown, left_out, notes)
    taken, label = shown.events()
    actions, chosen = shown.actions(taken, label)
    on_channels, channel = in_sorted_order(table.channels, label)
    unlabelled = len(table.rows) - len(labelled)
    return Read(
        Demonstration(
            path.name,
            read,
            columns[taken],
            (np.array(labelled, dtype=np.int64) if stamps is None else stamps)[taken],
            actions,
            chosen,
            on_channels,
            channel,
            row_kind=row_kind,
        ),
        tuple(notes),
        Account(
            "rows",
            len(table.rows),
            len(labelled),
            len(taken),
            {"have no action": unlabelled} if unlabelled else {},
        ),
    )


def _open(
    path: Path, labels: Sequence[str], header: bool, notes: list[str], *, optional: bool
) -> _Table:
    """The cells of a file, once it is clear whether its first line names the columns.

    Args:
        path: The file.
        labels: Columns that hold the actions.
        header: Whether the first line is said to name the columns.
        notes: Where to note what was found.
        optional: Whether the label columns count only if all of them are there.
    """
    text = read_text(path)
    dialect = dialect_of(text)
    notes += dialect.notes
    file = _File(path, text, dialect)
    records = _records(file)
    if optional and not set(labels) <= {cell.strip() for cell in records[0]}:
        labels = ()
    if header and _first_is_data(records, labels):
        header = False
        notes.append("the first line holds data, so the columns are named x0, x1, and so on")
    table = _table(file, records, labels, header)
    if not header:
        _refuse_header(table)
    if any(
        table.rows[row][one] != table.rows[row][one].strip()
        for one in table.labels
        for row in range(len(table.rows))
    ):
        notes.append("blanks around actions do not count")
    return table


def _states(
    shown: _Shown, left_out: Set[str], notes: list[str]
) -> tuple[tuple[Feature, ...], FloatArray]:
    """The features, and their values in each row (rows x features)."""
    table = shown.table
    found = [
        one
        for index, name in enumerate(table.columns)
        if index not in table.labels and name not in left_out
        if (one := shown.feature(index, notes)) is not None
    ]
    if not found:
        raise InputError(
            f"{table.file.path} has no column beside the actions that can be a feature: add one "
            "per value of the state, separated by commas."
        )
    return tuple(feature for feature, _ in found), np.column_stack([values for _, values in found])


def _numbering(table: _Table, known: Set[str], asked_for: Set[str], notes: list[str]) -> set[str]:
    """The columns that number or date the rows, but for those that are known or asked for."""
    found = {
        name
        for index, name in enumerate(table.columns)
        if name.lower() in _NUMBERING and index not in table.labels
        if name not in known and name not in asked_for
    }
    for name in sorted(found):
        integers = (
            ", and does not hold integers (nanoseconds), which could tell the time"
            if name == STAMP
            else ""
        )
        notes.append(f"column {name!r} numbers or dates the rows and is no feature{integers}")
    return found


@dataclass(frozen=True, slots=True)
class _File:
    path: Path
    text: str
    dialect: Dialect

    def records(self) -> Iterator[tuple[int, list[str]]]:
        """The line on which each record begins, and its cells; blank lines are left out."""
        text = io.StringIO(self.text, newline="")
        text.seek(self.dialect.begin)
        reader = csv.reader(
            text,
            delimiter=self.dialect.delimiter,
            skipinitialspace=True,
            strict=True,
        )
        line = before = 1 + self.text.count("\n", 0, self.dialect.begin)
        try:
            for cells in reader:
                if any(map(str.strip, cells)):
                    yield line, cells
                line = before + reader.line_num
        except csv.Error as err:
            raise InputError(
                f"{self.path}, line {line}: this is not CSV ({err}): check its quotes."
            ) from err

    def line(self, record: int) -> int:
        """Where a record begins; counted only for messages, as cells may hold line breaks."""
        return next(line for line, _ in islice(self.records(), record, None))


@dataclass(frozen=True, slots=True)
class _Table:
    file: _File
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    """Each as long as `columns`."""
    labels: tuple[int, ...]
    """Positions of the columns that hold the actions: one at least, all different."""
    header: bool

    @property
    def channels(self) -> tuple[str, ...]:
        """The channel of each label column."""
        if len(self.labels) == 1:
            return (DEFAULT_CHANNEL,)
        return tuple(self.columns[label] for label in self.labels)

    def line(self, row: int) -> int:
        return self.file.line(row + self.header)


@dataclass(frozen=True, slots=True)
class _Shown:
    """The rows of a table that have an action."""

    table: _Table
    rows: Sequence[int]
    cells: Sequence[Sequence[str]]
    """Column by column."""

    def events(self) -> tuple[IntArray, IntArray]:
        """Where each action stands, row by row: positions in `rows` and in `table.labels`."""
        filled = [
            [not is_missing(cell.strip()) for cell in self.cells[one]] for one in self.table.labels
        ]
        taken, label = np.nonzero(np.array(filled).T)
        return taken.astype(np.int64), label.astype(np.int64)

    def actions(self, taken: IntArray, label: IntArray) -> tuple[tuple[str, ...], IntArray]:
        """The actions that stand there, sorted, and the position of each event's one."""
        columns = [self.cells[one] for one in self.table.labels]
        cells = [
            columns[one][row].strip()
            for row, one in zip(taken.tolist(), label.tolist(), strict=True)
        ]
        actions = tuple(dict.fromkeys(cells))
        for action in actions:
            if not action.isprintable():
                row = self.rows[int(taken[cells.index(action)])]
                raise InputError(
                    f"{self.table.file.path}, line {self.table.line(row)}: the action "
                    f"{action!r} must consist of printable characters."
                )
        return in_sorted_order(actions, codes(actions, cells))

    def stamps(self, notes: list[str]) -> IntArray | None:
        """The stamp column; None where there is none."""
        columns = self.table.columns
        if not self.table.header or STAMP not in columns:
            return None
        if columns.index(STAMP) in self.table.labels:
            return None
        cells = self.cells[columns.index(STAMP)]
        try:
            return np.array([int(cell) for cell in cells], dtype=np.int64)
        except (ValueError, OverflowError):
            return None

    def feature(self, place: int, notes: list[str]) -> tuple[Feature, FloatArray] | None:
        """A feature with its values; None, with a note, where a column is none."""
        name, cells = self.table.columns[place], self.cells[place]
        read = column(name, cells, lambda row: self.table.line(self.rows[row]))
        if isinstance(read, NoFeature):
            notes.append(read.note)
            return None
        notes += read.notes
        self._check_numbers(name, cells, read.values)
        return read.feature, read.values

    def _check_numbers(self, name: str, cells: Sequence[str], values: FloatArray) -> None:
        wrong = np.flatnonzero(np.abs(values) > LARGEST_VALUE)
        if len(wrong):
            raise InputError(
                f"{self.table.file.path}, line {self.table.line(self.rows[wrong[0]])}: "
                f"column {name!r} holds {cells[wrong[0]]!r}: numbers must lie within "
                f"±{LARGEST_VALUE:g}, and a cell without a value must be empty."
            )


def _table(file: _File, records: list[list[str]], labels: Sequence[str], header: bool) -> _Table:
    path = file.path
    columns = (
        tuple(name.strip() for name in records[0])
        if header
        else tuple(f"x{index}" for index in range(len(records[0])))
    )
    _check_names(path, columns)
    for number, record in enumerate(records):
        if len(record) != len(columns):
            raise InputError(
                f"{path}, line {file.line(number)}: there are {len(record)} cells where "
                f"{len(columns)} were expected: quote cells that contain commas."
            )
    positions: list[int] = []
    for label in labels:
        position = _label_position(columns, label, header)
        if position is None:
            raise InputError(f"{path}: there is no column {label!r}: {_listing(columns)}.")
        if position in positions:
            raise InputError(
                f"{path}: column {columns[position]!r} is named twice as a label: "
                "name every label column once."
            )
        positions.append(position)
    if len(records) == header:
        raise InputError(f"{path} has no rows: record actions together with states first.")
    return _Table(file, columns, records[header:], tuple(positions) or (len(columns) - 1,), header)


def _labelled(table: _Table, notes: list[str]) -> list[int]:
    """The rows that have an action in some label column; notes which have none in each."""
    count = len(table.rows)
    for label in table.labels:
        name = table.columns[label]
        empty = sum(is_missing(cells[label].strip()) for cells in table.rows)
        if empty == count:
            raise InputError(
                f"{table.file.path}: column {name!r} holds no action: name the column that does."
            )
        if not empty:
            continue
        if len(table.labels) == 1:
            notes.append(f"{empty} of {count} rows have no action and are left out")
        else:
            notes.append(
                f"{empty} of {count} rows have no action in column {name!r} and are left out of "
                "its channel"
            )
    return [
        row
        for row, cells in enumerate(table.rows)
        if not all(is_missing(cells[label].strip()) for label in table.labels)
    ]


def _outcomes(table: _Table, notes: list[str]) -> set[str]:
    """The columns that say how the actions ended."""
    wanted = {table.columns[label] + OUTCOME_SUFFIX for label in table.labels}
    found = sorted(wanted & set(table.columns)) if table.header else []
    notes += [f"column {name!r} says how actions ended and is no feature" for name in found]
    return set(found)


def _check_names(path: Path, columns: Sequence[str]) -> None:
    for index, name in enumerate(columns):
        if not name:
            raise InputError(f"{path}: column {index + 1} has no name: name it or remove it.")
        if name in columns[:index]:
            raise InputError(
                f"{path}: two columns are named {name!r} (columns {columns.index(name) + 1} and "
                f"{index + 1}): rename one."
            )


def _listing(columns: Sequence[str]) -> str:
    more = ", ..." if len(columns) > _LISTED else ""
    return f"the columns are {', '.join(columns[:_LISTED])}{more}"


def _label_position(columns: Sequence[str], label: str, header: bool) -> int | None:
    name = label.strip()
    if not header and name.isdecimal():
        name = f"x{int(name)}"
    return columns.index(name) if name in columns else None


def _first_is_data(records: Sequence[Sequence[str]], labels: Sequence[str]) -> bool:
    """Whether the first record, which should name the columns, holds a row."""
    first = [cell.strip() for cell in records[0]]
    if any(label.strip() in first for label in labels):
        return False
    names = [f"x{index}" for index in range(len(first))]
    found = (_label_position(names, label, header=False) for label in labels)
    positions = {position for position in found if position is not None} or {len(first) - 1}
    others = [index for index in range(len(first)) if index not in positions]
    named = [index for index in others if not is_number(first[index])]
    if len(named) == len(others) or any(_holds_numbers(records, index) for index in named):
        return False
    if any(_recurs(records, index) for index in (*positions, *named)):
        return True
    # Tables of unnamed columns are often written with their indices as names.
    return any(first[index] != str(index) for index in others if index not in named)


def _recurs(records: Sequence[Sequence[str]], index: int) -> bool:
    """Whether what stands first in a column stands there once more."""
    first = records[0][index].strip()
    return any(index < len(record) and record[index].strip() == first for record in records[1:])


def _holds_numbers(records: Sequence[Sequence[str]], index: int) -> bool:
    """Whether a column holds numbers below its first cell."""
    below = [record[index].strip() for record in records[1:] if index < len(record)]
    found = numbers(below)
    return found is not None and not np.isnan(found).all()


def _refuse_header(table: _Table) -> None:
    """Refuses column names where data should be: text above columns of numbers."""
    if len(table.rows) < 2:
        return
    features = [index for index in range(len(table.columns)) if index not in table.labels]
    first = [table.rows[0][index].strip() for index in features]
    if not features or any(not cell or is_number(cell) for cell in first):
        return
    for index, name in zip(features, first, strict=True):
        if _holds_numbers(table.rows, index):
            raise InputError(
                f"{table.file.path}: the first line says {name!r} above a column of numbers: "
                "it names the columns, so read the table with a header."
            )


def _records(file: _File) -> list[list[str]]:
    """The records of a file: at least one, of two cells or more."""
    records = [cells for _, cells in file.records()]
    if not records:
        raise InputError(f"{file.path} is empty: name a table with rows.")
    if all(len(cells) == len(records[0]) and not cells[-1].strip() for cells in records):
        # Some programs end each line with a separator.
        records = [cells[:-1] for cells in records]
    if len(records[0]) < 2:
        raise InputError(
            f"{file.path} has a single column: a table needs at least one value of the state and "
            "an action, separated by commas."
        )
    return records
