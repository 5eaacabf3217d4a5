"""The column of a table that holds the stamp of each row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.storage.read import Part

#: Times between 2001 and 2096, in units of so many nanoseconds.
_UNITS = ((1_000_000_000, "seconds"), (1_000_000, "milliseconds"), (1_000, "microseconds"))
_FIRST, _LAST = 1_000_000_000, 4_000_000_000
_SECOND = 1_000_000_000


def stamps_of(cells: Sequence[str]) -> tuple[IntArray, str] | None:
    """Stamps, nanoseconds, and how they are read if not as such; None where they are none.

    >>> stamps_of(["5", " 7"])[0].tolist()
    [5, 7]
    >>> stamps_of(["1700000000", "1700000001"])[1]
    'seconds since 1970'
    """
    try:
        stamps = np.array([int(cell) for cell in cells], np.int64)
    except (ValueError, OverflowError):
        return None
    for unit, name in _UNITS:
        least = _SECOND // unit
        if np.all((stamps >= _FIRST * least) & (stamps < _LAST * least)):
            return stamps * unit, f"{name} since 1970"
    return stamps, ""


def falls(stamps: IntArray, parts: Sequence[Part]) -> int:
    """How often a row's stamp is before that of the row above it in the same demonstration."""
    falling = np.diff(stamps) < 0
    borders = np.cumsum([part.rows for part in parts], dtype=np.int64)[:-1] - 1
    falling[borders] = False
    return int(np.count_nonzero(falling))
