"""Idle stretches: rows in which neither the state nor the action changes.

A feature stands still in a window of rows in which it varies by no more than a hundredth of its
usual range; sensors hardly ever say the same twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.inspection.inspection import Stretches
from rebt_ros.inspection.timing import Clock

#: Seconds for which nothing changes, where nobody says how many.
IDLE_SECONDS: Final = 2.0
#: Rows in which nothing changes, where stamps tell no time, and the least in any case.
IDLE_ROWS: Final = 10
#: Share of its usual range by which a feature that stands still may vary.
STILL: Final = 0.01

_Array = npt.NDArray[Any]


def idle(states: FloatArray, chosen: IntArray, clock: Clock, seconds: float) -> Stretches:
    """The idle stretches of a demonstration.

    Args:
        states: In units of the features' usual ranges, shape (rows, features); what is missing is a
            number that is none of the values.
        chosen: Actions, shape (rows,).
        clock: When the rows were recorded.
        seconds: For which nothing changes at least.
    """
    least = IDLE_ROWS
    if clock.usual is not None:
        least = max(IDLE_ROWS, math.ceil(seconds / clock.usual) + 1)
    in_stretch = _in_windows(_still(states, chosen, least), least, len(chosen))
    edges = np.diff(in_stretch.astype(np.int8), prepend=0, append=0)
    first, end = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return clock.stretches(first, end - first)


def _still(states: FloatArray, chosen: IntArray, rows: int) -> BoolArray:
    """Whether nothing changes in the window of so many rows that begins at each row."""
    if len(chosen) < rows:
        return np.zeros(0, dtype=bool)
    same = _over_windows(chosen, rows, np.maximum) == _over_windows(chosen, rows, np.minimum)
    if not same.any():
        return np.zeros(len(same), dtype=bool)
    moved = _over_windows(states, rows, np.maximum) - _over_windows(states, rows, np.minimum)
    return np.asarray(same & (moved <= STILL).all(axis=1))


def _over_windows(values: _Array, rows: int, most: Callable[[_Array, _Array], _Array]) -> _Array:
    """The most of each window of so many rows, shape (windows, ...), in log(rows) passes."""
    width = 1
    while 2 * width <= rows:
        values = most(values[:-width], values[width:])
        width *= 2
    rest = rows - width
    return most(values[: len(values) - rest], values[rest:]) if rest else values


def _in_windows(begins: BoolArray, rows: int, count: int) -> BoolArray:
    """Which of all rows are in a window that begins at one of those, shape (count,)."""
    edges = np.zeros(count + 1, dtype=np.int64)
    first = np.flatnonzero(begins)
    edges[first] += 1
    edges[first + rows] -= 1
    return np.asarray(np.cumsum(edges)[:-1] > 0)
