"""Which branch of a tree acts: in one state, step by step, and in the rows of a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rebt_ros.arrays import IntArray, in_parts
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import States, as_it_stands, choose, history_columns
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable


class Outcome(Enum):
    """What came of a node in a tick."""

    SUCCESS = "success"
    FAILURE = "failure"
    RUNNING = "running"


@dataclass(frozen=True, slots=True)
class Step:
    """A node that was ticked, and what came of it."""

    node: nodes.Node
    outcome: Outcome
    children: tuple[Step, ...] = ()
    """Those of its children that were ticked."""
    leaf: int = -1
    """Of an action: its place among the action leaves of the tree."""
    skipped: int = 0
    """How many of its children come before the first that was ticked, as it goes on there."""

    def walk(self) -> Iterator[Step]:
        """This step and all below it, in the order of the ticks."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def acts(self) -> bool:
        """Whether an action was ticked in it."""
        return any(step.leaf >= 0 for step in self.walk())


def trace(
    tree: nodes.Node,
    features: Sequence[Feature],
    values: Sequence[float],
    history: ActionHistory,
) -> Step:
    """A first tick of the tree of one channel, with actions that are done at once.

    Args:
        tree: As it is executed.
        features: All features of the learned tree.
        values: One for each.
        history: What was done before.
    """
    row = np.array([values], dtype=np.float64)
    return _Tick(States(tuple(features), row, as_it_stands(history))).of(tree, 0)


def recorded(tree: nodes.Node, outcomes: Mapping[int, Outcome], first: int = 0) -> Step | None:
    """A tick that was done, whatever was remembered before it.

    Args:
        tree: The tree of one channel, as it was executed.
        outcomes: What came of the nodes that were ticked, by their places.
        first: The place of the tree's root.

    Returns:
        None if its root was not ticked.
    """
    return _recorded(tree, outcomes, first, 0)


def _recorded(
    node: nodes.Node, outcomes: Mapping[int, Outcome], place: int, leaf: int
) -> Step | None:
    if place not in outcomes:
        return None
    if isinstance(node, nodes.Action):
        return Step(node, outcomes[place], leaf=leaf)
    steps: list[Step] = []
    skipped = 0
    below = place + 1
    for child in nodes.children(node):
        step = _recorded(child, outcomes, below, leaf)
        if step is not None:
            steps.append(step)
        elif not steps:
            skipped += 1
        below += nodes.size(child)
        leaf += sum(isinstance(one, nodes.Action) for one in nodes.walk(child))
    return Step(node, outcomes[place], tuple(steps), skipped=skipped if steps else 0)


def commanding(traced: Step, tree: nodes.Node) -> Step | None:
    """The step whose action is the command; None if there is none."""
    ranks = nodes.precedence(tree)
    acting = [step for step in traced.walk() if step.leaf >= 0]
    return max(
        acting, key=lambda step: (step.outcome is Outcome.RUNNING, ranks[step.leaf]), default=None
    )


@dataclass(frozen=True, slots=True)
class _Tick:
    state: States

    def of(self, node: nodes.Node, leaf: int) -> Step:
        """A tick of a node, of which the first action leaf has this number."""
        match node:
            case nodes.Condition(literal=literal):
                holds = bool(self.state.satisfy(literal)[0])
                return Step(node, Outcome.SUCCESS if holds else Outcome.FAILURE)
            case nodes.Action():
                return Step(node, Outcome.SUCCESS, leaf=leaf)
            case nodes.Inverter(child=child):
                inner = self.of(child, leaf)
                return Step(node, _INVERTED[inner.outcome], (inner,))
            case nodes.Parallel():
                steps = tuple(self._in_turn(node, leaf, None))
                outcomes = [step.outcome for step in steps]
                decided = next((one for one in _DECIDING if one in outcomes), Outcome.SUCCESS)
                return Step(node, decided, steps)
            case nodes.Selector() | nodes.ParallelSelector():
                steps = tuple(self._in_turn(node, leaf, Outcome.FAILURE))
                return Step(node, steps[-1].outcome, steps)
            case nodes.Sequence():
                steps = tuple(self._in_turn(node, leaf, Outcome.SUCCESS))
                return Step(node, steps[-1].outcome, steps)
            case nodes.Repeater():
                steps = tuple(self._in_turn(node, leaf, Outcome.SUCCESS))
                again = steps[-1].outcome is Outcome.SUCCESS
                return Step(node, Outcome.RUNNING if again else steps[-1].outcome, steps)

    def _in_turn(self, node: nodes.Composite, leaf: int, goes_on: Outcome | None) -> Iterator[Step]:
        """Its children, up to the first that ends otherwise; with None, all of them."""
        for child in node.children:
            step = self.of(child, leaf)
            yield step
            if goes_on not in (None, step.outcome):
                return
            leaf += sum(isinstance(one, nodes.Action) for one in nodes.walk(child))


_INVERTED = {
    Outcome.SUCCESS: Outcome.FAILURE,
    Outcome.FAILURE: Outcome.SUCCESS,
    Outcome.RUNNING: Outcome.RUNNING,
}

#: Of the children of a Parallel, what decides, the strongest first.
_DECIDING = (Outcome.FAILURE, Outcome.RUNNING)


def acting_leaves(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """Which action leaf of a tree acts in each row, after what was shown before.

    Args:
        tree: The tree of the table's channel, as it is executed.
        table: Has the features of the tree.

    Returns:
        Places among the action leaves in their order, shape (rows,); -1 where none acts.
    """
    numbered, count = _numbered(tree, 0)
    actions = tuple(nodes.Action(str(place), table.channel) for place in range(count))
    acting = np.empty(len(table), dtype=np.int64)
    for rows in in_parts(len(table)):
        columns = history_columns(table.actions, table.previous[rows], table.last[rows])
        acting[rows] = choose(
            numbered, actions, States(table.features, table.states[rows], columns)
        )
    return acting


def _numbered(node: nodes.Node, count: int) -> tuple[nodes.Node, int]:
    """The tree with the place of each action leaf as its label, and how many there are."""
    if isinstance(node, nodes.Action):
        return nodes.Action(str(count), node.channel), count + 1
    children = []
    for child in nodes.children(node):
        numbered, count = _numbered(child, count)
        children.append(numbered)
    return nodes.with_children(node, tuple(children)), count
