"""Conditions and literals, the atoms of every rule.

condition
    An atomic test of the state or of what was done before: `Threshold`, `Interval`, `IsTrue`,
    `HasCategory`, `PreviousActionIs` or `LastActionIs`.
quantity
    What a `Threshold` or an `Interval` compares: a numeric feature, or a `Difference` of two.
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
class Difference:
    """``minuend - subtrahend``, computed in double precision; missing where either one is."""

    minuend: str
    subtrahend: str

    def __post_init__(self) -> None:
        if self.minuend == self.subtrahend:
            raise ValueError(f"the difference of {self.minuend!r} and itself is always 0")


#: A numeric feature by its name, or the difference of two.
Quantity: TypeAlias = str | Difference


@dataclass(frozen=True, slots=True)
class Threshold:
    """``quantity <= value``, compared in double precision."""

    quantity: Quantity
    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ValueError(f"the threshold of {self.quantity!r} must be finite, not {self.value}")


@dataclass(frozen=True, slots=True)
class Interval:
    """``above < quantity <= at_most``, compared in double precision."""

    quantity: Quantity
    above: float
    at_most: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.above) and math.isfinite(self.at_most)):
            raise ValueError(
                f"the interval of {self.quantity!r} must be finite, not from {self.above} to "
                f"{self.at_most}"
            )
        if not self.above < self.at_most:
            raise ValueError(
                f"the interval of {self.quantity!r} must not be empty, as from {self.above} to "
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
class PreviousActionIs:
    """The previous action: that of the row before; false in the first row of a demonstration."""

    action: str


@dataclass(frozen=True, slots=True)
class LastActionIs:
    """``LAT = action``: the last action taken (paper, III-B).

    LAT is the most recent action that differs from the one being decided.  A decision tree reads
    it from a column, where that action is known; a behavior tree is still choosing, so there the
    condition names in `deciding` the action, or PSA group of actions, of the rule it stands in.
    """

    action: str
    deciding: tuple[str, ...] = ()


#: What a state alone tells.
StateCondition: TypeAlias = Threshold | Interval | IsTrue | HasCategory
#: What was done before tells.
HistoryCondition: TypeAlias = PreviousActionIs | LastActionIs
Condition: TypeAlias = StateCondition | HistoryCondition


def features_of(condition: StateCondition) -> tuple[str, ...]:
    """The names of the features that a condition reads: one, or the two of a difference.

    >>> features_of(Threshold(Difference("left", "right"), 0.0)), features_of(IsTrue("docked"))
    (('left', 'right'), ('docked',))
    """
    match condition:
        case (
            Threshold(quantity=Difference() as difference)
            | Interval(quantity=Difference() as difference)
        ):
            return difference.minuend, difference.subtrahend
        case Threshold(quantity=str(name)) | Interval(quantity=str(name)):
            return (name,)
        case IsTrue(feature=name) | HasCategory(feature=name):
            return (name,)
    raise AssertionError(condition)


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
