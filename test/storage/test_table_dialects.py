"""Tables as people make them: however one is written, it is the same demonstration."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.storage.inputs import load
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
    "truths of a German spreadsheet": (
        _written(_each(lambda column, cell: {"True": "WAHR", "False": "FALSCH"}.get(cell, cell))),
        (),
    ),
    "truths of a French spreadsheet": (
        _written(_each(lambda column, cell: {"True": "VRAI", "False": "FAUX"}.get(cell, cell))),
        (),
    ),
    "R's write.table": (
        "\n".join(
            [" ".join(f'"{name}"' for name in NAMES)]
            + [f'"{place}" {" ".join(row)}' for place, row in enumerate(_plain(), 1)]
        )
        + "\n",
        ("blanks", "as where R writes the names of rows", "'Unnamed: 0' numbers or dates the rows"),
    ),
    "R's write.csv with names of rows": (
        _written([[f"run {place}", *row] for place, row in enumerate(_plain())], NAMES),
        ("as where R writes the names of rows", "'Unnamed: 0' numbers or dates the rows"),
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
    "a separator that is said": (
        "sep=;\n" + _written(_decimal_commas(), delimiter=";"),
        ("semicolons", "'dist' is read as numbers, with decimal commas"),
    ),
    "blanks": (_written(_plain(), delimiter=" "), ("separated by blanks",)),
    "several blanks": (
        "\n".join("  ".join(f"{cell:<9}" for cell in row) for row in [NAMES, *_plain()]),
        ("separated by blanks",),
    ),
    "single quotes": (
        "\n".join(",".join(f"'{cell}'" for cell in row) for row in [NAMES, *_plain()]) + "\n",
        ("quoted by single quotes",),
    ),
    "names in a comment": (f"#{_written(_plain())}", ("a line of comments", "what the comment")),
    "names again": (
        _written([*_plain()[:30], NAMES, *_plain()[30:]]),
        ("1 line repeats the column names",),
    ),
    "empty rows": (
        _written([*_plain()[:30], [""] * 5, [""] * 5, *_plain()[30:]]),
        ("2 lines are empty",),
    ),
    "comments in the table": (
        _written([*_plain()[:30], ["# a break"], *_plain()[30:], ["# the end"]]),
        ("2 lines are comments",),
    ),
    "an index without a name": (
        _written([[str(place), *row] for place, row in enumerate(_plain())], ["", *NAMES]),
        ("'Unnamed: 0' numbers or dates the rows",),
    ),
    "the action first": (
        _written([[row[-1], *row[:-1]] for row in _plain()], [NAMES[-1], *NAMES[:-1]]),
        ("'action' is taken for the actions",),
    ),
    "no names": (_written(_plain(), None), ("the first line holds data",)),
    "separators at the ends of rows": (
        _written([[*row, "", ""] for row in _plain()]),
        (),
    ),
    "separators at the ends of some": (
        _written([[*row, *[""] * (place % 3)] for place, row in enumerate(_plain())]),
        (),
    ),
    "several separators at the ends": (
        _written([[*row, "", ""] for row in _plain()], [*NAMES, "", ""]),
        (),
    ),
    "titles": (f"Run 3 from Monday\n\nby hand\n{_written(_plain())}", ("2 lines are titles",)),
    "a title of a spreadsheet": (f"Run 3,,,,\n{_written(_plain())}", ("1 line is a title",)),
    "units below the names": (
        _written([["[m]", "(kg)", "", "-", "[cmd]"], *_plain()]),
        ("1 line says units below the column names",),
    ),
    "ruled lines": (
        _written([["---"] * 5, *_plain(), ["==="] * 5]),
        ("2 lines are ruled lines",),
    ),
    "a table of psql": (
        "\n".join([" | ".join(NAMES), "+".join(["---"] * 5), *map(" | ".join, _plain())]),
        ("separated by bars", "1 line is a ruled line"),
    ),
    "a table of Markdown": (
        "\n".join(f"| {' | '.join(row)} |" for row in [NAMES, [":--:"] * 5, *_plain()]),
        ("separated by bars", "1 line is a ruled line", "blanks around actions"),
    ),
    "files one behind the other": (
        f"\ufeff{_written(_plain()[:30])}\ufeff{_written(_plain()[30:])}",
        ("1 line repeats the column names",),
    ),
    "a comment that has separators": (
        _written([*_plain()[:30], ["# a", "b", "c", "d", "e"], *_plain()[30:]]),
        ("1 line is a comment",),
    ),
    "stamps of ROS": (
        _written(
            [[str(place // 10), str(place % 10), *row] for place, row in enumerate(_plain())],
            ["header.stamp.sec", "header.stamp.nanosec", *NAMES],
        ),
        ("'header.stamp.nanosec' numbers or dates", "'header.stamp.sec' numbers or dates"),
    ),
    "row numbers that are called #": (
        _written([[str(place), *row] for place, row in enumerate(_plain())], ["#", *NAMES]),
        ("a line of comments", "what the comment", "'#' numbers or dates"),
    ),
    "Windows-1252": (
        (_written(_plain()) + "# höhe in °C\n").encode("cp1252"),
        ("read as Windows-1252", "1 line is a comment"),
    ),
    "times in seconds since 1970": (
        _written(
            [[f"17000000{place:02}.5", *row] for place, row in enumerate(_plain())],
            ["received", *NAMES],
        ),
        ("'received' numbers or dates the rows",),
    ),
    "units below the names, without brackets": (
        _written([["m", "kg", "", "", "cmd"], *_plain()]),
        ("1 line holds words where all others hold numbers",),
    ),
    "types below the names": (
        _written([["float", "int", "bool", "string", "string"], *_plain()]),
        ("1 line holds words where all others hold numbers",),
    ),
    "other names amid the table": (
        _written([*_plain()[:30], ["a", "b", "c", "d", "e"], *_plain()[30:]]),
        ("1 line holds words where all others hold numbers",),
    ),
    "groups above the names": (f"pose,,sensors,,\n{_written(_plain())}", ("1 line is a title",)),
    "groups that are repeated": (
        f"pose,pose,sensors,sensors,action\n{_written(_plain())}",
        ("1 line is a title",),
    ),
    "text below the table": (
        f"{_written(_plain())}\nExported by Tool 3.2 on 2026-01-01\nNote:,by hand\n",
        ("2 lines are text below the table",),
    ),
    "the count of psql": (
        "\n".join([" | ".join(NAMES), "+".join(["---"] * 5), *map(" | ".join, _plain())])
        + "\n(60 rows)\n",
        ("separated by bars", "1 line is a ruled line", "1 line is text below the table"),
    ),
    "a separator behind the last name": (_written(_plain(), [*NAMES, ""]), ()),
    "the end of a file of DOS": (f"{_written(_plain())}\x1a", ()),
    "hexadecimal numbers": (
        _written(_each(lambda column, cell: hex(int(cell)) if column == 1 else cell)),
        ("'load' is read as numbers, which are hexadecimal",),
    ),
    "a long remark in a cell": (
        _written(
            [[f"{place}: {'a' * 200_000}", *row] for place, row in enumerate(_plain())],
            ["said", *NAMES],
        ),
        ("'said' holds 60 different texts",),
    ),
    "utf-32": (_written(_plain()).encode("utf-32"), ()),
    "utf-16 without a mark": (_written(_plain()).encode("utf-16-le"), ()),
    "utf-16 of another order without a mark": (_written(_plain()).encode("utf-16-be"), ()),
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
    assert read.account.read == ROWS
    assert not read.account.missing


def _decoded(content: str | bytes, dialect: str) -> str:
    """The text of a table."""
    if isinstance(content, str):
        return content.replace("\ufeff", "").removesuffix("\x1a")
    if dialect == "Windows-1252":
        return content.decode("cp1252")
    for encoding in ("utf-32", "utf-16"):
        if dialect.startswith(encoding):
            order = {
                "utf-16 without a mark": "-le",
                "utf-16 of another order without a mark": "-be",
            }
            return content.decode(encoding + order.get(dialect, ""))
    return content.decode("utf-8-sig")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_line_of_a_table_has_a_place_in_its_account(dialect: str, tmp_path: Path) -> None:
    content, _ = DIALECTS[dialect]
    read = _read(tmp_path, content)
    text = _decoded(content, dialect)
    before = sum(line.startswith(("#", "sep=")) for line in text.splitlines()[:2])
    empty = text.count("\n\n")
    names = dialect not in {"no names", "names in a comment", "row numbers that are called #"}
    assert read.account is not None
    assert read.account.stated == len(text.splitlines()) - before - names - empty
    assert read.account.stated == read.account.read + sum(read.account.left_out.values())


@pytest.mark.parametrize(
    ("end", "notes"), [("le", 1), ("left", 0), ("back", 0), ("left\n", 0), ("le\n", 0)]
)
def test_a_last_word_that_may_be_cut_off_is_noted(tmp_path: Path, end: str, notes: int) -> None:
    read = _read(tmp_path, f"x,action\n1,left\n2,go\n3,left\n4,{end}")
    assert len([one for one in read.notes if "may be the beginning" in one]) == notes


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,action\n1,go\ninf,turn\n", "line 3: column 'x' holds 'inf': write a number"),
        ("<!DOCTYPE html>\n<html></html>\n", "is HTML or XML"),
        ("x,action\n1,前進\n2,go\n".encode("shift_jis"), "is not UTF-8"),
        ("x,action\n1,Привет\n2,go\n".encode("cp1251"), "is not UTF-8"),
        ("x,action\n1,go\n".encode("utf-16")[:-1], "ends inside of a character"),
    ],
)
def test_what_is_no_table_as_it_stands_is_called_what_it_is(
    tmp_path: Path, text: str | bytes, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        _read(tmp_path, text)


def test_names_that_recur_stand_behind_those_of_their_groups(tmp_path: Path) -> None:
    read = _read(tmp_path, "pose,,goal,,\nx,y,x,y,action\n1,2,3,4,go\n5,6,7,8,turn\n")
    names = [feature.name for feature in read.demonstration.features]
    assert names == ["pose.x", "pose.y", "goal.x", "goal.y"]
    assert read.demonstration.actions == ("go", "turn")


@pytest.mark.parametrize(
    "rows",
    [
        # Sensors that fail, a last row that was cut off, and words in a single column.
        ["1,2,go", "3,4,stop", "ERR,ERR,stop", "5,6,go"],
        ["1,2,go", "3,4,stop", "ERR,4,halt", "5,6,go"],
    ],
)
def test_rows_with_words_in_place_of_numbers_are_rows(rows: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, "\n".join(["x,y,a", *rows]) + "\n")
    assert len(read.demonstration) == 4
    assert not any("holds words" in note for note in read.notes)


@pytest.mark.parametrize("last", ["gre", "green", "3.", "3,4"])
def test_a_last_row_that_was_cut_off_is_no_text_below_the_table(last: str, tmp_path: Path) -> None:
    rows = ["1,2,go", "3,4,stop"] if last[0] == "3" else ["green,2,go", "red,4,stop"]
    with pytest.raises(InputError, match="if it was cut off"):
        _read(tmp_path, "\n".join(["x,y,a", *rows, last]))


def test_texts_that_nobody_could_read_are_no_feature(tmp_path: Path) -> None:
    long = "a" * 2000
    read = _read(tmp_path, f"x,said,a\n1,{long},go\n2,{long},turn\n")
    assert [feature.name for feature in read.demonstration.features] == ["x"]
    assert read.notes == ("column 'said' holds texts of up to 2000 characters, and is no feature",)


@pytest.mark.parametrize("name", ["label", "Command", "class"])
def test_a_column_that_is_called_like_labels_and_is_not_the_last_is_noted(
    name: str, tmp_path: Path
) -> None:
    read = _read(tmp_path, f"{name},x,color\n" + "go,1,red\nturn,2,blue\n" * 4)
    assert read.demonstration.actions == ("blue", "red")
    assert f"{name!r} is a feature: name the label column if it is that one" in read.notes[0]


@pytest.mark.parametrize(("separator", "called"), [("\uff0c", "commas"), ("\uff1b", "semicolons")])
def test_wide_separators_are_separators(separator: str, called: str, tmp_path: Path) -> None:
    read = _read(tmp_path, "x,y,动作\n1,2,前进\n3,4,停止\n".replace(",", separator))
    assert read.demonstration.states.tolist() == [[1, 2], [3, 4]]
    assert f"cells are separated by wide {called}" in read.notes


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
        (["1.234.567", "312"], [1_234_567, 312]),
        (["\u22120.5", "0.25"], [-0.5, 0.25]),
        (["\u22121,5 m", "2 m"], [-1.5, 2]),
        (["(0.5)", "0.25", "(1,250.5)"], [-0.5, 0.25, -1250.5]),
        (["(5 m)", "2 m"], [-5, 2]),
        (["1,23,456", "12,34,56,789.5", "1,207"], [123456, 123456789.5, 1207]),
        (["€ 0,5", "€12,25", "-€ 3"], [0.5, 12.25, -3]),
        (["$1,207.50", "$5", "($2)"], [1207.5, 5, -2]),
        (['="0.5"', '="-2"'], [0.5, -2]),
        (["٠٫٥", "١٢"], [0.5, 12]),
        (["１．５", "－２"], [1.5, -2]),
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
    said = any("is taken as text, not as numbers" in note for note in read.notes)
    assert said == (cells != ["a1", "a2"])


def test_a_point_behind_a_zero_parts_no_thousands(tmp_path: Path) -> None:
    read = _read(tmp_path, "dist;load;a\n1.250;0,5;go\n0.750;12,25;turn\n")
    assert read.demonstration.states.tolist() == [[1.25, 0.5], [0.75, 12.25]]


@pytest.mark.parametrize("cell", ["#DIV/0!", "#WERT!", "#NAME?", "#NV", "########", "Err:502"])
@pytest.mark.parametrize("column", [0, 2, 3, 4])
def test_formulas_that_failed_are_missing_values_and_no_comments(
    cell: str, column: int, tmp_path: Path
) -> None:
    rows = _plain()
    for place in (7, 11):
        rows[place][column] = cell
    read = _read(tmp_path, _written(rows))
    plain = _read(tmp_path, _written(_plain())).demonstration
    assert read.demonstration.features == plain.features
    assert read.account is not None
    if column == 4:
        assert read.notes == ("2 of 60 rows have no action and are left out",)
        assert read.account.left_out == {"have no action": 2}
        return
    assert np.argwhere(np.isnan(read.demonstration.states)).tolist() == [[7, column], [11, column]]
    # In all languages #N/A says that there is no value, not that something has failed.
    said = [f"cells of column {NAMES[column]!r} that say {cell!r} are missing values"]
    assert list(read.notes) == ([] if cell == "#NV" else said)


@pytest.mark.parametrize(
    ("stand_in", "others", "noted"),
    [
        ("-999", "{:.2f}", True),
        ("9999.0", "{:.2f}", True),
        ("1e30", "{:.2f}", True),
        ("-2147483648", "{:.0f}", True),
        # The largest range of a scanner, a round number, and one like the others.
        ("30.0", "{:.2f}", False),
        ("1000", "{:.2f}", False),
        ("999", "{:.0f}00", False),
    ],
)
def test_a_number_that_may_stand_for_none_is_noted_and_stays(
    stand_in: str, others: str, noted: bool, tmp_path: Path
) -> None:
    cells = [stand_in if place % 5 == 4 else others.format(place / 4) for place in range(40)]
    rows = [[cell, ("go", "turn")[place % 2]] for place, cell in enumerate(cells)]
    read = _read(tmp_path, _written(rows, ["x", "action"]))
    assert read.demonstration.states[:, 0].tolist() == list(map(float, cells))
    assert ["8 times, far from all else" in note for note in read.notes] == [True] * noted


@pytest.mark.parametrize(
    "rows",
    [
        ["red,0.134,go", "green,0.5,turn", "red,0.7,go"],
        ["red,0.134,go", "green,0.5,turn", "blue,0.7,turn"],
        ["red,3,go", "green,5,turn", "blue,7,go"],
        ["red,0.134 m,go", "green,0.5 m,turn", "blue,0.7 m,go"],
        ["red;0,134;go", "green;0,5;turn", "blue;0,7;go"],
        ["red,13%,go", "green,50 %,turn", "blue,70%,go"],
        ["False,a,go", "True,b,turn", "False,a,go"],
        ["no,a,go", "yes,b,turn", "no,a,go"],
        ["red,a,go", "green,b,turn", "red,b,go", "green,a,turn", "red,a,turn"],
        ["NA,0.5,go", "0.5,0.25,turn", "0.75,0.5,go"],
    ],
)
def test_a_first_row_of_data_is_no_line_of_names(rows: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, "\n".join(rows) + "\n")
    assert len(read.demonstration) == len(rows)
    assert [one.name for one in read.demonstration.features] == ["x0", "x1"]
    assert any(note.startswith("the first line holds data") for note in read.notes)


@pytest.mark.parametrize(
    "lines",
    [
        ["color,action", "red,go", "green,turn", "color,action", "red,turn"],
        ["color,on,action", "red,on,go", "green,off,turn"],
        ["color,on,action", "red,1,go", "green,0,turn"],
        ["date,color,action", "2026-01-02,red,go", "2026-01-03,green,turn"],
        ["y,t,action", "y,t,go", "n,f,turn"],
        ["width 5 m,action", "1 m,go", "2 m,go"],
        ["docked,action", "True,go", "False,stop"],
    ],
)
def test_names_above_words_and_amounts_are_no_data(lines: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, "\n".join(lines) + "\n")
    assert not any("first line holds data" in note for note in read.notes)


@pytest.mark.parametrize("names", ["color,dist,action", "0,1,action", "dist,2nd,action"])
def test_names_are_no_data(names: str, tmp_path: Path) -> None:
    read = _read(tmp_path, f"{names}\n0.5,0.7,go\n0.25,0.3,turn\n")
    assert len(read.demonstration) == 2


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("2020,2021,action\n5,6,go\n7,8,turn\n", ["2020", "2021"]),
        ("# by hand\n# dist,load,action\n0.5,6,go\n0.7,8,turn\n", ["dist", "load"]),
        ("# place,color,action\nhall,red,go\nhall,blue,turn\nyard,red,go\n", ["place", "color"]),
        (",dist,,action\n3,0.5,6,go\n1,0.7,8,turn\n", ["Unnamed: 0", "dist", "x2"]),
    ],
)
def test_columns_are_called_what_the_file_says(text: str, names: list[str], tmp_path: Path) -> None:
    read = _read(tmp_path, text)
    found = [feature.name for feature in read.demonstration.features]
    assert found == [name for name in names if name != "Unnamed: 0"]
    assert read.notes


def test_names_that_a_spreadsheet_broke_into_lines_are_of_one_line(tmp_path: Path) -> None:
    read = _read(tmp_path, '"dist\r\n[m]",load,action\n0.5,6,go\n0.7,8,turn\n')
    assert [feature.name for feature in read.demonstration.features] == ["dist [m]", "load"]


@pytest.mark.parametrize(
    ("name", "cells"),
    [
        ("t", "0.1,0.2,0.3"),
        ("Time (s)", "0.1,0.2,0.2,0.3"),
        ("time_ns", "100,200,300"),
        ("header.stamp", "1.5,1.6,1.7"),
        ("id", "7,8,9"),
        ("frame_id", "0,1,2"),
        ("field.header.seq", "0,1,2"),
        ("row", "3,4,7"),
        ("date", "20260101,20260102,20260103"),
    ],
)
def test_columns_that_rise_number_the_rows_if_their_names_say_so(
    name: str, cells: str, tmp_path: Path
) -> None:
    def features(column: str, values: list[str]) -> list[str]:
        rows = [[value, str(place % 2), "go"] for place, value in enumerate(values)]
        read = _read(tmp_path, _written(rows, [column, "x", "a"]))
        return [feature.name for feature in read.demonstration.features]

    rising = cells.split(",")
    assert features(name, rising) == ["x"]
    assert features(name, rising[::-1]) == [name, "x"]
    assert features("dist", rising) == ["dist", "x"]


@pytest.mark.parametrize("cells", ["0,0,1,1,2", "run_b,run_b,run_a,run_c,run_c", "7,7,7,7,7"])
@pytest.mark.parametrize(
    "name", ["episode", "Trial", "demo_id", "run id", "traj.index", "bag_name"]
)
def test_what_says_to_which_demonstration_a_row_belongs_is_no_feature(
    name: str, cells: str, tmp_path: Path
) -> None:
    rows = [[cell, str(x), "go"] for x, cell in enumerate(cells.split(","))]
    read = _read(tmp_path, _written(rows, [name, "x", "a"]))
    assert [feature.name for feature in read.demonstration.features] == ["x"]
    [note] = read.notes
    if cells == "7,7,7,7,7":
        assert (
            note == f"column {name!r} says to which demonstration a row belongs and is no feature"
        )
        assert read.demonstrations() == (read.demonstration,)
    else:
        values = list(dict.fromkeys(cells.split(",")))
        assert note == (
            f"column {name!r} splits the rows into 3 demonstrations, {values[0]!r} to "
            f"{values[-1]!r}, and is no feature"
        )
        shown = read.demonstrations()
        assert [one.name.partition("#")[2] for one in shown] == values
        assert [len(one) for one in shown] == [cells.split(",").count(one) for one in values]


@pytest.mark.parametrize(
    ("name", "cells"),
    [
        ("episode", "0,1,0,1,1"),
        ("run", "0,0,1,1,1"),
        ("session", "1,1,2,2,2"),
        ("trial_length", "1,1,2,2,2"),
        ("bagged", "0,0,1,1,1"),
        ("demo", ",1,1,1,2"),
    ],
)
def test_what_comes_back_or_is_called_otherwise_is_a_feature(
    name: str, cells: str, tmp_path: Path
) -> None:
    rows = [[cell, str(x), "go"] for x, cell in enumerate(cells.split(","))]
    read = _read(tmp_path, _written(rows, [name, "x", "a"]))
    assert [feature.name for feature in read.demonstration.features] == [name, "x"]


@pytest.mark.parametrize("sign", ["-", "--", "?"])
def test_a_sign_in_place_of_an_action_is_named(sign: str, tmp_path: Path) -> None:
    read = _read(tmp_path, f"x,a\n1,go\n2,{sign}\n3,turn\n")
    assert read.notes[0] == f"{sign!r} is taken for no action: write it out if it is one"
    assert read.account is not None
    assert read.account.left_out == {"have no action": 1}


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("words", [("ERR",), ("no target", "out of range"), ("OL", "uncal", "off")])
def test_a_few_words_among_numbers_are_missing_values_however_often_they_stand_there(
    words: tuple[str, ...], share: float, tmp_path: Path
) -> None:
    count = int(30 / (1 - share))
    rows = [
        [words[x % len(words)] if x < share * count else f"{x}.5", "go" if x % 3 else "turn"]
        for x in range(count)
    ]
    read = _read(tmp_path, _written(rows, ["x", "a"]))
    assert read.demonstration.features[0].kind is FeatureKind.NUMERIC
    missing = sum(row[0] in words for row in rows)
    assert np.isnan(read.demonstration.states[:, 0]).sum() == missing
    assert f"{missing} cells hold no number" in read.notes[0]


def test_the_largest_numbers_are_compared_without_a_warning(tmp_path: Path) -> None:
    rows = [["1e308" if x % 2 else "-1e308", str(x), "go"] for x in range(6)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="must lie within"):
            _read(tmp_path, _written(rows, ["d", "x", "a"]))


@pytest.mark.parametrize("name", ["row", "n", "id", "step", "goal_index"])
def test_what_stays_from_a_row_to_the_next_does_not_count_rows(name: str, tmp_path: Path) -> None:
    read = _read(tmp_path, f"{name},x,a\n1,5,go\n2,6,go\n2,7,turn\n3,8,go\n4,8,go\n")
    assert [feature.name for feature in read.demonstration.features] == [name, "x"]


@pytest.mark.parametrize(
    "cells", ["01/02/26,13/02/26", '"Jan 5, 2026","Feb 6, 2026"', "5 Jan 2026,NaT", "5-Jan-26,"]
)
def test_dates_are_known_however_they_are_written(cells: str, tmp_path: Path) -> None:
    rows = "".join(f"{cell},{place},go\n" for place, cell in enumerate(next_cells(cells)))
    read = _read(tmp_path, f"when,x,a\n{rows}")
    assert [feature.name for feature in read.demonstration.features] == ["x"]


def next_cells(line: str) -> list[str]:
    """The cells of a line, quoted again."""
    return [f'"{cell}"' for cell in next(csv.reader([line]))]


@pytest.mark.parametrize("word", ["None", "?", "#N/A", "unknown", "NaT"])
def test_words_for_no_value_are_missing_among_numbers_however_many(
    word: str, tmp_path: Path
) -> None:
    rows = [[str(x), "go"] for x in range(5)] + [[word, "turn"]] * 20
    read = _read(tmp_path, _written(rows, ["x", "a"]))
    assert read.demonstration.features[0].kind is FeatureKind.NUMERIC
    assert np.isnan(read.demonstration.states[5:]).all()


def test_a_text_that_says_none_is_a_text(tmp_path: Path) -> None:
    read = _read(tmp_path, "held,a\nnone,go\ncup,turn\nnone,go\n")
    assert read.demonstration.features[0].categories == ("cup", "none")


def test_actions_that_may_be_none_are_noted(tmp_path: Path) -> None:
    read = _read(tmp_path, "x,a\n1,GO\n2,go\n3,None\n4,turn\n5,GO\n")
    assert len(read.demonstration) == 5
    assert read.notes == ("'None' is taken for an action: leave cells without one empty",)


def test_a_last_column_of_numbers_beside_words_is_noted(tmp_path: Path) -> None:
    read = _read(tmp_path, "do,x,docked\ngo,0.5,1\nturn,0.7,0\ngo,0.5,1\nturn,0.9,0\n")
    assert read.demonstration.actions == ("0", "1")
    assert "'do' holds words" in read.notes[0]


@pytest.mark.parametrize(
    ("names", "rows", "note"),
    [
        (
            "label,x,docked",
            ["go,1,True", "turn,2,False"] * 4,
            "it is the last, but holds truths, and",
        ),
        ("do,x,docked", ["go,1,1", "turn,2,0"] * 4, "it is the last, but holds numbers, and 'do'"),
        ("x,y,speed", [f"1,2,0.{place}1" for place in range(100)], "100 different actions in 100"),
    ],
)
def test_a_last_column_that_hardly_holds_actions_is_noted(
    names: str, rows: list[str], note: str, tmp_path: Path
) -> None:
    read = _read(tmp_path, "\n".join([names, *rows]))
    assert any(note in one for one in read.notes), read.notes


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("x,y,a\n1,2,go\n3,4", "2 cells where 3 were expected, as on line 1: complete the line"),
        ("Run 3, May\nx,y,a\n1,2,go\n", "remove lines above the names"),
        ("x;y;a\n1;2;go\n1;2;3;go\n", "quote cells that contain what separates cells"),
        ('[{"x": 1,\n"action": "go"}]\n', "is JSON, and no table"),
        ('{"x": 1, "action": "go"}\n', "is JSON, and no table"),
    ],
)
def test_why_something_is_no_table_is_true(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=why):
        _read(tmp_path, text)


def test_colors_and_tags_are_no_comments(tmp_path: Path) -> None:
    read = _read(tmp_path, "tag,x,a\n#1,1,go\nred,2,turn\n#1,3,go\nred,4,go\n")
    assert len(read.demonstration) == 4


@pytest.mark.parametrize(
    ("text", "states"),
    [
        ("x;y;a\n1,107;0,5;go\n2,212;0,25;turn\n", [[1.107, 0.5], [2.212, 0.25]]),
        ("x;y;a\n1,107;3;go\n2,212;4;turn\n", [[1.107, 3], [2.212, 4]]),
        ("x;y;a\n1,107;0.5;go\n2,212;0.25;turn\n", [[1107, 0.5], [2212, 0.25]]),
        ('x,y,a\n"1,107","0,5",go\n"2,212","0,25",turn\n', [[1.107, 0.5], [2.212, 0.25]]),
        ('x,y,a\n"1,107",3,go\n"2,212",4,turn\n', [[1107, 3], [2212, 4]]),
    ],
)
def test_a_comma_before_three_digits_is_what_it_is_in_the_rest_of_the_table(
    text: str, states: list[list[float]], tmp_path: Path
) -> None:
    read = _read(tmp_path, text)
    assert read.demonstration.states.tolist() == states
    assert any("'x' is read as numbers" in note for note in read.notes)


def test_integers_that_are_rounded_are_noted(tmp_path: Path) -> None:
    read = _read(tmp_path, f"x,y,a\n{2**60 + 1},{2**60},go\n3,4,turn\n")
    assert [note for note in read.notes if "rounded" in note] == [
        f"column 'x' holds integers such as {2**60 + 1}, which are rounded"
    ]
    # The first one that is rounded, to the largest one that is not.
    read = _read(tmp_path, f"x,y,a\n{2**53 + 1},{2**53},go\n3,4,turn\n")
    assert [note for note in read.notes if "rounded" in note] == [
        f"column 'x' holds integers such as {2**53 + 1}, which are rounded"
    ]


def test_a_number_may_have_thousands_of_digits(tmp_path: Path) -> None:
    read = _read(tmp_path, f"x,a\n{'0' * 5000}7,go\n-{'0' * 5000}{2**60 + 1},turn\n")
    assert read.demonstration.states[:, 0].tolist() == [7.0, -(2.0**60)]
    assert any("which are rounded" in note for note in read.notes)
    for zeros in ("0" * 5000, ""):
        with pytest.raises(InputError, match=r"must lie within ±1e\+38"):
            _read(tmp_path, f"x,a\n{zeros}{'9' * 5000},go\n3,turn\n")


def test_why_there_is_no_feature_is_said(tmp_path: Path) -> None:
    text = "".join(f"1_{place}00,go\n" for place in range(10, 40))
    with pytest.raises(InputError, match=r"feature \(column 'x' holds 30 different texts"):
        _read(tmp_path, f"x,a\n{text}")


def test_points_part_thousands_where_other_columns_have_decimal_commas(tmp_path: Path) -> None:
    read = _read(tmp_path, "dist;load;a\n0,5;1.234;go\n0,75;312;turn\n")
    assert read.demonstration.states.tolist() == [[0.5, 1234], [0.75, 312]]
    assert any("'load' is read as numbers, without their points" in note for note in read.notes)


def test_what_is_no_feature_in_a_table_is_none_in_the_others(tmp_path: Path) -> None:
    dates = tmp_path / "dates.csv"
    numbers = tmp_path / "numbers.csv"
    dates.write_text("when,x,a\n19:25,5,go\n19:26,6,go\n19:27,7,turn\n")
    numbers.write_text("when,x,a\n3,5,go\n2,6,go\n1,7,turn\n")
    loaded = load([dates, numbers])
    assert all(
        [feature.name for feature in one.features] == ["x"] and one.states.shape == (3, 1)
        for one in loaded.demonstrations
    )
    assert any("numbers.csv: no feature in every table" in note for note in loaded.notes)


@pytest.mark.parametrize("name", ["row", "t", "id", "goal_index"])
def test_what_only_happens_to_rise_in_a_table_is_a_feature_in_all(
    name: str, tmp_path: Path
) -> None:
    rising = tmp_path / "rising.csv"
    other = tmp_path / "other.csv"
    rising.write_text(f"{name},x,a\n1,5,go\n2,6,go\n3,7,turn\n")
    other.write_text(f"{name},x,a\n3,5,go\n2,6,go\n1,7,turn\n")
    loaded = load([rising, other])
    assert [one.states[:, 0].tolist() for one in loaded.demonstrations] == [[1, 2, 3], [3, 2, 1]]
    assert [one.features[0].name for one in loaded.demonstrations] == [name, name]
    assert loaded.notes == ()


def test_what_numbers_the_rows_of_every_table_is_no_feature_because_of_a_short_one(
    tmp_path: Path,
) -> None:
    paths = [tmp_path / "long.csv", tmp_path / "short.csv"]
    paths[0].write_text("id,x,a\n1,5,go\n2,6,go\n3,7,turn\n")
    paths[1].write_text("id,x,a\n4,5,go\n5,6,turn\n")
    loaded = load(paths)
    assert [[f.name for f in one.features] for one in loaded.demonstrations] == [["x"], ["x"]]


def test_so_many_texts_are_no_feature_that_memory_stays_linear(tmp_path: Path) -> None:
    rows = [[str(row % 7), f"n{row % 1500}", "go"] for row in range(4000)]
    read = _read(tmp_path, _written(rows, ["x", "c", "a"]))
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert any("'c' holds 1500 different texts" in note for note in read.notes)


def _merged(*rows: str) -> str:
    return "\n".join(("t,x,door,action", *rows)) + "\n"


def test_where_topics_have_rows_of_their_own_the_state_above_an_action_counts(
    tmp_path: Path,
) -> None:
    text = _merged("0,1,,", "1,,open,", "2,,,go", "3,2,,", "4,,,stop", "5,,shut,", "6,,,go")
    read = _read(tmp_path, text)
    assert [feature.name for feature in read.demonstration.features] == ["x", "door"]
    assert read.demonstration.states.tolist() == [[1, 0], [2, 0], [2, 1]]
    assert "has the last values above it of 'x', 'door'" in " ".join(read.notes)
    assert not any("is empty" in note for note in read.notes)
    # Before the first one there is none.
    early = _read(tmp_path, _merged("0,,,go", "1,1,open,", "2,,,stop", "3,,,go"))
    assert np.isnan(early.demonstration.states[0]).all()
    # A row with both tells that empty cells are missing values.
    both = _read(tmp_path, _merged("0,1,,", "1,,open,", "2,3,,go", "3,2,,", "4,,,stop"))
    assert both.demonstration.states[0].tolist()[:2] == [2, 3]
    assert not any("last values above" in note for note in both.notes)


@pytest.mark.parametrize(
    ("stamps", "said", "first"),
    [
        ((1_700_000_000, 1_700_000_002), "seconds since 1970", 1_700_000_000_000_000_000),
        ((1_700_000_000_000,), "milliseconds since 1970", 1_700_000_000_000_000_000),
        ((1_700_000_000_000_000,), "microseconds since 1970", 1_700_000_000_000_000_000),
        ((1_700_000_000_000_000_000,), "", 1_700_000_000_000_000_000),
        ((0, 1_700_000_000), "", 0),
        ((5, 6, 7), "", 5),
    ],
)
def test_stamps_are_read_in_the_unit_that_their_size_says(
    stamps: tuple[int, ...], said: str, first: int, tmp_path: Path
) -> None:
    rows = [[str(stamp), str(place), "go"] for place, stamp in enumerate(stamps)]
    read = _read(tmp_path, _written(rows, ["stamp", "x", "a"]))
    assert read.demonstration.stamps[0] == first
    assert list(read.notes) == ([f"column 'stamp' is read as {said}"] if said else [])


def test_stamps_that_fall_are_noted_but_not_where_a_demonstration_begins(tmp_path: Path) -> None:
    def notes(name: str) -> list[str]:
        rows = [[str(e), str(t), str(t % 2), "go"] for e in range(3) for t in (0, 2, 4)]
        read = _read(tmp_path, _written(rows, [name, "stamp", "x", "a"]))
        return [one for one in read.notes if "falls" in one]

    assert notes("episode") == []
    [note] = notes("y")
    assert note.startswith("column 'stamp' falls 2 times from a row to the next")


@pytest.mark.parametrize("label", ["action", "cmd"])
def test_what_says_the_action_in_other_words_is_no_feature(label: str, tmp_path: Path) -> None:
    rows = [[str(x), str(x % 3), "abc"[x % 3], "abc"[x % 3]] for x in range(9)]
    read = _read(tmp_path, _written(rows, ["x", f"{label}_id", "command", label]))
    # What a person commanded may well be what the robot acts by.
    assert [feature.name for feature in read.demonstration.features] == ["x", "command"]
    assert f"column '{label}_id' says what the action is and is no feature" in read.notes
    rows[0][1] = "2"
    read = _read(tmp_path, _written(rows, ["x", f"{label}_id", "command", label]))
    assert [one.name for one in read.demonstration.features] == ["x", f"{label}_id", "command"]


def test_a_column_that_holds_the_actions_word_for_word_is_noted_or_no_feature(
    tmp_path: Path,
) -> None:
    rows = [[str(x), "abc"[x % 3], "abc"[x % 3]] for x in range(9)]
    read = _read(tmp_path, _written(rows, ["x", "label", "action"]))
    assert [one.name for one in read.demonstration.features] == ["x"]
    read = _read(tmp_path, _written(rows, ["x", "command", "action"]))
    assert [one.name for one in read.demonstration.features] == ["x", "command"]
    assert any("'command' holds the action of each row, word for word" in n for n in read.notes)


def test_what_nobody_sees_makes_no_other_actions(tmp_path: Path) -> None:
    text = "x,action\n1,f\u00e4hrt\n2,fa\u0308hrt\n3,f\u00e4hrt\u200b\n4\u200b,h\u00e4lt\n"
    for end in ("\n", "\r\n", "\u2028", "\x85"):
        read = _read(tmp_path, text.replace("\n", end))
        assert read.demonstration.actions == ("f\u00e4hrt", "h\u00e4lt")
        assert read.demonstration.states[:, 0].tolist() == [1, 2, 3, 4]
        assert [note for note in read.notes if "nobody sees" in note]
        assert [note for note in read.notes if "accents" in note]


def test_a_column_for_each_action_is_noted(tmp_path: Path) -> None:
    rows = [[str(x), *(str(int(x % 3 == one)) for one in range(3))] for x in range(9)]
    [note, *_] = _read(tmp_path, _written(rows, ["x", "go", "turn", "stop"])).notes
    assert note.startswith("each row has a single 1 in 'go', 'turn', 'stop', of which the last is")
    rows[0][1] = "0"
    notes = _read(tmp_path, _written(rows, ["x", "go", "turn", "stop"])).notes
    assert not any("single 1" in note for note in notes)


def test_what_is_known_after_the_action_is_noted(tmp_path: Path) -> None:
    rows = [[str(x), str(x % 2), str(x % 4), "go"] for x in range(9)]
    notes = _read(tmp_path, _written(rows, ["x", "reward", "next_x", "a"])).notes
    assert [note.split("'")[1] for note in notes] == ["reward", "next_x"]
    assert all("known only after the action" in note for note in notes)
