"""Numbers within several linear bounds, as those of weighted sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

#: A range that is narrower than this share of what was shown is taken for its upper end.
_NARROW: Final = 1e-7
#: How far inside of their bounds numbers are to lie, and how far outside they have to for it to be
#: sure that there are none: shares of what was shown.  The solver is exact to about 1e-7.
_INSIDE: Final = 0.01
_OUTSIDE: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Bound:
    """``above < weights · numbers <= at_most``; an end that is infinite is none."""

    weights: tuple[float, ...]
    above: float
    at_most: float


def numbers_within(
    ranges: Sequence[tuple[float, float]], scales: Sequence[float], bounds: Sequence[Bound]
) -> tuple[float, ...] | None:
    """Numbers that lie inside of all bounds, not close to them if that can be.

    Args:
        ranges: Above what each number lies, and what it is at most; infinite for no end.
        scales: How much of each number was shown; positive.
        bounds: Of weighted sums of the numbers.

    Returns:
        The numbers, which may be outside by a rounding error; None where there are none for sure.
    """
    # It takes half a second to import, and only weighted sums need it.
    from scipy.optimize import linprog

    # The unknowns are the numbers in shares of what was shown and, behind them, the margin.
    scale, ends = np.array(scales), np.array(ranges)
    narrow = ends[:, 1] - ends[:, 0] <= _NARROW * scale
    weights = np.array([one.weights for one in bounds]).reshape(len(bounds), len(scale))
    rows = np.concatenate([np.eye(len(scale))[~narrow], weights * scale])
    size = np.abs(rows).max(axis=1)
    own = [tuple(one) for one in ends[~narrow] / scale[~narrow, np.newaxis]]
    both = np.array([*own, *((one.above, one.at_most) for one in bounds)]).reshape(len(rows), 2)
    above, at_most = both[:, 0], both[:, 1]
    limits = np.concatenate([at_most / size, -above / size])
    matrix = np.concatenate([rows, -rows]) / np.concatenate([size, size])[:, np.newaxis]
    limited = np.isfinite(limits)
    fixed = [
        (end, end) if is_one else (None, None)
        for end, is_one in zip((ends[:, 1] / scale).tolist(), narrow, strict=True)
    ]
    solved = linprog(
        [*np.zeros(len(scale)), -1.0],
        A_ub=np.column_stack([matrix, np.ones(len(matrix))])[limited],
        b_ub=limits[limited],
        bounds=[*fixed, (None, _INSIDE)],
        method="highs",
    )
    if solved.x is None or solved.x[-1] < -_OUTSIDE:
        return None
    return tuple(np.where(narrow, ends[:, 1], solved.x[:-1] * scale).tolist())
