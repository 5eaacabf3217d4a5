"""How well a behavior tree does on a table: fidelity and agreement.

fidelity
    It chooses what its decision tree predicts; if conditions are left out (see
    `needless_conditions`), in the rows that the decision tree gets right.
agreement, teacher-forced
    It chooses what the demonstrator did, after the demonstrator's earlier actions.  The column of
    LAT knows the action of its own row, from which it differs, so the figure flatters trees that
    test LAT.
agreement, own-history
    It chooses what the demonstrator did, after its own choices in earlier rows: what to expect of
    the executed tree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.behavior_tree.prediction import (
    Plan,
    States,
    as_it_stands,
    choose,
    history_columns,
)
from rebt_ros.behavior_tree.runtime import Tick, TreeRuntime, executable
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory, History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs

#: Names of trees that are only ticked.
_NOT_LEARNED = Provenance(
    0, 0, 0.0, None, 0.0, Root.SELECTOR, History.NONE, Figures(0, None, None, 0)
)

#: How many rows a decision tree is run over at a time, for all possible previous actions.
_ROWS_AT_A_TIME = 65_536

#: Maximum number of conditions that one number encodes; with more, kinds are renumbered.
_MOST_BITS = 30


def actions_of(table: DemonstrationTable) -> tuple[nodes.Action, ...]:
    """The table's actions, in the order of its codes."""
    return tuple(nodes.Action(label, table.channel) for label in table.actions)


