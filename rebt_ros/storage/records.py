"""The records of a table: cells line by line, before anything is said about what they mean."""

from __future__ import annotations

import csv
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unicodedata import is_normalized, normalize

from rebt_ros.errors import InputError
from rebt_ros.storage.cells import is_number
from rebt_ros.storage.dialect import Dialect, dialect_of
from rebt_ros.storage.no_rows import NoRow, below_groups, no_rows
from rebt_ros.storage.text import read_text, windows_text


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

#: What ends lines in few files only, and characters that take no room.
_OTHER_ENDS = ("\u2028", "\u2029", "\x85")
_UNSEEN = ("\u200b", "\u200e", "\u200f", "\u2060")

#: How JSON begins that holds objects.
_JSON = ("{", "[{")

#: Longest cell (characters): that of a scan or an image as text has some millions.
_LONGEST_CELL = 1 << 30


def _usual(text: str, notes: list[str]) -> str:
    """Text with usual ends of lines, without what nobody sees; notes what was done."""
    if text.isascii():
        return text
    if "\n" not in text and "\r" not in text and any(end in text for end in _OTHER_ENDS):
        for end in _OTHER_ENDS:
            text = text.replace(end, "\n")
    if any(one in text for one in _UNSEEN):
        text = text.translate(dict.fromkeys(map(ord, _UNSEEN)))
        notes.append("characters that nobody sees, such as U+200B, are left out")
    if not is_normalized("NFC", text):
        text = normalize("NFC", text)
        notes.append("letters that are written as two characters, with their accents, are one")
    return text


def read_records(path: Path) -> Records:
    """Reads the file of a table.

    Raises:
        InputError: The file cannot be read, or holds no table.
    """
    said: list[str] = []

    def windows(data: bytes) -> str | None:
        text = windows_text(data)
        if text is not None:
            said.append("it is not UTF-8, and read as Windows-1252: check its letters")
        return text

    text = _usual(read_text(path, windows).replace(_BYTE_ORDER_MARK, ""), said)
    if text.lstrip().startswith("<"):
        raise InputError(
            f"{path} is HTML or XML, and no table: save the table itself as CSV, or download the "
            "file again."
        )
    if text.lstrip().startswith(_JSON):
        raise InputError(f"{path} is JSON, and no table: name a CSV table, a bag or a recording.")
    with _long_cells():
        dialect = dialect_of(text)
        rows, lines = _parsed(path, text, dialect)
    filled = [place for place, cells in enumerate(rows) if any(map(str.strip, cells))]
    if not filled:
        raise InputError(f"{path} is empty: name a table with rows.")
    reasons = no_rows(
        [rows[place] for place in filled],
        {
            number
            for number, place in enumerate(filled)
            if place and place - 1 != filled[number - 1]
        },
    )
    kept = [place for place, reason in zip(filled, reasons, strict=True) if reason is None]
    if named := below_groups([rows[place] for place in filled], reasons):
        rows[kept[0]] = named
    left_out = Counter(reason for reason in reasons if reason is not None)
    left_out[NoRow.EMPTY] += sum(map(bool, rows)) - len(filled)
    rows = [rows[place] for place in kept]
    if dialect.delimiter == "|" and not any(cells[0].strip() for cells in rows):
        # In Markdown, lines also begin with what separates cells.
        rows = [cells[1:] for cells in rows]
    rows = _without_blank_ends(rows)
    notes = (*said, *dialect.notes)
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


def _without_blank_ends(rows: Sequence[list[str]]) -> list[list[str]]:
    """Rows without the blank cells that some programs put behind the last one."""
    width = len(rows[0])
    while width > 1 and all(len(cells) < width or not cells[width - 1].strip() for cells in rows):
        width -= 1
    return [
        cells[:width] if len(cells) > width and not any(map(str.strip, cells[width:])) else cells
        for cells in rows
    ]


@contextmanager
def _long_cells() -> Iterator[None]:
    """Has the csv module read cells of any length, as long as it lasts."""
    before = csv.field_size_limit(_LONGEST_CELL)
    try:
        yield
    finally:
        csv.field_size_limit(before)


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
