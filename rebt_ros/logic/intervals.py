"""Two thresholds on one quantity as one interval, as a person writes it.

*Not* ``x <= 0.3`` and ``x <= 0.5`` is ``0.3 < x <= 0.5``.  Both are false if x is missing, so the
truth value is the same in every state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from operator import itemgetter

from rebt_ros.logic.conditions import KNOWN, Condition, Interval, Literal, Quantity, Threshold
from rebt_ros.logic.factoring import Factored
from rebt_ros.logic.literal_codes import Codes, mask


def with_intervals(condition: Factored) -> Factored:
    """The condition with intervals in place of the pairs of thresholds in each conjunction.

    Args:
        condition: Already factored: factoring cannot separate a pair that is one condition.
    """
    return Factored(
        merged(condition.common),
        tuple(with_intervals(alternative) for alternative in condition.alternatives),
    )


def merged(conjunction: Iterable[Literal]) -> tuple[Literal, ...]:
    """The literals, with each pair as one interval in the place of the first of the two.

    >>> near, reachable = Literal(Threshold("x", 0.3)), Literal(Threshold("x", 0.5))
    >>> merged((reachable, ~near))
    (Literal(condition=Interval(quantity='x', above=0.3, at_most=0.5), positive=True),)
    >>> merged((near, ~reachable)) == (near, ~reachable)
    True
    """
    literals: list[Literal] = []
    for literal in conjunction:
        for place, earlier in enumerate(literals):
            interval = _interval(earlier, literal)
            if interval is not None:
                literals[place] = Literal(interval)
                break
        else:
            literals.append(literal)
    return tuple(literals)


def enclosing_literals(conditions: Sequence[Condition]) -> list[int]:
    """For each code, the mask of the literals with which it forms an interval; only for ``>``."""
    enclosing = [0] * (2 * len(conditions))
    of_quantity: dict[Quantity, list[tuple[float, int]]] = {}
    for place, condition in enumerate(conditions):
        if isinstance(condition, Threshold):
            of_quantity.setdefault(condition.quantity, []).append((condition.value, place))
    for thresholds in of_quantity.values():
        # From the highest one down, each with all higher ones.
        higher = 0
        for value, equal in groupby(sorted(thresholds, reverse=True), key=itemgetter(0)):
            places = [place for _, place in equal]
            for lower in places:
                enclosing[2 * lower] = higher
            if value != KNOWN:
                higher |= mask(2 * upper + 1 for upper in places)
    return enclosing


def intervals_among(conjunction: Codes, enclosing: Sequence[int]) -> int:
    """How many intervals `merged` makes of a float-reduced conjunction of codes.

    Args:
        conjunction: At most one lower and one upper threshold of each feature.
        enclosing: From `enclosing_literals`.
    """
    there = mask(conjunction)
    return sum(1 for code in conjunction if enclosing[code] & there)


def _interval(one: Literal, other: Literal) -> Interval | None:
    """The interval that two literals make; None if they make none."""
    lower, upper = (one, other) if other.positive else (other, one)
    match lower, upper:
        case (
            Literal(condition=Threshold(quantity=quantity, value=above), positive=False),
            Literal(condition=Threshold(quantity=same, value=at_most), positive=True),
        ) if quantity == same and above < at_most and at_most != KNOWN:
            # "x > 0.3" and "x is known" read better than an interval up to the largest number.
            return Interval(quantity, above, at_most)
        case _:
            return None
