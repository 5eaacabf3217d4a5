"""Replay over files: what a tree would have done in recorded rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.learning.replaying import Replay
from rebt_ros.learning.replaying import replay as replay_demonstrations
from rebt_ros.offline.replay_logs import write_btlog
from rebt_ros.offline.trees_and_rows import as_learned_tree, demonstrations_for
from rebt_ros.storage.input_options import InputOptions


def replay(
    tree: LearnedTree | str | Path,
    inputs: Sequence[str | Path] | str | Path,
    *,
    reading: InputOptions | None = None,
    btlog: str | Path | None = None,
) -> tuple[Replay, ...]:
    """Runs a tree over the rows of bags, recordings and CSV tables.

    Args:
        tree: A learned tree, or the file of one.
        inputs: Each one or more demonstrations; or the only one.
        reading: How to read the inputs.  Label columns of tables need not be named where they are
            called like the tree's channels, and no topics where the tree has a robot file.
        btlog: Where to write what every node did in every row, for Groot2 (docs/groot2.md); None
            for nowhere.

    Returns:
        One for each channel of the tree that was recorded.

    Raises:
        RebtError: The tree or an input cannot be used, or they do not fit each other, or the
            log cannot be written.
    """
    learned = as_learned_tree(tree)
    demonstrations = demonstrations_for(learned, inputs, reading)
    results = replay_demonstrations(learned, demonstrations)
    if btlog is not None:
        write_btlog(learned, demonstrations, Path(btlog))
    return results
