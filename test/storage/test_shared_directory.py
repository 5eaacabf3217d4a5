"""Two processes that write to one directory notice each other."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.storage.shared_directory import SharedDirectory, Use


def test_who_uses_a_directory_sees_others_that_use_it_for_the_same(tmp_path: Path) -> None:
    directory = tmp_path / "there later"
    one, other, trees = (
        SharedDirectory(use) for use in (Use.RECORDINGS, Use.RECORDINGS, Use.TREES)
    )
    assert not one.is_shared(directory)
    directory.mkdir()
    assert not one.is_shared(directory)
    assert not trees.is_shared(directory)
    assert other.is_shared(directory)
    assert one.is_shared(directory)
    assert one.is_shared(directory)
    other.close()
    assert not one.is_shared(directory)


def test_another_directory_of_the_same_name_is_another_one(tmp_path: Path) -> None:
    directory = tmp_path / "demonstrations"
    directory.mkdir()
    one, other = SharedDirectory(Use.RECORDINGS), SharedDirectory(Use.RECORDINGS)
    assert not one.is_shared(directory)
    directory.rename(tmp_path / "moved")
    assert not one.is_shared(directory)
    directory.write_text("a file")
    assert not one.is_shared(directory)
    assert not other.is_shared(tmp_path / "moved")
