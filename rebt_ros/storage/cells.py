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
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from unicodedata import decimal

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.schema import Feature, FeatureKind

#: Words for a value that is not there, in lower case.
_MISSING = frozenset(
    {
        "",
        "na",
        "n/a",
        "n.a.",
        "#n/a",
        "#na",
        "#nv",
        "#n/d",
        "<na>",
        "nan",
        "nat",
        "null",
        "-",
        "--",
        "?",
    }
)
#: Words for it, among numbers and truths; among texts they may be texts as well.
_MAYBE_MISSING = frozenset({"none", "nil", "missing", "unknown", "undefined"})

#: What spreadsheets write where a formula fails, in whatever language, or a cell is too narrow.
_FAILED = re.compile(r"#(?:[^\W\d_][\w/ -]*[!?]|#+)|Err:\d{3}")

#: Also as spreadsheets in other languages write them.
_TRUE = (
    "true yes on t y 1 1.0 wahr ja vrai oui verdadero sí vero verdadeiro sim waar sant prawda tak"
)
_FALSE = "false no off f n 0 0.0 falsch nein faux non falso não onwaar nee falskt nej fałsz nie"
_TRUTH = {
    **dict.fromkeys(_TRUE.split(), 1.0),
    **dict.fromkeys(_FALSE.split(), 0.0),
}

#: Words of truth that no column is called.
_NO_NAMES = frozenset({"true", "false", "yes", "no"})

#: What stands between groups of three digits.
_SEPARATORS = "[ ,'\u2019\u00a0\u202f]"
#: What typesetters write for minus.
_MINUS = "\u2212"
#: How accountants write a number below zero, and amounts of money.
_BELOW_ZERO = re.compile(r"\((?P<number>[^()+-]*\d[^()]*)\)")
_MONEY = re.compile(r"(?P<sign>[+-]?) ?(?P<unit>[$€£¥₹]) ?(?P<number>\D?\d.*)")
#: A text that a spreadsheet is kept from reading as a number.
_FORMULA = re.compile(r'="(?P<number>[^"]*)"')
#: Decimal points and signs beside digits of other scripts.
_SIGNS = str.maketrans({"\u066b": ".", "\uff0e": ".", "\uff0d": "-", "\uff0b": "+"})
#: In India, there are two digits in all groups but the last.
_THOUSANDS = re.compile(
    rf"[+-]?[1-9](?:\d{{0,2}}(?:{_SEPARATORS}\d{{3}})+|\d?(?:,\d\d)+,\d{{3}})(?:\.\d+)?"
)
#: Points between them, where they cannot be decimal points: several, or by what other columns say.
_POINTED = re.compile(r"[+-]?[1-9]\d{0,2}(?:\.\d{3}){2,}")
_MAYBE_POINTED = re.compile(r"[+-]?(?:0|[1-9]\d{0,2}(?:\.\d{3})*)")
_DECIMAL_COMMA = re.compile(r"[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*),\d+(?:[eE][+-]?\d+)?")
_UNIT = re.compile(
    r"(?P<number>[^A-Za-z°µμΩ%]*\d[eE][+-]?\d+|[^A-Za-z°µμΩ%]*\d\.?) ?(?P<unit>\D.*)"
)
#: A number as addresses, flags and bytes are written.
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
#: What has digits, and no letters before them.
_AMOUNT = re.compile(r"[^A-Za-z\d]*\d.*")
_MONTH = r"(?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec)[a-z]*\.?"
_DATE = (
    r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2})"
    rf"|(?:[A-Z][a-z]+,? )?(?:{_MONTH} \d{{1,2}},?|\d{{1,2}}\.?[ -]{_MONTH})[ -]\d{{2}}(?:\d{{2}})?"
)
_TIME = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AaPp][Mm])?"
_ZONE = r" ?(?:Z|UTC|GMT|[+-]\d{2}:?\d{2})"
_MOMENT = re.compile(rf"(?:{_DATE})(?:,?[T ]{_TIME}(?:{_ZONE})?)?|{_TIME}")

#: Of cells most of which are numbers, this share must be, or all but so few different words; and so
#: many different ones, as otherwise they are codes.
_MOSTLY, _FEW_WORDS, _MANY_NUMBERS = 0.9, 3, 20
#: Texts may all differ in so few rows; in more, half of them must recur.
_FEW_TEXTS, _RECURRING = 20, 0.5
#: Nor more texts than that: each is an indicator of as many cells as there are rows.
_MOST_TEXTS = 1000
#: Nor longer ones, which nobody could read in a tree (characters).
_LONGEST_TEXT = 1000
_LONGEST_UNIT = 12
#: A number stands in for none where it is so often there, beside so many others, and so many times
#: as far from the next as they are from each other and from zero.
_FEWEST_STAND_INS, _FEWEST_OTHERS, _FAR = 2, 5, 3.0
#: The largest and smallest integers of 16 and 32 bits.
_LARGEST = frozenset({32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0, 4294967295.0})
#: Every integer up to here is a number of its own.
_LARGEST_EXACT = 2.0**53
#: Of the largest number that is learned from.
_MOST_DIGITS = 39
_WITH_COMMAS, _WITHOUT_SEPARATORS = "with decimal commas", "without their thousands separators"


