"""CSV tables as demonstrations: one table is one or several, one row is one action.

What the cells of a column mean is told in `cells`.  Where several columns hold actions, a row is
one event on each of their channels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import accumulate, pairwise
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
from rebt_ros.errors import InputError, listing
from rebt_ros.storage.account import Account
from rebt_ros.storage.cells import (
    Column,
    NoFeature,
    codes,
    column,
    is_failed,
    is_missing,
    is_number,
    is_truth,
    numbers,
)
from rebt_ros.storage.column_names import (
    column_names,
    counts_rows,
    label_position,
    names_actions,
    of_the_actions,
)
from rebt_ros.storage.episode_columns import (
    Episodes,
    found_episodes,
    may_tell,
    named_episodes,
)
from rebt_ros.storage.filling import filled_down
from rebt_ros.storage.no_rows import NoRow
from rebt_ros.storage.read import Part, Read
from rebt_ros.storage.records import Records, read_records
from rebt_ros.storage.stamp_column import falls, stamps_of
from rebt_ros.storage.table_doubts import (
    actions_again,
    of_actions,
    of_choices,
    of_features,
    same_words,
)

#: A column of this name holds each row's stamp, in nanoseconds, and is not a feature.
STAMP = "stamp"

#: A column of the label column's name and this says how each action ended: "success" or "failure".
#: It is no feature, because it is known only afterwards.
OUTCOME_SUFFIX = ".outcome"


def read_csv(
    path: Path,
    *,
    labels: Sequence[str] = (),
    header: bool = True,
    row_kind: RowKind | None = None,
    features: Set[str] = frozenset(),
    channels: Sequence[str] = (),
    episode_columns: Sequence[str] | None = None,
) -> Read:
    """Reads a CSV table.

    Args:
        path: The file: UTF-8 or UTF-16; cells are separated by commas, or else by semicolons, tabs,
            bars or blanks; one line of column names unless `header` says no.
        labels: Columns that hold the actions; without a header their names (`x24`) or indices
            (`24`); by default the column that is called `action`, else the last column.
        header: Whether the first line names the columns (`x0`, `x1`, ... if not).  A first line
            that holds data all the same is recognized by its values and noted.
        row_kind: What a row is; None: an event where a column says how actions ended, else a
            sample.
        features: Columns that are features even where their names say that they number or date the
            rows.
        channels: Label columns of a table that has all of them, where `labels` names none.
        episode_columns: Columns that say to which demonstration a row belongs; none for a table
            that is a single one; None to tell by names and values.

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
    table = _open(path, labels, channels, header, notes)
    labelled = _labelled(table, notes)
    cells, filled = filled_down(
        table.columns,
        table.rows,
        table.labels,
        labelled,
        lambda name, its: counts_rows(name, [its]) or may_tell(name),
    )
    notes += filled
    shown = _Shown(table, labelled, cells)
    stamps, unit = shown.stamps() or (None, "")
    outcomes = _outcomes(table, notes)
    if row_kind is None:
        row_kind = RowKind.EVENT if outcomes else RowKind.SAMPLE
    known = outcomes if stamps is None else outcomes | {STAMP}
    told = _episodes(shown, episode_columns, known, features)
    notes += told.notes
    if stamps is not None:
        notes += _on_stamps(stamps, unit, told)
    again = _actions_again(shown, known | features, notes)
    known |= again
    left_out = told.columns | again | _numbering(shown, told, known | told.columns, features, notes)
    read, columns, unreadable = _states(shown, known | left_out, notes)
    taken, label = shown.events()
    actions, chosen = shown.actions(taken, label)
    notes += of_actions(actions, len(taken))
    notes += of_features([one.name for one in read])
    on_channels, channel = in_sorted_order(table.channels, label)
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
        _account(table, len(labelled), len(taken)),
        frozenset(left_out | unreadable),
        parts=_of_events(told.parts, taken),
    )


def _account(table: _Table, labelled: int, events: int) -> Account:
    """Where all records of a table went, but for the one that names its columns."""
    left_out = {reason.several: count for reason, count in table.left_out.items()}
    if unlabelled := len(table.rows) - labelled:
        left_out["have no action"] = unlabelled
    stated = labelled + sum(left_out.values())
    return Account("rows", stated, labelled, events, left_out)


