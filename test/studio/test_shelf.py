"""Demonstrations on the shelf: listed, left out, deleted and had back; nothing is lost too soon."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.recording import RecordingWriter, read_recording
from rebt_ros.storage.recording_files import recordings
from rebt_ros.studio.shelf import UNDO_TIME, Shelf


def record(directory: Path, actions: str, name: str | None = None) -> str:
    features = (Feature("x", topic="state", index=0), Feature("y", topic="state", index=1))
    with RecordingWriter(directory, features, ["action"]) as writer:
        for place, action in enumerate(actions):
            writer.write(Row(place * 10**9, "action", action, None, (float(place), 7.0)))
    path = writer.path if name is None else writer.path.rename(directory / f"{name}.rec")
    return path.name.removesuffix(".rec")


def test_a_demonstration_is_listed_with_a_thumbnail(tmp_path: Path) -> None:
    name = record(tmp_path, "aabb")
    (tmp_path / "notes.txt").write_text("no recording")
    (tmp_path / "torn.rec").write_bytes(b"# rebt")
    [(listed, view)] = Shelf(tmp_path).views().items()
    assert listed == name
    assert (view["rows"], view["seconds"], view["actions"]) == (4, 3.0, {"a": 2, "b": 2})
    assert view["bands"] == [[0.0, 2.0, "a"], [2.0, 3.0, "b"]]
    # A feature that does not vary has no line.
    assert view["series"] == {"x": [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]}
    assert (view["origin"], view["notes"]) == ("demonstration", [])
    assert (view["kept"], view["deleted"]) == (True, False)


def test_without_a_directory_there_is_nothing_yet(tmp_path: Path) -> None:
    assert Shelf(tmp_path / "later").views() == {}


def test_what_is_left_out_is_not_learned_from_until_it_is_taken_in(tmp_path: Path) -> None:
    first, second = record(tmp_path, "ab", "first"), record(tmp_path, "cd", "second")
    shelf = Shelf(tmp_path)
    shelf.leave_out(first)
    assert [path.stem for path in recordings(tmp_path)] == [second]
    kept = {name: view["kept"] for name, view in shelf.views().items()}
    assert kept == {first: False, second: True}
    with pytest.raises(OptionError, match="'first' any more"):
        shelf.leave_out(first)
    shelf.take_in(first)
    assert [path.stem for path in recordings(tmp_path)] == [first, second]
    with pytest.raises(OptionError, match="not left out"):
        shelf.take_in(first)


def test_what_is_deleted_can_be_had_back_until_the_time_is_over(tmp_path: Path) -> None:
    name = record(tmp_path, "ab", "first")
    now = (tmp_path / "first.rec").stat().st_ctime
    shelf = Shelf(tmp_path, clock=lambda: now)
    shelf.delete(name)
    with pytest.raises(InputError):
        recordings(tmp_path)
    shelf.tidy()
    assert shelf.views()[name]["deleted"]
    shelf.restore(name)
    assert [path.stem for path in recordings(tmp_path)] == [name]
    assert len(read_recording(tmp_path / "first.rec").demonstration) == 2
    shelf.delete(name)
    now += UNDO_TIME + 60.0
    shelf.tidy()
    assert shelf.views() == {}
    with pytest.raises(OptionError):
        shelf.restore(name)


@pytest.mark.parametrize("name", ["../outside", "/etc/passwd", "", ".", "a/b", "first\0"])
def test_no_name_leads_out_of_the_directory(tmp_path: Path, name: str) -> None:
    inside = tmp_path / "inside"
    record(tmp_path, "ab", "outside")
    record(inside, "ab", "first")
    shelf = Shelf(inside)
    for change in (shelf.leave_out, shelf.take_in, shelf.delete, shelf.restore):
        with pytest.raises(OptionError):
            change(name)
    assert (tmp_path / "outside.rec").is_file()


def actions_in(directory: Path) -> dict[str, str]:
    """What was done in each demonstration."""
    found = {}
    for path in recordings(directory):
        shown = read_recording(path).demonstration
        found[path.stem] = "".join(shown.actions[code] for code in shown.chosen)
    return found


def test_a_demonstration_is_cut_to_a_stretch_and_can_be_had_back(tmp_path: Path) -> None:
    record(tmp_path, "abcde", "first")
    shelf = Shelf(tmp_path)
    shelf.trim("first", 1.0, 3.0)
    assert actions_in(tmp_path) == {"first-1": "bcd"}
    part = read_recording(tmp_path / "first-1.rec").demonstration
    assert part.states[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert part.before == {"action": "a"}
    shelf.trim("first-1", 2.0, 9.0)
    assert actions_in(tmp_path) == {"first-1-1": "d"}
    # Nothing is learned from twice.
    assert shelf.restore("first") == "first is whole again."
    assert actions_in(tmp_path) == {"first": "abcde"}
    assert list(shelf.views()) == ["first"]
    shelf.trim("first", 0.0, 1.0)
    assert actions_in(tmp_path) == {"first-1": "ab"}


def test_what_is_only_called_like_a_part_stays(tmp_path: Path) -> None:
    for name, actions in (("first", "abc"), ("first-1", "ab-"), ("first-2", "abcd")):
        record(tmp_path, actions, name)
    before = actions_in(tmp_path)
    shelf = Shelf(tmp_path)
    shelf.delete("first")
    assert shelf.restore("first") == "first is back."
    assert actions_in(tmp_path) == before


def test_a_demonstration_is_split_in_two_between_rows(tmp_path: Path) -> None:
    record(tmp_path, "abcde", "first")
    Shelf(tmp_path).split("first", 2.0)
    assert actions_in(tmp_path) == {"first-1": "ab", "first-2": "cde"}


@pytest.mark.parametrize("at", [-1.0, 0.0, 99.0])
def test_a_split_without_two_parts_changes_nothing(tmp_path: Path, at: float) -> None:
    record(tmp_path, "abcde", "first")
    with pytest.raises(OptionError, match="no rows from"):
        Shelf(tmp_path).split("first", at)
    assert actions_in(tmp_path) == {"first": "abcde"}
    assert list(tmp_path.iterdir()) == [tmp_path / "first.rec"]


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    record(tmp_path, "ab", "first")
    shelf = Shelf(tmp_path)
    shelf.delete("first")
    record(tmp_path, "cde", "first")
    with pytest.raises(OptionError, match="already"):
        shelf.restore("first")


def test_a_damaged_demonstration_says_so(tmp_path: Path) -> None:
    name = record(tmp_path, "ab")
    path = tmp_path / f"{name}.rec"
    path.write_bytes(path.read_bytes().replace(b'"version": 2', b'"version": 9'))
    [view] = Shelf(tmp_path).views().values()
    assert "version" in view["notes"][0]
