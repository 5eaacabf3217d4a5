"""Files of a learned tree in the languages of other engines."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import RebtError
from rebt_ros.export.languages import LANGUAGES
from rebt_ros.storage.atomic import write_text_atomically


def write_export(directory: Path, learned: LearnedTree, language: str) -> Path:
    """Writes a tree for another engine, or else leaves none there that is of another tree.

    Raises:
        RebtError: The engine cannot run it, or the file cannot be written.
    """
    path = export_path(directory, language)
    path.unlink(missing_ok=True)
    write_text_atomically(path, LANGUAGES[language](learned))
    return path


def write_exports_again(directory: Path, learned: LearnedTree) -> list[str]:
    """Writes a tree for each engine for which one was written there before.

    Returns:
        Notes on those that cannot run it; their files are gone.
    """
    notes = []
    for language in LANGUAGES:
        path = export_path(directory, language)
        if path.exists():
            try:
                write_export(directory, learned, language)
            except RebtError as err:
                notes.append(f"{path} is gone: {str(err).rstrip('.')}")
    return notes


def export_path(directory: Path, language: str) -> Path:
    """Where the command ``learn`` writes a tree for an engine."""
    return directory / f"{language}.xml"
