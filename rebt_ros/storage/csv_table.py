"""CSV tables as demonstrations: one table is one demonstration, one row is one action.

A column is numeric where all its cells are numbers, binary where they all say true or false, and
categorical otherwise.  An empty cell is a missing value.  Where several columns hold actions, a
row is one event on each of their channels.
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
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.storage.read import Read
from rebt_ros.storage.text import read_text

#: A column of this name holds each row's stamp, in nanoseconds, and is not a feature.
STAMP = "stamp"

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
) -> Read:
    """Reads a CSV table.

    Args:
        path: The file: UTF-8, comma separated, one line of column names unless `header` says no.
        labels: Columns that hold the actions; without a header their names (`x24`) or indices
            (`24`); by default the last column.
        header: Whether the first line names the columns (`x0`, `x1`, ... if not).  A first line
            that holds data all the same is recognised by its numbers and noted.
        row_kind: What a row is; None: an event where a column says how actions ended, else a
            sample.

    Returns:
        The rows that have an action: on the channel `DEFAULT_CHANNEL` where there is one label
        column; where there are several, each is a channel of its own, named after the column, and
        a row of the table is one row on each channel that has an action there.  Stamps are those
        of the column `stamp` if it holds integers, else each row's position in the file.  Columns
        that say how the actions ended (`OUTCOME_SUFFIX`) are left out.

    Raises:
        InputError: The file cannot be read or is not such a table.
    """
    notes: list[str] = []
    table = _open(path, labels, header, notes)
    labelled = _labelled(table, notes)
    cells = tuple(zip(*(table.rows[row] for row in labelled), strict=True))
    shown = _Shown(table, labelled, cells)
    stamps = shown.stamps(notes)
    left_out = _outcomes(table, notes)
    if row_kind is None:
        row_kind = RowKind.EVENT if left_out else RowKind.SAMPLE
    if stamps is not None:
        left_out.add(STAMP)
    features, columns = _states(shown, left_out, notes)
    taken, label = shown.events()
    actions, chosen = shown.actions(taken, label)
    channels, channel = in_sorted_order(table.channels, label)
    return Read(
        Demonstration(
            path.name,
            features,
            columns[taken],
            (np.array(labelled, dtype=np.int64) if stamps is None else stamps)[taken],
            actions,
            chosen,
            channels,
            channel,
            row_kind=row_kind,
        ),
        tuple(notes),
    )


def _open(path: Path, labels: Sequence[str], header: bool, notes: list[str]) -> _Table:
    """The cells of a file, once it is clear whether its first line names the columns."""
    file = _File(path, read_text(path))
    records = _records(file)
    if header and _first_is_data(records, labels):
        header = False
        notes.append("the first line holds data, so the columns are named x0, x1, and so on")
    table = _table(file, records, labels, header)
    if not header:
        _refuse_header(table)
    return table


def _states(
    shown: _Shown, left_out: Set[str], notes: list[str]
) -> tuple[tuple[Feature, ...], FloatArray]:
    """The features, and their values in each row (rows x features)."""
    table = shown.table
    read = [
        shown.feature(index, notes)
        for index, name in enumerate(table.columns)
        if index not in table.labels and name not in left_out
    ]
    if not read:
        raise InputError(
            f"{table.file.path} has no column beside the actions: add one per value of the state, "
            "separated by commas."
        )
    return tuple(feature for feature, _ in read), np.column_stack([values for _, values in read])


@dataclass(frozen=True, slots=True)
class _File:
    path: Path
    text: str

    def records(self) -> Iterator[tuple[int, list[str]]]:
        """The line on which each record begins, and its cells; blank lines are left out."""
        reader = csv.reader(io.StringIO(self.text, newline=""), strict=True)
        line = 1
        try:
            for cells in reader:
                if cells:
                    yield line, cells
                line = reader.line_num + 1
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
        filled = [[bool(cell.strip()) for cell in self.cells[one]] for one in self.table.labels]
        taken, label = np.nonzero(np.array(filled).T)
        return taken.astype(np.int64), label.astype(np.int64)

    def actions(self, taken: IntArray, label: IntArray) -> tuple[tuple[str, ...], IntArray]:
        """The actions that stand there, sorted, and the position of each event's one."""
        columns = [self.cells[one] for one in self.table.labels]
        cells = [
            columns[column][row] for row, column in zip(taken.tolist(), label.tolist(), strict=True)
        ]
        actions = tuple(dict.fromkeys(cells))
        for action in actions:
            if not action.isprintable():
                row = self.rows[int(taken[cells.index(action)])]
                raise InputError(
                    f"{self.table.file.path}, line {self.table.line(row)}: the action "
                    f"{action!r} must consist of printable characters."
                )
        return in_sorted_order(actions, _codes(actions, cells))

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
            notes.append(
                f"column {STAMP!r} does not hold integers (nanoseconds) and is taken as a feature"
            )
            return None

    def feature(self, column: int, notes: list[str]) -> tuple[Feature, FloatArray]:
        name = self.table.columns[column]
        cells = self.cells[column]
        numbers = _numbers(cells)
        if numbers is None:
            cells = [cell.strip() for cell in cells]
            numbers = _numbers(cells)
        if numbers is not None:
            self._check_numbers(name, cells, numbers)
            if np.isnan(numbers).all():
                notes.append(f"column {name!r} is empty")
            return Feature(name), numbers
        words = {cell.lower() for cell in set(cells)}
        if words <= {"true", "false"}:
            return Feature(name, FeatureKind.BINARY), np.array(
                [cell.lower() == "true" for cell in cells], dtype=np.float64
            )
        if words <= {"true", "false", "0", "1", ""}:
            # However it is spelt, it is one value.
            cells = [_TRUTH[cell.lower()] for cell in cells]
        categories = sorted(set(cells) - {""})
        if any(map(_is_number, categories)):
            text = next(category for category in categories if not _is_number(category))
            notes.append(
                f"column {name!r} is taken as text, not as numbers, "
                f"because line {self._line(cells, text)} holds {text!r}"
            )
        values = _codes(("", *categories), cells).astype(np.float64) - 1
        values[values < 0] = np.nan
        return Feature(name, FeatureKind.CATEGORICAL, tuple(categories)), values

    def _check_numbers(self, name: str, cells: Sequence[str], numbers: FloatArray) -> None:
        filled = np.fromiter(map(bool, cells), bool, len(cells))
        wrong = np.flatnonzero(filled & ~(np.abs(numbers) <= LARGEST_VALUE))
        if len(wrong):
            raise InputError(
                f"{self.table.file.path}, line {self.table.line(self.rows[wrong[0]])}: "
                f"column {name!r} holds {cells[wrong[0]]!r}: numbers must lie within "
                f"±{LARGEST_VALUE:g}, and a cell without a value must be empty."
            )

    def _line(self, cells: Sequence[str], cell: str) -> int:
        """Where a cell first stands."""
        return self.table.line(self.rows[cells.index(cell)])


