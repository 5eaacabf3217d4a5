"""Demonstrations are named as `inspect` names them, and left out before they are read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import rebt_ros
from rebt_ros.commands import inspect, learn
from rebt_ros.errors import InputError
from rebt_ros.storage.addressing import Demonstrations, weighted
from rebt_ros.storage.input_options import InputOptions, ReadingPlan
from rebt_ros.storage.inputs import load

NAMES = ("a.csv", "b.csv", "x/run.csv", "y/run.csv", "[odd].csv")
PATHS = tuple(Path("fleet") / name for name in ("a.csv", "b.csv", "x/run.csv", "y/run.csv"))


def write(path: Path, border: int = 10, rows: int = 24) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = (f"{x / 8},{'go' if x < border else 'turn'}" for x in range(rows))
    path.write_text("\n".join(("front,action", *lines)) + "\n")
    return path


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six tables, two of which have one name, and one that cannot be read."""
    monkeypatch.chdir(tmp_path)
    for number, name in enumerate(("a", "b", "c", "[odd]", "x/run", "y/run")):
        write(Path("fleet", f"{name}.csv"), 8 + number)
    Path("fleet/broken.csv").write_text("front,action\n")
    return Path("fleet")


ALL = ("fleet/*.csv", "fleet/?/run.csv")


def names(*exclude: str, inputs: tuple[str, ...] = ALL, strict: bool = False) -> list[str]:
    options = InputOptions(exclude=exclude, plan=ReadingPlan(strict=strict))
    loaded = load([Path(one) for one in inputs], options)
    return [one.name for one in loaded.demonstrations]


@pytest.mark.parametrize(
    ("address", "left"),
    [
        ("a.csv", "[odd] b c fleet/x/run fleet/y/run"),
        ("fleet/a.csv", "[odd] b c fleet/x/run fleet/y/run"),
        ("./fleet/../fleet/a.csv", "[odd] b c fleet/x/run fleet/y/run"),
        ("[odd].csv", "a b c fleet/x/run fleet/y/run"),
        ("[ab].csv", "[odd] c fleet/x/run fleet/y/run"),
        ("fleet/x/run.csv", "[odd] a b c run"),
        ("fleet/y", "[odd] a b c run"),
        ("*/run.csv", "[odd] a b c"),
        ("@out.txt", "[odd] a fleet/x/run fleet/y/run"),
    ],
)
def test_demonstrations_are_left_out_by_name_path_pattern_and_list(
    fleet: Path, address: str, left: str
) -> None:
    Path("out.txt").write_text("# bad ones\n\nb.csv\n  fleet/c*  \n")
    assert names(address) == [f"{name}.csv" for name in left.split()]


def test_what_is_left_out_is_not_read(fleet: Path) -> None:
    assert len(names("broken.csv", strict=True)) == 6
    with pytest.raises(InputError, match=r"broken\.csv"):
        names("a.csv", strict=True)


def test_a_name_that_fits_nothing_is_said_with_what_is_there(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        learn.main([*ALL, "--exclude", "run.csv", "--no-cache"])
    assert ended.value.code == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        "learn: no demonstration is called 'run.csv', and no file of one: there are [odd].csv, "
        "a.csv, b.csv, broken.csv, c.csv, fleet/x/run.csv, fleet/y/run.csv (inspect lists all)."
    )


@pytest.mark.parametrize("address", ["", "\0", "x" * 5000, "@nowhere", "@", "**/nothing"])
def test_odd_addresses_are_refused_in_a_sentence(fleet: Path, address: str) -> None:
    with pytest.raises(InputError):
        names(address)


def test_not_all_can_be_left_out(fleet: Path) -> None:
    with pytest.raises(InputError, match="all 7 demonstrations are left out"):
        names("*")
    with pytest.raises(InputError, match=r"a\.csv is left out"):
        names("a.csv", inputs=("fleet/a.csv",))


def test_leaving_out_is_learning_from_the_rest(fleet: Path) -> None:
    left_out, rest = Path("left_out"), Path("rest")
    learn.main([*ALL, "--out", str(left_out), "--exclude", "[bc].csv", "--exclude", "fleet/y"])
    kept = ["fleet/[[]odd].csv", "fleet/a.csv", "fleet/broken.csv", "fleet/x/run.csv"]
    learn.main([*kept, "--out", str(rest)])
    for name in ("tree.json", "tree.txt", "learning.npz", "decision_tree.svg"):
        assert (left_out / name).read_bytes() == (rest / name).read_bytes()
    first, second = (json.loads((out / "summary.json").read_text()) for out in (left_out, rest))
    assert first.pop("excluded") == ["fleet/b.csv", "fleet/c.csv", "fleet/y/run.csv"]
    assert second.pop("excluded") == []
    note = "3 of 7 demonstrations are left out as asked: fleet/b.csv, fleet/c.csv, fleet/y/run.csv"
    assert first["notes"] == [note, *second["notes"]]
    assert {**first, "inputs": 0, "notes": 0} == {**second, "inputs": 0, "notes": 0}


def test_every_name_that_inspect_prints_can_be_left_out(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inspect.main([*ALL, "--json", "found.json", "--no-cache"])
    printed = capsys.readouterr().out
    found = json.loads(Path("found.json").read_text())["demonstrations"]
    every = [one["name"] for one in found]
    for one in found:
        assert one["name"] in printed
        assert len(names(one["name"])) == len(names(one["path"])) == len(every) - 1
    assert rebt_ros.InputOptions(exclude="a.csv").exclude == ("a.csv",)


@given(st.sets(st.sampled_from(range(4))), st.booleans())
def test_what_is_meant_is_left_out_and_nothing_else(chosen: set[int], by_path: bool) -> None:
    known = NAMES[:4]
    addresses = [str(PATHS[place]) if by_path else known[place] for place in sorted(chosen)]
    if by_path:
        # These files are not there: only names, patterns and what is there can be meant.
        addresses = [f"[{address[0]}]{address[1:]}" for address in addresses]
    if len(chosen) == 4:
        with pytest.raises(InputError):
            weighted(known, PATHS, addresses)
    else:
        counting = weighted(known, PATHS, addresses)
        assert {place for place, count in enumerate(counting) if not count} == chosen
    for place, name in enumerate(known):
        assert Demonstrations(known, PATHS).meant(name) == (place,)
