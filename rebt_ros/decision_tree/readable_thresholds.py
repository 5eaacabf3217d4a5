"""Thresholds as a person would write them: round, and shared wherever possible.

gap
    The values ``low <= t < high`` that the threshold t of a split may have without sending any row
    of its node another way: low is the largest known value that goes left, and high the smallest
    one that goes right.
round
    Of two decimals, the rounder one is the multiple of the larger power of ten.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Sequence
from decimal import Decimal

#: A threshold keeps this share of a gap's width away from its ends, since future rows may lie
#: slightly beyond those that were shown, ...
_MARGIN = 0.2
#: ... unless that takes more significant digits than this.
_FEW_DIGITS = 2
#: Significant digits that distinguish any two doubles.
_ALL_DIGITS = 17
#: A rounder value near an end is taken if at most this share of such gaps would contain one as
#: round by chance: a demonstrator who turns at 10 hardly ever has 9.9 in mind.
_BY_CHANCE = 0.25


def shared_thresholds(
    gaps: Sequence[tuple[float, float]], largest: float | None = None
) -> list[float]:
    """A threshold for each gap: as few values as possible, each as round as possible.

    Greedy stabbing is minimal: in the order of their ends, a gap is chosen if it begins at or above
    the end of the last chosen one.  Chosen gaps do not overlap, so each needs a value of its own.
    Every other gap contains all values just below the end of a chosen one.  It shares the value of
    the first such chosen gap, or that of the next one if it contains all of that: there it does not
    restrict how round the value is.

    Args:
        gaps: Gaps of one quantity, each ``(low, high)`` with a finite low below high.
        largest: Largest absolute value of the quantity; None for that of the gaps' ends.

    Returns:
        A value ``low <= t < high`` for each gap, in O(n log n).

    >>> shared_thresholds([(0.1952, 0.204), (0.1987, 0.231), (0.19, 0.2019), (0.6, 0.92)])
    [0.2, 0.2, 0.2, 0.8]
    >>> shared_thresholds([(0.0, 1.0), (0.93, 5.0), (2.0, 3.0)])
    [0.5, 2.5, 2.5]
    """
    lows: list[float] = []
    ends: list[float] = []
    # Of gaps with the same end, the innermost comes first: their order does not matter.
    for low, high in sorted(gaps, key=lambda gap: (gap[1], -gap[0])):
        if not ends or low >= ends[-1]:
            lows.append(low)
            ends.append(high)
    serving, reached = [], list(lows)
    for low, high in gaps:
        # The first chosen gap that ends above; this gap ends there or later.
        place = bisect_right(ends, low)
        if low > lows[place] and place + 1 < len(ends) and ends[place + 1] <= high:
            place += 1
        reached[place] = max(reached[place], low)
        serving.append(place)
    if largest is None:
        largest = max((abs(end) for gap in gaps for end in gap if math.isfinite(end)), default=0.0)
    values = [roundest(low, end, largest) for low, end in zip(reached, ends, strict=True)]
    return [values[place] for place in serving]


def roundest(low: float, high: float, largest: float = 0.0) -> float:
    """The roundest decimal in ``low <= t < high``; of several, the one nearest to the middle.

    It keeps away from the ends if two significant digits are enough for that, unless a value near
    an end is too round to be there by chance.  So may 0 be, compared with the largest value.

    Args:
        low: The lower end, which the value may equal.
        high: The upper end.
        largest: Largest absolute value of what is compared; 0 if unknown.

    >>> roundest(0.31, 0.55), roundest(-0.3, 0.2), roundest(98.7, 104.2), roundest(1.0, 1.0000001)
    (0.4, 0.0, 100.0, 1.0)
    >>> roundest(9.79, 10.002), roundest(-0.03, 0.16), roundest(-0.03, 0.16, 10.0)
    (10.0, 0.1, 0.0)
    """
    high = min(high, sys.float_info.max)
    # Halves, because the difference of two doubles can be infinite.
    half = high / 2 - low / 2
    middle = low + half
    least, most = middle - half * (1 - 2 * _MARGIN), middle + half * (1 - 2 * _MARGIN)
    inner = _roundest(max(least, low), min(most, high), middle, _FEW_DIGITS)
    outer = _roundest(low, high, middle, _ALL_DIGITS)
    if outer is None:
        return low
    value, power = outer
    if inner is None:
        return value
    if value == 0:
        power = max(largest, -low, high)
    # The largest value that goes left was shown, so it is no border between shown values.
    by_chance = half > _BY_CHANCE / 2 * power or value == low
    return value if power > inner[1] and not by_chance else inner[0]


def _roundest(low: float, high: float, middle: float, digits: int) -> tuple[float, float] | None:
    """The roundest decimal with at most this many significant digits, or None.

    Comes with the power of ten that it is a multiple of.
    """
    largest = max(abs(low), abs(high))
    if largest == 0:
        return None
    first = math.floor(math.log10(largest)) + 1
    for exponent in range(first, first - digits - 1, -1):
        # Decimals, because powers of ten far from 1 are not exact as doubles.
        multiples = {
            round(Decimal(value).scaleb(-exponent)) + off
            for value in (low, middle, high)
            for off in (-1, 0, 1)
        }
        inside = [
            value
            for value in (float(f"{multiple}e{exponent}") for multiple in sorted(multiples))
            if low <= value < high
        ]
        if inside:
            nearest = min(inside, key=lambda value: abs(value - middle))
            return nearest + 0.0, 10.0**exponent
    return None