#: Spellings of truth, as categories.
_TRUTH = {"true": "True", "1": "True", "false": "False", "0": "False", "": ""}


def _codes(labels: Sequence[str], cells: Sequence[str]) -> IntArray:
    code = {label: index for index, label in enumerate(labels)}
    return np.fromiter(map(code.__getitem__, cells), np.int64, len(cells))


def _numbers(cells: Sequence[str]) -> FloatArray | None:
    """A column as numbers, NaN where a cell is empty; None where a cell holds something else."""
    text = "".join(cells)
    # Python also reads 1_000 and digits of other scripts, which no other tool would.
    if not text.isascii() or "_" in text:
        return None
    filled = cells if all(cells) else [cell or "nan" for cell in cells]
    try:
        return np.fromiter(map(float, filled), np.float64, len(cells))
    except ValueError:
        return None


def _is_number(cell: str) -> bool:
    return bool(cell) and _numbers((cell,)) is not None


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
        empty = sum(not cells[label].strip() for cells in table.rows)
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
        if any(cells[label].strip() for label in table.labels)
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
    """Whether the first record, which should name the columns, holds a row's numbers."""
    first = [cell.strip() for cell in records[0]]
    if any(label.strip() in first for label in labels):
        return False
    names = [f"x{index}" for index in range(len(first))]
    found = (_label_position(names, label, header=False) for label in labels)
    positions = {position for position in found if position is not None} or {len(first) - 1}
    others = [index for index in range(len(first)) if index not in positions]
    cells = [first[index] for index in others]
    if not cells or not all(map(_is_number, cells)):
        return False
    # Tables of unnamed columns are often written with their indices as names.
    counted = cells == [str(index) for index in others]
    recurs = any(
        record[position].strip() == first[position]
        for record in records[1:]
        for position in positions
        if position < len(record)
    )
    return recurs or not counted


def _refuse_header(table: _Table) -> None:
    """Refuses column names where data should be: text above columns of numbers."""
    if len(table.rows) < 2:
        return
    features = [index for index in range(len(table.columns)) if index not in table.labels]
    first = [table.rows[0][index].strip() for index in features]
    if not features or any(not cell or _is_number(cell) for cell in first):
        return
    for index, name in zip(features, first, strict=True):
        numbers = _numbers([row[index].strip() for row in table.rows[1:]])
        if numbers is not None and not np.isnan(numbers).all():
            raise InputError(
                f"{table.file.path}: the first line says {name!r} above a column of numbers: "
                "it names the columns, so read the table with a header."
            )


def _records(file: _File) -> list[list[str]]:
    """The records of a file: at least one, of two cells or more."""
    records = [cells for _, cells in file.records()]
    if not records:
        raise InputError(f"{file.path} is empty: name a table with rows.")
    if len(records[0]) < 2:
        raise InputError(
            f"{file.path} has a single column: a table needs at least one value of the state and "
            "an action, separated by commas."
        )
    return records
