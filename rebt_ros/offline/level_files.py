"""The files of learned trees and of their pruning levels.

A directory describes one learning: pictures and levels of an earlier one do not stay beside it.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.drawing.accuracy_plot import AccuracyCurve, PlotFormat, render_accuracy_plot
from rebt_ros.drawing.decision_tree_dot import render_decision_tree_dot
from rebt_ros.drawing.decision_tree_svg import render_decision_tree_svg
from rebt_ros.drawing.dot import render_dot
from rebt_ros.drawing.errors import PictureError
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.tree_png import render_decision_tree_png, render_png
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.levels import Levels, PruningLevel
from rebt_ros.learning.progress import Progress
from rebt_ros.storage.atomic import StorageError, write_bytes_atomically, write_text_atomically
from rebt_ros.storage.tree_file import write_tree

#: The behavior tree document beside its pictures.
TREE_FILE: Final = "tree.json"

_LEVELS, _SUMMARY = "levels", "summary.json"
_PLOT = "accuracy_vs_alpha"
#: Longest directory of a channel (characters); its name in full is in the documents.
_LONGEST_NAME = 100
#: Levels that take more room say so.
_MENTIONED_MEGABYTES = 50
_PICTURES = (
    "tree.svg",
    "tree.dot",
    "tree.png",
    "decision_tree.svg",
    "decision_tree.dot",
    "decision_tree.png",
)
_LEVEL_FILES = (TREE_FILE, *_PICTURES)
_BESIDE_TREE = (*_PICTURES, "tree.txt", _SUMMARY)


def write_behavior_tree(directory: Path, learned: LearnedTree) -> list[str]:
    """Writes tree.json, tree.svg, tree.dot, and tree.png where possible.

    Returns:
        Notes on what could not be made; no full stops.
    """
    write_tree(directory / TREE_FILE, learned)
    return write_tree_pictures(directory, learned)


def write_tree_pictures(directory: Path, learned: LearnedTree) -> list[str]:
    """Writes tree.svg, tree.dot, and tree.png where possible.

    Returns:
        Notes on what could not be made; no full stops.
    """
    write_text_atomically(directory / "tree.svg", render_svg(learned))
    write_text_atomically(directory / "tree.dot", render_dot(learned))
    return _write_picture(directory / "tree.png", partial(render_png, learned))


def write_decision_tree(directory: Path, tree: DecisionTree) -> list[str]:
    """Writes decision_tree.svg, decision_tree.dot, and decision_tree.png where possible.

    Returns:
        Notes on what could not be made; no full stops.
    """
    path = directory / "decision_tree"
    write_text_atomically(path.with_suffix(".svg"), render_decision_tree_svg(tree))
    write_text_atomically(path.with_suffix(".dot"), render_decision_tree_dot(tree))
    return _write_picture(path.with_suffix(".png"), partial(render_decision_tree_png, tree))


def channel_directories(learnings: Sequence[Learning]) -> Iterator[tuple[Path, Learning]]:
    """Where the files of each channel's policy go, relative to those of the whole tree."""
    if len(learnings) == 1:
        yield Path(), learnings[0]
        return
    taken: set[str] = set()
    for learning in learnings:
        # Channels are topics, whose slashes would make directories of their own.
        name = (
            re.sub("[^A-Za-z0-9_-]+", "_", learning.table.channel).strip("_")[:_LONGEST_NAME]
            or "channel"
        )
        while name in taken:
            name += "_"
        taken.add(name)
        yield Path("channels", name), learning


def write_levels(directory: Path, levels: Levels, most: int, progress: Progress) -> list[str]:
    """Writes levels/NN/ for each pruning level, levels/summary.json and the plot.

    Args:
        directory: Where to.
        levels: Of the tree that was learned.
        most: Levels to write at most.
        progress: Told what is being done and which share of the work is behind.

    Returns:
        Notes on what was left out, each once; no full stops.

    Raises:
        OptionError: `most` is too small.
        StorageError: A file cannot be written.
    """
    numbers = levels.selected(most)
    clear_levels(directory)
    width = max(2, len(str(len(levels.ccp_alphas) - 1)))
    notes = list(_selection_notes(levels, numbers))
    entries, simpler = [], 0
    for place, number in enumerate(numbers):
        progress(f"level {place + 1} of {len(numbers)}", place / len(numbers))
        level = levels.level(number)
        name = f"{number:0{width}d}"
        notes += write_behavior_tree(directory / _LEVELS / name, level.learned)
        notes += write_decision_tree(directory / _LEVELS / name, level.decision_tree)
        entries.append(_entry(name, level))
        simpler += not level.reduced
    if simpler:
        notes.append(
            f"the {simpler} largest of these levels were made without the domain's don't-cares, "
            "which would take too long"
        )
    text = json.dumps(entries, indent=2, ensure_ascii=False)
    write_text_atomically(directory / _LEVELS / _SUMMARY, text + "\n")
    notes += _write_plot(directory, levels)
    megabytes = _size(directory / _LEVELS) / 1e6
    if megabytes > _MENTIONED_MEGABYTES:
        notes.append(f"the levels take {megabytes:.0f} MB; a smaller --most-levels takes less")
    return list(dict.fromkeys(notes))


