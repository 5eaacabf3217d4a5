"""Conjunctions and disjunctive normal forms (DNF).

The literals of a conjunction and the conjunctions of a DNF are ordered, which makes printing,
drawing and comparing deterministic.  Their order has no logical meaning.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rebt_ros.logic.conditions import Condition, Literal


@dataclass(frozen=True, slots=True)
class Conjunction:
    """An AND of literals; without literals it is TRUE."""

    literals: tuple[Literal, ...] = ()

    def __post_init__(self) -> None:
        conditions = {literal.condition for literal in self.literals}
        if len(conditions) != len(self.literals):
            raise ValueError(f"a conjunction may name a condition only once, not {self.literals}")

    def __iter__(self) -> Iterator[Literal]:
        return iter(self.literals)

    def __len__(self) -> int:
        return len(self.literals)

    def without(self, literals: frozenset[Literal]) -> Conjunction:
        """The conjunction without the given literals, in the same order."""
        return Conjunction(tuple(literal for literal in self.literals if literal not in literals))


@dataclass(frozen=True, slots=True)
class Dnf:
    """An OR of conjunctions; without conjunctions it is FALSE."""

    conjunctions: tuple[Conjunction, ...] = ()

    def __iter__(self) -> Iterator[Conjunction]:
        return iter(self.conjunctions)

    def __len__(self) -> int:
        return len(self.conjunctions)


FALSE = Dnf()


def conditions_of(dnf: Dnf) -> tuple[Condition, ...]:
    """Each condition of the DNF once, in the order in which it first occurs."""
    return tuple(dict.fromkeys(literal.condition for conjunction in dnf for literal in conjunction))
