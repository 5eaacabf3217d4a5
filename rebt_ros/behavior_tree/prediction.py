"""What a behavior tree does on many states at once, without ticking it.

Actions count as succeeding at once and memory as empty, so that the result is that of a first tick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
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


#: Rows that are evaluated at a time: few enough to stay in a processor's cache, condition after
#: condition, and many enough for what Python does once per node not to matter.
_ROWS_AT_A_TIME = 16_384


@dataclass(frozen=True, eq=False, slots=True)
class States:
    """Rows of states on which a tree is evaluated; remembers the conditions it has tested."""

    features: tuple[Feature, ...]
    values: FloatArray
    """Shape (rows, features): numbers, 0 or 1, positions in a feature's categories, or NaN."""
    last_action: LastActionTest
    _tested: dict[Literal, BoolArray] = field(default_factory=dict, init=False)

    def __len__(self) -> int:
        return len(self.values)

    def satisfy(self, literal: Literal) -> BoolArray:
        """Where the literal holds, shape (rows,)."""
        found = self._tested.get(literal)
        if found is None:
            found = (
                ~self.satisfy(~literal) if not literal.positive else self._test(literal.condition)
            )
            self._tested[literal] = found
        return found

    def parts(self) -> Iterator[tuple[slice, States]]:
        """The rows in parts that are quick to evaluate, each with its place."""
        if len(self) <= _ROWS_AT_A_TIME:
            yield slice(0, len(self)), self
            return
        tested: dict[LastActionIs, BoolArray | bool] = {}

        def last_action(condition: LastActionIs) -> BoolArray | bool:
            if condition not in tested:
                tested[condition] = self.last_action(condition)
            return tested[condition]

        for start in range(0, len(self), _ROWS_AT_A_TIME):
            rows = slice(start, min(start + _ROWS_AT_A_TIME, len(self)))
            # Column by column, as they are tested.
            values = np.asfortranarray(self.values[rows])
            yield rows, States(self.features, values, _in_part(last_action, rows))

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


def _in_part(last_action: LastActionTest, rows: slice) -> LastActionTest:
    def test(condition: LastActionIs) -> BoolArray | bool:
        found = last_action(condition)
        return found if isinstance(found, bool) else found[rows]

    return test


def triggered(tree: nodes.Node, states: States) -> dict[nodes.Action, BoolArray]:
    """In which states each action is ticked, in the order in which the tree names them.

    Args:
        tree: The behavior tree.
        states: The rows to evaluate.

    Returns:
        One array of shape (rows,) per action.
    """
    ticked = {action: np.zeros(len(states), dtype=bool) for action in nodes.actions(tree)}
    for rows, part in states.parts():
        in_part = {action: where[rows] for action, where in ticked.items()}
        _tick(tree, part, np.ones(len(part), dtype=bool), in_part)
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
    named = nodes.actions(tree)
    for rows, part in states.parts():
        ticked = {action: np.zeros(len(part), dtype=bool) for action in named}
        _tick(tree, part, np.ones(len(part), dtype=bool), ticked)
        # The first that is named is written last.
        for action in reversed(named):
            if action in actions:
                np.putmask(chosen[rows], ticked[action], actions.index(action))
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
            where = ticked[node]
            where |= reached
            return reached
        case nodes.Inverter(child=child):
            return reached & ~_tick(child, states, reached, ticked)
        case nodes.Sequence(children=children) | nodes.Repeater(children=children):
            for child in children:
                reached = _tick(child, states, reached, ticked)
                if not reached.any():
                    break
            return reached
        case nodes.Selector(children=children) | nodes.ParallelSelector(children=children):
            left = reached
            for child in children:
                left = left & ~_tick(child, states, left, ticked)
                if not left.any():
                    break
            return reached & ~left
        case nodes.Parallel(children=children):
            results = [_tick(child, states, reached, ticked) for child in children]
            for succeeded in results:
                reached = reached & succeeded
            return reached
