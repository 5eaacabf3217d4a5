"""Removal of thresholds that other thresholds subsume (Algorithm 1, line 5: FLOAT_REDUCTION).

Espresso treats conditions as free variables.  Thresholds are not free: ``x <= 0.3`` implies
``x <= 0.5``.
"""

from __future__ import annotations

from collections.abc import Iterable

from rebt_ros.logic.conditions import Literal, Threshold
from rebt_ros.logic.dnf import Conjunction, Dnf


def implies(stronger: Literal, weaker: Literal) -> bool:
    """Whether every state that satisfies `stronger` satisfies `weaker`.

    >>> near, reachable = Literal(Threshold("x", 0.3)), Literal(Threshold("x", 0.5))
    >>> implies(near, reachable), implies(reachable, near), implies(~reachable, ~near)
    (True, False, True)
    """
    a, b = stronger.condition, weaker.condition
    if (
        isinstance(a, Threshold)
        and isinstance(b, Threshold)
        and a.feature == b.feature
        and stronger.positive == weaker.positive
    ):
        return a.value <= b.value if stronger.positive else a.value >= b.value
    return stronger == weaker


def float_reduction(dnf: Dnf) -> Dnf:
    """The DNF without literals and conjunctions that others subsume.

    Within a conjunction the strongest of several thresholds on one side stays; of two
    conjunctions of which one implies the other, the weaker stays.  The truth value is unchanged
    in every state.
    """
    distinct: dict[frozenset[Literal], Conjunction] = {}
    for conjunction in map(_strongest, dnf):
        # Two that differ in nothing but the order of their literals would subsume each other.
        distinct.setdefault(frozenset(conjunction), conjunction)
    reduced = distinct.values()
    return Dnf(
        tuple(
            conjunction
            for conjunction in reduced
            if not any(
                _conjunction_implies(conjunction, other) and other != conjunction
                for other in reduced
            )
        )
    )


def _strongest(conjunction: Conjunction) -> Conjunction:
    return conjunction.without(
        frozenset(
            weaker
            for weaker in conjunction
            if any(implies(other, weaker) for other in conjunction if other != weaker)
        )
    )


def _conjunction_implies(stronger: Conjunction, weaker: Iterable[Literal]) -> bool:
    return all(any(implies(mine, its) for mine in stronger) for its in weaker)
