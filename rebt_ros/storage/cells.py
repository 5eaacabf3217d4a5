"""What the cells of a column mean, as people write them.

A column is

numeric
    where its cells are numbers, also with decimal commas, thousands separators, percent signs or
    one unit behind them, or where a few of many numbers are words;
binary
    where they say true or false, in any of the usual words;
categorical
    otherwise.

Blanks around a cell do not count, and a cell that says that there is no value is a missing value.
Dates and times are no features, and neither are texts that hardly ever recur.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.schema import Feature, FeatureKind

#: Words for a value that is not there, in lower case.
_MISSING = frozenset({"", "na", "n/a", "nan", "null", "-", "--"})

_TRUTH = {
    **dict.fromkeys(("true", "yes", "on", "t", "y", "1", "1.0"), 1.0),
    **dict.fromkeys(("false", "no", "off", "f", "n", "0", "0.0"), 0.0),
}

#: What stands between groups of three digits.
_SEPARATORS = "[ ,'\u2019\u00a0\u202f]"
_THOUSANDS = re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{_SEPARATORS}\d{{3}})+(?:\.\d+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*),\d+(?:[eE][+-]?\d+)?")
_UNIT = re.compile(
    r"(?P<number>[^A-Za-z°µμΩ%]*\d[eE][+-]?\d+|[^A-Za-z°µμΩ%]*\d\.?) ?(?P<unit>\D.*)"
)
_DATE = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}"
_TIME = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AaPp][Mm])?"
_MOMENT = re.compile(rf"(?:{_DATE})(?:[T ]{_TIME}(?:Z|[+-]\d{{2}}:?\d{{2}})?)?|{_TIME}")

#: Of cells most of which are numbers, this share must be; and so many different ones, as otherwise
#: they are codes.
_MOSTLY, _MANY_NUMBERS = 0.9, 20
#: Texts may all differ in so few rows; in more, half of them must recur.
_FEW_TEXTS, _RECURRING = 20, 0.5
_LONGEST_UNIT = 12


@dataclass(frozen=True, eq=False, slots=True)
class Column:
    """A feature with its values, one for each cell."""

    feature: Feature
    values: FloatArray
    """Numbers, 0 or 1, positions in the feature's categories, or NaN: shape (cells,)."""
    notes: tuple[str, ...] = ()
    """How its cells were read, where that is not plain; no full stops."""


@dataclass(frozen=True, slots=True)
class NoFeature:
    """A column that is not learned from, and why."""

    note: str


