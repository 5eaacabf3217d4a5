"""A sample of the rows of a large table: whole demonstrations, above all those of rare actions.

unit
    A demonstration, or a stretch of one that is longer than a fiftieth of the sample.
rare
    An action is rarer than another one if the units that show it have fewer rows in total.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.table import DemonstrationTable

#: Length of the longest unit, as a share of the sample.
_LONGEST = 1 / 50
#: Share of the sample that is chosen by action.
_FOR_ACTIONS = 1 / 2


@dataclass(frozen=True, eq=False, slots=True)
class Sample:
    """Some rows of a table."""

    rows: BoolArray
    """Which rows are in it, shape (rows,)."""
    demonstrations: int
    """Number of demonstrations that it has rows of."""
    complete: tuple[str, ...]
    """Actions with all their rows in it, in the order of the table's actions."""

    def __len__(self) -> int:
        return int(np.count_nonzero(self.rows))


def sample_of(table: DemonstrationTable, rows: int) -> Sample:
    """A sample of about this many rows, in whole units.

    One half is divided equally among the actions, the rarest first; each leaves to the others what
    it does not need.  An action gets all units that show it, or as many as there is room for,
    evenly spread over time.  The other half is drawn from the rest in proportion: units with the
    same rarest action form a stratum, in each of which units are evenly spread over time.

    Args:
        table: Has more rows than that.
        rows: Number of rows.

    Returns:
        A deterministic sample with every action in it.
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
    # The stretches of a demonstration are about equally long.
    stretches = -(-lengths // longest)
    number = np.arange(stretches.sum()) - np.repeat(np.cumsum(stretches) - stretches, stretches)
    parts = np.repeat(lengths, stretches) * number // np.repeat(stretches, stretches)
    of_units = np.diff(np.repeat(begins, stretches) + parts, append=len(table))
    return np.repeat(np.arange(len(of_units)), of_units), of_units


def _spread(lengths: IntArray, rows: float) -> BoolArray:
    """Evenly spread units with about this many rows; all units if they have no more."""
    total = int(lengths.sum())
    if rows <= 0:
        return np.zeros(len(lengths), dtype=bool)
    if total <= rows:
        return np.ones(len(lengths), dtype=bool)
    # Marks at even distances along the rows, as many as there is room for units: takes the units
    # that have a mark.
    marks = int(rows * len(lengths) / total)
    passed = np.cumsum(lengths) * marks // total
    return np.asarray(np.diff(passed, prepend=0) > 0)
