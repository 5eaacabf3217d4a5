"""What an executor's last tick did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rebt_ros.behavior_tree.learned_tree import LearnedTree


@dataclass(frozen=True, eq=False, slots=True)
class LastTick:
    """The state of a tick, and what came of the nodes that were ticked."""

    learned: LearnedTree
    values: tuple[float, ...]
    """Of the features of the tree."""
    outcomes: Mapping[int, str]
    """From `TreeRuntime.outcomes`."""
