"""Rules in numbers: literals as small integers, for code that compares them very often.

code
    A literal: twice the position of its condition in a vocabulary, plus one if it is positive.
cover
    A DNF: each conjunction as the codes of its literals, in their order.
mask
    A set of literals: an integer with the bit of each literal's code set.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from rebt_ros.logic.conditions import Condition, Literal
from rebt_ros.logic.dnf import Conjunction, Dnf

Codes: TypeAlias = tuple[int, ...]
Cover: TypeAlias = Sequence[Codes]


class Numbering:
    """A mapping between literals and their codes."""

    def __init__(self, conditions: Iterable[Condition]) -> None:
        """Numbers the conditions in their order, each once."""
        self.conditions = tuple(conditions)
        self._literals = tuple(
            Literal(condition, positive)
            for condition in self.conditions
            for positive in (False, True)
        )
        self._code = {condition: 2 * position for position, condition in enumerate(self.conditions)}

    def codes(self, literals: Iterable[Literal]) -> Codes:
        """The code of each literal, whose condition must be in the vocabulary."""
        return tuple(self._code[literal.condition] + literal.positive for literal in literals)

    def cover(self, dnf: Dnf) -> list[Codes]:
        """The cover of a DNF."""
        return [self.codes(conjunction) for conjunction in dnf]

    def literals(self, codes: Iterable[int]) -> tuple[Literal, ...]:
        """The literals of the codes."""
        return tuple(map(self._literals.__getitem__, codes))

    def dnf(self, cover: Iterable[Codes]) -> Dnf:
        """The DNF of a cover."""
        return Dnf(tuple(Conjunction(self.literals(codes)) for codes in cover))


def mask(codes: Iterable[int]) -> int:
    """The mask of these codes."""
    found = 0
    for code in codes:
        found |= 1 << code
    return found