def _open(
    path: Path, labels: Sequence[str], channels: Sequence[str], header: bool, notes: list[str]
) -> _Table:
    """The cells of a file, once it is clear what its columns are called.

    Args:
        path: The file.
        labels: Columns that hold the actions.
        channels: Columns that do where all of them are there, if `labels` names none.
        header: Whether the first line is said to name the columns.
        notes: Where to note what was found.
    """
    records = read_records(path)
    notes += records.notes
    names = column_names(records, labels or channels, header=header)
    notes += names.notes
    if not labels and set(channels) <= set(names.names):
        labels = channels
    if names.said:
        records = records.without([cell.strip() for cell in records.rows[0]])
    table = _table(records, names.names, labels, notes, said=names.said)
    if not header:
        _refuse_header(table)
    notes += _left_out(records)
    if any(row[label] != row[label].strip() for label in table.labels for row in table.rows):
        notes.append("blanks around actions do not count")
    return table


def _left_out(records: Records) -> list[str]:
    """Sentences on the records that are no rows."""
    notes = []
    for reason, count in records.left_out.items():
        lines = f"{count} lines {reason.several}" if count > 1 else f"1 line {reason.single}"
        notes.append(f"{lines} and {'are' if count > 1 else 'is'} left out")
    return notes


def _states(
    shown: _Shown, left_out: Set[str], notes: list[str]
) -> tuple[tuple[Feature, ...], FloatArray, set[str]]:
    """The features, their values in each row (rows x features), and the columns that are none."""
    table = shown.table
    places = [
        place
        for place, name in enumerate(table.columns)
        if place not in table.labels and name not in left_out
    ]
    read = {place: shown.column(place) for place in places}
    if _has_decimal_commas(table, list(read.values())):
        # In such a table, points stand between groups of three digits, and commas do not.
        read = {place: shown.column(place, decimal_commas=True) for place in places}
    found: list[Column] = []
    unreadable = set()
    for place, one in read.items():
        if isinstance(one, NoFeature):
            notes.append(one.note)
            unreadable.add(table.columns[place])
            continue
        notes += one.notes
        shown.check_numbers(place, one.values)
        found.append(one)
    if not found:
        why = [f" ({one.note})" for one in read.values() if isinstance(one, NoFeature)]
        raise InputError(
            f"{table.path} has no column beside the actions that can be a feature"
            f"{''.join(why[:1])}: add one per value of the state, separated by commas."
        )
    return (
        tuple(one.feature for one in found),
        np.column_stack([one.values for one in found]),
        unreadable,
    )


def _has_decimal_commas(table: _Table, columns: Sequence[Column | NoFeature]) -> bool:
    """Whether commas are decimal ones, by any column or by what else separates cells."""
    if any(isinstance(one, Column) and one.decimal_commas for one in columns):
        return True
    return table.delimiter == ";" and not any(
        "." in cell for row in table.rows for cell in row if is_number(cell.strip())
    )


def _numbering(
    shown: _Shown,
    episodes: Episodes,
    known: Set[str],
    asked_for: Set[str],
    notes: list[str],
) -> frozenset[str]:
    """The columns that number or date the rows, but for those that are known or asked for."""
    table = shown.table
    found = set()
    for place, name in enumerate(table.columns):
        if place in table.labels or name in known or name in asked_for:
            continue
        cells = shown.cells[place]
        ends = [*accumulate(part.rows for part in episodes.parts)] or [len(cells)]
        if counts_rows(name, [cells[begin:end] for begin, end in pairwise((0, *ends))]):
            found.add(name)
    for name in sorted(found):
        integers = (
            ", and does not hold integers (nanoseconds), which could tell the time"
            if name == STAMP
            else ""
        )
        notes.append(f"column {name!r} numbers or dates the rows and is no feature{integers}")
    return frozenset(found)


def _episodes(
    shown: _Shown, columns: Sequence[str] | None, known: Set[str], asked_for: Set[str]
) -> Episodes:
    """The demonstrations of a table, by the columns that tell them.

    Args:
        shown: The rows that have an action.
        columns: The columns that somebody named; None to find them.
        known: Columns that say something else.
        asked_for: Columns that are features.

    Raises:
        InputError: A column that was named is not there, says something else, or does not tell.
    """
    table = shown.table

    def cells(place: int) -> list[str]:
        return [row[place] for row in table.rows]

    if not columns:
        return found_episodes(
            {
                name: cells(place)
                for place, name in enumerate(table.columns)
                if place not in table.labels and name not in known and name not in asked_for
            },
            shown.rows,
            split=columns is None,
        )
    named = {}
    for said in columns:
        place = label_position(table.columns, said, said=table.said)
        if place is None:
            raise InputError(
                f"{table.path}: there is no column {said!r}: {_listing(table.columns)}."
            )
        name = table.columns[place]
        if place in table.labels or name in known:
            raise InputError(
                f"{table.path}: column {name!r} holds actions, how they ended, or stamps: name "
                "another episode column."
            )
        named[name] = cells(place)
    return named_episodes(named, shown.rows, lambda row: f"{table.path}, line {table.lines[row]}")


