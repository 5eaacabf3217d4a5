"""When rows were recorded, and where some are missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.demonstration import NO_TIME
from rebt_ros.inspection.inspection import Stretch, Stretches, Timing

#: A gap is longer than the upper quartile of the times between rows by more than so many times the
#: range between the quartiles (outer fence of Tukey, Exploratory Data Analysis, 1977), ...
FENCE: Final = 3.0
#: ... and than so many times the usual one: rows that come like clockwork have no range.
MANY_TIMES: Final = 2.0
#: With fewer times between rows, nobody knows which are usual.
FEWEST_INTERVALS: Final = 5
#: Stretches that are listed of a demonstration.
MOST_LISTED: Final = 3


@dataclass(frozen=True, eq=False, slots=True)
class Clock:
    """The times of a demonstration's rows."""

    seconds: FloatArray
    """Since the first row, shape (rows,); where the clock was set back, it stands still."""
    usual: float | None
    """Seconds from a row to the next one, by the median; None where stamps tell no time."""
    set_back: int
    """How often a row is older than the one before it."""

    def at(self, row: int) -> float | None:
        """When a row was recorded; None where stamps tell no time."""
        return None if self.usual is None else float(self.seconds[row])

    def timing(self) -> Timing | None:
        """The figures; None where stamps tell no time."""
        if self.usual is None:
            return None
        return Timing(float(self.seconds[-1]), 1 / self.usual, self.set_back)

    def gaps(self) -> Stretches | None:
        """Where rows are missing; None where stamps tell no time."""
        if self.usual is None:
            return None
        steps = np.diff(self.seconds)
        later = steps[steps > 0]
        least = np.inf
        if len(later) >= FEWEST_INTERVALS:
            lower, upper = np.percentile(later, (25.0, 75.0))
            least = max(upper + FENCE * (upper - lower), MANY_TIMES * self.usual)
        first = np.flatnonzero(steps > least)
        found = self.stretches(first, np.full(len(first), 2, dtype=np.int64))
        return Stretches(found.count, found.count, found.seconds, found.longest)

    def stretches(self, first: IntArray, rows: IntArray) -> Stretches:
        """Parts of the demonstration, the longest of which are listed.

        Args:
            first: The first row of each part, ascending, shape (parts,).
            rows: How many rows it has, shape (parts,).
        """
        spans = self.seconds[first + rows - 1] - self.seconds[first]
        longest = np.lexsort((first, -rows, -spans))[:MOST_LISTED].tolist()
        known = self.usual is not None
        return Stretches(
            len(first),
            int(rows.sum()),
            float(spans.sum()) if known else None,
            tuple(
                Stretch(
                    int(first[part]),
                    int(rows[part]),
                    float(self.seconds[first[part]]) if known else None,
                    float(spans[part]) if known else None,
                )
                for part in longest
            ),
        )


def clock(stamps: IntArray) -> Clock:
    """The times of a demonstration's rows.

    Args:
        stamps: Nanoseconds, shape (rows,).  Rows of several channels at one time are one.
    """
    # In floating point: stamps may be as far apart as integers can be.
    steps = np.diff(stamps.astype(np.float64)) / 1e9
    later = steps[steps > 0]
    usual = float(np.median(later)) if len(later) else 0.0
    seconds = np.concatenate([np.zeros(min(len(stamps), 1)), np.cumsum(np.maximum(steps, 0.0))])
    has_time = usual > NO_TIME / 1e9
    return Clock(seconds, usual if has_time else None, int(np.count_nonzero(steps < 0)))
