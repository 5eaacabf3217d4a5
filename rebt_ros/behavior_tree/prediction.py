"""What a behavior tree does on many states at once, without ticking it.

Actions count as succeeding at once and memory as empty, so that the result is that of a first tick.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import (
    Condition,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    Threshold,
)

#: Tells in which of the states a LAT condition holds, or for all of them at once.
LastActionTest: TypeAlias = Callable[[LastActionIs], BoolArray | bool]


def last_action_column(labels: tuple[str, ...], last: IntArray) -> LastActionTest:
    """LAT as a decision tree reads it: one column, whatever action is being decided."""
    code = {label: position for position, label in enumerate(labels)}
    return lambda condition: last == code.get(condition.action, NO_ACTION - 1)


def last_action_of(history: ActionHistory) -> LastActionTest:
    """LAT as an executed tree reads it: from one history, by the rule that asks."""
    return lambda condition: history.before(*condition.deciding) == condition.action


@dataclass(frozen=True, eq=False, slots=True)
class States:
    """Rows of states on which a tree is evaluated; remembers the conditions it has tested."""

    features: tuple[Feature, ...]
    values: FloatArray
    """Shape (rows, features): numbers, 0 or 1, positions in a feature's categories, or NaN."""
    last_action: LastActionTest
    _tested: dict[Condition, BoolArray] = field(default_factory=dict, init=False)

    def __len__(self) -> int:
        return len(self.values)

    def satisfy(self, literal: Literal) -> BoolArray:
        """Where the literal holds, shape (rows,)."""
        if literal.condition not in self._tested:
            self._tested[literal.condition] = self._test(literal.condition)
        holds = self._tested[literal.condition]
        return holds if literal.positive else ~holds

    def _test(self, condition: Condition) -> BoolArray:
        if isinstance(condition, LastActionIs):
            return np.broadcast_to(self.last_action(condition), len(self))
        index, feature = next(
            (index, one) for index, one in enumerate(self.features) if one.name == condition.feature
        )
        column: FloatArray = self.values[:, index]
        match condition:
            case Threshold(value=value):
                return np.less_equal(column, value)
            case Interval(above=above, at_most=at_most):
                return np.less(above, column) & np.less_equal(column, at_most)
            case IsTrue():
                return np.equal(column, 1)
            case HasCategory(category=category):
                return np.equal(column, feature.categories.index(category))


def triggered(tree: nodes.Node, states: States) -> dict[nodes.Action, BoolArray]:
    """In which states each action is ticked, in the order in which the tree names them.

    Args:
        tree: The behavior tree.
        states: The rows to evaluate.

    Returns:
        One array of shape (rows,) per action.
    """
    ticked = {action: np.zeros(len(states), dtype=bool) for action in nodes.actions(tree)}
    _tick(tree, states, np.ones(len(states), dtype=bool), ticked)
    return ticked


def choose(tree: nodes.Node, actions: tuple[nodes.Action, ...], states: States) -> IntArray:
    """The action that the tree takes in each state.

    Args:
        tree: The behavior tree.
        actions: What the result's numbers stand for.
        states: The rows to evaluate.

    Returns:
        Positions in `actions`, shape (rows,); `NO_ACTION` where the tree takes none of them.  Where
        a Parallel takes several, it is the first that the tree names.
    """
    chosen = np.full(len(states), NO_ACTION, dtype=np.int64)
    for action, ticked in triggered(tree, states).items():
        if action in actions:
            chosen[ticked & (chosen == NO_ACTION)] = actions.index(action)
    return chosen


def _tick(
    node: nodes.Node,
    states: States,
    reached: BoolArray,
    ticked: dict[nodes.Action, BoolArray],
) -> BoolArray:
    """Where the node succeeds, of the states in which it is reached."""
    match node:
        case nodes.Condition(literal=literal):
            return reached & states.satisfy(literal)
        case nodes.Action():
            ticked[node] |= reached
            return reached
        case nodes.Inverter(child=child):
            return reached & ~_tick(child, states, reached, ticked)
        case nodes.Sequence(children=children) | nodes.Repeater(children=children):
            for child in children:
                reached = _tick(child, states, reached, ticked)
            return reached
        case nodes.Selector(children=children) | nodes.ParallelSelector(children=children):
            succeeded = np.zeros(len(states), dtype=bool)
            for child in children:
                succeeded |= _tick(child, states, reached & ~succeeded, ticked)
            return succeeded
        case nodes.Parallel(children=children):
            results = [_tick(child, states, reached, ticked) for child in children]
            for succeeded in results:
                reached = reached & succeeded
            return reached
