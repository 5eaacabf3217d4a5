"""Which rows have equal states."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rebt_ros.arrays import FloatArray, IntArray, in_parts

#: Odd numbers that mix the hashes of states.
_GOLDEN, _ODD = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xD6E8FEB86659FD93)


def codes_of_states(states: FloatArray) -> IntArray:
    """A number for each row, equal for equal states, shape (rows,); below twice the rows.

    Missing values equal each other.

    Args:
        states: Shape (rows, features).
    """
    hashes = np.zeros(len(states), dtype=np.uint64)
    # In parts: a large table may be on disk, where a single pass takes long enough.
    for rows in in_parts(len(states)):
        part = hashes[rows]
        for column in states[rows].T:
            # 0 has two signs, and NaN many forms.
            values = np.where(np.isnan(column), np.nan, column) + 0.0
            part[:] = _mixed(part + _GOLDEN) ^ _mixed(values.view(np.uint64))
            part *= _ODD
    return codes_of_numbers(hashes)


def codes_of_numbers(numbers: IntArray | npt.NDArray[np.uint64]) -> IntArray:
    """A code for each number, equal for equal numbers and below twice the rows, shape (rows,).

    Args:
        numbers: Few of them come again as a rule, shape (rows,).

    >>> codes_of_numbers(np.array([30, 10, 30, 20])).tolist()
    [0, 2, 0, 4]
    """
    # Numbers are sorted much sooner than their places are.
    ordered = np.sort(numbers)
    again = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    codes = len(again) + np.arange(len(numbers))
    if len(again):
        place = np.minimum(np.searchsorted(again, numbers), len(again) - 1)
        comes_again = again[place] == numbers
        codes[comes_again] = place[comes_again]
    return codes


def _mixed(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Spreads each bit over all 64 (the finalizer of splitmix64, Steele et al., 2014)."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
