"""Behavior tree documents on disk."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import DocumentError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.text import read_text


def read_tree(path: Path) -> LearnedTree:
    """Reads a behavior tree document.

    Raises:
        InputError: There is no such text file.
        DocumentError: It is not a valid document.
    """
    text = read_text(path)
    try:
        return loads(text)
    except DocumentError as err:
        raise DocumentError(f"{path}: {err}") from err


def write_tree(path: Path, learned: LearnedTree) -> None:
    """Writes a behavior tree document; a reader never sees half of one.

    Raises:
        StorageError: It could not be written; what was there before is untouched.
    """
    write_text_atomically(path, dumps(learned))
