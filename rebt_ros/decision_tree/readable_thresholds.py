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
from bisect import bisect_right
from collections.abc import Sequence
from decimal import Decimal

#: A threshold keeps this share of a gap's width from its ends, as rows to come may lie a little
#: beyond those that were shown, ...
_MARGIN = 0.2
#: ... unless that takes more significant digits than these.
_FEW_DIGITS = 2
#: Significant digits that tell any two doubles apart.
_ALL_DIGITS = 17
#: A rounder value near an end is taken where at most this share of such gaps would hold one as
#: round by chance: a demonstrator who turns at 10 has hardly ever 9.9 in mind.
_BY_CHANCE = 0.25


def shared_thresholds(
    gaps: Sequence[tuple[float, float]], largest: float | None = None
) -> list[float]:
    """A threshold for each gap: as few values as possible, each as round as possible.

    Greedy stabbing is minimal: going through the gaps by their ends, one that begins at or above
    the end of the last chosen one is chosen as well.  The chosen gaps do not overlap, so that each
    needs a value of its own, and every other gap holds all values just below the end of one.  Each
    gap is served by the first chosen one with which that is so, or by the next one where it holds
    all of that: there it leaves the value free to be round.

    Args:
        gaps: Of one quantity, each ``(low, high)`` with a finite low below high.
        largest: Absolute value of the quantity; None for that of the gaps' ends.

    Returns:
        For each gap a value ``low <= t < high``, in O(n log n).

    >>> shared_thresholds([(0.1952, 0.204), (0.1987, 0.231), (0.19, 0.2019), (0.6, 0.92)])
    [0.2, 0.2, 0.2, 0.8]
    >>> shared_thresholds([(0.0, 1.0), (0.93, 5.0), (2.0, 3.0)])
    [0.5, 2.5, 2.5]
    """
    lows: list[float] = []
    ends: list[float] = []
    # Of those that end together the innermost, so that their order does not matter.
    for low, high in sorted(gaps, key=lambda gap: (gap[1], -gap[0])):
        if not ends or low >= ends[-1]:
            lows.append(low)
            ends.append(high)
    serving, reached = [], list(lows)
    for low, high in gaps:
        # The first chosen gap that ends above; this one ends there or later.
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
    """The roundest decimal in ``low <= t < high``, the one nearest to the middle of several.

    It lies away from the ends if that takes two significant digits at most, unless one near an end
    is too round to be there by chance.  That is 0, too, as a share of the largest value.

    Args:
        low: The end that the value may have.
        high: The other one.
        largest: Absolute value of what is compared; 0 where it is not known.

    >>> roundest(0.31, 0.55), roundest(-0.3, 0.2), roundest(98.7, 104.2), roundest(1.0, 1.0000001)
    (0.4, 0.0, 100.0, 1.0)
    >>> roundest(9.79, 10.002), roundest(-0.03, 0.16), roundest(-0.03, 0.16, 10.0)
    (10.0, 0.1, 0.0)
    """
    high = min(high, sys.float_info.max)
    # Halves, as the difference of two doubles can be infinite.
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
    # The largest value that goes left was shown, and is no border between what was.
    by_chance = half > _BY_CHANCE / 2 * power or value == low
    return value if power > inner[1] and not by_chance else inner[0]


def _roundest(low: float, high: float, middle: float, digits: int) -> tuple[float, float] | None:
    """The roundest decimal of at most so many significant digits; None where there is none.

    With the power of ten that it is a multiple of.
    """
    largest = max(abs(low), abs(high))
    if largest == 0:
        return None
    first = math.floor(math.log10(largest)) + 1
    for exponent in range(first, first - digits - 1, -1):
        # As decimals, since a power of ten far from 1 is not exact as a double.
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
