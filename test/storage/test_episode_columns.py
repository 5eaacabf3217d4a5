"""A table with a column that tells demonstrations is split into them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rebt_ros
from rebt_ros.commands import inspect, learn
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.storage.input_options import InputOptions, ReadingPlan
from rebt_ros.storage.inputs import Loaded, load
from rebt_ros.storage.read import Read


def _read(directory: Path, text: str, **options: tuple[str, ...] | bool | None) -> Read:
    path = directory / "runs.csv"
    path.write_text(text)
    return read_csv(path, **options)  # type: ignore[arg-type]


def _table(names: str, *rows: str) -> str:
    return "\n".join((names, *rows)) + "\n"


def _of(name: str, cells: str) -> str:
    """A table with a column of this name and with these cells, a feature and actions."""
    rows = (f"{cell},{x % 4},{'go' if x % 4 else 'stop'}" for x, cell in enumerate(cells.split()))
    return _table(f"{name},x,action", *rows)


def _parts(read: Read) -> list[tuple[str, int]]:
    return [tuple(part) for part in read.parts]


@pytest.mark.parametrize(
    ("name", "cells", "parts"),
    [
        ("episode", "0 0 1 1 1 2", [("0", 2), ("1", 3), ("2", 1)]),
        ("Trial", "b b a a", [("b", 2), ("a", 2)]),
        ("demonstration_id", "10 10 30 30 20", [("10", 2), ("30", 2), ("20", 1)]),
        ("episode_index", "1.0 1.0 2.0 2.0", [("1.0", 2), ("2.0", 2)]),
        ("ep_id", "1 1 2 2", [("1", 2), ("2", 2)]),
        ("run", "1 1 2 2 3", [("1", 2), ("2", 2), ("3", 1)]),
        ("run", "run_7 run_7 run_2", [("run_7", 2), ("run_2", 1)]),
        ("file", "a.csv a.csv b.csv", [("a.csv", 2), ("b.csv", 1)]),
        ("source_file", "x/1.mcap x/1.mcap x/2.mcap", [("x/1.mcap", 2), ("x/2.mcap", 1)]),
        # As a spreadsheet writes merged cells.
        ("demo", "1 NA NA 2 NA", [("1", 3), ("2", 2)]),
    ],
)
def test_a_column_splits_a_table_by_its_name_and_values(
    name: str, cells: str, parts: list[tuple[str, int]], tmp_path: Path
) -> None:
    read = _read(tmp_path, _of(name, cells))
    assert _parts(read) == parts
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert name in read.no_features
    [note] = read.notes
    first, last = parts[0][0], parts[-1][0]
    assert note == (
        f"column {name!r} splits the rows into {len(parts)} demonstrations, {first!r} to "
        f"{last!r}, and is no feature"
    )
    shown = read.demonstrations()
    assert [one.name for one in shown] == [f"runs.csv#{name}" for name, _ in parts]
    assert np.array_equal(np.vstack([one.states for one in shown]), read.demonstration.states)


@pytest.mark.parametrize(
    ("name", "cells", "note"),
    [
        ("episode", "0 1 0 1 1", "has values that come back or are missing, and is a feature"),
        ("demo", "NA 1 1 2 2", "has values that come back or are missing, and is a feature"),
        ("run", "0 0 1 1", "has values that do not come back, and is a feature"),
        ("session", "am am pm pm", "has values that do not come back, and is a feature"),
        ("run", "0 1 0 1", None),
        ("runs_left", "3 3 2 2", None),
        ("file", "left left right right", "has values that do not come back, and is a feature"),
    ],
)
def test_where_it_is_not_certain_the_column_is_a_feature_and_a_note_asks(
    name: str, cells: str, note: str | None, tmp_path: Path
) -> None:
    read = _read(tmp_path, _of(name, cells))
    assert [one.name for one in read.demonstration.features] == [name, "x"]
    assert not read.parts
    asked = [one for one in read.notes if "episode column" in one]
    assert len(asked) == (note is not None)
    assert all(f"column {name!r} {note}: name it as an episode column" in one for one in asked)


def test_where_every_row_has_another_number_it_numbers_the_rows(tmp_path: Path) -> None:
    read = _read(tmp_path, _of("trial", "4 5 6 7"))
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert not read.parts
    assert "numbers or dates the rows and is no feature" in read.notes[0]
    asked = _read(tmp_path, _of("trial", "4 5 6 7"), episode_columns=("trial",))
    assert [part.rows for part in asked.parts] == [1, 1, 1, 1]


def test_trials_begin_anew_in_every_session(tmp_path: Path) -> None:
    rows = [f"{s},{t},{x},go" for s in "AB" for t in "12" for x in range(2)]
    read = _read(tmp_path, _table("session_id,trial,x,action", *rows))
    assert _parts(read) == [("A/1", 2), ("A/2", 2), ("B/1", 2), ("B/2", 2)]
    assert read.notes == (
        "columns 'session_id', 'trial' split the rows into 4 demonstrations, 'A/1' to 'B/2', and "
        "are no features",
    )
    rows = [f"{s},{t},{x},go" for s in ("Ann", "Bob") for t in "12" for x in range(2)]
    text = _table("person,trial,x,action", *rows)
    assert not _read(tmp_path, text).parts
    named = _read(tmp_path, text, episode_columns=("person", "trial"))
    assert [part.name for part in named.parts] == ["Ann/1", "Ann/2", "Bob/1", "Bob/2"]
    assert [one.name for one in named.demonstration.features] == ["x"]


def test_a_named_column_that_does_not_tell_is_refused_with_the_line(tmp_path: Path) -> None:
    def refused(text: str, *columns: str) -> str:
        with pytest.raises(InputError) as caught:
            _read(tmp_path, text, episode_columns=columns)
        return str(caught.value).removeprefix(str(tmp_path))

    assert refused(_of("set", "1 1 2 1"), "set") == (
        "/runs.csv, line 5: column 'set' says '1' again, after another demonstration: sort the "
        "rows by demonstration, or name a further column that tells these apart."
    )
    assert refused(_of("set", "1 1 NA 2 2"), "set") == (
        "/runs.csv, line 4: column 'set' is empty: say to which demonstration the row belongs."
    )
    assert "there is no column 'sett': the columns are set, x, action" in refused(
        _of("set", "1 2"), "sett"
    )
    assert "column 'action' holds actions" in refused(_of("set", "1 2"), "action")


def test_demonstrations_without_an_action_are_named(tmp_path: Path) -> None:
    rows = ("1,0,go", "1,1,go", "2,0,", "2,1,", "3,0,go", ",,", "3,1,stop")
    read = _read(tmp_path, _table("episode,x,action", *rows))
    assert _parts(read) == [("1", 2), ("3", 2)]
    assert "1 demonstration has no action and is left out: '2'" in read.notes


def test_what_counts_within_each_demonstration_numbers_its_rows(tmp_path: Path) -> None:
    rows = [f"{e},{t / 10},{t},{t % 2},go" for e in range(3) for t in range(4)]
    read = _read(tmp_path, _table("episode,t,step,x,action", *rows))
    assert [one.name for one in read.demonstration.features] == ["x"]
    whole = _read(tmp_path, _table("episode,t,step,x,action", *rows), episode_columns=())
    assert [one.name for one in whole.demonstration.features] == ["t", "step", "x"]


def test_several_channels_split_at_the_same_rows(tmp_path: Path) -> None:
    rows = ("1,0,go,", "1,1,go,open", "2,0,,shut", "2,1,stop,shut")
    read = _read(tmp_path, _table("episode,x,base,hand", *rows), labels=("base", "hand"))
    assert _parts(read) == [("1", 3), ("2", 3)]
    first, second = read.demonstrations()
    assert (first.actions, second.actions) == (("go", "open"), ("shut", "stop"))
    assert first.stamps.tolist() == [0, 1, 1]


def _load(path: Path, cache: Path | None = None, **options: object) -> Loaded:
    reading = InputOptions(**options)  # type: ignore[arg-type]
    return load([path], replace(reading, plan=ReadingPlan(cache=cache)))


def test_the_cache_keeps_where_demonstrations_begin_and_options_decide(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(_of("episode", "1 1 2 2 3"))
    cache = tmp_path / "cache"
    for _ in range(2):
        split = _load(path, cache)
        assert [one.name for one in split.demonstrations] == [f"runs.csv#{e}" for e in (1, 2, 3)]
        assert split.paths == (path, path, path)
        assert list(split.accounts) == ["runs.csv"]
        [whole] = _load(path, cache, episode_columns=()).demonstrations
        assert len(whole) == 5
    assert _load(path, cache, episode_columns="episode").demonstrations[1].name == "runs.csv#2"


@pytest.mark.parametrize(
    ("exclude", "left"),
    [
        ("runs.csv#2", "1 3 12"),
        ("runs.csv#1*", "2 3"),
        ("*#1", "2 3 12"),
        ("*2", "1 3"),
        ("{path}#3", "1 2 12"),
    ],
)
def test_single_demonstrations_of_a_table_are_left_out_and_weighed(
    exclude: str, left: str, tmp_path: Path
) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(_of("episode", "1 1 2 2 3 3 12"))
    address = exclude.format(path=path)
    loaded = _load(path, exclude=address)
    kept = [f"runs.csv#{one}" for one in left.split()]
    assert [one.name for one in loaded.demonstrations] == kept
    assert len(loaded.excluded_parts) == 4 - len(kept)
    assert loaded.notes[0].startswith(f"{4 - len(kept)} of 4 demonstrations are left out as asked")
    weighed = _load(path, weights={"runs.csv": 0, address: 3})
    assert {one.name for one in weighed.demonstrations}.isdisjoint(kept)
    assert set(weighed.weights) == {3}


def test_addresses_that_mean_no_demonstration_of_a_table_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(_of("episode", "1 1 2 2"))
    for address in ("runs.csv#7", "other.csv#1", "#1", "*#7"):
        with pytest.raises(InputError, match="no demonstration is called"):
            _load(path, exclude=address)
    with pytest.raises(InputError, match="are left out: there is nothing else"):
        _load(path, exclude=("runs.csv#1", "runs.csv#2"))


def test_a_name_that_two_demonstrations_would_have_is_refused(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(_of("episode", "1 1 2 2"))
    (tmp_path / "runs.csv#1").write_text(_of("x0", "1 1 2 2"))
    with pytest.raises(InputError, match=r"two demonstrations are called 'runs\.csv#1'"):
        load([tmp_path / "runs.csv", tmp_path / "runs.csv#1"])


def test_an_episode_column_is_refused_where_no_input_is_a_table(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="episode_columns must be texts"):
        InputOptions(episode_columns=3)  # type: ignore[arg-type]
    (tmp_path / "a.rec").write_bytes(b"")
    with pytest.raises(rebt_ros.RebtError):
        load([tmp_path / "a.rec"], InputOptions(episode_columns=("episode",)))


_ROWS = st.lists(
    st.tuples(
        st.sampled_from(["0", "1"]),
        st.integers(0, 9).map(lambda value: f"{value / 4}"),
        st.sampled_from(["red", "blue"]),
        st.sampled_from(["go", "stop", "turn"]),
    ),
    min_size=2,
    max_size=8,
)


@settings(max_examples=25)
@given(st.lists(_ROWS, min_size=2, max_size=5), st.booleans())
def test_a_split_table_gives_the_tree_of_separate_files(
    demonstrations: list[list[tuple[str, ...]]], is_named: bool
) -> None:
    with TemporaryDirectory() as directory:
        there = Path(directory)
        together = ["set,t,flag,x,color,action" if is_named else "episode,t,flag,x,color,action"]
        files = []
        for number, rows in enumerate(demonstrations):
            lines = [",".join((f"{t}", *row)) for t, row in enumerate(rows)]
            files.append(there / f"{number}.csv")
            files[-1].write_text("\n".join(("t,flag,x,color,action", *lines)) + "\n")
            together += [f"{number},{line}" for line in lines]
        table = there / "all.csv"
        table.write_text("\n".join(together) + "\n")
        # No column of a table is of a kind of its own: what a table never shows, others do.
        declared = {"flag": "binary", "x": "numeric", "color": "categorical"}
        reading = InputOptions(episode_columns="set" if is_named else None)
        split = _learned(table, declared, reading)
        apart = _learned(files, declared)
    if isinstance(apart, str) or isinstance(split, str):
        assert split == apart
        return
    assert split.learned.tree == apart.learned.tree
    assert split.learned.features == apart.learned.features
    assert split.learned.provenance == apart.learned.provenance
    for one, other in zip(split.learnings, apart.learnings, strict=True):
        assert one.report == other.report
        assert np.array_equal(one.table.demonstration, other.table.demonstration)


def _learned(
    inputs: Path | list[Path], declared: dict[str, str], reading: InputOptions | None = None
) -> rebt_ros.OfflineLearning | str:
    try:
        return rebt_ros.learn(inputs, declared=declared, reading=reading)
    except rebt_ros.RebtError as error:
        return type(error).__name__


def test_learn_replay_and_inspect_split_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs.csv").write_text(_of("episode", " ".join(f"{x // 8}" for x in range(48))))
    learn.main(["runs.csv", "--out", "split", "--no-cache"])
    printed = capsys.readouterr()
    assert "column 'episode' splits the rows into 6 demonstrations" in printed.out + printed.err
    summary = json.loads(Path("split/summary.json").read_text())
    assert summary["demonstrations"] == 6
    learn.main(["runs.csv", "--out", "whole", "--no-cache", "--episode-column", "none"])
    assert json.loads(Path("whole/summary.json").read_text())["demonstrations"] == 1
    learn.main(["runs.csv", "--out", "fewer", "--no-cache", "--exclude", "runs.csv#[01]"])
    fewer = json.loads(Path("fewer/summary.json").read_text())
    assert fewer["demonstrations"] == 4
    assert fewer["excluded"] == ["runs.csv#0", "runs.csv#1"]
    capsys.readouterr()
    inspect.main(["runs.csv", "--no-cache", "--episode-column", "episode", "--json", "seen.json"])
    assert "runs.csv#5" in capsys.readouterr().out
    seen = json.loads(Path("seen.json").read_text())["demonstrations"]
    assert [one["name"] for one in seen] == [f"runs.csv#{number}" for number in range(6)]
    replays = rebt_ros.replay("split/tree.json", "runs.csv")
    assert sum(one.rows for one in replays) == 48
