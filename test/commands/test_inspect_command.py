"""The command `inspect`: a table in the terminal, JSON, and a page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from rebt_ros.commands import inspect
from rebt_ros.inspection.inspection import json_schema


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    """Three tables, two of which are the same, and one without rows."""
    directory = tmp_path / "tables"
    directory.mkdir()
    for name, width in (("a", 10), ("b", 10), ("c", 7)):
        rows = (f"{x * 100_000_000},{x / 7},{'go' if x < width else 'turn'}" for x in range(20))
        text = "\n".join(("stamp,front,action", *rows)) + "\n"
        (directory / f"{name}.csv").write_text(text)
    (directory / "broken.csv").write_text("stamp,front,action\n")
    return directory


def test_a_table_is_printed_and_all_of_it_written(
    tables: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found, page = tmp_path / "found.json", tmp_path / "new" / "found.html"
    inspect.main([str(tables), "--json", str(found), "--html", str(page), "--no-cache"])
    told = capsys.readouterr()
    lines = told.out.splitlines()
    start = next(place for place, line in enumerate(lines) if line.startswith("demonstration"))
    assert lines[start : start + 4] == [
        "demonstration  rows  seconds   rate  gaps  idle  constant  contradicting  actions",
        "a.csv            20      1.9  10 Hz     0     0         0              3  go 10, turn 10",
        "b.csv            20      1.9  10 Hz     0     0         0              3  go 10, turn 10",
        "c.csv            20      1.9  10 Hz     0     0         0              3  turn 13, go 7",
    ]
    assert "  b.csv: near-duplicate of a.csv (100.0% of the rows are alike)" in lines
    assert str(tables / "broken.csv") in told.err
    written = json.loads(found.read_text(encoding="utf-8"))
    Draft202012Validator(json_schema()).validate(written)
    assert [one["path"] for one in written["demonstrations"]] == [
        str(tables / f"{name}.csv") for name in "abc"
    ]
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_time_that_makes_no_sense_is_said_in_a_sentence(
    tables: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        inspect.main([str(tables), "--idle", "0", "--no-cache"])
    assert ended.value.code == 1
    assert (
        capsys.readouterr()
        .err.splitlines()[-1]
        .startswith("inspect: the time of an idle stretch must be above 0")
    )
