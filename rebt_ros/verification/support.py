"""The rows in which a branch of a tree acts, in short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.table import DemonstrationTable

#: How many demonstrations are named.
_NAMED: Final = 3


@dataclass(frozen=True, slots=True)
class Support:
    """The rows in which a branch acts."""

    rows: int
    actions: tuple[tuple[str, int], ...]
    """What was done in them, the most frequent action first."""
    demonstrations: tuple[tuple[str, int, float], ...]
    """The demonstrations with most of them: name, rows, seconds from its start to the first."""


def support_of(table: DemonstrationTable, rows: IntArray) -> Support:
    """Some rows of a table in short.

    Args:
        table: All rows.
        rows: Their positions, ascending.
    """
    labels = _most_common(table.chosen[rows])
    numbers = table.demonstration[rows]
    named = []
    for number, count in _most_common(numbers)[:_NAMED]:
        start = int(np.searchsorted(table.demonstration, number))
        first = int(rows[np.searchsorted(numbers, number)])
        seconds = float(table.stamps[first] - table.stamps[start]) / 1e9
        named.append((table.demonstrations[number], count, seconds))
    named_labels = tuple((table.actions[code], count) for code, count in labels)
    return Support(len(rows), named_labels, tuple(named))


def _most_common(codes: IntArray) -> list[tuple[int, int]]:
    """Each code with how often it occurs, the most frequent first, of several the first to come."""
    counts = np.bincount(codes)
    first = np.zeros(len(counts), dtype=np.int64)
    # What is written last stays.
    first[codes[::-1]] = np.arange(len(codes))[::-1]
    there = np.flatnonzero(counts)
    order = there[np.lexsort((first[there], -counts[there]))]
    return list(zip(order.tolist(), counts[order].tolist(), strict=True))
