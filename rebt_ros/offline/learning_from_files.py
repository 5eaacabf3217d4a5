"""Learning from files: the Python side of the command `learn`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, unmeasurable
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.demonstration.together import notes_together
from rebt_ros.drawing.text import render_text
from rebt_ros.errors import InputError, OptionError, listing
from rebt_ros.learning import pipeline
from rebt_ros.learning.learning_file import NAME as LEARNING_FILE
from rebt_ros.learning.learning_file import write_learning
from rebt_ros.learning.levels import check_most_levels
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.progress import Progress
from rebt_ros.learning.replaying import rows_for
from rebt_ros.offline.level_files import (
    TREE_FILE,
    channel_directories,
    clear_levels,
    nothing_of_before,
    write_decision_tree,
    write_levels,
    write_tree_pictures,
)
from rebt_ros.offline.result import OfflineLearning, write_summary
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import as_paths, load
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.verification.errors import BrokenRuleError, RuleError
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.ruling import Ruled, ruled

_Options = TypeVar("_Options", LearnOptions, InputOptions)

#: Names that ROS 2 has for topics.
_TOPIC = re.compile(r"/?(?:[A-Za-z_]\w*/)*[A-Za-z_]\w*", re.ASCII)

#: So many different ones can be actions even where each was shown once or twice.
_FEW_ACTIONS = 20

#: Of all the work, where pruning levels are written.
_LEARNING_SHARE = 0.3


def learn(
    inputs: Sequence[str | Path] | str | Path,
    *,
    out: str | Path | None = None,
    options: LearnOptions | None = None,
    reading: InputOptions | None = None,
    declared: Mapping[str, FeatureKind | str] | None = None,
    levels: bool = False,
    most_levels: int = 100,
    rules: str | Path | None = None,
    repair: bool = False,
    progress: Progress = lambda stage, share: None,
) -> OfflineLearning:
    """Learns a behavior tree from bags, recordings and CSV tables.

    Args:
        inputs: Each one or more demonstrations, oldest first; or the only one.
        out: Directory to write to: tree.json, summary.json, tree.txt, learning.npz (see
            `load_learning`), pictures of the behavior tree and of its decision tree.  With several
            channels the decision trees and learning.npz are in channels/NAME/.
        options: How to learn.
        reading: How to read the inputs, such as which column of a CSV table is the action.
        declared: Kinds of features by name, where they should not be detected.
        levels: Whether all pruning levels are written as well, to levels/ beside each decision
            tree.
        most_levels: If so, this many at most.
        rules: File of the rules that the tree must keep, beside the rules of the robot file by
            which the inputs were recorded or are read; see docs/rules.md.
        repair: Whether guards are put into a tree that breaks a rule, instead of refusing it.
        progress: Told what is being done and which share of the work is behind.

    Raises:
        RebtError: An input cannot be used, an option makes no sense, or the tree is not proven to
            keep its rules; nothing was written.
    """
    options = _checked("options", options or LearnOptions(), LearnOptions)
    reading = _checked("reading", reading or InputOptions(), InputOptions)
    declared = _kinds(declared or {})
    if out is not None and not (isinstance(out, str | Path) and str(out).strip()):
        raise OptionError(f"out must name a directory, not {out!r}: name one, or leave it out.")
    if levels:
        check_most_levels(most_levels)
    given = rules_for(rules)
    progress("reading", 0.0)
    paths = as_paths(inputs)
    loaded = load(paths, replace(reading, features=reading.features | frozenset(declared)))
    files = {one.name: path for one, path in zip(loaded.demonstrations, loaded.paths, strict=True)}
    together = tuple(notes_together(loaded.demonstrations))
    tables = tuple(
        replace(table, robot=loaded.robot)
        for table in tabulate(loaded.demonstrations, declared, loaded.weights)
    )
    asked = rules_for(given, loaded.robot)
    if asked is None:
        # The tables have all of it: nobody asks for a large one twice.
        loaded = replace(loaded, demonstrations=())
    learning = _part(progress, 0.0, _LEARNING_SHARE) if levels else progress
    for table in tables:
        _refuse_what_are_no_actions(table)
    learnings = pipeline.learn_channels(tables, options, learning)
    further = (note for learning in learnings for note in learning.notes)
    learned = pipeline.side_by_side(learnings)
    proven: tuple[str, ...] = ()
    if asked is not None:
        kept = _ruled(learned, asked, loaded.demonstrations, repair)
        learned, proven = kept.learned, kept.rules
    weights = _weights(tables[0])
    notes = (*loaded.notes, *together, *_on_weights(weights), *further, *_not_on_a_robot(learned))
    result = OfflineLearning(
        learned,
        learnings,
        notes,
        loaded.accounts,
        proven,
        aside=loaded.aside,
        excluded=(*loaded.excluded, *loaded.excluded_parts),
        paths=files,
        weights=weights,
    )
    if out is not None:
        writing = _part(progress, _LEARNING_SHARE, 1.0)
        most = most_levels if levels else 0
        write_tree(Path(out) / TREE_FILE, result.learned)
        result = write_files(Path(out), result, paths, options, most, writing)
    progress("done", 1.0)
    return result


def _checked(name: str, value: object, kind: type[_Options]) -> _Options:
    if not isinstance(value, kind):
        raise OptionError(f"{name} must be {kind.__name__}, not {value!r}.")
    return value


def _kinds(declared: object) -> dict[str, FeatureKind]:
    """Kinds of features, also by their words, such as ``{"docked": "binary"}``."""
    if not isinstance(declared, Mapping):
        raise OptionError(f"declared must be kinds by names of features, not {declared!r}.")
    words = [kind.value for kind in FeatureKind]
    kinds = {}
    for name, kind in declared.items():
        if not isinstance(kind, FeatureKind) and kind not in words:
            raise OptionError(
                f"the kind of {name!r} must be one of {', '.join(words)}, not {kind!r}."
            )
        kinds[name] = FeatureKind(kind)
    return kinds


def write_files(
    directory: Path,
    result: OfflineLearning,
    inputs: Sequence[str | Path],
    options: LearnOptions,
    most_levels: int = 0,
    progress: Progress = lambda stage, share: None,
) -> OfflineLearning:
    """Writes all files of a learned tree but tree.json; see `learn`.

    They may take a while, and which tree is published may change meanwhile.  Where one cannot be
    written, none of an earlier tree stays beside those that were.

    Args:
        directory: Where to.
        result: What was learned.
        inputs: What from, for the summary.
        options: How.
        most_levels: So many pruning levels at most; 0 for none.
        progress: Told what is being done and which share of the work is behind.

    Returns:
        The same, with notes on what could not be made.

    Raises:
        StorageError: A file cannot be written.
    """
    channels = [name for name, _ in channel_directories(result.learnings)]
    with nothing_of_before(directory, channels, [LEARNING_FILE]):
        missing = _write_trees(directory, result, options, most_levels, progress)
        result = replace(result, notes=(*result.notes, *missing))
        write_summary(directory, result, list(map(str, inputs)), options)
    return result


def _ruled(
    learned: LearnedTree, rules: RuleSet, demonstrations: Sequence[Demonstration], repair: bool
) -> Ruled:
    """The tree as it keeps its rules.

    Raises:
        RuleError: It does not keep them.
    """
    try:
        return ruled(learned, rules, rows_for(learned, demonstrations), mend=repair)
    except BrokenRuleError as err:
        raise RuleError(
            f"nothing is written: {err} Show what should be done there, or let --repair put guards "
            "into the tree."
        ) from err


def _not_on_a_robot(learned: LearnedTree) -> Iterator[str]:
    """What keeps the executor from running the tree."""
    for feature in unmeasurable(learned):
        yield (
            f"the tree tests {feature.name!r}, which holds texts ({feature.examples}): "
            "topics carry numbers, so that the executor refuses this tree; replay and "
            "rebt_ros.Policy run it"
        )
    for channel in nodes.policies(learned.tree):
        if not _TOPIC.fullmatch(channel):
            yield (
                f"{channel!r} is no name of a topic, so that the executor refuses this tree: "
                "name the topic or label column with letters, digits and underscores"
            )


def _weights(table: DemonstrationTable) -> dict[str, int]:
    """How often the rows of each demonstration count; empty where all count once."""
    if table.weights is None:
        return {}
    return dict(zip(table.demonstrations, table.weights.tolist(), strict=True))


def _on_weights(weights: Mapping[str, int]) -> Iterator[str]:
    """Says how much demonstrations count."""
    by_weight: dict[int, list[str]] = {}
    for name, weight in weights.items():
        by_weight.setdefault(weight, []).append(name)
    for weight, names in sorted(by_weight.items()):
        times = "once" if weight == 1 else f"{weight} times"
        yield f"each row counts {times} in {listing(names)}"


def _refuse_what_are_no_actions(table: DemonstrationTable) -> None:
    if len(table.actions) > _FEW_ACTIONS and len(table.actions) * 2 > len(table):
        raise InputError(
            f"{len(table.actions)} different actions in {len(table)} rows do not look like actions "
            f"({', '.join(table.actions[:3])}, …): name the column with --label, or the topic with "
            "--action-topic."
        )


def _part(progress: Progress, start: float, end: float) -> Progress:
    """Progress of a part of the work."""
    return lambda stage, share: progress(stage, start + share * (end - start))


def _write_trees(
    directory: Path,
    result: OfflineLearning,
    options: LearnOptions,
    most_levels: int,
    progress: Progress,
) -> tuple[str, ...]:
    """Writes all but the summary; returns notes, each once."""
    channels = list(channel_directories(result.learnings))
    notes: list[str] = []
    # The studio waits for these; pictures take longer.
    for name, learning in channels:
        notes += write_learning(directory / name, learning)
    notes += write_tree_pictures(directory, result.learned)
    write_text_atomically(directory / "tree.txt", render_text(result.learned))
    for place, (name, learning) in enumerate(channels):
        beside = directory / name
        notes += write_decision_tree(beside, learning.decision_tree.tree)
        if most_levels:
            count = len(result.learnings)
            of_channel = _part(progress, place / count, (place + 1) / count)
            notes += write_levels(beside, learning.levels, most_levels, of_channel)
        else:
            clear_levels(beside)
    return tuple(dict.fromkeys(notes))
