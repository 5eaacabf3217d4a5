"""Weights of demonstrations: how often each of their rows counts.

Weights are ratios.  They are reduced to the smallest whole numbers: counts of rows remain counts,
and equal weights have no effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Final

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.errors import OptionError

#: Maximum of the whole numbers.
LARGEST_WEIGHT: Final = 1000


def whole_weights(weights: Sequence[Fraction]) -> IntArray | None:
    """The smallest whole numbers in the ratio of weights, shape (weights,); None if all are equal.

    Args:
        weights: Above 0.

    Raises:
        OptionError: The whole numbers are too large.

    >>> whole_weights([Fraction(1), Fraction("0.5"), Fraction(3)])
    array([2, 1, 6])
    >>> whole_weights([Fraction(3), Fraction(3)])
    """
    if len(set(weights)) < 2:
        return None
    scale = math.lcm(*(one.denominator for one in weights))
    whole = [int(one * scale) for one in weights]
    divisor = math.gcd(*whole)
    if max(whole) // divisor > LARGEST_WEIGHT:
        raise OptionError(
            f"the weights of demonstrations come to whole numbers up to {max(whole) // divisor}, "
            f"and {LARGEST_WEIGHT} is the most: give them in simpler ratios, such as 1, 2 and 5."
        )
    return np.array([one // divisor for one in whole], dtype=np.int64)
