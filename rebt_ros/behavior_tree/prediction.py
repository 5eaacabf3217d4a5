"""What a behavior tree does on many states at once, without ticking it.

Actions count as succeeding at once and memory as empty, so that the result is that of a first tick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial, reduce
from itertools import count
from operator import and_
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import StateTests, holds_after
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import (
    Condition,
    HistoryCondition,
    LastActionIs,
    Literal,
    PreviousActionIs,
    features_of,
)

#: Tells in which of the states a condition on the history holds, or for all of them at once.
HistoryTest: TypeAlias = Callable[[HistoryCondition], BoolArray | bool]


def history_columns(labels: tuple[str, ...], previous: IntArray, last: IntArray) -> HistoryTest:
    """The history as a decision tree reads it: columns, whatever action is being decided."""
    code = {label: position for position, label in enumerate(labels)}

    def holds(condition: HistoryCondition) -> BoolArray:
        column = previous if isinstance(condition, PreviousActionIs) else last
        return np.equal(column, code.get(condition.action, NO_ACTION - 1))

    return holds


def as_it_stands(history: ActionHistory) -> HistoryTest:
    """The history as an executed tree reads it; of LAT, by the rule that asks."""
    return partial(holds_after, history)


#: Rows that are evaluated at a time: so many that what Python does once per node does not matter,
#: and few enough for a column of them to stay in a processor's cache.
_ROWS_AT_A_TIME = 131_072
#: Rows whose columns are copied at a time, which stay in the cache meanwhile.
_ROWS_COPIED = 512
#: Rows that one number of a mask stands for.
_BITS = 64

#: A bit per row, 64 to a number; behind the last row there are zeros.
_Mask: TypeAlias = "npt.NDArray[np.uint64]"
#: Where a node succeeds, of the rows in which it is reached.
_Step: TypeAlias = Callable[["_Part", _Mask], _Mask]


@dataclass(frozen=True, eq=False, slots=True)
class States:
    """Rows of states on which a tree is evaluated."""

    features: tuple[Feature, ...]
    values: FloatArray
    """Shape (rows, features): numbers, 0 or 1, positions in a feature's categories, or NaN."""
    history: HistoryTest

    def __len__(self) -> int:
        return len(self.values)

    def satisfy(self, literal: Literal) -> BoolArray:
        """Where the literal holds, shape (rows,)."""
        condition = literal.condition
        if isinstance(condition, PreviousActionIs | LastActionIs):
            holds = np.broadcast_to(self.history(condition), len(self))
        else:
            holds = StateTests(self.features).of(condition)(self.values.T)
        return holds if literal.positive else ~holds


def triggered(tree: nodes.Node, states: States) -> dict[nodes.Action, BoolArray]:
    """In which states each action is ticked, in the order in which the tree names them.

    Args:
        tree: The behavior tree.
        states: The rows to evaluate.

    Returns:
        One array of shape (rows,) per action.
    """
    plan = Plan(tree, states.features)
    ticked = {action: np.zeros(len(states), dtype=bool) for action in plan.actions}
    for rows, in_part in plan.ticked(states):
        for action, where in zip(plan.actions, in_part, strict=True):
            ticked[action][rows] = where
    return ticked


def choose(tree: nodes.Node, actions: tuple[nodes.Action, ...], states: States) -> IntArray:
    """The action that the tree takes in each state.

    Args:
        tree: The behavior tree.
        actions: What the result's numbers stand for.
        states: The rows to evaluate.

    Returns:
        Positions in `actions`, shape (rows,); `NO_ACTION` where the tree takes none, or another
        one.  Where it takes several, it is the command (see `nodes.precedence`).
    """
    return Plan(tree, states.features).choose(actions, states)