@dataclass(frozen=True, eq=False, slots=True)
class Column:
    """A feature with its values, one for each cell."""

    feature: Feature
    values: FloatArray
    """Numbers, 0 or 1, positions in the feature's categories, or NaN: shape (cells,)."""
    notes: tuple[str, ...] = ()
    """How its cells were read, where that is not plain; no full stops."""
    decimal_commas: bool = False
    """Whether a comma is its decimal separator."""


@dataclass(frozen=True, slots=True)
class NoFeature:
    """A column that is not learned from, and why."""

    note: str


def is_missing(cell: str) -> bool:
    """Whether a cell, without blanks around it, says that there is no value."""
    return cell.lower() in _MISSING


def is_failed(cell: str) -> bool:
    """Whether a cell, without blanks around it, says that a formula of a spreadsheet failed.

    >>> [is_failed(cell) for cell in ("#DIV/0!", "#WERT!", "#####", "Err:502", "#1", "#red")]
    [True, True, True, True, False, False]
    """
    return _FAILED.fullmatch(cell) is not None


def is_maybe_missing(cell: str) -> bool:
    """Whether a cell says that there is no value if it stands among numbers or truths."""
    return cell.lower() in _MAYBE_MISSING


def is_truth(cell: str) -> bool:
    """Whether a cell, without blanks around it, says true or false in a word."""
    return cell.lower() in _TRUTH


def is_number(cell: str) -> bool:
    """Whether a cell is a number as every tool reads it."""
    return bool(cell) and numbers((cell,)) is not None


def is_value_like(cell: str, others: Iterable[str]) -> bool:
    """Whether a cell is a number, date, time or truth, written as all others that hold something.

    Words of truth that may well be names, such as `on`, do not count.

    Args:
        cell: It, with or without blanks around it.
        others: Of the same column.
    """
    cell = cell.strip()
    filled = [other for one in others if not is_missing(other := one.strip())]
    if is_missing(cell) or not filled:
        return False
    cells = [cell, *filled]
    return (
        numbers(cells) is not None
        or (cell.lower() in _NO_NAMES and all(one.lower() in _TRUTH for one in cells))
        or all(map(_MOMENT.fullmatch, cells))
        or _in_notation("", cells, set(cells)) is not None
    )


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


def column(
    name: str, cells: Sequence[str], line: Callable[[int], int], *, decimal_commas: bool = False
) -> Column | NoFeature:
    """Reads a column.

    Args:
        name: Of the column.
        cells: Its cells, with or without blanks around them.
        line: The line on which a cell stands, by its position.
        decimal_commas: Whether the numbers of the table are known to have decimal commas.
    """
    plain = numbers(cells)
    if plain is None:
        cells = ["" if is_missing(stripped := cell.strip()) else stripped for cell in cells]
        plain = numbers(cells)
    if plain is not None:
        return (_grouped(name, cells) if decimal_commas else None) or _numeric(
            name, plain, *_rounded(name, cells, plain)
        )
    failed = set(filter(is_failed, set(cells)))
    if failed:
        note = f"cells of column {name!r} that say {min(failed)!r} are missing values"
        filled = ["" if cell in failed else cell for cell in cells]
        others = column(name, filled, line, decimal_commas=decimal_commas)
        if isinstance(others, NoFeature):
            return others
        return replace(others, notes=(*others.notes, note))
    distinct = set(cells) - {""}
    if all(map(_MOMENT.fullmatch, distinct)):
        return NoFeature(f"column {name!r} holds dates or times and is no feature")
    sure = [cell for cell in distinct if not is_maybe_missing(cell)]
    if sure and len(sure) < len(distinct):
        filled = ["" if is_maybe_missing(cell) else cell for cell in cells]
        found = _amounts(name, filled, set(sure), decimal_commas=decimal_commas)
        if found is not None:
            (word, *_) = (cell for cell in cells if is_maybe_missing(cell))
            note = f"cells of column {name!r} that say {word!r} are missing values"
            return replace(found, notes=(*found.notes, note))
    return (
        _amounts(name, cells, distinct, decimal_commas=decimal_commas)
        or _mostly_numbers(name, cells, line)
        or _texts(name, cells, distinct, line)
    )


