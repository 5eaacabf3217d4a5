"""Many inputs on the command line: what is set aside is listed, and what was read is kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rebt_ros.commands import learn, replay


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    """Two tables, and one without rows."""
    directory = tmp_path / "tables"
    directory.mkdir()
    for number in range(2):
        rows = (f"{x / 7},{'left' if x < 10 else 'right'}" for x in range(20))
        (directory / f"{number}.csv").write_text("\n".join(("front,action", *rows)) + "\n")
    (directory / "broken.csv").write_text("front,action\n")
    return directory


def test_what_cannot_be_read_is_listed_with_its_path_and_reason(
    tables: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    learn.main([str(tables), "--out", str(out), "--cache", str(cache)])
    told = capsys.readouterr()
    broken = str(tables / "broken.csv")
    (aside,) = json.loads((out / "summary.json").read_text())["set_aside"]
    assert aside["path"] == broken
    assert told.err.startswith("set aside 1 input that cannot be read (--strict refuses such):\n")
    assert aside["reason"] in told.err
    assert broken in told.err
    assert len(list(cache.rglob("*.columns"))) == 2
    replay.main([str(out / "tree.json"), str(tables / "*.csv"), "--no-cache"])
    told = capsys.readouterr()
    assert told.out.startswith("40 rows\n")
    assert broken in told.err


def test_strict_refuses_what_cannot_be_read(
    tables: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        learn.main([str(tables), "--out", str(out), "--no-cache", "--strict"])
    assert ended.value.code == 1
    assert str(tables / "broken.csv") in capsys.readouterr().err
    assert not out.exists()


def test_the_tree_is_the_same_from_the_cache(tables: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    for name in ("first", "second"):
        learn.main([str(tables), "--out", str(tmp_path / name), "--cache", str(cache)])
    first, second = ((tmp_path / name / "tree.json").read_bytes() for name in ("first", "second"))
    assert first == second


def test_what_was_read_before_is_counted_and_a_long_list_is_cut(
    tables: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in range(24):
        (tables / f"broken_{number}.csv").write_text("front,action\n")
    out = tmp_path / "out"
    arguments = [str(tables), "--out", str(out), "--cache", str(tmp_path / "cache")]
    learn.main(arguments)
    told = capsys.readouterr().err
    assert told.count("broken_") == 19
    assert "\n  and 5 more: learn lists all of them in summary.json\n" in told
    assert len(json.loads((out / "summary.json").read_text())["set_aside"]) == 25
    assert "from the cache" not in told
    learn.main(arguments)
    assert "\n27 inputs: 2 from the cache, 0 read, 25 set aside\n" in capsys.readouterr().err
