"""When there is something new to learn from."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.live.ended_demonstrations import QUIET, EndedDemonstrations


def _write(directory: Path, name: str, size: int) -> None:
    (directory / f"{name}.rec").write_bytes(b"x" * size)


def test_a_recording_counts_once_nothing_is_written_to_it_any_more(tmp_path: Path) -> None:
    ended = EndedDemonstrations()
    assert ended.look(tmp_path, 0.0) == 0
    _write(tmp_path, "one", 10)
    assert ended.look(tmp_path, 1.0) == 0
    _write(tmp_path, "one", 20)
    assert ended.look(tmp_path, 1.0 + QUIET) == 0
    assert ended.look(tmp_path, 1.0 + 2 * QUIET) == 1
    _write(tmp_path, "two", 10)
    assert ended.look(tmp_path, 2.0 + 2 * QUIET) == 1
    assert ended.look(tmp_path, 2.0 + 3 * QUIET) == 2


def test_what_was_learned_from_counts_again_only_if_it_goes_on(tmp_path: Path) -> None:
    ended = EndedDemonstrations()
    ended.look(tmp_path, 0.0)
    _write(tmp_path, "one", 10)
    ended.look(tmp_path, 1.0)
    ended.learn()
    assert ended.look(tmp_path, 100.0) == 0
    _write(tmp_path, "one", 11)
    ended.look(tmp_path, 101.0)
    assert ended.look(tmp_path, 101.0 + QUIET) == 1


def test_what_is_there_at_the_first_look_at_a_directory_does_not_count(tmp_path: Path) -> None:
    ended = EndedDemonstrations()
    other = tmp_path / "other"
    other.mkdir()
    for directory in (tmp_path, other):
        _write(directory, "old", 10)
        assert ended.look(directory, 0.0) == 0
        assert ended.look(directory, 100.0) == 0


def test_what_is_no_recording_or_gone_does_not_count(tmp_path: Path) -> None:
    ended = EndedDemonstrations()
    assert ended.look(tmp_path / "nowhere", 0.0) == 0
    ended.look(tmp_path, 0.0)
    (tmp_path / "notes.txt").write_text("x")
    _write(tmp_path, "one", 10)
    ended.look(tmp_path, 1.0)
    assert ended.look(tmp_path, 1.0 + QUIET) == 1
    (tmp_path / "one.rec").unlink()
    assert ended.look(tmp_path, 2.0 + QUIET) == 0


def test_what_cannot_be_looked_into_is_said(tmp_path: Path) -> None:
    ended = EndedDemonstrations()
    ended.look(tmp_path / "not there yet", 0.0)
    assert ended.problem == ""
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        assert ended.look(path, 1.0) == 0
        assert ended.problem == f"{tmp_path / 'file'} is a file, not a directory: check its name"
    ended.look(tmp_path, 2.0)
    assert ended.problem == ""
