"""Rules in numbers: literals are small integers wherever the same ones are compared very often.

code
    A literal: twice the position of its condition in a vocabulary, and one more if it is positive.
cover
    A DNF: each conjunction as the codes of its literals, in their order.
mask
    A set of literals: an integer in which the bit of each one's code is set.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from rebt_ros.logic.conditions import Condition, Literal
from rebt_ros.logic.dnf import Conjunction, Dnf

Codes: TypeAlias = tuple[int, ...]
Cover: TypeAlias = Sequence[Codes]


class Numbering:
    """The codes of literals, and back."""

    def __init__(self, conditions: Iterable[Condition]) -> None:
        """Numbers the conditions in their order; each one once."""
        self.conditions = tuple(conditions)
        self._literals = tuple(
            Literal(condition, positive)
            for condition in self.conditions
            for positive in (False, True)
        )
        self._code = {condition: 2 * position for position, condition in enumerate(self.conditions)}

    def codes(self, literals: Iterable[Literal]) -> Codes:
        """The code of each literal; their conditions must be among those that are numbered."""
        return tuple(self._code[literal.condition] + literal.positive for literal in literals)

    def cover(self, dnf: Dnf) -> list[Codes]:
        """The DNF in numbers."""
        return [self.codes(conjunction) for conjunction in dnf]

    def literals(self, codes: Iterable[int]) -> tuple[Literal, ...]:
        """The literals of the codes."""
        return tuple(map(self._literals.__getitem__, codes))

    def dnf(self, cover: Iterable[Codes]) -> Dnf:
        """The DNF of a cover."""
        return Dnf(tuple(Conjunction(self.literals(codes)) for codes in cover))


def mask(codes: Iterable[int]) -> int:
    """The set of some literals."""
    found = 0
    for code in codes:
        found |= 1 << code
    return found