@contextlib.contextmanager
def nothing_of_before(
    directory: Path, channels: Iterable[Path] = (), further: Iterable[str] = ()
) -> Iterator[None]:
    """Where not all files can be written, none of an earlier tree stays beside those that were.

    Args:
        directory: Of the tree.
        channels: Where the files of each channel's policy go, relative to it.
        further: Names of files that are written as well.
    """
    written = {directory, *(directory / channel for channel in channels)}
    names = (*_BESIDE_TREE, *further)
    files = [one / name for one in sorted(written) for name in names]
    before = {path: _mark(path) for path in files}
    try:
        yield
    except StorageError:
        for path in files:
            if _mark(path) == before[path]:
                path.unlink(missing_ok=True)
        for one in written:
            clear_levels(one)
        raise


def _mark(path: Path) -> tuple[int, int] | None:
    """What tells a file from the one that takes its place; None where there is none."""
    with contextlib.suppress(OSError):
        status = path.stat()
        return status.st_ino, status.st_mtime_ns
    return None


def clear_levels(directory: Path) -> None:
    """Takes away the levels that an earlier learning wrote here, and nothing else."""
    written = directory / _LEVELS
    for form in PlotFormat:
        (directory / f"{_PLOT}.{form.value}").unlink(missing_ok=True)
    if written.is_dir():
        for level in written.iterdir():
            if level.name.isdecimal() and level.is_dir():
                for name in _LEVEL_FILES:
                    (level / name).unlink(missing_ok=True)
                _remove_if_empty(level)
        (written / _SUMMARY).unlink(missing_ok=True)
        _remove_if_empty(written)


def _size(directory: Path) -> int:
    return sum(path.stat().st_size for path in directory.rglob("*") if path.is_file())


def _remove_if_empty(directory: Path) -> None:
    with contextlib.suppress(OSError):
        directory.rmdir()


def _entry(name: str, level: PruningLevel) -> dict[str, Any]:
    tree, figures = level.learned.tree, level.learned.provenance.figures
    judged = level.cross_validated
    return {
        "level": name,
        "ccp_alpha": level.ccp_alpha,
        "leaves": level.leaves,
        "nodes": nodes.size(tree),
        "depth": nodes.depth(tree),
        "actions": [action.label for action in nodes.actions(tree)],
        "fidelity_mismatches": figures.fidelity_mismatches,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        "cross_validated_mean_recall": judged.recall if judged else None,
        "cross_validated_agreement": judged.agreement if judged else None,
        "cross_validated_standard_error": judged.standard_error if judged else None,
        "all_reductions": level.reduced,
        "best": level.best,
        "chosen": level.chosen,
    }


def _selection_notes(levels: Levels, numbers: tuple[int, ...]) -> Iterator[str]:
    count = len(levels.ccp_alphas)
    if len(numbers) < count:
        yield (
            f"{len(numbers)} of {count} pruning levels were written, evenly spread, and "
            f"{count - len(numbers)} left out; --most-levels {count} writes all"
        )


def _write_plot(directory: Path, levels: Levels) -> list[str]:
    policy = levels.policy
    judged = policy.levels
    if judged is None:
        return [f"there is no {_PLOT}, as there were too few rows for cross-validation"]
    curve = AccuracyCurve(
        judged.ccp_alphas,
        judged.means,
        judged.standard_errors,
        # The levels of another fit may have been judged: each comes to one of this tree.
        levels.leaves[np.searchsorted(levels.ccp_alphas, judged.ccp_alphas, side="right") - 1],
        policy.ccp_alpha,
    )
    notes: list[str] = []
    for form in PlotFormat:
        path = directory / f"{_PLOT}.{form.value}"
        notes += _write_picture(path, partial(render_accuracy_plot, curve, form))
    return notes


def _write_picture(path: Path, render: Callable[[], bytes]) -> list[str]:
    """Writes a picture, or takes an older one away and says why there is none."""
    try:
        write_bytes_atomically(path, render())
    except PictureError as err:
        path.unlink(missing_ok=True)
        return [str(err).removesuffix(".")]
    return []
