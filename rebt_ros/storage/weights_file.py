"""Files of weights: for each demonstration, how much it counts."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Final

from rebt_ros.codec import text
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.text import read_text
from rebt_ros.storage.weights import weight

_COMMENT: Final = "#"
#: Cells of a line.
_CELLS: Final = 2


def read_weights(path: Path) -> tuple[tuple[str, Fraction], ...]:
    """The weights of a file.

    Args:
        path: A JSON object of weights by names; or a table of two columns, separated by commas,
            with or without a heading.  A name is what `inspect` calls a demonstration, a path, or
            a pattern.

    Returns:
        Names and weights, in the order of the file; at least one.

    Raises:
        InputError: It cannot be read, or is no such file.
    """
    content = read_text(path)
    is_json = path.suffix.lower() == ".json" or content.lstrip().startswith("{")
    found = tuple(_of_json(path, content) if is_json else _of_table(path, content))
    if not found:
        raise InputError(f"{path} has no weights: write a name and a weight in each of its lines.")
    return found


def _of_json(path: Path, content: str) -> Iterator[tuple[str, Fraction]]:
    try:
        value = text.parsed(content)
    except (ValueError, RecursionError) as err:
        raise InputError(f"{path} is no JSON ({err}): correct it, or write a table.") from err
    if not isinstance(value, Mapping):
        raise InputError(f"{path} must be a JSON object of weights by names of demonstrations.")
    for name, its in value.items():
        yield name, _weight(f"{path}, {name!r}", its)


def _of_table(path: Path, content: str) -> Iterator[tuple[str, Fraction]]:
    lines = csv.reader(content.splitlines(), skipinitialspace=True)
    is_first = True
    for cells in _records(path, lines):
        if not cells or cells[0].startswith(_COMMENT):
            continue
        where = f"{path}, line {lines.line_num}"
        if len(cells) != _CELLS:
            raise InputError(f"{where}: there must be a name and a weight, separated by a comma.")
        if is_first and _is_heading(cells[1]):
            is_first = False
            continue
        is_first = False
        yield cells[0], _weight(where, cells[1])


def _records(path: Path, lines: Iterator[list[str]]) -> Iterator[list[str]]:
    try:
        for cells in lines:
            yield [cell.strip() for cell in cells] if any(map(str.strip, cells)) else []
    except csv.Error as err:
        raise InputError(
            f"{path} is no table ({err}): write a name and a weight per line."
        ) from err


def _is_heading(cell: str) -> bool:
    """Whether a cell names a column, instead of holding a number."""
    return cell.replace("_", "").replace(" ", "").isalpha() and cell.lower() not in ("nan", "inf")


def _weight(where: str, value: object) -> Fraction:
    try:
        return weight(value)
    except OptionError as err:
        raise InputError(f"{where}: {err}") from err
