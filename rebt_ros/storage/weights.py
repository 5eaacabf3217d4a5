"""Weights as people write them."""

from __future__ import annotations

import contextlib
from fractions import Fraction
from numbers import Real
from typing import Final

from rebt_ros.errors import OptionError

#: Bounds of weights above 0.
LEAST: Final = 0.001
MOST: Final = 1000.0
#: Longer numbers are no weights.
_LONGEST: Final = 24


def weight(value: object) -> Fraction:
    """A weight as an exact number.

    Args:
        value: A number, or the text of one.

    Raises:
        OptionError: It is none, or not 0 or 0.001 to 1000.

    >>> weight("0.1"), weight(2)
    (Fraction(1, 10), Fraction(2, 1))
    """
    written = str(value).strip()
    number = -1.0
    if isinstance(value, str | Real) and not isinstance(value, bool):
        with contextlib.suppress(OverflowError, ValueError):
            number = float(value)
    # Exact numbers are made of few digits only: exponents can make them as long as memory is.
    fits = number == 0 or LEAST <= number <= MOST
    if not fits or not (isinstance(value, Fraction) or len(written) <= _LONGEST):
        raise OptionError(
            f"a weight must be 0 or a number from {LEAST:g} to {MOST:g}, not {written[:_LONGEST]}."
        )
    return Fraction(written) if number else Fraction(0)
