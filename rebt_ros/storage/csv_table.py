"""CSV tables as demonstrations: one table is one demonstration, one row is one action event.

A column is numeric where all its cells are numbers, binary where they all say true or false, and
categorical otherwise.  An empty cell is a missing value.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.demonstration import (
    DEFAULT_CHANNEL,
    Demonstration,
    in_sorted_order,
)
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.storage.read import Read
from rebt_ros.storage.text import read_text

#: A column of this name holds each row's stamp, in nanoseconds, and is not a feature.
STAMP = "stamp"

#: How many column names a message lists.
_LISTED = 8


def read_csv(path: Path, *, label: str | None = None, header: bool = True) -> Read:
    """Reads a CSV table.

    Args:
        path: The file: UTF-8, comma separated, one line of column names unless `header` says no.
        label: Column that holds the actions; without a header its name (`x24`) or its index
            (`24`); by default the last column.
        header: Whether the first line names the columns (`x0`, `x1`, ... if not).  A first line
            that holds data all the same is recognised by its numbers and noted.

    Returns:
        The rows that have an action, on the channel `DEFAULT_CHANNEL`.  Stamps are those of the
        column `stamp` if it holds integers, else each row's position in the file.

    Raises:
        InputError: The file cannot be read or is not such a table.
    """
    file = _File(path, read_text(path))
    records = _records(file)
    notes: list[str] = []
    if header and _first_is_data(records, label):
        header = False
        notes.append("the first line holds data, so the columns are named x0, x1, and so on")
    table = _table(file, records, label, header)
    if not header:
        _refuse_header(table)
    labelled = [row for row, cells in enumerate(table.rows) if cells[table.label].strip()]
    if len(labelled) < len(table.rows):
        left_out = len(table.rows) - len(labelled)
        notes.append(f"{left_out} of {len(table.rows)} rows have no action and are left out")
    if not labelled:
        raise InputError(
            f"{path}: column {table.columns[table.label]!r} holds no action: "
            "name the column that does."
        )
    cells = tuple(zip(*(table.rows[row] for row in labelled), strict=True))
    shown = _Shown(table, labelled, cells)
    stamps = shown.stamps(notes)
    read = [
        shown.feature(index, notes)
        for index in range(len(table.columns))
        if index not in (table.label, None if stamps is None else table.columns.index(STAMP))
    ]
    if not read:
        raise InputError(
            f"{path} has no column beside the actions: add one per value of the state, "
            "separated by commas."
        )
    actions, chosen = shown.actions()
    return Read(
        Demonstration(
            path.name,
            tuple(feature for feature, _ in read),
            np.column_stack([values for _, values in read]),
            np.array(labelled, dtype=np.int64) if stamps is None else stamps,
            actions,
            chosen,
            (DEFAULT_CHANNEL,),
            np.zeros(len(labelled), dtype=np.int64),
        ),
        tuple(notes),
    )


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
    label: int
    """Position of the column that holds the actions."""
    header: bool

    def line(self, row: int) -> int:
        return self.file.line(row + self.header)


@dataclass(frozen=True, slots=True)
class _Shown:
    """The rows of a table that have an action."""

    table: _Table
    rows: Sequence[int]
    cells: Sequence[Sequence[str]]
    """Column by column."""

    def actions(self) -> tuple[tuple[str, ...], IntArray]:
        cells = self.cells[self.table.label]
        labels = tuple(dict.fromkeys(cells))
        for label in labels:
            if not label.isprintable():
                raise InputError(
                    f"{self.table.file.path}, line {self._line(cells, label)}: the action "
                    f"{label!r} must consist of printable characters."
                )
        return in_sorted_order(labels, _codes(labels, cells))

    def stamps(self, notes: list[str]) -> IntArray | None:
        """The stamp column; None where there is none."""
        columns = self.table.columns
        if not self.table.header or STAMP not in columns or columns[self.table.label] == STAMP:
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


def _table(file: _File, records: list[list[str]], label: str | None, header: bool) -> _Table:
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
    position = _label_position(columns, label, header)
    if position is None:
        raise InputError(f"{path}: there is no column {label!r}: {_listing(columns)}.")
    if len(records) == header:
        raise InputError(f"{path} has no rows: record actions together with states first.")
    return _Table(file, columns, records[header:], position, header)


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


def _label_position(columns: Sequence[str], label: str | None, header: bool) -> int | None:
    if label is None:
        return len(columns) - 1
    name = label.strip()
    if not header and name.isdecimal():
        name = f"x{int(name)}"
    return columns.index(name) if name in columns else None


def _first_is_data(records: Sequence[Sequence[str]], label: str | None) -> bool:
    """Whether the first record, which should name the columns, holds a row's numbers."""
    first = [cell.strip() for cell in records[0]]
    if label is not None and label.strip() in first:
        return False
    names = [f"x{index}" for index in range(len(first))]
    position = _label_position(names, label, header=False)
    position = len(first) - 1 if position is None else position
    cells = first[:position] + first[position + 1 :]
    if not cells or not all(map(_is_number, cells)):
        return False
    # Tables of unnamed columns are often written with their indices as names.
    counted = cells == [str(index) for index in range(len(first)) if index != position]
    recurs = any(
        record[position].strip() == first[position]
        for record in records[1:]
        if position < len(record)
    )
    return recurs or not counted


def _refuse_header(table: _Table) -> None:
    """Refuses column names where data should be: text above columns of numbers."""
    if len(table.rows) < 2:
        return
    features = [index for index in range(len(table.columns)) if index != table.label]
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
