"""Factoring by the distributive law (Algorithm 1, line 6: PULLOUT_COMMON)."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.dnf import Dnf


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