class Plan:
    """A tree that is made ready to be evaluated on many states of the same features, many times."""

    def __init__(self, tree: nodes.Node, features: tuple[Feature, ...]) -> None:
        in_order = list(nodes.walk(tree))
        leaves = [node for node in in_order if isinstance(node, nodes.Action)]
        self.actions = tuple(dict.fromkeys(leaves))
        """In the order in which the tree names them."""
        numbers = {action: number for number, action in enumerate(self.actions)}
        self._leaf_actions = tuple(numbers[leaf] for leaf in leaves)
        ranks = nodes.precedence(tree)
        # From the leaf that has its channel before all others on.
        self._descending = sorted(range(len(leaves)), key=ranks.__getitem__, reverse=True)
        conditions = dict.fromkeys(
            node.literal.condition for node in in_order if isinstance(node, nodes.Condition)
        )
        self._conditions = tuple(conditions)
        place = {condition: number for number, condition in enumerate(conditions)}
        self._root = _step(tree, place, count())
        # Of what is tested, the columns that are read.
        by_name = {feature.name: number for number, feature in reversed([*enumerate(features)])}
        read = {
            by_name[name]
            for condition in conditions
            if not isinstance(condition, PreviousActionIs | LastActionIs)
            for name in features_of(condition)
        }
        self._columns = tuple(sorted(read))
        tests = StateTests([features[column] for column in self._columns])
        self._tests = {
            number: tests.of(condition)
            for number, condition in enumerate(self._conditions)
            if not isinstance(condition, PreviousActionIs | LastActionIs)
        }

    def choose(self, actions: tuple[nodes.Action, ...], states: States) -> IntArray:
        """As the function of this name."""
        chosen = np.full(len(states), NO_ACTION, dtype=np.int64)
        code = [
            actions.index(action) if action in actions else NO_ACTION for action in self.actions
        ]
        for rows, part in self._parts(states):
            for number, mask in zip(code, self._commands(part), strict=True):
                np.putmask(chosen[rows], _unpacked(mask, part.rows), number)
        return chosen

    def _commands(self, part: _Part) -> list[_Mask]:
        """Where each action is the command."""
        commands = [part.nowhere() for _ in self.actions]
        decided = part.nowhere()
        for leaf in self._descending:
            reached = part.reached[leaf]
            if reached is not None:
                commands[self._leaf_actions[leaf]] |= reached & ~decided
                decided |= reached
        return commands

    def ticked(self, states: States) -> Iterator[tuple[slice, list[BoolArray]]]:
        """In which rows each action is ticked, part by part of the rows."""
        for rows, part in self._parts(states):
            ticked = [part.nowhere() for _ in self.actions]
            for number, reached in zip(self._leaf_actions, part.reached, strict=True):
                if reached is not None:
                    ticked[number] |= reached
            yield rows, [_unpacked(mask, part.rows) for mask in ticked]

    def _parts(self, states: States) -> Iterator[tuple[slice, _Part]]:
        """What the tree does, part by part of the rows."""
        before = {
            number: states.history(condition)
            for number, condition in enumerate(self._conditions)
            if isinstance(condition, PreviousActionIs | LastActionIs)
        }
        columns = np.empty((len(self._columns), min(len(states), _ROWS_AT_A_TIME)))
        for start in range(0, len(states), _ROWS_AT_A_TIME):
            rows = slice(start, min(start + _ROWS_AT_A_TIME, len(states)))
            _copy_columns(states.values[rows], self._columns, columns)
            holds = partial(self._holds, columns, before, rows)
            part = _Part(rows.stop - start, len(self._leaf_actions), holds)
            self._root(part, _packed(np.ones(part.rows, dtype=bool)))
            yield rows, part

    def _holds(
        self,
        columns: FloatArray,
        before: Mapping[int, BoolArray | bool],
        rows: slice,
        number: int,
    ) -> _Mask:
        """Where a condition holds in a part of the rows."""
        count = rows.stop - rows.start
        if number in self._tests:
            return _packed(self._tests[number](columns[:, :count]))
        found = before[number]
        return _packed(found[rows] if isinstance(found, np.ndarray) else np.full(count, found))


class _Part:
    """Some rows while a tree is evaluated on them."""

    def __init__(self, rows: int, leaves: int, holds: Callable[[int], _Mask]) -> None:
        self.rows = rows
        self.reached: list[_Mask | None] = [None] * leaves
        """Where each leaf that is an action is ticked; None where that is nowhere."""
        self.holds = cache(holds)
        """Where a condition holds, by its number."""

    def nowhere(self) -> _Mask:
        """None of the rows."""
        return np.zeros(-(-self.rows // _BITS), dtype=np.uint64)


def _copy_columns(values: FloatArray, chosen: tuple[int, ...], columns: FloatArray) -> None:
    """Copies columns into rows, so that each is read in one go."""
    everything = chosen == tuple(range(values.shape[1]))
    for start in range(0, len(values), _ROWS_COPIED):
        rows = values[start : start + _ROWS_COPIED]
        columns[:, start : start + len(rows)] = (rows if everything else rows[:, chosen]).T


def _packed(where: BoolArray) -> _Mask:
    mask = np.zeros(-(-len(where) // _BITS), dtype=np.uint64)
    mask.view(np.uint8)[: -(-len(where) // 8)] = np.packbits(where, bitorder="little")
    return mask


def _unpacked(mask: _Mask, rows: int) -> BoolArray:
    return np.unpackbits(mask.view(np.uint8), count=rows, bitorder="little").view(np.bool_)


def _step(node: nodes.Node, place: Mapping[Condition, int], leaves: Iterator[int]) -> _Step:
    """What a node does, with numbers instead of conditions.

    Args:
        node: The node.
        place: The number of each condition.
        leaves: Numbers of the leaves that are actions, which come in the order of `nodes.walk`.
    """
    match node:
        case nodes.Condition(literal=literal):
            number = place[literal.condition]
            if literal.positive:
                return lambda part, reached: reached & part.holds(number)
            return lambda part, reached: reached & ~part.holds(number)
        case nodes.Action():
            return partial(_act, next(leaves))
        case nodes.Inverter(child=child):
            inverted = _step(child, place, leaves)
            # What succeeds was reached, so that the rest is what differs.
            return lambda part, reached: reached ^ inverted(part, reached)
        case nodes.Sequence(children=children) | nodes.Repeater(children=children):
            return partial(_all_in_turn, [_step(child, place, leaves) for child in children])
        case nodes.Selector(children=children) | nodes.ParallelSelector(children=children):
            return partial(_first_in_turn, [_step(child, place, leaves) for child in children])
        case nodes.Parallel(children=children):
            return partial(_all_at_once, [_step(child, place, leaves) for child in children])


def _act(leaf: int, part: _Part, reached: _Mask) -> _Mask:
    part.reached[leaf] = reached
    return reached


def _all_in_turn(steps: list[_Step], part: _Part, reached: _Mask) -> _Mask:
    for step in steps:
        reached = step(part, reached)
        if not reached.any():
            break
    return reached


def _first_in_turn(steps: list[_Step], part: _Part, reached: _Mask) -> _Mask:
    left = reached
    for step in steps:
        left = left ^ step(part, left)
        if not left.any():
            break
    return reached ^ left


def _all_at_once(steps: list[_Step], part: _Part, reached: _Mask) -> _Mask:
    results = [step(part, reached) for step in steps]
    return reduce(and_, results, reached)
