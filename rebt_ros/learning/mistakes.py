"""Mistakes of demonstrators: rows in which something was done that was not meant.

A mistake is an action that lasts for a row or two, and that the smallest explanation of the rows
(see `FittedTree.explanation`) does not take where what it takes was done just before or after.
Left out of what is learned from, with what follows it told the action that was right, it no longer
teaches that a held action may end anywhere: that is what keeps a tree that tests the previous
action from being learned from few demonstrations of people who err.

Which rows these are depends on the explanation, and the other way round.  So an explanation of the
rest is made, again and again, until it comes to mistakes that it came to before.  Of all rounds
the one counts in which leaves, exceptions and mistakes are fewest together; none is a mistake where
that is no less than without any.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, History, previous_actions
from rebt_ros.demonstration.table import DemonstrationTable

#: Rows that a mistake lasts at most.
_MOST_ROWS_HELD = 2
#: Where an action would lose more than this share of its rows, they are what it is.
_MOST_LOST = 0.5
#: With fewer rows for each leaf and exception, the size of an explanation tells nothing.
_LEAST_ROWS_EACH = 5
#: Rows of the largest table that is searched, and explanations that are made after the first.
_MOST_ROWS, _MOST_ROUNDS = 5_000, 5

_WITH_PREVIOUS = FitOptions(vocabulary=Vocabulary(History.PREVIOUS))


def intended_actions(table: DemonstrationTable) -> IntArray:
    """What was meant in each row: what was done, but for mistakes.

    Args:
        table: Rows of one channel, in whole demonstrations.  None is a mistake where rows are
            events, which do not last, or where there are more than 5000.

    Returns:
        Positions in ``table.actions``, shape (rows,); deterministic.
    """
    chosen = table.chosen
    # What looks like a mistake is told from what was done, however much that counts.
    table = replace(table, weights=None)
    if table.row_kind is RowKind.EVENT or len(table) > _MOST_ROWS:
        return chosen
    held, before, after = _held(table)
    # What is done last has nothing after it that would tell.
    brief = (held <= _MOST_ROWS_HELD) & (after != NO_ACTION)
    intended, least = chosen, 0
    made = [chosen]
    for _ in range(_MOST_ROUNDS + 1):
        meant = made[-1]
        explanation = fit(without_mistakes(table, meant), _WITH_PREVIOUS)
        size = explanation.explanation + int(np.count_nonzero(meant != chosen))
        if meant is chosen and len(table) < _LEAST_ROWS_EACH * size:
            break
        if meant is chosen or size < least:
            intended, least = meant, size
        explained = explanation.explained(_following(table, meant))
        mistaken = brief & (explained != chosen) & ((explained == before) | (explained == after))
        meant = np.where(_without_lost_actions(mistaken, table), explained, chosen)
        if any(np.array_equal(meant != chosen, other != chosen) for other in made):
            break
        made.append(meant)
    return intended


def without_mistakes(table: DemonstrationTable, intended: IntArray) -> DemonstrationTable:
    """The table without the rows in which something else was done than was meant.

    What follows such a row follows the action that was meant.

    Args:
        table: All rows.
        intended: See `intended_actions`.
    """
    right = intended == table.chosen
    return table if right.all() else _following(table, intended).where(right)


def _following(table: DemonstrationTable, intended: IntArray) -> DemonstrationTable:
    """The table in which each row follows what was meant in the one before it."""
    return replace(table, previous=previous_actions(intended, table.demonstration))


def _without_lost_actions(mistaken: BoolArray, table: DemonstrationTable) -> BoolArray:
    shown = np.bincount(table.chosen, minlength=len(table.actions))
    lost = np.bincount(table.chosen[mistaken], minlength=len(table.actions))
    return np.asarray(mistaken & (lost <= _MOST_LOST * shown)[table.chosen])


def _held(table: DemonstrationTable) -> tuple[IntArray, IntArray, IntArray]:
    """For how many rows each row's action is held, and the actions before and after that.

    Returns:
        Three of shape (rows,); the latter `NO_ACTION` at the ends of demonstrations.
    """
    chosen, demonstration = table.chosen, table.demonstration
    starts = np.ones(len(table), dtype=bool)
    starts[1:] = (chosen[1:] != chosen[:-1]) | (demonstration[1:] != demonstration[:-1])
    first = np.flatnonzero(starts)
    run = np.cumsum(starts) - 1
    held = np.diff(first, append=len(table))
    same = demonstration[first[1:]] == demonstration[first[:-1]]
    before = np.append(NO_ACTION, np.where(same, chosen[first[:-1]], NO_ACTION))
    after = np.append(np.where(same, chosen[first[1:]], NO_ACTION), NO_ACTION)
    return held[run], before[run], after[run]