def _on_stamps(stamps: IntArray, unit: str, told: Episodes) -> Iterator[str]:
    """How stamps are read, and that they are not in order."""
    if unit:
        yield f"column {STAMP!r} is read as {unit}"
    if count := falls(stamps, told.parts):
        yield (
            f"column {STAMP!r} falls {count} times from a row to the next, and rows are taken in "
            "the order of the table: sort it if things were done in the order of the stamps"
        )


def _actions_again(shown: _Shown, known: Set[str], notes: list[str]) -> frozenset[str]:
    """The columns that say what the action is, beside the only one of actions."""
    table = shown.table
    if len(table.labels) > 1:
        return frozenset()
    actions = [cell.strip() for cell in shown.cells[table.labels[0]]]
    columns = {
        name: shown.cells[place]
        for place, name in enumerate(table.columns)
        if place not in table.labels and name not in known
    }
    found = actions_again(table.columns[table.labels[0]], columns, actions)
    notes += [f"column {name!r} says what the action is and is no feature" for name in found]
    notes += same_words({name: columns[name] for name in columns if name not in found}, actions)
    return frozenset(found)


def _of_events(parts: Sequence[Part], taken: IntArray) -> tuple[Part, ...]:
    """How many events the demonstrations have, of which a row may hold several."""
    ends = np.searchsorted(taken, np.cumsum([part.rows for part in parts], dtype=np.int64))
    counts = np.diff(ends, prepend=0).tolist()
    return tuple(Part(part.name, count) for part, count in zip(parts, counts, strict=True))


@dataclass(frozen=True, slots=True)
class _Table:
    path: Path
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    """Each as long as `columns`."""
    lines: Sequence[int]
    """The line on which each row begins."""
    labels: tuple[int, ...]
    """Positions of the columns that hold the actions: one at least, all different."""
    said: bool
    """Whether the first record names the columns."""
    left_out: Counter[NoRow]
    """Other records, by what they are."""
    delimiter: str

    @property
    def channels(self) -> tuple[str, ...]:
        """The channel of each label column."""
        if len(self.labels) == 1:
            return (DEFAULT_CHANNEL,)
        return tuple(self.columns[label] for label in self.labels)


