"""Conditions and literals, the atoms of every rule.

condition
    An atomic test of the state: `Threshold`, `Interval`, `IsTrue`, `HasCategory` or
    `LastActionIs`.
literal
    A condition or its negation.

A missing value makes every condition on it false, so ``~(x <= 3)`` holds where x is missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

#: Threshold under which every value lies that is not missing.
KNOWN = 1.7976931348623157e308


@dataclass(frozen=True, slots=True)
class Threshold:
    """``feature <= value``, compared in double precision."""

    feature: str
    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ValueError(f"the threshold of {self.feature!r} must be finite, not {self.value}")


@dataclass(frozen=True, slots=True)
class Interval:
    """``above < feature <= at_most``, compared in double precision."""

    feature: str
    above: float
    at_most: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.above) and math.isfinite(self.at_most)):
            raise ValueError(
                f"the interval of {self.feature!r} must be finite, not from {self.above} to "
                f"{self.at_most}"
            )
        if not self.above < self.at_most:
            raise ValueError(
                f"the interval of {self.feature!r} must not be empty, as from {self.above} to "
                f"{self.at_most}"
            )


@dataclass(frozen=True, slots=True)
class IsTrue:
    """The binary feature is 1."""

    feature: str


@dataclass(frozen=True, slots=True)
class HasCategory:
    """``feature = category`` for a categorical feature."""

    feature: str
    category: str


@dataclass(frozen=True, slots=True)
class LastActionIs:
    """``LAT = action``: the last action taken (paper, III-B).

    LAT is the most recent action that differs from the one being decided.  A decision tree reads
    it from a column, where that action is known; a behavior tree is still choosing, so there the
    condition names in `deciding` the action, or PSA group of actions, of the rule it stands in.
    """

    action: str
    deciding: tuple[str, ...] = ()


Condition: TypeAlias = Threshold | Interval | IsTrue | HasCategory | LastActionIs


@dataclass(frozen=True, slots=True)
class Literal:
    """A condition or its negation.

    >>> battery_low = Literal(Threshold("battery", 0.2))
    >>> ~~battery_low == battery_low
    True
    """

    condition: Condition
    positive: bool = True

    def __invert__(self) -> Literal:
        return Literal(self.condition, not self.positive)


def deciding(literal: Literal, actions: tuple[str, ...]) -> Literal:
    """The literal as it is meant in a rule that triggers `actions`; only LAT literals change."""
    if isinstance(literal.condition, LastActionIs):
        return replace(literal, condition=replace(literal.condition, deciding=actions))
    return literal
