"""The decision tree as immutable data, in terms of conditions instead of encoded columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.logic.conditions import Condition, Literal
from rebt_ros.logic.dnf import Conjunction


@dataclass(frozen=True, slots=True)
class Leaf:
    """Where a decision path ends."""

    distribution: tuple[int, ...]
    """Training rows of each action, including made-up ones, in the order of the tree's actions."""

    @property
    def most_probable(self) -> int:
        """Position of the most frequent action; of equals, the first."""
        return self.distribution.index(max(self.distribution))


@dataclass(frozen=True, slots=True)
class Split:
    """A test on the way to a leaf."""

    condition: Condition
    if_true: DecisionNode
    if_false: DecisionNode


DecisionNode: TypeAlias = Leaf | Split


@dataclass(frozen=True, slots=True)
class DecisionTree:
    """A policy: every state leads to one leaf."""

    actions: tuple[Action, ...]
    root: DecisionNode

    @property
    def depth(self) -> int:
        """Splits on the longest path."""
        level, depth = [self.root], 0
        while level := [
            branch
            for node in level
            if isinstance(node, Split)
            for branch in (node.if_true, node.if_false)
        ]:
            depth += 1
        return depth

    @property
    def leaves(self) -> int:
        """Number of leaves."""
        return sum(isinstance(node, Leaf) for node in self.walk())

    def walk(self) -> Iterator[DecisionNode]:
        """All nodes, each before its branches and ``if_true`` before ``if_false``."""
        waiting = [self.root]
        while waiting:
            node = waiting.pop()
            yield node
            if isinstance(node, Split):
                waiting += [node.if_false, node.if_true]

    def paths(self) -> Iterator[tuple[Conjunction, Leaf]]:
        """Every leaf with the conjunction of the literals that lead to it, from left to right.

        A condition that a path tests twice, as may happen with thresholds at the limit of single
        precision, is in its conjunction once.  A path that contradicts itself is left out.
        """
        waiting: list[tuple[tuple[Literal, ...], DecisionNode]] = [((), self.root)]
        while waiting:
            literals, node = waiting.pop()
            if isinstance(node, Leaf):
                yield Conjunction(literals), node
                continue
            holds = Literal(node.condition)
            for literal, branch in ((~holds, node.if_false), (holds, node.if_true)):
                if ~literal not in literals:
                    known = literal in literals
                    waiting.append((literals if known else (*literals, literal), branch))