def is_missing(cell: str) -> bool:
    """Whether a cell, without blanks around it, says that there is no value."""
    return cell.lower() in _MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number as every tool reads it."""
    return bool(cell) and numbers((cell,)) is not None


def numbers(cells: Sequence[str]) -> FloatArray | None:
    """Cells as numbers, NaN where one is empty; None where one holds something else."""
    text = "".join(cells)
    # Python also reads 1_000 and digits of other scripts, which no other tool would.
    if not text.isascii() or "_" in text:
        return None
    filled = cells if all(cells) else [cell or "nan" for cell in cells]
    try:
        return np.fromiter(map(float, filled), np.float64, len(cells))
    except ValueError:
        return None


def codes(labels: Sequence[str], cells: Sequence[str]) -> IntArray:
    """The position of each cell among the labels."""
    code = {label: index for index, label in enumerate(labels)}
    return np.fromiter(map(code.__getitem__, cells), np.int64, len(cells))


def column(name: str, cells: Sequence[str], line: Callable[[int], int]) -> Column | NoFeature:
    """Reads a column.

    Args:
        name: Of the column.
        cells: Its cells, with or without blanks around them.
        line: The line on which a cell stands, by its position.
    """
    plain = numbers(cells)
    if plain is not None:
        return _numeric(name, plain)
    cells = ["" if is_missing(stripped := cell.strip()) else stripped for cell in cells]
    plain = numbers(cells)
    if plain is not None:
        return _numeric(name, plain)
    distinct = set(cells) - {""}
    if {cell.lower() for cell in distinct} <= _TRUTH.keys():
        truth = [_TRUTH[cell.lower()] if cell else np.nan for cell in cells]
        return Column(Feature(name, FeatureKind.BINARY), np.array(truth))
    if all(map(_MOMENT.fullmatch, distinct)):
        return NoFeature(f"column {name!r} holds dates or times and is no feature")
    return (
        _in_notation(name, cells, distinct)
        or _mostly_numbers(name, cells, line)
        or _texts(name, cells, distinct, line)
    )


def _numeric(name: str, values: FloatArray, *notes: str) -> Column:
    empty = (f"column {name!r} is empty",) if np.isnan(values).all() else ()
    return Column(Feature(name), values, (*notes, *empty))


def _in_notation(name: str, cells: Sequence[str], distinct: Iterable[str]) -> Column | None:
    """Numbers as people write them, all in the same way."""
    units = {_unit(cell) for cell in distinct}
    said: list[str] = []
    if len(units) == 1 and (unit := units.pop()):
        cells = [_without_unit(cell) for cell in cells]
        said.append("without their percent signs" if unit == "%" else f"without their unit {unit}")
    values = numbers(cells)
    if values is None:
        decimal = _with_points(cells)
        if decimal is None:
            return None
        cells, how = decimal
        said.append(how)
        values = numbers(cells)
    if values is None or not said:
        return None
    return _numeric(name, values, f"column {name!r} is read as numbers, {' and '.join(said)}")


def _unit(cell: str) -> str:
    """What stands behind a number; empty where nothing does, or no number is there."""
    found = _UNIT.fullmatch(cell)
    unit = found["unit"].strip() if found else ""
    return unit if len(unit) <= _LONGEST_UNIT and not re.search(r"[\d,:]", unit) else ""


def _without_unit(cell: str) -> str:
    found = _UNIT.fullmatch(cell)
    return found["number"].strip() if found else cell


def _with_points(cells: Sequence[str]) -> tuple[list[str], str] | None:
    """The cells as numbers with decimal points, and how they were read; None where they are not."""
    others = [cell for cell in cells if cell and not is_number(cell)]
    if all(map(_THOUSANDS.fullmatch, others)):
        dropped = re.compile(_SEPARATORS)
        return [dropped.sub("", cell) for cell in cells], "without their thousands separators"
    if all(map(_DECIMAL_COMMA.fullmatch, others)) and not any("." in one for one in _plain(cells)):
        points = [cell.replace(".", "").replace(",", ".") for cell in cells]
        return points, "with decimal commas"
    return None


def _plain(cells: Iterable[str]) -> Iterable[str]:
    return (cell for cell in cells if is_number(cell))


def _mostly_numbers(name: str, cells: Sequence[str], line: Callable[[int], int]) -> Column | None:
    """Numbers with a few words among them, which are missing values."""
    filled = [cell for cell in cells if cell]
    found = list(_plain(filled))
    if len(found) < _MOSTLY * len(filled) or len(set(found)) <= _MANY_NUMBERS:
        return None
    words = [place for place, cell in enumerate(cells) if cell and not is_number(cell)]
    values = numbers([cell if is_number(cell) else "" for cell in cells])
    assert values is not None
    count = f"{len(words)} cells hold" if len(words) > 1 else "1 cell holds"
    return _numeric(
        name,
        values,
        f"column {name!r} is read as numbers: {count} no number, such as {cells[words[0]]!r} on "
        f"line {line(words[0])}, and {'are missing values' if words[1:] else 'is a missing value'}",
    )


def _texts(
    name: str, cells: Sequence[str], distinct: set[str], line: Callable[[int], int]
) -> Column | NoFeature:
    filled = sum(map(bool, cells))
    if len(distinct) > _FEW_TEXTS and len(distinct) > _RECURRING * filled:
        return NoFeature(
            f"column {name!r} holds {len(distinct)} different texts in {filled} cells, such as "
            f"{cells[next(i for i, cell in enumerate(cells) if cell)]!r}, and is no feature"
        )
    categories = sorted(distinct)
    values = codes(("", *categories), cells).astype(np.float64) - 1
    values[values < 0] = np.nan
    notes: tuple[str, ...] = ()
    if any(map(is_number, categories)):
        text = next(cell for cell in categories if not is_number(cell))
        notes = (
            f"column {name!r} is taken as text, not as numbers, because line "
            f"{line(cells.index(text))} holds {text!r}",
        )
    return Column(Feature(name, FeatureKind.CATEGORICAL, tuple(categories)), values, notes)
