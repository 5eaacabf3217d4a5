"""Some rows of a large table that stand for all: whole demonstrations, of rare actions before all.

unit
    A demonstration, or a stretch of one that is longer than a fiftieth of the sample.
rare
    Of two actions, the one whose units have fewer rows together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.table import DemonstrationTable

#: The longest unit: this share of the sample.
_LONGEST = 1 / 50
#: Of the sample, what is taken for the sake of single actions.
_FOR_ACTIONS = 1 / 2


@dataclass(frozen=True, eq=False, slots=True)
class Sample:
    """Some rows of a table."""

    rows: BoolArray
    """Which of them, shape (rows,)."""
    demonstrations: int
    """How many demonstrations they are of."""
    complete: tuple[str, ...]
    """The actions of which no row is left out, in the order of the table's actions."""

    def __len__(self) -> int:
        return int(np.count_nonzero(self.rows))


def sample_of(table: DemonstrationTable, rows: int) -> Sample:
    """A sample of about so many rows, in whole units.

    One half of it goes to the actions in equal parts, from the rarest one on, each of which leaves
    to the others what it does not need: all units that show it, or as many as there is room for,
    evenly spread over time.  The other half is drawn from the rest in proportion: from strata of
    units with the same rarest action, evenly spread over time in each.

    Args:
        table: More rows than that.
        rows: How many.

    Returns:
        Deterministic.  Every action is in it.
    """
    unit, lengths = _units(table, max(int(rows * _LONGEST), 1))
    shows = np.zeros((len(lengths), len(table.actions)), dtype=bool)
    shows[unit, table.chosen] = True
    reach = lengths @ shows
    taken = np.zeros(len(lengths), dtype=bool)
    from_rare = [action for action in np.argsort(reach, kind="stable").tolist() if reach[action]]
    for left, action in zip(range(len(from_rare), 0, -1), from_rare, strict=True):
        quota = (rows * _FOR_ACTIONS - lengths[taken].sum()) / left
        quota -= lengths[taken & shows[:, action]].sum()
        fresh = np.flatnonzero(shows[:, action] & ~taken)
        taken[fresh[_spread(lengths[fresh], quota)]] = True
        if not (taken & shows[:, action]).any():
            taken[fresh[:1]] = True
    rest = np.flatnonzero(~taken)
    rarest = np.argmin(np.where(shows[rest], reach, np.iinfo(np.int64).max), axis=1)
    rest = rest[np.argsort(rarest, kind="stable")]
    taken[rest[_spread(lengths[rest], rows - lengths[taken].sum())]] = True
    inside = taken[unit]
    shown = np.bincount(table.chosen, minlength=len(table.actions))
    missing = np.bincount(table.chosen[~inside], minlength=len(table.actions))
    return Sample(
        inside,
        len(np.unique(table.demonstration[inside])),
        tuple(
            label
            for label, count, out in zip(
                table.actions, shown.tolist(), missing.tolist(), strict=True
            )
            if count and not out
        ),
    )


def _units(table: DemonstrationTable, longest: int) -> tuple[IntArray, IntArray]:
    """The unit of each row, shape (rows,), and how many rows each has, shape (units,)."""
    begins = np.flatnonzero(np.diff(table.demonstration, prepend=-1))
    lengths = np.diff(begins, append=len(table))
    # Stretches of a demonstration are about equally long.
    stretches = -(-lengths // longest)
    number = np.arange(stretches.sum()) - np.repeat(np.cumsum(stretches) - stretches, stretches)
    parts = np.repeat(lengths, stretches) * number // np.repeat(stretches, stretches)
    of_units = np.diff(np.repeat(begins, stretches) + parts, append=len(table))
    return np.repeat(np.arange(len(of_units)), of_units), of_units


def _spread(lengths: IntArray, rows: float) -> BoolArray:
    """Which of some units to take for about so many rows, evenly spread; all if that is enough."""
    total = int(lengths.sum())
    if rows <= 0:
        return np.zeros(len(lengths), dtype=bool)
    if total <= rows:
        return np.ones(len(lengths), dtype=bool)
    # As many marks as units have room, at even distances along the rows: the units that have one.
    marks = int(rows * len(lengths) / total)
    passed = np.cumsum(lengths) * marks // total
    return np.asarray(np.diff(passed, prepend=0) > 0)