@dataclass(frozen=True, slots=True)
class _Shown:
    """The rows of a table that have an action."""

    table: _Table
    rows: Sequence[int]
    cells: Sequence[Sequence[str]]
    """Column by column."""

    def line(self, row: int) -> int:
        return self.table.lines[self.rows[row]]

    def events(self) -> tuple[IntArray, IntArray]:
        """Where each action stands, row by row: positions in `rows` and in `table.labels`."""
        filled = [
            [not _is_no_action(cell) for cell in self.cells[one]] for one in self.table.labels
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
                line = self.line(int(taken[cells.index(action)]))
                raise InputError(
                    f"{self.table.path}, line {line}: the action {action!r} must consist of "
                    "printable characters."
                )
        return in_sorted_order(actions, codes(actions, cells))

    def stamps(self) -> tuple[IntArray, str] | None:
        """The stamp column, and how it is read; None where there is none."""
        columns = self.table.columns
        if STAMP not in columns or columns.index(STAMP) in self.table.labels:
            return None
        return stamps_of(self.cells[columns.index(STAMP)])

    def column(self, place: int, *, decimal_commas: bool = False) -> Column | NoFeature:
        return column(
            self.table.columns[place],
            self.cells[place],
            self.line,
            decimal_commas=decimal_commas,
        )

    def check_numbers(self, place: int, values: FloatArray) -> None:
        wrong = np.flatnonzero(np.abs(values) > LARGEST_VALUE)
        if len(wrong):
            if np.isinf(values[wrong[0]]) and "inf" in self.cells[place][wrong[0]].lower():
                raise InputError(
                    f"{self.table.path}, line {self.line(wrong[0])}: column "
                    f"{self.table.columns[place]!r} holds {self.cells[place][wrong[0]]!r}: write a "
                    "number in its place, such as the range of the sensor, or leave the cell empty."
                )
            raise InputError(
                f"{self.table.path}, line {self.line(wrong[0])}: column "
                f"{self.table.columns[place]!r} holds {self.cells[place][wrong[0]]!r}: numbers "
                f"must lie within ±{LARGEST_VALUE:g}, and a cell without a value must be empty."
            )


def _table(
    records: Records,
    columns: tuple[str, ...],
    labels: Sequence[str],
    notes: list[str],
    *,
    said: bool,
) -> _Table:
    path = records.path
    _check_names(path, columns)
    for cells, line in zip(records.rows, records.lines, strict=True):
        if len(cells) != len(columns):
            helps = (
                "quote cells that contain what separates cells, and remove lines above the names"
                if len(cells) > len(columns)
                else "complete the line, or remove it if it was cut off"
            )
            raise InputError(
                f"{path}, line {line}: there are {len(cells)} cells where "
                f"{len(columns)} were expected, as on line {records.lines[0]}: {helps}."
            )
    positions: list[int] = []
    for label in labels:
        position = label_position(columns, label, said=said)
        if position is None:
            raise InputError(f"{path}: there is no column {label!r}: {_listing(columns)}.")
        if position in positions:
            raise InputError(
                f"{path}: column {columns[position]!r} is named twice as a label: "
                "name every label column once."
            )
        positions.append(position)
    rows = records.rows[said:]
    if not rows:
        raise InputError(f"{path} has no rows: record actions together with states first.")
    if not positions:
        positions = [_default_label(columns, rows, notes)]
    return _Table(
        path,
        columns,
        rows,
        records.lines[said:],
        tuple(positions),
        said,
        records.left_out,
        records.delimiter,
    )


def _default_label(columns: Sequence[str], rows: Sequence[Sequence[str]], notes: list[str]) -> int:
    """The column that is called after the actions; else the last one."""
    last = len(columns) - 1
    named = of_the_actions(columns)
    if named is not None:
        if named != last:
            notes.append(f"column {columns[named]!r} is taken for the actions because of its name")
        return named
    held = {row[last].strip() for row in rows}
    notes += of_choices(columns, rows)
    if all(is_missing(cell) or is_number(cell) for cell in held):
        what = "numbers"
    elif all(is_missing(cell) or is_truth(cell) for cell in held):
        what = "truths"
    else:
        called = next(
            (place for place in range(last) if names_actions(columns[place], columns[last])), None
        )
        if called is not None and _holds_words(rows, called):
            notes.append(
                f"column {columns[last]!r} is taken for the actions because it is the last, and "
                f"{columns[called]!r} is a feature: name the label column if it is that one"
            )
        return last
    words = next((place for place in range(last) if _holds_words(rows, place)), None)
    if words is not None:
        notes.append(
            f"column {columns[last]!r} is taken for the actions because it is the last, but "
            f"holds {what}, and {columns[words]!r} holds words: name the label column if it "
            "is another"
        )
    return last


def _holds_words(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a column holds words, and few of them that often recur, as actions do."""
    cells = {row[place].strip() for row in rows}
    words = [cell for cell in cells if not is_missing(cell)]
    return 2 * len(words) <= len(rows) and not any(is_number(one) or is_truth(one) for one in words)


def _labelled(table: _Table, notes: list[str]) -> list[int]:
    """The rows that have an action in some label column; notes which have none in each."""
    count = len(table.rows)
    for label in table.labels:
        name = table.columns[label]
        empty = sum(_is_no_action(cells[label]) for cells in table.rows)
        if empty == count:
            raise InputError(
                f"{table.path}: column {name!r} holds no action: name the column that does."
            )
        if not empty:
            continue
        signs = {cells[label].strip() for cells in table.rows if _is_no_action(cells[label])}
        notes += [
            f"{sign!r} is taken for no action: write it out if it is one"
            for sign in sorted(signs)
            if sign and not any(map(str.isalnum, sign)) and not is_failed(sign)
        ]
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
        if not all(_is_no_action(cells[label]) for label in table.labels)
    ]


def _is_no_action(cell: str) -> bool:
    cell = cell.strip()
    return is_missing(cell) or is_failed(cell)


def _outcomes(table: _Table, notes: list[str]) -> set[str]:
    """The columns that say how the actions ended."""
    wanted = {table.columns[label] + OUTCOME_SUFFIX for label in table.labels}
    found = sorted(wanted & set(table.columns))
    notes += [f"column {name!r} says how actions ended and is no feature" for name in found]
    return set(found)


def _check_names(path: Path, columns: Sequence[str]) -> None:
    for index, name in enumerate(columns):
        if name in columns[:index]:
            raise InputError(
                f"{path}: two columns are named {name!r} (columns {columns.index(name) + 1} and "
                f"{index + 1}): rename one."
            )


def _listing(columns: Sequence[str]) -> str:
    return f"the columns are {listing(columns)}"


def _refuse_header(table: _Table) -> None:
    """Refuses column names where data should be: text above columns of numbers."""
    if len(table.rows) < 2:
        return
    features = [index for index in range(len(table.columns)) if index not in table.labels]
    first = [table.rows[0][index].strip() for index in features]
    if not features or any(not cell or is_number(cell) for cell in first):
        return
    for index, name in zip(features, first, strict=True):
        below = numbers([row[index].strip() for row in table.rows[1:]])
        if below is not None and not np.isnan(below).all():
            raise InputError(
                f"{table.path}: the first line says {name!r} above a column of numbers: "
                "it names the columns, so read the table with a header."
            )
