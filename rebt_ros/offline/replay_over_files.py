"""Replay over files: what a tree would have done in recorded rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.learning.replaying import Replay
from rebt_ros.learning.replaying import replay as replay_demonstrations
from rebt_ros.storage.inputs import InputOptions, as_paths, holds_bags, load
from rebt_ros.storage.tree_file import read_tree


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
            called like the tree's channels, and no topics where the tree has a robot file.

    Returns:
        One for each channel of the tree that was recorded.

    Raises:
        RebtError: The tree or an input cannot be used, or they do not fit each other.
    """
    learned = tree if isinstance(tree, LearnedTree) else read_tree(Path(tree))
    reading = reading or InputOptions()
    names = frozenset(feature.name for feature in learned.features)
    reading = replace(reading, features=reading.features | names)
    paths = as_paths(inputs)
    if learned.robot is not None and reading.robot is None and holds_bags(paths):
        reading = replace(reading, robot=learned.robot)
    policies = tuple(nodes.policies(learned.tree))
    if len(policies) > 1:
        reading = replace(reading, channels=reading.channels or policies)
    return replay_demonstrations(learned, load(paths, reading).demonstrations)
