"""Files where a tree should be."""

from __future__ import annotations

from pathlib import Path

import pytest
from trial_examples import GO, learned

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.errors import RebtError
from rebt_ros.storage.tree_file import read_tree

_TREE = learned(GO)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("table.csv", b"x,action\n1,go\n", "is a demonstration, and no tree: name the tree.json"),
        ("bag_0.mcap", b"\x89MCAP0\r\n\0\1", "is a demonstration, and no tree"),
        ("bag_0.db3.zstd", b"\x28\xb5\x2f\xfd\0", "is a demonstration, and no tree"),
        ("bag/metadata.yaml", b"rosbag2_bagfile_information:", "the tree comes first"),
        ("learned/tree.json", dumps(_TREE).encode(), r"is a directory: name .*tree\.json\."),
        ("empty/notes.txt", b"", "is a directory: name a file in it"),
        ("learning.npz", b"PK\x03\x04\0\0\xff", "is not a text file"),
        ("summary.json", b"{}", "does not say that its format"),
        ("tree.json", dumps(_TREE).encode() + bytes(9), "ends in zero bytes, as where a machine"),
    ],
)
def test_what_is_named_in_place_of_a_tree_is_told(
    name: str, content: bytes, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    with pytest.raises(RebtError, match=said):
        read_tree(path if path.parent == tmp_path else path.parent)


def test_a_tree_is_read_whatever_it_is_called(tmp_path: Path) -> None:
    path = tmp_path / "tree.csv"
    path.write_text(dumps(_TREE), encoding="utf-8")
    assert read_tree(path) == _TREE
