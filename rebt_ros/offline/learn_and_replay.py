"""Learning from files and replaying over files: the Python side of the commands."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, unmeasurable
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.drawing.text import render_text
from rebt_ros.errors import InputError
from rebt_ros.learning import pipeline
from rebt_ros.learning.cross_validation import JudgedLevels
from rebt_ros.learning.levels import Family, check_most_levels
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import Learning, Progress
from rebt_ros.learning.replaying import Replay
from rebt_ros.learning.replaying import replay as replay_demonstrations
from rebt_ros.logic.conditions import Interval
from rebt_ros.offline.level_files import (
    channel_directories,
    clear_family,
    write_behavior_tree,
    write_decision_tree,
    write_family,
)
from rebt_ros.storage.account import Account
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.inputs import InputOptions, load
from rebt_ros.storage.tree_file import read_tree
from rebt_ros.storage.versions import versions

#: Names that ROS 2 has for topics.
_TOPIC = re.compile(r"/?(?:[A-Za-z_]\w*/)*[A-Za-z_]\w*", re.ASCII)

#: So many different ones can be actions even where each was shown once or twice.
_FEW_ACTIONS = 20

#: Packages whose versions can change a result.
_DECIDING_PACKAGES = ("numpy", "scikit-learn", "pyeda", "py_trees")
#: Of all the work, where pruning levels are written.
_LEARNING_SHARE = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class OfflineLearning:
    """A tree learned from files."""

    learned: LearnedTree
    """The value of the behavior tree document."""
    learnings: tuple[Learning, ...]
    """What it was made from, for each channel."""
    notes: tuple[str, ...]
    """What a person should know about the inputs; no full stops."""
    accounts: Mapping[str, Account] = field(default_factory=dict)
    """Where what each demonstration's file holds went."""


def learn(
    inputs: Sequence[str | Path] | str | Path,
    *,
    out: str | Path | None = None,
    options: LearnOptions | None = None,
    reading: InputOptions | None = None,
    declared: Mapping[str, FeatureKind] | None = None,
    levels: bool = False,
    most_levels: int = 100,
    progress: Progress = lambda stage, share: None,
) -> OfflineLearning:
    """Learns a behavior tree from bags, recordings and CSV tables.

    Args:
        inputs: Each one or more demonstrations, oldest first; or the only one.
        out: Directory to write to: tree.json, summary.json, tree.txt, pictures of the behavior
            tree and of its decision tree.  With several channels the decision trees are in
            channels/NAME/.
        options: How to learn.
        reading: How to read the inputs, such as which column of a CSV table is the action.
        declared: Kinds of features by name, where they should not be detected.
        levels: Whether all pruning levels are written as well, to levels/ beside each decision
            tree.
        most_levels: If so, this many at most.
        progress: Told what is being done and which share of the work is behind.

    Raises:
        RebtError: An input cannot be used or an option makes no sense; nothing was written.
    """
    options = options or LearnOptions()
    if levels:
        check_most_levels(most_levels)
    progress("reading", 0.0)
    paths = _paths(inputs)
    reading = reading or InputOptions()
    loaded = load(paths, replace(reading, features=reading.features | frozenset(declared or ())))
    tables = tabulate(loaded.demonstrations, declared)
    learning = _part(progress, 0.0, _LEARNING_SHARE) if levels else progress
    for table in tables:
        _refuse_what_are_no_actions(table)
    learnings = pipeline.learn_channels(tables, options, learning)
    further = (note for learning in learnings for note in learning.notes)
    learned = pipeline.side_by_side(learnings)
    notes = (*loaded.notes, *further, *_not_on_a_robot(learned))
    result = OfflineLearning(learned, learnings, notes, loaded.accounts)
    if out is not None:
        writing = _part(progress, _LEARNING_SHARE, 1.0)
        missing = _write_trees(Path(out), result, options, most_levels if levels else 0, writing)
        result = replace(result, notes=(*notes, *missing))
        _write_summary(Path(out), result, [str(one) for one in paths], options)
    progress("done", 1.0)
    return result


def replay(
    tree: LearnedTree | str | Path,
    inputs: Sequence[str | Path] | str | Path,
    *,
    reading: InputOptions | None = None,
) -> tuple[Replay, ...]:
    """Runs a tree over the rows of bags, recordings and CSV tables.

    Args:
        tree: A learned tree, or the file of one.
        inputs: Each one or more demonstrations; or the only one.
        reading: How to read the inputs.  Label columns of tables need not be named where they are
            called like the tree's channels.

    Returns:
        One for each channel of the tree that was recorded.

    Raises:
        RebtError: The tree or an input cannot be used, or they do not fit each other.
    """
    learned = tree if isinstance(tree, LearnedTree) else read_tree(Path(tree))
    reading = reading or InputOptions()
    names = frozenset(feature.name for feature in learned.features)
    reading = replace(reading, features=reading.features | names)
    policies = tuple(nodes.policies(learned.tree))
    if len(policies) > 1:
        reading = replace(reading, channels=reading.channels or policies)
    return replay_demonstrations(learned, load(_paths(inputs), reading).demonstrations)


