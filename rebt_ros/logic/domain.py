"""How conditions depend on each other: combinations that no state has.

Espresso minimizes over free variables.  Conditions are not free: of two thresholds, the lower one
implies the higher one; a feature has at most one category; and the previous action and LAT are at
most one action each.  Passed to espresso as don't-cares, infeasible combinations give smaller rules
that are equal in every state.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise

from rebt_ros.logic.conditions import (
    Condition,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
)
from rebt_ros.logic.dnf import Conjunction, Dnf


def spelled_out(dnf: Dnf, conditions: Iterable[Condition]) -> Dnf:
    """The DNF, with all literals of the given conditions that its own literals imply.

    If one of two feasible conjunctions is spelled out, they share an assignment only if they share
    a state.

    >>> near, reachable = Threshold("x", 0.3), Threshold("x", 0.5)
    >>> spelled_out(Dnf((Conjunction((Literal(near),)),)), [near, reachable]) == Dnf(
    ...     (Conjunction((Literal(near), Literal(reachable))),)
    ... )
    True
    """
    related: dict[Hashable, list[Condition]] = {}
    for condition in dict.fromkeys(conditions):
        related.setdefault(_subject(condition), []).append(condition)
    spelled: list[Conjunction] = []
    for conjunction in dnf:
        implied = (one for literal in conjunction for one in _implied(literal, related))
        literals = dict.fromkeys((*conjunction, *implied))
        # A conjunction that contradicts itself holds in no state.
        if not any(~literal in literals for literal in literals):
            spelled.append(Conjunction(tuple(literals)))
    return Dnf(tuple(spelled))


def _subject(condition: Condition) -> Hashable:
    """What a condition is about; conditions about different things are independent."""
    match condition:
        case LastActionIs(deciding=deciding):
            return LastActionIs, deciding
        case PreviousActionIs():
            return PreviousActionIs
        case Threshold(quantity=quantity) | Interval(quantity=quantity):
            return type(condition), quantity
        case IsTrue(feature=feature) | HasCategory(feature=feature):
            return type(condition), feature


def _implied(
    literal: Literal, related: Mapping[Hashable, Sequence[Condition]]
) -> Iterator[Literal]:
    condition = literal.condition
    others = related.get(_subject(condition), ())
    match condition:
        case Threshold(value=value):
            for other in others:
                if isinstance(other, Threshold) and (
                    other.value > value if literal.positive else other.value < value
                ):
                    yield Literal(other, literal.positive)
        case HasCategory() | PreviousActionIs() | LastActionIs():
            if literal.positive:
                yield from (~Literal(other) for other in others if other != condition)
        case IsTrue() | Interval():
            pass


def infeasible(conditions: Iterable[Condition]) -> Dnf:
    """The combinations of conditions that no state has, as a DNF linear in the thresholds.

    >>> near, reachable = Threshold("x", 0.3), Threshold("x", 0.5)
    >>> infeasible([reachable, near]) == Dnf(
    ...     (Conjunction((Literal(near), Literal(reachable, positive=False))),)
    ... )
    True
    """
    thresholds: dict[Quantity, set[Threshold]] = {}
    exclusive: dict[Hashable, list[Condition]] = {}
    for condition in dict.fromkeys(conditions):
        match condition:
            case Threshold(quantity=quantity):
                thresholds.setdefault(quantity, set()).add(condition)
            case HasCategory() | PreviousActionIs() | LastActionIs():
                exclusive.setdefault(_subject(condition), []).append(condition)
            case IsTrue() | Interval():
                # There are no intervals yet: they are made from minimized rules.
                pass
    # Pairs of neighbors are enough: being below a threshold but not below a higher one violates
    # one of the pairs between them.
    lower_without_higher = (
        Conjunction((Literal(lower), ~Literal(higher)))
        for group in thresholds.values()
        for lower, higher in pairwise(sorted(group, key=lambda one: one.value))
    )
    two_at_once = (
        Conjunction((Literal(one), Literal(other)))
        for group in exclusive.values()
        for one, other in combinations(group, 2)
    )
    return Dnf((*lower_without_higher, *two_at_once))
