"""How a table is written: what separates its cells, and where it begins."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

#: What may separate cells, the usual one first, with its name.
_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
#: Records that tell.
_FIRST = 50
_COMMENT = "#"


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written."""

    delimiter: str
    begin: int
    """Where the first record begins: what stands before are comments."""
    notes: tuple[str, ...]
    """How it is read, where that is not plain; no full stops."""


def dialect_of(text: str) -> Dialect:
    """Tells how a table is written by its first records."""
    begin = _after_comments(text)
    comments = text.count("\n", 0, begin)
    delimiter = _delimiter(text[begin:])
    notes = []
    if comments:
        lines = f"{comments} lines of comments are" if comments > 1 else "a line of comments is"
        notes.append(f"{lines} left out before the table")
    if delimiter != ",":
        notes.append(f"cells are separated by {_DELIMITERS[delimiter]}")
    return Dialect(delimiter, begin, tuple(notes))


def _after_comments(text: str) -> int:
    begin = 0
    while text.startswith(_COMMENT, begin):
        end = text.find("\n", begin)
        if end < 0:
            break
        begin = end + 1
    return begin


def _delimiter(text: str) -> str:
    """The one that gives all records as many cells as the first; commas where none does.

    A table with semicolons may have a decimal comma in each cell, so that commas would do as well:
    then there are semicolons in the cells of its first record.
    """
    fitting = [one for one in _DELIMITERS if _fits(text, one)]
    if not fitting:
        return ","
    if fitting[0] == ",":
        first = next(_first_records(text, ","))
        others = [one for one in fitting[1:] if any(one in cell for cell in first)]
        return others[0] if others else ","
    return fitting[0]


def _fits(text: str, delimiter: str) -> bool:
    try:
        counts = {len(cells) for cells in islice(_first_records(text, delimiter), _FIRST)}
    except csv.Error:
        return False
    return len(counts) == 1 and min(counts) > 1


def _first_records(text: str, delimiter: str) -> Iterator[list[str]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    return (cells for cells in reader if any(map(str.strip, cells)))
