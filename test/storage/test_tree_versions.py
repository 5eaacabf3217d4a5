"""Trees that were published, by number."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import StorageError
from rebt_ros.storage.tree_versions import TreeVersions


def test_the_tree_before_comes_back_however_often_it_is_asked_for(tmp_path: Path) -> None:
    versions = TreeVersions(tmp_path / "trees", 20)
    for document in ("one", "two", "three", "three"):
        versions.keep(document)
    assert versions.go_back()[1] == "two"
    assert versions.go_back()[1] == "one"
    with pytest.raises(InputError, match="no tree before this one"):
        versions.go_back()
    # Numbers are not used again.
    assert versions.keep("four").name == "000004.json"
    assert versions.go_back()[1] == "one"
    assert {one.name for one in (tmp_path / "trees").iterdir()} == {
        "000001.json",
        "000002.json.undone",
        "000003.json.undone",
        "000004.json.undone",
    }


def test_the_newest_tree_is_there_where_none_is_published(tmp_path: Path) -> None:
    versions = TreeVersions(tmp_path / "trees", 5)
    assert not versions.any
    with pytest.raises(InputError, match="there is no tree in"):
        versions.newest()
    for document in ("one", "two"):
        versions.keep(document)
    assert versions.any
    assert versions.newest() == (tmp_path / "trees" / "000002.json", "two")
    assert versions.go_back()[1] == "one"
    assert versions.newest()[1] == "one"

    def refuse(document: str) -> None:
        raise InputError(f"{document} breaks a rule.")

    with pytest.raises(InputError, match=r"000001.json is not published again: one breaks a rule"):
        versions.newest(refuse)


def test_only_the_newest_trees_are_kept(tmp_path: Path) -> None:
    versions = TreeVersions(tmp_path, 3)
    for number in range(10):
        versions.keep(str(number))
    assert sorted(one.read_text() for one in tmp_path.iterdir()) == ["7", "8", "9"]


def test_a_tree_before_that_is_not_accepted_changes_nothing(tmp_path: Path) -> None:
    versions = TreeVersions(tmp_path, 5)
    versions.keep("one")
    versions.keep("two")

    def refuse(document: str) -> None:
        raise InputError(f"{document} breaks a rule.")

    with pytest.raises(InputError, match=r"000001.json is .*one breaks a rule\. .*remove it\."):
        versions.go_back(refuse)
    assert versions.go_back() == (tmp_path / "000001.json", "one")


def test_a_tree_that_cannot_be_put_in_place_leaves_all_versions_as_they_are(tmp_path: Path) -> None:
    versions = TreeVersions(tmp_path, 5)
    versions.keep("one")
    versions.keep("two")

    def refuse(document: str) -> None:
        raise StorageError(f"there is no room for {document}.")

    with pytest.raises(StorageError, match=r"no room for three\."):
        versions.keep("three", refuse)
    with pytest.raises(StorageError, match=r"no room for one\."):
        versions.go_back(refuse)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["000001.json", "000002.json"]
    assert versions.go_back()[1] == "one"
