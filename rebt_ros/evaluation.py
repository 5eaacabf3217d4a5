"""How well a behavior tree does on a table: fidelity and agreement.

fidelity
    It chooses what its decision tree predicts.
agreement, teacher-forced
    It chooses what the demonstrator did, LAT being the demonstration's column.  That column knows
    the action of its own row, from which it differs, so the figure flatters trees that test LAT.
agreement, own-history
    It chooses what the demonstrator did, LAT being what the tree chose itself in earlier rows:
    what to expect of the executed tree.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import (
    Plan,
    States,
    choose,
    last_action_column,
    last_action_of,
)
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import LastActionIs, Literal

#: Conditions that are told apart by one number each; with more, the kinds are counted anew.
_MOST_BITS = 30


def actions_of(table: DemonstrationTable) -> tuple[nodes.Action, ...]:
    """The table's actions, in the order of its codes."""
    return tuple(nodes.Action(label, table.channel) for label in table.actions)


def teacher_forced_choices(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """What the tree chooses in each row when LAT is the table's column, as for a decision tree.

    Returns:
        Positions in ``table.actions``, `NO_ACTION` where it chooses none, shape (rows,).
    """
    column = last_action_column(table.actions, table.last)
    return choose(tree, actions_of(table), States(table.features, table.states, column))


def own_history_choices(tree: nodes.Node, table: DemonstrationTable) -> IntArray:
    """What the tree chooses in each row after its own choices in the rows before it."""
    reach = _reach(tree)
    if not reach:
        return teacher_forced_choices(tree, table)
    situations, of_row = _situations(tree, table)
    plan, actions = Plan(tree, table.features), actions_of(table)
    # Each history that comes up is evaluated once: there are far fewer than rows.
    choices: dict[tuple[str, ...], list[int]] = {}

    def after(recent: tuple[str, ...]) -> list[int]:
        if recent not in choices:
            history = last_action_of(ActionHistory(reversed(recent)))
            states = States(situations.features, situations.states, history)
            choices[recent] = plan.choose(actions, states).tolist()
        return choices[recent]

    chosen: list[int] = []
    for start, end in pairwise((*np.flatnonzero(_starts(table)).tolist(), len(table))):
        recent = _recent_at(start, table)
        chooses, newest = after(recent), NO_ACTION
        for situation in of_row[start:end].tolist():
            choice = chooses[situation]
            chosen.append(choice)
            # What was done just now is the first in the history already.
            if choice not in (newest, NO_ACTION):
                newest = choice
                recent = _after(recent, table.actions[choice], reach)
                chooses = after(recent)
    return np.array(chosen, dtype=np.int64)


def agreement(chosen: IntArray, table: DemonstrationTable) -> float | None:
    """Share of the rows in which `chosen` is what the demonstrator did; None without rows."""
    return float(np.mean(chosen == table.chosen)) if len(table) else None


def _situations(tree: nodes.Node, table: DemonstrationTable) -> tuple[DemonstrationTable, IntArray]:
    """A row of each kind that the tree can tell apart but for LAT, and the kind of each row."""
    states = States(table.features, table.states, lambda condition: False)
    tested = dict.fromkeys(
        one.literal.condition
        for one in nodes.conditions(tree)
        if not isinstance(one.literal.condition, LastActionIs)
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
    """What is known to have been done before the first row of a demonstration."""
    code = NO_ACTION if table.before is None else int(table.before[table.demonstration[row]])
    return () if code == NO_ACTION else (table.actions[code],)


def _after(recent: tuple[str, ...], action: str, reach: int) -> tuple[str, ...]:
    """The distinct actions taken, most recent first, as far back as the tree can tell."""
    return (action, *(one for one in recent if one != action))[:reach]


def _reach(tree: nodes.Node) -> int:
    """How many distinct recent actions the tree's LAT conditions can look back over."""
    conditions = [one.literal.condition for one in nodes.conditions(tree)]
    return max(
        (len(one.deciding) + 1 for one in conditions if isinstance(one, LastActionIs)), default=0
    )


def _starts(table: DemonstrationTable) -> BoolArray:
    starts = np.ones(len(table), dtype=bool)
    starts[1:] = table.demonstration[1:] != table.demonstration[:-1]
    return starts
