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

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import (
    States,
    choose,
    last_action_column,
    last_action_of,
)
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import LastActionIs


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
    # Each history that comes up is evaluated once, on all rows: there are far fewer than rows.
    choices: dict[tuple[str, ...], IntArray] = {}
    chosen = np.full(len(table), NO_ACTION, dtype=np.int64)
    recent: tuple[str, ...] = ()
    for row, starts in enumerate(_starts(table)):
        recent = _recent_at(row, table) if starts else recent
        if recent not in choices:
            choices[recent] = _choices_after(recent, tree, table)
        choice = int(choices[recent][row])
        chosen[row] = choice
        if choice != NO_ACTION:
            recent = _after(recent, table.actions[choice], reach)
    return chosen


def agreement(chosen: IntArray, table: DemonstrationTable) -> float | None:
    """Share of the rows in which `chosen` is what the demonstrator did; None without rows."""
    return float(np.mean(chosen == table.chosen)) if len(table) else None


def _choices_after(
    recent: tuple[str, ...], tree: nodes.Node, table: DemonstrationTable
) -> IntArray:
    history = ActionHistory(reversed(recent))
    states = States(table.features, table.states, last_action_of(history))
    return choose(tree, actions_of(table), states)


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
