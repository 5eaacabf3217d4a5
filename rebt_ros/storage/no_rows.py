"""Records of a table that are no rows: titles, units, comments, ruled lines, text below it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence, Set
from enum import Enum
from itertools import pairwise

from rebt_ros.storage.cells import is_failed, is_missing, is_number
from rebt_ros.storage.dialect import COMMENT


class NoRow(Enum):
    """Why a record is no row."""

    EMPTY = "is empty", "are empty"
    COMMENT = "is a comment", "are comments"
    NAMES = "repeats the column names", "repeat the column names"
    TITLE = "is a title", "are titles"
    UNITS = "says units below the column names", "say units below the column names"
    RULER = "is a ruled line", "are ruled lines"
    WORDS = "holds words where all others hold numbers", "hold words where all others hold numbers"
    BELOW = "is text below the table", "are text below the table"

    def __init__(self, single: str, several: str) -> None:
        self.single = single
        self.several = several


#: A cell of a line that is drawn, as below the names of a table in Markdown.
_RULED = re.compile(r"(?::?-+:?|=+|[-+]+)?")
_BRACKETED = re.compile(r"\[[^\[\]]*\]|\([^()]*\)")

#: So many records tell which columns hold numbers: this share of them does.
_TELLING, _MOSTLY = 200, 0.9
#: Amid a table words stand in place of numbers in so many columns where they are no values.
_FEWEST_COLUMNS = 2


def no_rows(records: Sequence[Sequence[str]], after_blank: Set[int]) -> list[NoRow | None]:
    """Why each of the records that hold something is no row; None where it may be one.

    Args:
        records: The cells of each of them.
        after_blank: Positions of those that stand below a blank line.
    """
    titles = _titles(records)
    width = len(records[titles])
    numeric = _numeric(records[titles + 1 :], width)
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
    _note_words(records, reasons, titles, numeric)
    _note_below(records, reasons, after_blank, width, is_numeric=0 in numeric)
    return reasons


def below_groups(
    records: Sequence[Sequence[str]], reasons: Sequence[NoRow | None]
) -> list[str] | None:
    """The names of columns that recur, each behind that of the group of columns which it is in.

    None where the names do not recur, or no record above them names groups.
    """
    first = next((place for place, reason in enumerate(reasons) if reason is None), 0)
    names = [cell.strip() for cell in records[first]]
    if not first or len(set(names)) == len(names) or len(records[first - 1]) != len(names):
        return None
    named, group = [], ""
    for above, name in zip(records[first - 1], names, strict=True):
        group = above.strip() or group
        named.append(name if group in ("", name) else f"{group}.{name}")
    return named if len(set(named)) == len(named) else None


def _titles(records: Sequence[Sequence[str]]) -> int:
    """How many records stand above the names: titles in their first cell, and groups of columns."""
    count = 0
    while count < len(records) - 2 and not any(map(str.strip, records[count][1:])):
        count += 1
    # Below them are names: several, each column with one, over rows of as many cells.
    if not _are_names(records, count):
        count = 0
    return count + _are_groups(records, count)


def _are_names(records: Sequence[Sequence[str]], place: int) -> bool:
    names = records[place]
    below = records[min(place + 1, len(records) - 1)]
    return len(names) > 1 and all(map(str.strip, names)) and len(below) == len(names)


def _are_groups(records: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a record names groups of columns: not each of them, and its own name is below it."""
    if len(records) < place + 3 or not _are_names(records, place + 1):
        return False
    groups = [cell.strip() for cell in records[place]]
    names = [cell.strip() for cell in records[place + 1]]
    filled = [group for group in groups if group]
    return (
        len(groups) == len(names)
        and any(not group or group == before for before, group in pairwise(groups))
        and not any(map(is_number, (*filled, *names)))
        and bool(_numeric(records[place + 2 :], len(names)))
    )


def _numeric(records: Sequence[Sequence[str]], width: int) -> tuple[int, ...]:
    """The columns that hold numbers, by the first records of a table."""
    telling = [cells for cells in records[:_TELLING] if len(cells) == width]
    found = []
    for column in range(width):
        filled = [cell for cells in telling if not is_missing(cell := cells[column].strip())]
        numbers = sum(map(is_number, filled))
        if numbers > 1 and numbers >= min(_MOSTLY * len(filled), len(filled) - 1):
            found.append(column)
    return tuple(found)


def _note_words(
    records: Sequence[Sequence[str]],
    reasons: list[NoRow | None],
    first: int,
    numeric: Sequence[int],
) -> None:
    """Finds records of words in place of all numbers, as of units, of types or of other names.

    None of their words stands elsewhere in its column, as the action of a row would.
    """
    if not numeric:
        return
    names = [cell.strip() for cell in records[first]]
    width, column = len(names), numeric[0]
    counts: list[Counter[str]] = []
    for place in range(first + 1, len(records)):
        cells = records[place]
        if reasons[place] is not None or len(cells) != width or _is_plain(cells[column]):
            continue
        words = [cell for one in numeric if not is_missing(cell := cells[one].strip())]
        fewest = 1 if place == first + 1 else _FEWEST_COLUMNS
        if len(words) < fewest or any(is_number(word) or is_failed(word) for word in words):
            continue
        said = [cell.strip() for cell in cells]
        counts = counts or [
            Counter(row[one].strip() for row in records[first + 1 :] if one < len(row))
            for one in range(width)
        ]
        if said != names and all(
            is_missing(cell) or its[cell] == 1 for cell, its in zip(said, counts, strict=True)
        ):
            reasons[place] = NoRow.WORDS


def _is_plain(cell: str) -> bool:
    """Whether a cell is a number; it costs little."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _note_below(
    records: Sequence[Sequence[str]],
    reasons: list[NoRow | None],
    after_blank: Set[int],
    width: int,
    *,
    is_numeric: bool,
) -> None:
    """Finds what is written below a table, in fewer cells: no row that was cut off begins so.

    Args:
        records: All of them.
        reasons: Why each is no row, where that is known.
        after_blank: Positions of those that stand below a blank line.
        width: Of the table, in cells.
        is_numeric: Whether the first column holds numbers.
    """
    end = len(records)
    while end > 1 and (reasons[end - 1] is not None or len(records[end - 1]) < width):
        end -= 1
    for place in range(end, len(records)):
        begin = records[place][0].strip()
        told = is_numeric or place in after_blank or reasons[place - 1] is NoRow.BELOW
        if told and reasons[place] is None and begin and not is_number(begin):
            reasons[place] = NoRow.BELOW


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
