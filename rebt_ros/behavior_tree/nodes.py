"""The behavior tree as immutable data.

Sequence, Selector, Parallel
    Control nodes; Sequence and Selector are memoryless unless they say otherwise.
ParallelSelector
    Actions that were shown about equally often in the same states (PSA).  The user turns it into a
    Parallel or a Selector; it acts as a Selector until told otherwise.
Inverter
    Succeeds where its child fails, and the other way round.
Repeater
    A Sequence that starts again whenever it has succeeded, until it fails.
Condition, Action
    The leaves.

py_trees objects, JSON, pictures and predictions are views of these values.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from typing import TypeAlias

from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs, features_of


@dataclass(frozen=True, slots=True)
class Condition:
    """Succeeds where the literal holds, and fails elsewhere."""

    literal: Literal


@dataclass(frozen=True, slots=True)
class Action:
    """Sends the command `label` on `channel`."""

    label: str
    channel: str


@dataclass(frozen=True, slots=True)
class Inverter:
    """Turns its child's success into failure, and failure into success."""

    child: Node


@dataclass(frozen=True, slots=True)
class _Control:
    children: tuple[Node, ...]

    def __post_init__(self) -> None:
        if not self.children:
            raise ValueError(f"a {type(self).__name__} needs children")


@dataclass(frozen=True, slots=True)
class Sequence(_Control):
    """Runs its children in order until one fails."""

    memory: bool = False
    """Whether it resumes at the child that was running, instead of at the first."""


@dataclass(frozen=True, slots=True)
class Selector(_Control):
    """Runs its children in order until one succeeds."""

    memory: bool = False
    """Whether it resumes at the child that was running, instead of at the first."""


@dataclass(frozen=True, slots=True)
class Parallel(_Control):
    """Runs all its children at every tick; succeeds when all have, fails when one does.

    Where several of them act on the same channel, the first one has it (see `precedence`).
    """


@dataclass(frozen=True, slots=True)
class ParallelSelector(_Control):
    """Actions to choose from (paper: Parallel Selector Actions)."""


@dataclass(frozen=True, slots=True)
class Repeater(_Control):
    """Runs its children as a Sequence with memory, again and again until one fails."""


Composite: TypeAlias = Sequence | Selector | Parallel | ParallelSelector | Repeater
Node: TypeAlias = Composite | Inverter | Condition | Action


def children(node: Node) -> tuple[Node, ...]:
    """The node's children, none for leaves."""
    if isinstance(node, _Control):
        return node.children
    return (node.child,) if isinstance(node, Inverter) else ()


def with_children(node: Node, family: tuple[Node, ...]) -> Node:
    """The node with other children, as many as it must have; a leaf stays as it is."""
    if isinstance(node, _Control):
        return replace(node, children=family)
    return Inverter(*family) if isinstance(node, Inverter) else node


def walk(node: Node) -> Iterator[Node]:
    """The node and all its descendants, each parent before its children."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        # Most nodes are conditions: all proofs and drawings walk, so this is kept quick.
        if not isinstance(node, Condition):
            waiting.extend(reversed(children(node)))


def size(node: Node) -> int:
    """Number of nodes of the tree."""
    return sum(1 for _ in walk(node))


def depth(node: Node) -> int:
    """Number of nodes on the longest way from the root to a leaf."""
    level, deepest = [node], 0
    while level:
        level = [child for one in level for child in children(one)]
        deepest += 1
    return deepest


def actions(node: Node) -> tuple[Action, ...]:
    """Each action of the tree once, in the order in which it first occurs."""
    return tuple(dict.fromkeys(one for one in walk(node) if isinstance(one, Action)))


def is_reactive(node: Node) -> bool:
    """Whether a tick takes one action at most, and leaves nothing behind but the history.

    Actions that stand together under a Parallel count as the one that has the channel.
    """
    for one in walk(node):
        match one:
            case Sequence(memory=True) | Selector(memory=True) | Repeater():
                return False
            case Parallel() if not all(isinstance(child, Action) for child in one.children):
                return False
            case Inverter() if actions(one):
                return False
            case Sequence():
                if any(actions(child) for child in one.children[:-1]):
                    return False
    return True


def precedence(node: Node) -> tuple[int, ...]:
    """Which of several actions that are ticked together is the command of their channel.

    A channel carries one command at a time.  What is ticked later takes the place of what was
    ticked before, as where one step of a Sequence has ended and the next begins.  The children of a
    Parallel begin together: the first one that acts has the channel, which of a PSA group is the
    best supported action.

    Returns:
        For each leaf that is an action, in the order of `walk`, its rank: the highest of those
        ticked is the command.
    """
    ascending = _ascending(node, count())
    ranks = dict(zip(ascending, count(), strict=False))
    return tuple(ranks[leaf] for leaf in range(len(ascending)))


def _ascending(node: Node, numbers: Iterator[int]) -> list[int]:
    """The numbers of the leaves that are actions, those that give way first."""
    if isinstance(node, Action):
        return [next(numbers)]
    if isinstance(node, Condition):
        return []
    below = [_ascending(child, numbers) for child in children(node)]
    return [leaf for one in (below[::-1] if isinstance(node, Parallel) else below) for leaf in one]


def conditions(node: Node) -> tuple[Condition, ...]:
    """Each condition of the tree once, in the order in which it first occurs."""
    return tuple(dict.fromkeys(one for one in walk(node) if isinstance(one, Condition)))


def features(node: Node) -> frozenset[str]:
    """The names of the features that the tree tests."""
    return frozenset(
        name
        for condition in conditions(node)
        if not isinstance(condition.literal.condition, PreviousActionIs | LastActionIs)
        for name in features_of(condition.literal.condition)
    )


def policies(node: Node) -> dict[str, Node]:
    """The tree of each channel.

    Channels act side by side under a root Parallel with one child for each.  A Parallel whose
    children share a channel is the root of one policy, with a child for each rule.
    """
    if isinstance(node, Parallel):
        channels = [{action.channel for action in actions(child)} for child in node.children]
        if all(len(channel) == 1 for channel in channels) and len(set.union(*channels)) == len(
            channels
        ):
            return {
                channel.pop(): child for channel, child in zip(channels, node.children, strict=True)
            }
    return {action.channel: node for action in actions(node)[:1]}