def _amounts(
    name: str, cells: Sequence[str], distinct: Set[str], *, decimal_commas: bool
) -> Column | None:
    """Truths, or numbers however they are written; None where a cell is neither."""
    if {cell.lower() for cell in distinct} <= _TRUTH.keys():
        truth = [_TRUTH[cell.lower()] if cell else np.nan for cell in cells]
        return Column(Feature(name, FeatureKind.BINARY), np.array(truth))
    plain = numbers(cells)
    if plain is not None:
        return _numeric(name, plain)
    return _in_notation(name, cells, distinct, decimal_commas=decimal_commas)


def _numeric(name: str, values: FloatArray, *notes: str, decimal_commas: bool = False) -> Column:
    empty = (f"column {name!r} is empty",) if np.isnan(values).all() else ()
    stand_ins = [
        f"column {name!r} holds {number:.17g} {count} times, far from all else: it is read as a "
        "number; leave the cell empty if it says that there is no value"
        for number, count in _stand_ins(values)
    ]
    return Column(Feature(name), values, (*notes, *empty, *stand_ins), decimal_commas)


def _stand_ins(values: FloatArray) -> Iterable[tuple[float, int]]:
    """Numbers that people write where there is none, such as -999, and how often they do."""
    kept = values[np.isfinite(values)]
    for number in (kept.min(initial=0.0), kept.max(initial=0.0)):
        others = kept[kept != number]
        if not _is_stand_in(abs(float(number))) or len(kept) - len(others) < _FEWEST_STAND_INS:
            continue
        if len(np.unique(others)) < _FEWEST_OTHERS:
            continue
        # What is as large as that is refused later, in a sentence.
        with np.errstate(over="ignore"):
            distance = np.abs(others - number).min()
            spread = _FAR * max(np.ptp(others), np.abs(others).max())
        if distance > spread:
            yield float(number), len(kept) - len(others)


def _is_stand_in(number: float) -> bool:
    """Whether a number is one of those: nines, a power of ten, or the largest of its type."""
    digits = f"{number:.0f}"
    return number >= 99 and (
        (number < _LARGEST_EXACT and number == int(number) and set(digits) == {"9"})
        or (number >= 1e5 and f"{number:e}".startswith("1.000000e"))
        or number in _LARGEST
    )


def _rounded(name: str, cells: Sequence[str], values: FloatArray) -> Iterable[str]:
    """A note where integers are too long to be told apart."""
    for place in np.flatnonzero(np.abs(values) >= _LARGEST_EXACT).tolist():
        cell = cells[place].strip()
        digits = cell.lstrip("+-").lstrip("0")
        # Python reads no integer of thousands of digits, and no such number is learned from.
        exact = int(digits) if digits.isdecimal() and len(digits) <= _MOST_DIGITS else None
        if exact is not None and exact != abs(int(values[place])):
            yield f"column {name!r} holds integers such as {cell}, which are rounded"
            return


def _grouped(name: str, cells: Sequence[str]) -> Column | None:
    """Numbers with points that cannot be decimal ones; None where there is no such number."""
    filled = [cell for cell in cells if cell]
    if not any("." in cell for cell in filled) or not all(map(_MAYBE_POINTED.fullmatch, filled)):
        return None
    values = numbers([cell.replace(".", "") for cell in cells])
    assert values is not None
    note = f"column {name!r} is read as numbers, without their points, as others have commas"
    return _numeric(name, values, note)


def _in_notation(
    name: str, cells: Sequence[str], distinct: Iterable[str], *, decimal_commas: bool = False
) -> Column | None:
    """Numbers as people write them, all in the same way."""
    if any(distinct) and all(_HEXADECIMAL.fullmatch(cell) for cell in distinct if cell):
        note = f"column {name!r} is read as numbers, which are hexadecimal"
        return _numeric(name, np.array([int(cell, 16) if cell else np.nan for cell in cells]), note)
    said: list[str] = []
    for change, how in _changes(set(distinct) - {""}):
        distinct, cells = set(map(change, distinct)), list(map(change, cells))
        said.append(how)
    units = {_unit(cell) for cell in distinct}
    if len(units) == 1 and (unit := units.pop()):
        cells = [_without_unit(cell) for cell in cells]
        said.append("without their percent signs" if unit == "%" else f"without their unit {unit}")
    values = numbers(cells)
    how = ""
    if values is None:
        pointed = _with_points(cells, decimal_commas=decimal_commas)
        if pointed is None:
            return None
        cells, how = pointed
        said.append(how)
        values = numbers(cells)
    if values is None or not said:
        return None
    note = f"column {name!r} is read as numbers, {' and '.join(said)}"
    return _numeric(name, values, note, decimal_commas=how == _WITH_COMMAS)


