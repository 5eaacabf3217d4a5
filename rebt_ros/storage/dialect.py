"""How a table is written: what separates and quotes its cells, and where it begins."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import dropwhile, islice

#: What may separate cells, the usual one first, with its name.
_DELIMITERS = {
    ",": "commas",
    ";": "semicolons",
    "\t": "tabs",
    "|": "bars",
    " ": "blanks",
    "\uff0c": "wide commas",
    "\uff1b": "wide semicolons",
}
#: Records that tell.
_FIRST = 50

#: What begins a line of comment.
COMMENT = "#"

#: The line by which spreadsheets are told what separates cells.
_SAID = re.compile(r"sep=(?P<delimiter>[,;|\t ])\r?\n", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written."""

    delimiter: str
    quote: str
    begin: int
    """Where the first record begins: comments may stand before it."""
    comment: tuple[str, ...]
    """The cells of the last comment before the table, which may name its columns."""
    notes: tuple[str, ...]
    """How it is read, where that is not plain; no full stops."""

    def records(self, text: str) -> Iterator[tuple[list[str], int]]:
        """The cells of each record, and how many lines of the table end with it.

        Raises:
            csv.Error: A quote is not closed, or stands where none can.
        """
        lines = io.StringIO(text, newline="")
        lines.seek(self.begin)
        reader = csv.reader(
            lines,
            delimiter=self.delimiter,
            quotechar=self.quote,
            skipinitialspace=True,
            strict=True,
        )
        for cells in reader:
            yield cells, reader.line_num


def dialect_of(text: str) -> Dialect:
    """Tells how a table is written by its first records."""
    said = _SAID.match(text)
    first = said.end() if said else 0
    begin = _after_comments(text, first)
    delimiter = said["delimiter"] if said else _delimiter(text[begin:])
    quote = _quote(text[begin:], delimiter)
    notes = []
    if comments := text.count("\n", first, begin):
        lines = f"{comments} lines of comments are" if comments > 1 else "a line of comments is"
        notes.append(f"{lines} left out before the table")
    if delimiter != ",":
        notes.append(f"cells are separated by {_DELIMITERS[delimiter]}")
    if quote != '"':
        notes.append("cells are quoted by single quotes")
    comment = _last_comment(text[first:begin], delimiter)
    return Dialect(delimiter, quote, begin, comment, tuple(notes))


def _after_comments(text: str, begin: int) -> int:
    while text.startswith(COMMENT, begin):
        end = text.find("\n", begin)
        if end < 0:
            break
        begin = end + 1
    return begin


def _last_comment(comments: str, delimiter: str) -> tuple[str, ...]:
    lines = comments.splitlines()
    last = lines[-1].lstrip(COMMENT).strip() if lines else ""
    if last.startswith(delimiter):
        # That is what the first column is called: the number of the row.
        last = COMMENT + last
    try:
        return tuple(next(_first_records(last, delimiter), ()))
    except csv.Error:
        return ()


def _delimiter(text: str) -> str:
    """The one that gives all records as many cells as the first.

    Where none does, the names may lack that of the first column; then most records do; then titles
    above the table, which have a single cell, do not count; and then it is commas.

    A table with semicolons may have a decimal comma in each cell, so that commas would do as well:
    then there are semicolons in the cells of its first record.
    """
    fitting = [one for one in _DELIMITERS if _fits(text, one)]
    if not fitting:
        one_less = [one for one in _DELIMITERS if _lacks_a_name(_counts(text, one))]
        below_titles = [one for one in _DELIMITERS if _fits(text, one, titles=True)]
        mostly = [one for one in _DELIMITERS if one != " " and _fits_most(text, one)]
        return next(iter([*one_less, *mostly, *below_titles, ","]))
    if fitting[0] == ",":
        first = next(_first_records(text, ","))
        others = [one for one in fitting[1:] if one != " " and any(one in cell for cell in first)]
        return others[0] if others else ","
    return fitting[0]


def _fits(text: str, delimiter: str, *, titles: bool = False) -> bool:
    counts = _counts(text, delimiter)
    if titles:
        counts = list(dropwhile(lambda count: count == 1, counts))
    fewest = 2 if titles else 1
    return len(counts) >= fewest and len(set(counts)) == 1 and counts[0] > 1


def _lacks_a_name(counts: Sequence[int]) -> bool:
    return len(counts) > 1 and counts[0] > 1 and set(counts[1:]) == {counts[0] + 1}


def _fits_most(text: str, delimiter: str) -> bool:
    counts = _counts(text, delimiter)
    return bool(counts) and counts[0] > 1 and 2 * counts.count(counts[0]) > len(counts)


def _counts(text: str, delimiter: str) -> list[int]:
    """How many cells each of the first records has that is no comment; empty where it cannot be."""
    try:
        return [
            len(cells)
            for cells in islice(_first_records(text, delimiter), _FIRST)
            if not cells[0].startswith(COMMENT)
        ]
    except csv.Error:
        return []


def _quote(text: str, delimiter: str) -> str:
    """Double quotes, unless all cells of a column are within single ones."""
    try:
        _, *records = islice(_first_records(text, delimiter), _FIRST)
    except (csv.Error, ValueError):
        return '"'
    quoted = (
        all(len(cell) > 1 and cell.startswith("'") and cell.endswith("'") for cell in cells)
        for cells in zip(*records, strict=False)
    )
    return "'" if any(quoted) else '"'


def _first_records(text: str, delimiter: str) -> Iterator[list[str]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    return (cells for cells in reader if any(map(str.strip, cells)))
