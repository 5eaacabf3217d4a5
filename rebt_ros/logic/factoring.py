"""Factoring by the distributive law.

`pull_out_common` is the paper's one level (Algorithm 1, line 6), `factor` repeats it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.dnf import Conjunction, Dnf


@dataclass(frozen=True, slots=True)
class Factored:
    """``common AND (OR of alternatives)``; without alternatives it is ``common`` alone."""

    common: tuple[Literal, ...]
    alternatives: tuple[Factored, ...] = ()


def unfactored(dnf: Dnf) -> Factored:
    """The DNF as it is: nothing in common."""
    conjunctions = tuple(Factored(conjunction.literals) for conjunction in dnf)
    return conjunctions[0] if len(conjunctions) == 1 else Factored((), conjunctions)


def pull_out_common(dnf: Dnf) -> Factored:
    """One level of factoring, as in the paper: literals of all conjunctions come to the front.

    Args:
        dnf: At least one conjunction, none of which implies another (as espresso leaves it).
    """
    first, *others = dnf.conjunctions
    common = tuple(one for one in first if all(one in other.literals for other in others))
    if not others:
        return Factored(common)
    shared = frozenset(common)
    return Factored(
        common,
        tuple(Factored(conjunction.without(shared).literals) for conjunction in dnf),
    )


def factor(dnf: Dnf) -> Factored:
    """Repeated factoring: what is common to several conjunctions is pulled out, again and again.

    Of the literals that occur in several conjunctions, the most frequent one is divided out first
    (the first of equals), then quotient and remainder are factored likewise.

    Args:
        dnf: At least one conjunction, none of which implies another (as espresso leaves it).
    """
    pulled = pull_out_common(dnf)
    return Factored(pulled.common, tuple(_divided(list(pulled.alternatives))))


def _divided(alternatives: list[Factored]) -> list[Factored]:
    """An OR of plain conjunctions as an OR of factored ones."""
    occurrences = Counter(literal for one in alternatives for literal in one.common)
    divisor, times = max(occurrences.items(), key=lambda pair: pair[1], default=(None, 0))
    if divisor is None or times < 2:
        return alternatives
    dividend = [Conjunction(one.common) for one in alternatives if divisor in one.common]
    remainder = [one for one in alternatives if divisor not in one.common]
    return [factor(Dnf(tuple(dividend))), *_divided(remainder)]