def _changes(filled: Set[str]) -> Iterator[tuple[Callable[[str], str], str]]:
    """What makes usual numbers of all cells that are not empty, and how each is called."""
    if all(map(_FORMULA.fullmatch, filled)):
        change = partial(_FORMULA.sub, r"\g<number>")
        yield change, "without the formulas around them"
        filled = set(map(change, filled))
    if any(map(_has_foreign_digits, filled)):
        yield _with_usual_digits, "with digits of another script"
    if any(_MINUS in cell for cell in filled):
        yield lambda cell: cell.replace(_MINUS, "-"), f"with {_MINUS} for minus"
    below_zero = list(map(_BELOW_ZERO.fullmatch, filled))
    if any(below_zero) and not all(below_zero):
        yield partial(_BELOW_ZERO.sub, r"-\g<number>"), "with parentheses for minus"
        filled = {_BELOW_ZERO.sub(r"-\g<number>", cell) for cell in filled}
    signs = {found["unit"] if (found := _MONEY.fullmatch(cell)) else "" for cell in filled}
    if len(signs) == 1 and (sign := signs.pop()):
        yield partial(_MONEY.sub, r"\g<sign>\g<number>"), f"without their unit {sign}"


def _has_foreign_digits(cell: str) -> bool:
    return not cell.isascii() and any(one.isdecimal() and not one.isascii() for one in cell)


def _with_usual_digits(cell: str) -> str:
    usual = (str(decimal(one)) if one.isdecimal() else one for one in cell)
    return "".join(usual).translate(_SIGNS)


def _unit(cell: str) -> str:
    """What stands behind a number; empty where nothing does, or no number is there."""
    found = _UNIT.fullmatch(cell)
    unit = found["unit"].strip() if found else ""
    return unit if len(unit) <= _LONGEST_UNIT and not re.search(r"[\d,:]", unit) else ""


def _without_unit(cell: str) -> str:
    found = _UNIT.fullmatch(cell)
    return found["number"].strip() if found else cell


def _with_points(cells: Sequence[str], *, decimal_commas: bool) -> tuple[list[str], str] | None:
    """The cells as numbers with decimal points, and how they were read; None where they are not."""
    others = [cell for cell in cells if cell and not is_number(cell)]
    commas = all(map(_DECIMAL_COMMA.fullmatch, others)) and not any(
        "." in one for one in _plain(cells)
    )
    if all(map(_THOUSANDS.fullmatch, others)) and not (commas and decimal_commas):
        dropped = re.compile(_SEPARATORS)
        return [dropped.sub("", cell) for cell in cells], _WITHOUT_SEPARATORS
    if commas:
        points = [cell.replace(".", "").replace(",", ".") for cell in cells]
        return points, _WITH_COMMAS
    if all(map(_POINTED.fullmatch, others)) and all(map(_MAYBE_POINTED.fullmatch, _filled(cells))):
        return [cell.replace(".", "") for cell in cells], _WITHOUT_SEPARATORS
    return None


def _filled(cells: Iterable[str]) -> Iterable[str]:
    return (cell for cell in cells if cell)


def _plain(cells: Iterable[str]) -> Iterable[str]:
    return (cell for cell in cells if is_number(cell))


def _mostly_numbers(name: str, cells: Sequence[str], line: Callable[[int], int]) -> Column | None:
    """Numbers with a few words among them, however often each stands there: missing values."""
    filled = [cell for cell in cells if cell]
    found = list(_plain(filled))
    words = [place for place, cell in enumerate(cells) if cell and not is_number(cell)]
    few = len({cells[place] for place in words}) <= _FEW_WORDS
    if not (few or len(found) >= _MOSTLY * len(filled)) or len(set(found)) <= _MANY_NUMBERS:
        return None
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
    if len(distinct) > min(max(_FEW_TEXTS, _RECURRING * filled), _MOST_TEXTS):
        return NoFeature(
            f"column {name!r} holds {len(distinct)} different texts in {filled} cells, such as "
            f"{cells[next(i for i, cell in enumerate(cells) if cell)]!r}, and is no feature"
        )
    if (longest := max(map(len, distinct), default=0)) > _LONGEST_TEXT:
        return NoFeature(
            f"column {name!r} holds texts of up to {longest} characters, and is no feature"
        )
    categories = sorted(distinct)
    values = codes(("", *categories), cells).astype(np.float64) - 1
    values[values < 0] = np.nan
    notes: tuple[str, ...] = ()
    if categories and all(map(_AMOUNT.fullmatch, categories)):
        notes = (
            f"column {name!r} is taken as text, not as numbers: its cells, such as "
            f"{categories[0]!r}, are not all numbers written in the same way",
        )
    elif any(map(is_number, categories)):
        text = next(cell for cell in categories if not is_number(cell))
        notes = (
            f"column {name!r} is taken as text, not as numbers, because line "
            f"{line(cells.index(text))} holds {text!r}",
        )
    return Column(Feature(name, FeatureKind.CATEGORICAL, tuple(categories)), values, notes)
