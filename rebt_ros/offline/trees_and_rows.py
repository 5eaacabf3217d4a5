"""A learned tree, and what was shown to it: however each is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import as_paths, holds_bags, load
from rebt_ros.storage.tree_file import read_tree


def as_learned_tree(tree: LearnedTree | str | Path) -> LearnedTree:
    """A learned tree that is given as such, or by its file.

    Raises:
        RebtError: The file cannot be used.
    """
    return tree if isinstance(tree, LearnedTree) else read_tree(Path(tree))


def demonstrations_for(
    learned: LearnedTree,
    inputs: Sequence[str | Path] | str | Path,
    reading: InputOptions | None = None,
) -> tuple[Demonstration, ...]:
    """Reads inputs as a tree needs them.

    Columns of tables that are called like features of the tree are features, and those that are
    called like its channels hold actions.  Bags are read by the tree's robot file if it has one.

    Args:
        learned: The tree.
        inputs: Each one or more demonstrations; or the only one.
        reading: How to read them; what it says comes first.

    Raises:
        RebtError: An input cannot be used.
    """
    reading = reading or InputOptions()
    names = frozenset(feature.name for feature in learned.features)
    reading = replace(reading, features=reading.features | names)
    paths = as_paths(inputs)
    if learned.robot is not None and reading.robot is None and holds_bags(paths):
        reading = replace(reading, robot=learned.robot)
    policies = tuple(nodes.policies(learned.tree))
    if len(policies) > 1:
        reading = replace(reading, channels=reading.channels or policies)
    return load(paths, reading).demonstrations
