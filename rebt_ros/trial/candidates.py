"""The trees of a trial: named one by one, or all pruning levels of a learning."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import InputError
from rebt_ros.storage.text import read_text
from rebt_ros.storage.tree_file import read_tree


@dataclass(frozen=True)
class Candidate:
    """A tree that is to be judged."""

    name: str
    learned: LearnedTree
    path: Path

    @cached_property
    def document(self) -> str:
        """What the executor is sent."""
        return dumps(self.learned)

    @cached_property
    def fingerprint(self) -> str:
        """By which the executor names that."""
        return fingerprint(self.document)

    @property
    def nodes(self) -> int:
        """Nodes of its tree."""
        return nodes.size(self.learned.tree)

    @property
    def agreement(self) -> float | None:
        """Own-history agreement with held-out rows; None where there were none."""
        return self.learned.provenance.figures.own_history_agreement

    def drives_like(self, other: Candidate) -> bool:
        """Whether both are the same tree, wherever they come from."""
        mine, others = self.learned, other.learned
        return (mine.tree, mine.features, mine.actions, mine.row_kind) == (
            others.tree,
            others.features,
            others.actions,
            others.row_kind,
        )


def of_files(paths: Iterable[Path]) -> Iterator[Candidate]:
    """Candidates of behavior tree documents, named as the files are.

    Raises:
        InputError: There is no such file.
        DocumentError: It is not a valid document.
    """
    for path in paths:
        yield Candidate(str(path), read_tree(path), path)


def of_levels(directory: Path) -> Iterator[Candidate]:
    """Candidates of what ``learn --levels --out DIRECTORY`` wrote, largest first.

    Raises:
        InputError: There is no such family, or one of its files is missing.
        DocumentError: One of its trees is not a valid document.
    """
    levels = directory / "levels"
    for entry in _entries(directory, levels / "summary.json"):
        number = entry["level"]
        path = levels / number / "tree.json"
        chosen = " (chosen)" if entry.get("chosen") is True else ""
        yield Candidate(f"level {number}{chosen}", read_tree(path), path)


def distinct(candidates: Iterable[Candidate]) -> tuple[tuple[Candidate, ...], tuple[str, ...]]:
    """The first candidate of each tree.

    Returns:
        Those, and a note on each of the others; no full stops.
    """
    first: list[Candidate] = []
    notes: list[str] = []
    for candidate in candidates:
        same = next((one for one in first if candidate.drives_like(one)), None)
        if same is None:
            first.append(candidate)
        else:
            notes.append(f"{candidate.name} is the same tree as {same.name}, which drives for both")
    return tuple(first), tuple(notes)


def _entries(directory: Path, summary: Path) -> Sequence[dict[str, Any]]:
    if not summary.is_file():
        channels = sorted(directory.glob("channels/*/levels/summary.json"))
        if channels:
            raise InputError(
                f"{directory} has a family for each channel: name one of them, such as "
                f"{channels[0].parents[1]}."
            )
        raise InputError(
            f"{directory} has no levels/summary.json: write the levels with "
            f"'learn INPUT --levels --out {directory}'."
        )
    try:
        entries = json.loads(read_text(summary))
    except (ValueError, RecursionError) as err:
        raise InputError(f"{summary} is not JSON: learn the levels again.") from err
    if not isinstance(entries, list) or not entries or not all(map(_is_entry, entries)):
        raise InputError(f"{summary} is no list of pruning levels: learn them again.")
    return entries


def _is_entry(value: object) -> bool:
    """Whether it names a level; the name is a directory, and nothing but a number."""
    number = value.get("level") if isinstance(value, dict) else None
    return isinstance(number, str) and number.isascii() and number.isdecimal()
