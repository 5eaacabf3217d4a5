"""Where the leaves of a tree come from: the rows in which each of them acts, by file and time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.demonstration.demonstration import NO_TIME
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.acting import acting_leaves
from rebt_ros.verification.support import Support, support_of

#: Stretches that are named of a leaf, the longest ones.
MOST_STRETCHES: Final = 5
#: Leaves up to which so many are named; of more leaves, one of each.
MANY_LEAVES: Final = 250


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows one after the other, in one demonstration, in which a leaf acts."""

    demonstration: str
    row: int
    """The first of them, numbered from 0 among the rows of the demonstration on its channel."""
    rows: int
    first_stamp: int
    """Of the first row: nanoseconds, or the number of the row in its file where that has none."""
    last_stamp: int
    seconds: float | None
    """From the first row of the demonstration to the first of these; None where stamps tell no
    time."""


@dataclass(frozen=True, slots=True)
class TracedLeaf:
    """An action leaf of a tree, and the rows that it comes from."""

    path: paths.Path
    """Where it stands in the tree."""
    action: nodes.Action
    support: Support
    demonstrations: int
    """In how many demonstrations it acts."""
    stretches: tuple[Stretch, ...]
    """The longest ones, the longest first."""


@dataclass(frozen=True, slots=True)
class Traced:
    """Where the leaves of a channel's tree come from."""

    leaves: tuple[TracedLeaf, ...]
    """All of them, from left to right."""
    rows: int
    """That were learned from."""
    without: int
    """Of them, those in which no leaf acts."""


def trace_leaves(
    tree: nodes.Node,
    table: DemonstrationTable,
    learned_from: DemonstrationTable,
    rows: BoolArray,
    path: paths.Path = (),
) -> Traced:
    """Where the leaves of a channel's tree come from.

    Args:
        tree: Of the channel.
        table: All rows of the channel.
        learned_from: Those that the tree is learned from, each after what was meant before it.
        rows: Which of all rows these are, shape (rows,).
        path: Where the tree stands in a larger one.
    """
    acting = acting_leaves(tree, learned_from)
    place = np.flatnonzero(rows)
    found = [
        (where, node) for where, node in paths.walk(tree, path) if isinstance(node, nodes.Action)
    ]
    most = MOST_STRETCHES if len(found) <= MANY_LEAVES else 1
    # Numbers of few bits are sorted several times as fast.
    order = np.argsort(acting.astype(np.min_scalar_type(-len(found) - 1)), kind="stable")
    ends = np.cumsum(np.bincount(acting + 1, minlength=len(found) + 1))
    leaves = []
    for number, (where, action) in enumerate(found):
        its = place[order[ends[number] : ends[number + 1]]]
        leaves.append(
            TracedLeaf(
                where,
                action,
                support_of(table, its),
                int(np.count_nonzero(np.diff(table.demonstration[its], prepend=-1))),
                tuple(_stretches(table, its, most)),
            )
        )
    return Traced(tuple(leaves), len(acting), int(np.count_nonzero(acting < 0)))


def _stretches(table: DemonstrationTable, rows: IntArray, most: int) -> Iterator[Stretch]:
    """The longest stretches of some rows, ascending, at most so many."""
    if not len(rows):
        return
    numbers = table.demonstration[rows]
    begins = np.flatnonzero((np.diff(rows, prepend=-2) != 1) | (np.diff(numbers, prepend=-1) != 0))
    lengths = np.diff(begins, append=len(rows))
    for part in np.argsort(-lengths, kind="stable")[:most].tolist():
        first = int(rows[begins[part]])
        last = first + int(lengths[part]) - 1
        number = int(table.demonstration[first])
        start, end = np.searchsorted(table.demonstration, (number, number + 1)).tolist()
        steps = np.diff(table.stamps[start:end])
        timed = bool(len(steps)) and float(np.median(steps)) > NO_TIME
        yield Stretch(
            table.demonstrations[number],
            first - start,
            int(lengths[part]),
            int(table.stamps[first]),
            int(table.stamps[last]),
            float(table.stamps[first] - table.stamps[start]) / 1e9 if timed else None,
        )
