"""Tables as people make them: however one is written, it is the same demonstration."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.storage.read import Read

ROWS = 60
NAMES = ["dist", "load", "docked", "color", "action"]


def _plain() -> list[list[str]]:
    random = np.random.default_rng(0)
    rows = []
    for place in range(ROWS):
        dist, load = random.uniform(0, 2), random.uniform(1_000, 9_000)
        docked = place % 3 == 0
        action = "stop" if docked else "left" if dist < 1 else "go"
        color = ("red", "green", "blue")[place % 5 % 3]
        rows.append([f"{dist:.3f}", f"{load:.0f}", str(docked), color, action])
    return rows


def _written(
    rows: list[list[str]], names: list[str] | None = NAMES, *, delimiter: str = ",", end: str = "\n"
) -> str:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=delimiter, lineterminator=end)
    writer.writerows([names, *rows] if names else rows)
    return text.getvalue()


def _each(change: Callable[[int, str], str]) -> list[list[str]]:
    return [[change(column, cell) for column, cell in enumerate(row)] for row in _plain()]


def _grouped(cell: str) -> str:
    return f"{int(cell):,}"


def _decimal_commas() -> list[list[str]]:
    return _each(lambda column, cell: cell.replace(".", ",") if column == 0 else cell)


#: How it is written, and what the notes on it say.
DIALECTS: dict[str, tuple[str | bytes, tuple[str, ...]]] = {
    "plain": (_written(_plain()), ()),
    "windows": (_written(_plain(), end="\r\n"), ()),
    "byte order mark": (b"\xef\xbb\xbf" + _written(_plain()).encode(), ()),
    "utf-16": (_written(_plain(), delimiter="\t").encode("utf-16"), ("tabs",)),
    "tabs": (_written(_plain(), delimiter="\t"), ("tabs",)),
    "semicolons": (_written(_plain(), delimiter=";"), ("semicolons",)),
    "bars": (_written(_plain(), delimiter="|"), ("bars",)),
    "semicolons and decimal commas": (
        _written(_decimal_commas(), delimiter=";"),
        ("semicolons", "'dist' is read as numbers, with decimal commas"),
    ),
    "quoted decimal commas": (_written(_decimal_commas()), ("with decimal commas",)),
    "thousands separators": (
        _written(_each(lambda column, cell: _grouped(cell) if column == 1 else cell)),
        ("'load' is read as numbers, without their thousands separators",),
    ),
    "units": (
        _written(_each(lambda column, cell: f"{cell} m" if column == 0 else cell)),
        ("'dist' is read as numbers, without their unit m",),
    ),
    "units without a blank": (
        _written(_each(lambda column, cell: f"{cell}kg" if column == 1 else cell)),
        ("'load' is read as numbers, without their unit kg",),
    ),
    "percent signs": (
        _written(_each(lambda column, cell: f"{cell}%" if column == 0 else cell)),
        ("'dist' is read as numbers, without their percent signs",),
    ),
    "blanks behind commas": (
        "\n".join(", ".join(row) for row in [NAMES, *_plain()]) + "\n",
        (),
    ),
    "blanks behind some cells": (
        _written(
            [[f"{cell}{' ' * (place % 3)}" for cell in row] for place, row in enumerate(_plain())]
        ),
        ("blanks around actions do not count",),
    ),
    "yes and no": (
        _written(_each(lambda column, cell: {"True": "yes", "False": "no"}.get(cell, cell))),
        (),
    ),
    "zeros and ones": (
        _written(_each(lambda column, cell: {"True": "1", "False": "0"}.get(cell, cell))),
        (),
    ),
    "comments": (f"# by hand\n# in May\n{_written(_plain())}", ("2 lines of comments",)),
    "separators at the ends": (
        "\n".join(",".join(row) + "," for row in [NAMES, *_plain()]) + "\n",
        (),
    ),
    "row numbers": (
        _written([[str(place), *row] for place, row in enumerate(_plain())], ["index", *NAMES]),
        ("'index' numbers or dates the rows",),
    ),
    "times": (
        _written(
            [[f"19:{place:02}", *row] for place, row in enumerate(_plain())], ["when", *NAMES]
        ),
        ("'when' holds dates or times",),
    ),
    "comments in a column": (
        _written([[f"try {place}", *row] for place, row in enumerate(_plain())], ["said", *NAMES]),
        ("'said' holds 60 different texts",),
    ),
    "no names": (_written(_plain(), None), ("the first line holds data",)),
}


def _read(directory: Path, text: str | bytes) -> Read:
    path = directory / "table.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_csv(path)


def _shown(one: Demonstration) -> tuple[list[str], list[list[float]]]:
    return [one.actions[code] for code in one.chosen], one.states.tolist()


@pytest.mark.parametrize("dialect", DIALECTS)
def test_however_a_table_is_written_it_is_the_same_demonstration(
    dialect: str, tmp_path: Path
) -> None:
    plain = _read(tmp_path, _written(_plain())).demonstration
    text, notes = DIALECTS[dialect]
    read = _read(tmp_path, text)
    assert _shown(read.demonstration) == _shown(plain)
    if dialect != "no names":
        assert [one.name for one in read.demonstration.features] == NAMES[:-1]
    for feature, wanted in zip(read.demonstration.features, plain.features, strict=True):
        # 0 and 1 become binary where demonstrations are joined.
        assert feature.kind is wanted.kind or dialect == "zeros and ones"
    assert len(read.notes) == len(notes)
    for note in notes:
        assert any(note in one for one in read.notes), read.notes
    assert read.account is not None
    assert read.account.stated == read.account.read == ROWS
    assert not read.account.missing


def test_an_amount_that_is_written_both_ways_is_one_with_thousands(tmp_path: Path) -> None:
    read = _read(tmp_path, 'x,a\n"1,207",go\n"3,512",turn\n')
    assert read.demonstration.states[:, 0].tolist() == [1207, 3512]
    assert "thousands" in read.notes[0]


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["1.207,5", "312,25"], [1207.5, 312.25]),
        (["1 207.5", "12 300 000"], [1207.5, 12_300_000]),
        (["-0,5", "1,25e3"], [-0.5, 1250]),
        (["5 °C", "-7.5 °C"], [5, -7.5]),
        (["1e3 m/s", "2.5 m/s"], [1000, 2.5]),
        (["0,5 m", "12 m"], [0.5, 12]),
    ],
)
def test_numbers_are_read_as_people_write_them(
    cells: list[str], values: list[float], tmp_path: Path
) -> None:
    read = _read(tmp_path, _written([[cell, "go"] for cell in cells], ["x", "a"]))
    assert read.demonstration.features[0].kind is FeatureKind.NUMERIC
    assert read.demonstration.states[:, 0].tolist() == values


@pytest.mark.parametrize("cells", [["5 m", "7 km"], ["1,5", "2.5"], ["a1", "a2"], ["1/2", "2/3"]])
def test_what_is_written_in_several_ways_is_text(cells: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, _written([[cell, "go"] for cell in cells], ["x", "a"]))
    assert read.demonstration.features[0].categories == tuple(sorted(cells))


@pytest.mark.parametrize(
    "rows",
    [
        ["red,0.134,go", "green,0.5,turn", "red,0.7,go"],
        ["red,0.134,go", "green,0.5,turn", "blue,0.7,turn"],
        ["red,3,go", "green,5,turn", "blue,7,go"],
    ],
)
def test_a_first_row_of_data_is_no_line_of_names(rows: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, "\n".join(rows) + "\n")
    assert len(read.demonstration) == 3
    assert [one.name for one in read.demonstration.features] == ["x0", "x1"]
    assert read.notes[0].startswith("the first line holds data")


@pytest.mark.parametrize("names", ["color,dist,action", "0,1,action", "dist,2nd,action"])
def test_names_are_no_data(names: str, tmp_path: Path) -> None:
    read = _read(tmp_path, f"{names}\n0.5,0.7,go\n0.25,0.3,turn\n")
    assert len(read.demonstration) == 2
