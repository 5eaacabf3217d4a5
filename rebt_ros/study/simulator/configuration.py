"""The behavior trees that are simulated in the paper's experiments (IV-B).

check
    A leaf that compares an environment variable with a threshold.
act
    A leaf that tries an action.
group
    A node over an ordered list of others.
environment variable
    A number in [0, 1] that checks read.

`configuration_file` reads and writes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.logic.conditions import Literal, Threshold


class GroupKind(Enum):
    """How a group runs its children; the values are those of the files."""

    SEQUENCE = "sequence"
    """In order until one fails; resumes at the child that runs."""
    SELECTOR = "selector"
    """In order until one succeeds; begins with the first at every tick."""
    PARALLEL = "parallel"
    """All, each until it has succeeded; fails, and halts them, once one fails."""
    PARALLEL_SELECTOR = "parsel"
    """A Parallel/Selector node: simulated as a Parallel."""
    REPEATER = "repeater"
    """As a Sequence, several times."""


@dataclass(frozen=True, slots=True)
class Check:
    """Succeeds where the variable is below the threshold."""

    variable: str
    threshold: float
    p_correct: float = 1.0
    """Probability of the right answer; otherwise the opposite one is given."""


@dataclass(frozen=True, slots=True)
class Act:
    """Tries an action."""

    label: str
    p_success: float = 1.0
    """Probability that it succeeds, once it is done."""


@dataclass(frozen=True, slots=True)
class Inverted:
    """Turns success into failure, and failure into success."""

    child: SimulatedNode


@dataclass(frozen=True, slots=True)
class Group:
    """A node with children."""

    kind: GroupKind
    children: tuple[SimulatedNode, ...]

    def __post_init__(self) -> None:
        if not self.children:
            raise ValueError(f"a {self.kind.value} needs children")


SimulatedNode: TypeAlias = Check | Act | Inverted | Group


@dataclass(frozen=True, slots=True)
class ExperimentConfig:
    """A behavior tree to simulate."""

    name: str
    """Where it came from, for messages."""
    root: Group
    notes: tuple[str, ...] = ()
    """What was skipped, one clause each."""

    @property
    def variables(self) -> tuple[str, ...]:
        """The environment variables that checks read, sorted."""
        return tuple(
            sorted({leaf.variable for leaf in leaves(self.root) if isinstance(leaf, Check)})
        )

    @property
    def actions(self) -> tuple[str, ...]:
        """The labels of the actions, sorted."""
        return tuple(sorted({leaf.label for leaf in leaves(self.root) if isinstance(leaf, Act)}))

    @property
    def subtrees(self) -> tuple[SimulatedNode, ...]:
        """What stands under the root: what an experiment looks for in the learned trees."""
        return self.root.children


def leaves(node: SimulatedNode) -> Iterator[Check | Act]:
    """The leaves of a tree from left to right."""
    match node:
        case Group(children=children):
            for child in children:
                yield from leaves(child)
        case Inverted(child=child):
            yield from leaves(child)
        case _:
            yield node


def as_behavior_tree(node: SimulatedNode) -> nodes.Node:
    """The tree in the words of learned ones, without probabilities.

    A check ``variable < threshold`` becomes ``variable <= threshold``: for numbers that are drawn
    at random they are the same.
    """
    match node:
        case Check(variable=variable, threshold=threshold):
            return nodes.Condition(Literal(Threshold(variable, threshold)))
        case Act(label=label):
            return nodes.Action(label, DEFAULT_CHANNEL)
        case Inverted(child=child):
            return nodes.Inverter(as_behavior_tree(child))
        case Group(kind=kind, children=children):
            subtrees = tuple(map(as_behavior_tree, children))
            match kind:
                case GroupKind.SEQUENCE:
                    return nodes.Sequence(subtrees, memory=True)
                case GroupKind.SELECTOR:
                    return nodes.Selector(subtrees)
                case GroupKind.PARALLEL:
                    return nodes.Parallel(subtrees)
                case GroupKind.PARALLEL_SELECTOR:
                    return nodes.ParallelSelector(subtrees)
                case GroupKind.REPEATER:
                    return nodes.Repeater(subtrees)
