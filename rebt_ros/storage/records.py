"""The records of a table: cells line by line, before anything is said about what they mean."""

from __future__ import annotations

import csv
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rebt_ros.errors import InputError
from rebt_ros.storage.cells import is_failed, is_missing, is_number
from rebt_ros.storage.dialect import COMMENT, Dialect, dialect_of
from rebt_ros.storage.text import read_text, windows_text


class NoRow(Enum):
    """Why a record is no row."""

    EMPTY = "is empty", "are empty"
    COMMENT = "is a comment", "are comments"
    NAMES = "repeats the column names", "repeat the column names"
    TITLE = "is a title", "are titles"
    UNITS = "says units below the column names", "say units below the column names"
    RULER = "is a ruled line", "are ruled lines"

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
    delimiter: str
    """What separates cells."""

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
            self.delimiter,
        )


#: Stands between two files that were put one behind the other.
_BYTE_ORDER_MARK = "\ufeff"

#: How JSON begins that holds objects.
_JSON = ("{", "[{")

#: A cell of a line that is drawn, as below the names of a table in Markdown.
_RULED = re.compile(r"(?::?-+:?|=+|[-+]+)?")
_BRACKETED = re.compile(r"\[[^\[\]]*\]|\([^()]*\)")


def read_records(path: Path) -> Records:
    """Reads the file of a table.

    Raises:
        InputError: The file cannot be read, or holds no table.
    """
    encoding: list[str] = []

    def windows(data: bytes) -> str | None:
        text = windows_text(data)
        if text is not None:
            encoding.append("it is not UTF-8, and read as Windows-1252: check its letters")
        return text

    text = read_text(path, windows).replace(_BYTE_ORDER_MARK, "")
    if text.lstrip().startswith("<"):
        raise InputError(
            f"{path} is HTML or XML, and no table: save the table itself as CSV, or download the "
            "file again."
        )
    if text.lstrip().startswith(_JSON):
        raise InputError(f"{path} is JSON, and no table: name a CSV table, a bag or a recording.")
    dialect = dialect_of(text)
    rows, lines = _parsed(path, text, dialect)
    filled = [place for place, cells in enumerate(rows) if any(map(str.strip, cells))]
    if not filled:
        raise InputError(f"{path} is empty: name a table with rows.")
    reasons = _no_rows([rows[place] for place in filled])
    kept = [place for place, reason in zip(filled, reasons, strict=True) if reason is None]
    left_out = Counter(reason for reason in reasons if reason is not None)
    left_out[NoRow.EMPTY] += sum(map(bool, rows)) - len(filled)
    rows = [rows[place] for place in kept]
    if dialect.delimiter == "|" and not any(cells[0].strip() for cells in rows):
        # In Markdown, lines also begin with what separates cells.
        rows = [cells[1:] for cells in rows]
    rows = _without_blank_ends(rows)
    notes = (*encoding, *dialect.notes)
    if cut := _cut_off(text, rows):
        notes += (cut,)
    if _lacks_a_name(rows):
        rows[0] = ["", *rows[0]]
        notes += ("the first column has no name, as where R writes the names of rows",)
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
        notes,
        dialect.delimiter,
    )


def _no_rows(records: Sequence[Sequence[str]]) -> list[NoRow | None]:
    """Why each of the records that hold something is no row; None where it may be one."""
    titles = _titles(records)
    width = len(records[titles])
    numbered = _numbered(records[titles + 1 :])
    reasons: list[NoRow | None] = [NoRow.TITLE] * titles
    for place, cells in enumerate(records[titles:]):
        reason = None
        if _is_comment(cells[0]) and place and (len(cells) != width or numbered):
            reason = NoRow.COMMENT
        elif place and all(_RULED.fullmatch(cell.strip()) for cell in cells):
            reason = NoRow.RULER
        elif place == 1 and _says_units(cells):
            reason = NoRow.UNITS
        reasons.append(reason)
    return reasons


def _titles(records: Sequence[Sequence[str]]) -> int:
    """How many records above a table have nothing but their first cell, as titles do."""
    count = 0
    while count < len(records) - 2 and not any(map(str.strip, records[count][1:])):
        count += 1
    # Below them are names: several, each column with one, over rows of as many cells.
    names = records[count]
    below = records[min(count + 1, len(records) - 1)]
    are_names = len(names) > 1 and all(map(str.strip, names)) and len(below) == len(names)
    return count if are_names else 0


def _numbered(records: Sequence[Sequence[str]]) -> bool:
    """Whether the first column holds numbers, so that what begins like a comment is one."""
    cells = {cells[0].strip() for cells in records if not _is_comment(cells[0])}
    filled = [cell for cell in cells if not is_missing(cell)]
    return bool(filled) and all(map(is_number, filled))


def _is_comment(cell: str) -> bool:
    """Whether a record whose first cell this is may be a comment."""
    return cell.startswith(COMMENT) and not (is_failed(cell.strip()) or is_missing(cell.strip()))


def _says_units(cells: Sequence[str]) -> bool:
    """Whether a record below names has brackets around whatever it holds, as around units."""
    filled = [cell.strip() for cell in cells if not is_missing(cell.strip())]
    return bool(filled) and all(
        _BRACKETED.fullmatch(cell) and not is_number(cell[1:-1]) for cell in filled
    )


def _without_blank_ends(rows: Sequence[list[str]]) -> list[list[str]]:
    """Rows without the blank cells that some programs put behind the last one."""
    width = len(rows[0])
    if all(len(cells) == width for cells in rows):
        while width > 1 and not any(cells[width - 1].strip() for cells in rows):
            width -= 1
    return [
        cells[:width] if len(cells) > width and not any(map(str.strip, cells[width:])) else cells
        for cells in rows
    ]


def _lacks_a_name(rows: Sequence[Sequence[str]]) -> bool:
    """Whether all rows begin with a name or number of their own, for which there is no name."""
    width = len(rows[0]) + 1
    if width < 3 or len(rows) < 3 or any(len(cells) != width for cells in rows[1:]):
        return False
    own = [cells[0].strip() for cells in rows[1:]]
    if own == [str(number) for number in range(1, len(rows))]:
        return True
    return len(set(own)) == len(own) and not any(map(is_number, own))


def _cut_off(text: str, rows: Sequence[Sequence[str]]) -> str:
    """A note on a last line that seems to end amid its last word; empty where it does not."""
    if text.endswith(("\n", "\r")) or len(rows) < 3 or not rows[-1]:
        return ""
    last = rows[-1][-1].strip()
    others = {cells[-1].strip() for cells in rows[:-1] if cells}
    if last and last not in others and any(one.startswith(last) for one in others):
        return f"the last line has no end, and {last!r} in it may be the beginning of a longer word"
    return ""


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
