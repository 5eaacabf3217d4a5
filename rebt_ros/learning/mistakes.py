"""Mistakes of demonstrators: rows with an action that was not meant.

A mistake is an action that lasts for a row or two and differs from the choice of the smallest
explanation of the rows (see `FittedTree.explanation`), while this choice was taken just before or
after.  Such rows are left out, and the row after one follows the action that was meant.  Otherwise
they teach that a held action may end anywhere, and a tree that tests the previous action cannot be
learned from few demonstrations with mistakes.

Whoever slips may do anything.  If brief actions out of line are nearly always the same few, such as
dropping a part between driving there and back, they are meant, and none is a mistake.

The mistakes depend on the explanation, and the explanation on the mistakes.  So the remaining rows
are explained repeatedly, until mistakes recur.  The round with the fewest leaves, exceptions and
mistakes in total counts.  If that is no fewer than without mistakes, there are none.
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

#: Maximum number of rows of a mistake.
_MOST_ROWS_HELD = 2
#: If an action would lose more than this share of its rows, they are no mistakes.
_MOST_LOST = 0.5
#: With fewer rows per leaf and exception, the size of an explanation says nothing.
_LEAST_ROWS_EACH = 5
#: Slips into any action are distributed as unevenly as this in one of so many tables.
_UNLIKELY = 1 / 100
#: Maximum number of rows of a table, and of explanations after the first.
_MOST_ROWS, _MOST_ROUNDS = 5_000, 5

_WITH_PREVIOUS = FitOptions(vocabulary=Vocabulary(History.PREVIOUS))


def intended_actions(table: DemonstrationTable) -> IntArray:
    """The action that was meant in each row, which differs from the shown one in mistakes.

    Args:
        table: Rows of one channel, in whole demonstrations.  If rows are events, which do not last,
            or if there are more than 5000, none is a mistake.

    Returns:
        Positions in ``table.actions``, shape (rows,); deterministic.
    """
    chosen = table.chosen
    # Mistakes are found in what was done, whatever its weight.
    table = replace(table, weights=None)
    if table.row_kind is RowKind.EVENT or len(table) > _MOST_ROWS:
        return chosen
    held, before, after = _held(table)
    # Nothing follows the last action that could confirm a mistake.
    brief = (held <= _MOST_ROWS_HELD) & (after != NO_ACTION)
    intended, least = chosen, 0
    made = [chosen]
    spared = np.zeros(len(table.actions), dtype=bool)
    for _ in range(_MOST_ROUNDS + 1):
        meant = made[-1]
        explanation = fit(without_mistakes(table, meant), _WITH_PREVIOUS)
        size = explanation.explanation + int(np.count_nonzero(meant != chosen))
        if meant is chosen and len(table) < _LEAST_ROWS_EACH * size:
            break
        if meant is chosen or (size < least and _may_be_slips(table, meant, spared)):
            intended, least = meant, size
        explained = explanation.explained(_following(table, meant))
        mistaken = brief & (explained != chosen) & ((explained == before) | (explained == after))
        spared = _lost_actions(mistaken, table)
        meant = np.where(mistaken & ~spared[chosen], explained, chosen)
        if any(np.array_equal(meant != chosen, other != chosen) for other in made):
            break
        made.append(meant)
    return intended


def without_mistakes(table: DemonstrationTable, intended: IntArray) -> DemonstrationTable:
    """The table without mistakes.

    The row after a mistake follows the action that was meant.

    Args:
        table: All rows.
        intended: See `intended_actions`.
    """
    right = intended == table.chosen
    return table if right.all() else _following(table, intended).where(right)


def _following(table: DemonstrationTable, intended: IntArray) -> DemonstrationTable:
    """The table in which each row follows the action that was meant in the row before."""
    return replace(table, previous=previous_actions(intended, table.demonstration))


def _lost_actions(mistaken: BoolArray, table: DemonstrationTable) -> BoolArray:
    """The actions that would lose most of their rows, shape (actions,)."""
    shown = np.bincount(table.chosen, minlength=len(table.actions))
    lost = np.bincount(table.chosen[mistaken], minlength=len(table.actions))
    return np.asarray(lost > _MOST_LOST * shown)


def _may_be_slips(table: DemonstrationTable, meant: IntArray, spared: BoolArray) -> bool:
    """Whether mistakes are spread over the actions as slips are, by a chi-squared test.

    Args:
        table: All rows.
        meant: The action that was meant in each row.
        spared: Actions whose rows are no mistakes, shape (actions,).
    """
    from scipy.special import chdtrc

    mistaken = meant != table.chosen
    actions = len(table.actions)
    of_each = np.bincount(meant[mistaken], minlength=actions)
    # Each slips into one of the other actions.
    possible = ~spared & ~np.eye(actions, dtype=bool)
    others = np.maximum(possible.sum(axis=1, keepdims=True), 1)
    expected = of_each @ (possible / others)
    found = np.bincount(table.chosen[mistaken], minlength=actions)
    there = expected > 0
    uneven = float(np.sum((found - expected)[there] ** 2 / expected[there]))
    return bool(chdtrc(max(np.count_nonzero(there) - 1, 1), uneven) >= _UNLIKELY)


def _held(table: DemonstrationTable) -> tuple[IntArray, IntArray, IntArray]:
    """For how many rows the action of each row is held, and the actions before and after that.

    Returns:
        Three arrays of shape (rows,); the latter two have `NO_ACTION` at the ends of
        demonstrations.
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
