"""The rows in which a branch of a tree acts, in short."""

from __future__ import annotations

from collections import Counter
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
    labels = Counter(table.actions[code] for code in table.chosen[rows].tolist())
    numbers = Counter(table.demonstration[rows].tolist())
    named = []
    for number, count in numbers.most_common(_NAMED):
        start = int(np.searchsorted(table.demonstration, number))
        first = int(rows[np.searchsorted(table.demonstration[rows], number)])
        seconds = float(table.stamps[first] - table.stamps[start]) / 1e9
        named.append((table.demonstrations[number], count, seconds))
    return Support(len(rows), tuple(labels.most_common()), tuple(named))
