"""Rows that contradict others: an equal state, and another action on the same channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.equal_states import codes_of_states
from rebt_ros.inspection.joined import Joined

#: Contradicting rows that are listed of a demonstration.
MOST_LISTED: Final = 3


@dataclass(frozen=True, eq=False, slots=True)
class Contradicting:
    """Contradicting rows, ascending."""

    rows: IntArray
    """Of all demonstrations, shape (contradicting,)."""
    with_others: BoolArray
    """Whether another demonstration is contradicted, shape (contradicting,)."""
    outvoted: BoolArray
    """Whether another action is shown more often in this state, shape (contradicting,)."""
    other_row: IntArray
    """Where the most frequent other action is shown first, shape (contradicting,)."""


def contradicting(joined: Joined) -> Contradicting:
    """All rows that contradict others."""
    table = joined.table
    channel = joined.channel
    states = codes_of_states(table.states)
    situation = states * (int(channel.max()) + 1) + channel[table.chosen]
    rows = _with_several_actions(situation, table.chosen)
    _, situation = np.unique(situation[rows], return_inverse=True)
    chosen, demonstration = table.chosen[rows], joined.number[rows]
    actions = len(joined.actions)
    # Rows with each action in each situation, and the first of them.
    pairs, first, pair, counts = np.unique(
        situation * actions + chosen, return_index=True, return_inverse=True, return_counts=True
    )
    best = _most_frequent_others(pairs // actions, counts)[pair]
    # All rows but those of the same action, and but those of the same demonstration.
    others = (
        _times(situation)
        - counts[pair]
        - _times(_together(situation, demonstration))
        + _times(_together(pair, demonstration))
    )
    return Contradicting(
        rows, others > 0, counts[best] > counts[pair], rows[first[best]] if len(rows) else rows
    )


def _with_several_actions(situation: IntArray, chosen: IntArray) -> IntArray:
    """The rows in whose situation several actions are chosen, ascending."""
    order = np.argsort(situation, kind="stable")
    starts = np.flatnonzero(np.diff(situation[order], prepend=-1))
    low = np.minimum.reduceat(chosen[order], starts)
    high = np.maximum.reduceat(chosen[order], starts)
    several = np.repeat(low != high, np.diff(starts, append=len(order)))
    return np.sort(order[several])


def _most_frequent_others(situation: IntArray, counts: IntArray) -> IntArray:
    """For each pair of situation and action, the most frequent other pair of the situation.

    Args:
        situation: Of each pair, ascending; at least two pairs of each, shape (pairs,).
        counts: Rows of each pair, shape (pairs,).
    """
    order = np.lexsort((-counts, situation))
    starts = np.flatnonzero(np.diff(situation[order], prepend=-1))
    best = np.repeat(order[starts], np.diff(starts, append=len(order)))
    if len(order):
        best[starts] = order[starts + 1]
    found = np.empty_like(order)
    found[order] = best
    return found


def _together(first: IntArray, second: IntArray) -> IntArray:
    return first * (int(second.max(initial=0)) + 1) + second


def _times(values: IntArray) -> IntArray:
    """How often the value of each row occurs, shape (rows,)."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray(counts[place])
