"""Behavior tree documents on disk."""

from __future__ import annotations

import contextlib
import stat
from pathlib import Path

from rebt_ros.behavior_tree.document import LARGEST_DOCUMENT, dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import DocumentError, InputError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.text import read_text, unreadable

#: What a learned tree is called, and how the names of demonstrations end.
_NAME = "tree.json"
_DEMONSTRATIONS = frozenset({".csv", ".tsv", ".rec", ".mcap", ".db3"})

#: A character has four bytes at most.
_LARGEST_FILE = 4 * LARGEST_DOCUMENT


def read_tree(path: Path) -> LearnedTree:
    """Reads a behavior tree document.

    Raises:
        InputError: There is no such text file.
        DocumentError: It is not a valid document.
    """
    # What is no file, or no name of one, is told by reading it.
    with contextlib.suppress(OSError, ValueError):
        if path.is_file() and path.stat().st_size > _LARGEST_FILE:
            raise DocumentError(f"{path} has more than {_LARGEST_FILE} bytes: this is no document.")
    try:
        return loads(read_text(path))
    except InputError as err:
        raise InputError(_mistaken(path) or str(err)) from err
    except DocumentError as err:
        raise DocumentError(_mistaken(path) or f"{path}: {err}") from err


def _mistaken(path: Path) -> str:
    """What a path names that is no tree, and what to name instead; empty where that is unclear."""
    try:
        if path.is_dir() and (path / _NAME).is_file():
            return f"{path} is a directory: name {path / _NAME}."
        suffixes = {suffix.lower() for suffix in path.suffixes}
        is_bag = path.is_dir() and (path / "metadata.yaml").is_file()
        is_demonstration = path.is_file() and bool(suffixes & _DEMONSTRATIONS)
    except (OSError, ValueError):
        return ""
    if not is_bag and not is_demonstration:
        return ""
    return (
        f"{path} is a demonstration, and no tree: name the {_NAME} that was learned; where "
        "demonstrations are named as well, the tree comes first."
    )


def find_tree(path: Path) -> LearnedTree | None:
    """Reads a behavior tree document that may not be there yet; None if it is not.

    Raises:
        InputError: What is there is no text file, or cannot be read.
        DocumentError: It is not a valid document.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    except OSError as err:
        raise unreadable(path, err) from err
    if stat.S_ISDIR(mode) or stat.S_ISREG(mode):
        return read_tree(path)
    # A pipe would never end.
    raise InputError(f"{path} is no regular file: remove it.")


def write_tree(path: Path, learned: LearnedTree) -> None:
    """Writes a behavior tree document; a reader never sees half of one.

    Raises:
        StorageError: It could not be written; what was there before is untouched.
    """
    write_text_atomically(path, dumps(learned))