def teacher_forced_choices(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """What the tree chooses in each row after the actions in the table, as a decision tree does.

    Returns:
        Positions in ``table.actions``, `NO_ACTION` where it chooses none, shape (rows,).
    """
    columns = history_columns(table.actions, table.previous, table.last)
    return choose(tree, actions_of(table), States(table.features, table.states, columns))


def does_the_same(
    one: nodes.Node, other: nodes.Node, table: DemonstrationTable, held_out: BoolArray
) -> bool:
    """Whether two trees choose alike in all rows, and in those held out after their own choices.

    Trees with memory are the same only where they are equal.
    """
    trees = executable(one), executable(other)
    if trees[0] == trees[1]:
        return True
    if not all(map(nodes.is_reactive, trees)):
        return False
    rows = table.where(held_out)
    return all(
        np.array_equal(choices(trees[0], its), choices(trees[1], its))
        for choices, its in ((teacher_forced_choices, table), (own_history_choices, rows))
    )


def own_history_choices(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """What the tree chooses in each row after its own choices in the rows before it.

    An action counts as done once it is chosen.  Other memory of the tree (the step of a Sequence, a
    running Repeater) is kept from row to row, as on the robot.

    Returns:
        Positions in ``table.actions``, `NO_ACTION` where it chooses none, shape (rows,).
    """
    tree = executable(tree)
    if not nodes.is_reactive(tree):
        return _ticked_choices(tree, table)
    reach = _reach(tree)
    if not reach:
        return teacher_forced_choices(tree, table)
    situations, of_row = _situations(tree, table)
    plan, actions = Plan(tree, table.features), actions_of(table)
    # Each history is evaluated once: there are far fewer than rows.
    choices: dict[tuple[str | None, tuple[str, ...]], list[int]] = {}

    def after(previous: str | None, recent: tuple[str, ...]) -> list[int]:
        if (previous, recent) not in choices:
            history = ActionHistory(reversed(recent))
            history.previous = previous
            states = States(situations.features, situations.states, as_it_stands(history))
            choices[previous, recent] = plan.choose(actions, states).tolist()
        return choices[previous, recent]

    chosen: list[int] = []
    for start, end in pairwise((*np.flatnonzero(_starts(table)).tolist(), len(table))):
        recent = _recent_at(start, table)
        chooses, newest = after(_label(table, table.previous[start]), recent), NO_ACTION
        for situation in of_row[start:end].tolist():
            choice = chooses[situation]
            chosen.append(choice)
            # The latest action is already the first in the history.
            if choice not in (newest, NO_ACTION):
                newest = choice
                label = table.actions[choice]
                recent = _after(recent, label, reach)
                chooses = after(label, recent)
    return np.array(chosen, dtype=np.int64)


def _ticked_choices(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """What the tree chooses when it is ticked in one row after another."""
    actions = dict.fromkeys((*actions_of(table), *nodes.actions(tree)))
    learned = LearnedTree(
        table.features, tuple(actions), tree, _NOT_LEARNED, row_kind=table.row_kind
    )
    chosen: list[int] = []
    for _, tick in ticks(TreeRuntime(learned), table):
        commands = [command for command in tick.commands if command.channel == table.channel]
        known = commands and commands[0].label in table.actions
        chosen.append(table.actions.index(commands[0].label) if known else NO_ACTION)
    return np.array(chosen, dtype=np.int64)


def ticks(runtime: TreeRuntime, table: DemonstrationTable) -> Iterator[tuple[bool, Tick]]:
    """Ticks a tree once in each row; its history starts again with each demonstration.

    Args:
        runtime: Runs the tree; its features are those of the table.
        table: The rows.

    Yields:
        For each row, whether a demonstration begins with it, and the tick.
    """
    own = runtime.histories.setdefault(table.channel, ActionHistory())
    for row, (starts, state) in enumerate(
        zip(_starts(table).tolist(), table.states.tolist(), strict=True)
    ):
        if starts:
            runtime.halt()
            for history in runtime.histories.values():
                history.clear()
            for label in _recent_at(row, table):
                own.begin(label)
            own.previous = _label(table, table.previous[row])
        yield starts, runtime.tick(state)


def decision_tree_choices(
    predict: Callable[[DemonstrationTable], IntArray],
    history: History,
    table: DemonstrationTable,
) -> IntArray:
    """What a decision tree chooses in each row after its own choices in the rows before it.

    The behavior tree of a decision tree that does not test LAT chooses the same, but takes longer
    to make.

    Args:
        predict: What it chooses in each row after the actions in the table.
        history: Which earlier action it may test.
        table: The rows.
    """
    match history:
        case History.NONE:
            return predict(table)
        case History.LAST:
            raise ValueError("LAT depends on the rule that asks, which a decision tree has none of")
    # The choices after each action; in the last line, after none.
    befores = [*range(len(table.actions)), NO_ACTION]
    chosen = np.empty(len(table), dtype=np.int64)
    starts = _starts(table)
    choice = NO_ACTION
    for start in range(0, len(table), _ROWS_AT_A_TIME):
        inside = np.zeros(len(table), dtype=bool)
        inside[start : start + _ROWS_AT_A_TIME] = True
        rows = table.where(inside)
        choices = [
            predict(replace(rows, previous=np.full(len(rows), before))).tolist()
            for before in befores
        ]
        for row, (starting, before) in enumerate(
            zip(starts[inside].tolist(), rows.previous.tolist(), strict=True)
        ):
            choice = choices[before if starting else choice][row]
            chosen[start + row] = choice
    return chosen


def agreement(chosen: IntArray, table: DemonstrationTable) -> float | None:
    """Share of rows in which `chosen` is what the demonstrator did; None without rows."""
    return float(np.mean(chosen == table.chosen)) if len(table) else None


def mean_recall(hits: IntArray, shown: IntArray) -> FloatArray:
    """The mean recall of the actions that were shown.

    Args:
        hits: Rows of each action that were predicted, shape (..., actions).
        shown: Rows of each action, shape (actions,).
    """
    occurring = shown > 0
    return np.asarray(np.mean(hits[..., occurring] / shown[occurring], axis=-1))


def _situations(tree: nodes.Node, table: DemonstrationTable) -> tuple[DemonstrationTable, IntArray]:
    """A row of each kind that states distinguish, and the kind of each row."""
    states = States(table.features, table.states, lambda condition: False)
    tested = dict.fromkeys(
        one.literal.condition
        for one in nodes.conditions(tree)
        if not isinstance(one.literal.condition, PreviousActionIs | LastActionIs)
    )
    kind = np.zeros(len(table), dtype=np.int64)
    for place, condition in enumerate(tested, start=1):
        kind = 2 * kind + states.satisfy(Literal(condition))
        if place % _MOST_BITS == 0:
            kind = np.unique(kind, return_inverse=True)[1]
    _, first, of_row = np.unique(kind, return_index=True, return_inverse=True)
    chosen = np.zeros(len(table), dtype=bool)
    chosen[first] = True
    order = np.empty(len(first), dtype=np.int64)
    order[np.argsort(first)] = np.arange(len(first))
    return table.where(chosen), order[of_row]


def _recent_at(row: int, table: DemonstrationTable) -> tuple[str, ...]:
    """What is known of actions before the first row of a demonstration."""
    code = NO_ACTION if table.before is None else table.before[table.demonstration[row]]
    label = _label(table, code)
    return () if label is None else (label,)


def _label(table: DemonstrationTable, code: int) -> str | None:
    return None if code == NO_ACTION else table.actions[code]


def _after(recent: tuple[str, ...], action: str, reach: int) -> tuple[str, ...]:
    """The distinct actions taken, most recent first, as far back as the tree looks."""
    return (action, *(one for one in recent if one != action))[:reach]


def _reach(tree: nodes.Node) -> int:
    """How many distinct recent actions the tree's conditions can look back over."""
    reach = 0
    for condition in nodes.conditions(tree):
        match condition.literal.condition:
            case PreviousActionIs():
                reach = max(reach, 1)
            case LastActionIs(deciding=deciding):
                reach = max(reach, len(deciding) + 1)
    return reach


def _starts(table: DemonstrationTable) -> BoolArray:
    starts = np.ones(len(table), dtype=bool)
    starts[1:] = table.demonstration[1:] != table.demonstration[:-1]
    return starts
