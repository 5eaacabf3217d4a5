"""Undoing a known reaction time: actions move back to the states that they respond to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.demonstration import NO_TIME
from rebt_ros.demonstration.last_action import NO_ACTION, previous_actions
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError


def shifted(table: DemonstrationTable, rows: int) -> DemonstrationTable:
    """The table with actions moved back to the states that they respond to.

    Row t gets the action of row t + `rows` of its demonstration.  The last rows, which then have no
    action, are left out, as are demonstrations without other rows.  What was done before each row
    is derived from the moved actions.  If something was done before a demonstration began, LAT of
    its first row still knows.

    Args:
        table: Rows of one channel, in whole demonstrations.
        rows: The delay, 0 or more.

    Raises:
        OptionError: No demonstration is longer than the delay.
    """
    if not rows:
        return table
    place, length = places(table)
    has_action = place < length - rows
    if not has_action.any():
        raise OptionError(
            f"no demonstration is longer than a reaction time of {rows} rows: give a shorter one."
        )
    states = table.where(has_action)
    before = table.before
    if before is not None:
        shown, first = np.unique(states.demonstration, return_index=True)
        moved = np.full_like(before, NO_ACTION)
        moved[shown] = table.last[np.flatnonzero(has_action)[first] + rows]
        before = np.where(before == NO_ACTION, NO_ACTION, moved)
    chosen = table.chosen[np.flatnonzero(has_action) + rows]
    previous = previous_actions(chosen, states.demonstration)
    return replace(states, chosen=chosen, before=before, previous=previous)


def tells_time(table: DemonstrationTable) -> bool:
    """Whether the stamps are times, not row numbers."""
    return row_gap(table) is not None


def rows_in(table: DemonstrationTable, seconds: float) -> int:
    """A time in rows, rounded.

    Raises:
        OptionError: The table's stamps are not times.
    """
    gap = row_gap(table)
    if not seconds:
        return 0
    if gap is None:
        raise OptionError(
            "a reaction time in seconds needs rows with stamps: give the table a column 'stamp' "
            "(nanoseconds)."
        )
    return round(seconds / gap)


def places(table: DemonstrationTable) -> tuple[IntArray, IntArray]:
    """Position of each row in its demonstration, and number of rows there, both (rows,)."""
    first = np.searchsorted(table.demonstration, table.demonstration)
    end = np.searchsorted(table.demonstration, table.demonstration, side="right")
    return np.arange(len(table)) - first, end - first


def row_gap(table: DemonstrationTable) -> float | None:
    """Seconds from one row to the next; None if stamps are not times."""
    gaps = np.diff(table.stamps)[np.diff(table.demonstration) == 0]
    gap = float(np.median(gaps)) if len(gaps) else 0.0
    return gap / 1e9 if gap > NO_TIME else None