def _paths(inputs: Sequence[str | Path] | str | Path) -> tuple[Path, ...]:
    return tuple(map(Path, [inputs] if isinstance(inputs, str | Path) else inputs))


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
                "rename the label column, with letters, digits and underscores"
            )


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
    notes = write_behavior_tree(directory, result.learned)
    write_text_atomically(directory / "tree.txt", render_text(result.learned))
    for place, (name, learning) in enumerate(channel_directories(result.learnings)):
        beside = directory / name
        notes += write_decision_tree(beside, learning.decision_tree.tree)
        if most_levels:
            count = len(result.learnings)
            of_channel = _part(progress, place / count, (place + 1) / count)
            notes += write_family(beside, Family(learning, options), most_levels, of_channel)
        else:
            clear_family(beside)
    return tuple(dict.fromkeys(notes))


def _write_summary(
    directory: Path, result: OfflineLearning, inputs: Sequence[str], options: LearnOptions
) -> None:
    summary = summarize(result) | {
        "inputs": list(inputs),
        "accounts": {name: account.as_json() for name, account in result.accounts.items()},
        "notes": list(result.notes),
        "random_state": options.random_state,
        "upsample": options.upsample.value,
        "test_fraction": options.test_fraction,
        "refit": options.refit,
        "lags": options.lags,
        "versions": _versions(options),
    }
    text = json.dumps(summary, indent=2, ensure_ascii=False)
    write_text_atomically(directory / "summary.json", text + "\n")


def summarize(result: OfflineLearning) -> dict[str, Any]:
    """The figures of a learned tree, as written to summary.json."""
    learned, provenance = result.learned, result.learned.provenance
    figures = provenance.figures
    summary = {
        "rows": provenance.rows,
        "demonstrations": provenance.demonstrations,
        "features": [feature.name for feature in learned.features],
        "actions": [action.label for action in learned.actions],
        "nodes": nodes.size(learned.tree),
        "intervals": _intervals(learned.tree),
        "depth": nodes.depth(learned.tree),
        "fidelity_mismatches": figures.fidelity_mismatches,
        "held_out_rows": figures.held_out_rows,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        "mean_recall": figures.mean_recall,
        "history": provenance.history.value,
        "row_kind": learned.row_kind.value,
        "root": provenance.root.value,
        "delta": provenance.delta,
        "max_depth": provenance.max_depth,
        "ccp_alpha": provenance.ccp_alpha,
        "suggestions": [
            {
                "id": one.id,
                "kind": one.kind.value,
                "support": one.support,
                "nodes": nodes.size(one.subtree),
                "attached": one.attached,
            }
            for one in learned.suggestions
        ],
    }
    if len(result.learnings) == 1:
        return summary | _choices(result.learnings[0])
    return summary | {"channels": {one.table.channel: _of_channel(one) for one in result.learnings}}


def _of_channel(learning: Learning) -> dict[str, Any]:
    figures = learning.learned.provenance.figures
    return {
        "rows": learning.learned.provenance.rows,
        "nodes": nodes.size(learning.learned.tree),
        "intervals": _intervals(learning.learned.tree),
        "ccp_alpha": learning.policy.ccp_alpha,
        "fidelity_mismatches": figures.fidelity_mismatches,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        **_choices(learning),
    }


def _intervals(tree: nodes.Node) -> int:
    """Nodes that stand for two thresholds each."""
    conditions = (node for node in nodes.walk(tree) if isinstance(node, nodes.Condition))
    return sum(isinstance(one.literal.condition, Interval) for one in conditions)


def _choices(learning: Learning) -> dict[str, Any]:
    return {
        "decision_tree_leaves": learning.decision_tree.tree.leaves,
        "psa": learning.policy.psa,
        "report": learning.report.as_json(),
        "reasons": list(learning.policy.reasons),
        "levels": list(_levels(learning.policy.levels)),
    }


def _levels(levels: JudgedLevels | None) -> Iterator[dict[str, float]]:
    """The pruning levels that were chosen from, with their agreement in cross-validation."""
    if levels is not None:
        columns = (levels.ccp_alphas, levels.mean_recalls, levels.means, levels.standard_errors)
        for alpha, recall, mean, error in zip(*(one.tolist() for one in columns), strict=True):
            yield {
                "ccp_alpha": alpha,
                "mean_recall": recall,
                "agreement": mean,
                "standard_error": error,
            }


def _versions(options: LearnOptions) -> dict[str, str]:
    further = () if options.upsample is Upsampling.NONE else ("imbalanced-learn",)
    return versions((*_DECIDING_PACKAGES, *further))
