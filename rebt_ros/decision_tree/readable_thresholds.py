"""Thresholds as a person would write them: round, and the same wherever they can be.

gap
    The values ``low <= t < high`` that a split's threshold t may take without any row of its node
    going another way: the largest known value that goes left, and the smallest that goes right.
round
    Of two decimals, the one that is a multiple of the larger power of ten.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

#: A threshold keeps this share of a gap's width from its ends, as rows to come may lie a little
#: beyond those that were shown, ...
_MARGIN = 0.2
#: ... unless that takes more significant digits than these.
_FEW_DIGITS = 2
#: Significant digits that tell any two doubles apart.
_ALL_DIGITS = 17


def shared_thresholds(gaps: Sequence[tuple[float, float]]) -> list[float]:
    """A threshold for each gap: as few values as possible, each as round as possible.

    Greedy stabbing is minimal: the first of the gaps that ends next needs a value of its own, and
    the largest one below its end serves every other gap that any of its values could serve first.
    So all gaps that begin below that end are served at once, and wherever they all reach, the
    roundest value is as good.

    Args:
        gaps: Of one quantity, each ``(low, high)`` with a finite low below high.

    Returns:
        For each gap a value ``low <= t < high``, in O(n log n + n m) for m values.

    >>> shared_thresholds([(0.1952, 0.204), (0.1987, 0.231), (0.19, 0.2019), (0.6, 0.92)])
    [0.2, 0.2, 0.2, 0.8]
    """
    thresholds = [0.0] * len(gaps)
    waiting = sorted(range(len(gaps)), key=lambda place: gaps[place][1])
    while waiting:
        end = gaps[waiting[0]][1]
        served = [place for place in waiting if gaps[place][0] < end]
        value = roundest(max(gaps[place][0] for place in served), end)
        for place in served:
            thresholds[place] = value
        waiting = [place for place in waiting if gaps[place][0] >= end]
    return thresholds


def roundest(low: float, high: float) -> float:
    """The roundest decimal in ``low <= t < high``, the one nearest to the middle of several.

    Away from the ends, if that takes two significant digits at most.

    >>> roundest(0.31, 0.55), roundest(-0.3, 0.2), roundest(98.7, 104.2), roundest(1.0, 1.0000001)
    (0.4, 0.0, 100.0, 1.0)
    """
    high = min(high, sys.float_info.max)
    # Halves, as the difference of two doubles can be infinite.
    half = high / 2 - low / 2
    middle = low + half
    inner = (middle - half * (1 - 2 * _MARGIN), middle + half * (1 - 2 * _MARGIN))
    for (least, most), digits in ((inner, _FEW_DIGITS), ((low, high), _ALL_DIGITS)):
        found = _roundest(max(least, low), min(most, high), middle, digits)
        if found is not None:
            return found
    return low


def _roundest(low: float, high: float, middle: float, digits: int) -> float | None:
    """The roundest decimal of at most so many significant digits; None where there is none."""
    largest = max(abs(low), abs(high))
    if largest == 0:
        return None
    first = math.floor(math.log10(largest)) + 1
    for exponent in range(first, first - digits - 1, -1):
        step = float(f"1e{exponent}")
        if not 0 < step < math.inf:
            continue
        # Rounding can make the first and the last multiple miss by one.
        multiples = {
            round(place) + off
            for place in (low / step, middle / step, high / step)
            for off in (-1, 0, 1)
        }
        inside = [
            value
            for value in (float(f"{multiple}e{exponent}") for multiple in sorted(multiples))
            if low <= value < high
        ]
        if inside:
            return min(inside, key=lambda value: abs(value - middle)) + 0.0
    return None
