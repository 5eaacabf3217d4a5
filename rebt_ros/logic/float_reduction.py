"""Removal of thresholds that other thresholds subsume (Algorithm 1, line 5: FLOAT_REDUCTION).

Espresso treats conditions as free variables.  Thresholds are not free: ``x <= 0.3`` implies
``x <= 0.5``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rebt_ros.logic.conditions import Condition, Quantity, Threshold
from rebt_ros.logic.dnf import Dnf, conditions_of
from rebt_ros.logic.literal_codes import Codes, Numbering, mask


def float_reduction(dnf: Dnf) -> Dnf:
    """The DNF without literals and conjunctions that others subsume.

    Within a conjunction, only the strictest of several thresholds on one side stays.  If one of two
    conjunctions implies the other, the weaker one stays.  The truth value is the same in every
    state.
    """
    numbering = Numbering(conditions_of(dnf))
    implied = implied_literals(numbering.conditions)
    return numbering.dnf(reduced(numbering.cover(dnf), implied))


def implied_literals(conditions: Sequence[Condition]) -> list[int]:
    """For each code, the mask of the literals that it implies, including itself."""
    implied = [1 << code for code in range(2 * len(conditions))]
    of_quantity: dict[Quantity, list[tuple[float, int]]] = {}
    for position, condition in enumerate(conditions):
        if isinstance(condition, Threshold):
            of_quantity.setdefault(condition.quantity, []).append((condition.value, position))
    for thresholds in of_quantity.values():
        # A positive literal implies those of higher thresholds, a negative one those of lower ones.
        for positive, ordered in ((1, sorted(thresholds, reverse=True)), (0, sorted(thresholds))):
            weaker = 0
            for _, position in ordered:
                weaker |= 1 << (2 * position + positive)
                implied[2 * position + positive] = weaker
    return implied


def reduced(cover: Iterable[Codes], implied: Sequence[int]) -> list[Codes]:
    """`float_reduction` for a cover.

    Args:
        cover: The conjunctions.
        implied: From `implied_literals`, of the vocabulary of the cover.
    """
    distinct: dict[int, Codes] = {}
    for conjunction in cover:
        strongest = _strongest(conjunction, implied)
        # Two that differ only in the order of their literals would subsume each other.
        distinct.setdefault(mask(strongest), strongest)
    wanted = list(distinct)
    kept: list[Codes] = []
    for own, conjunction in distinct.items():
        missing = ~_closure(conjunction, implied)
        # One conjunction implies another if it implies all its literals.
        if not any(not (other & missing) and other != own for other in wanted):
            kept.append(conjunction)
    return kept


def _strongest(conjunction: Codes, implied: Sequence[int]) -> Codes:
    subsumed = 0
    for code in conjunction:
        subsumed |= implied[code] & ~(1 << code)
    return tuple(code for code in conjunction if not subsumed >> code & 1)


def _closure(conjunction: Codes, implied: Sequence[int]) -> int:
    """All literals that the conjunction implies."""
    closure = 0
    for code in conjunction:
        closure |= implied[code]
    return closure
