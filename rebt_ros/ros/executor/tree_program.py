"""A tree with all that the executor needs to run it."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.novelty import NoveltyDetector
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.export.watched import WatchedTree
from rebt_ros.live.tree_inputs import TreeInputs


@dataclass(frozen=True, eq=False, slots=True)
class TreeProgram:
    """A tree that is ready to be ticked."""

    document: str
    fingerprint: str
    """Of the document."""
    runtime: TreeRuntime
    inputs: TreeInputs
    novelty: NoveltyDetector
    watched: WatchedTree | None
    """As it is watched; None where nobody does, or where it is too large for that."""

    @property
    def learned(self) -> LearnedTree:
        """The tree as it was learned."""
        return self.runtime.learned

    @property
    def channels(self) -> list[str]:
        """Its channels, sorted."""
        return channels_of(self.learned)


def channels_of(learned: LearnedTree) -> list[str]:
    """The channels of a tree, sorted."""
    return sorted({action.channel for action in learned.actions})
