"""Conditions and literals, the atoms of every rule.

condition
    An atomic test of the state or of what was done before: `Threshold`, `Interval`, `IsTrue`,
    `HasCategory`, `PreviousActionIs` or `LastActionIs`.
quantity
    What a `Threshold` or an `Interval` compares: a numeric feature, or a `Combination` of several,
    which is a `Difference` of two or a `WeightedSum`.
literal
    A condition or its negation.

A missing value makes every condition on it false, so ``~(x <= 3)`` holds if x is missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

#: Threshold that every known value is below.
KNOWN = 1.7976931348623157e308


@dataclass(frozen=True, slots=True)
class Difference:
    """``minuend - subtrahend``, computed in double precision; missing if either is missing."""

    minuend: str
    subtrahend: str

    def __post_init__(self) -> None:
        if self.minuend == self.subtrahend:
            raise ValueError(f"the difference of {self.minuend!r} and itself is always 0")

    @property
    def terms(self) -> tuple[tuple[str, float], ...]:
        """Its features with their weights."""
        return (self.minuend, 1.0), (self.subtrahend, -1.0)


@dataclass(frozen=True, slots=True)
class WeightedSum:
    """``angle + 0.4 × spin``, computed in double precision from left to right.

    It is missing if any of its features is.
    """

    terms: tuple[tuple[str, float], ...]
    """Features with their weights: at least two features, and no weight of 0."""

    def __post_init__(self) -> None:
        names = tuple(name for name, _ in self.terms)
        if len(names) < 2 or len(set(names)) < len(names):
            raise ValueError(
                f"a weighted sum needs at least two different features, not {', '.join(names)}"
            )
        for name, weight in self.terms:
            if not math.isfinite(weight) or not weight:
                raise ValueError(f"the weight of {name!r} must be finite and not 0, not {weight}")
        if tuple(weight for _, weight in self.terms) == (1.0, -1.0):
            raise ValueError(f"{names[0]!r} less {names[1]!r} is a difference, not a weighted sum")


#: What is computed from several numeric features.
Combination: TypeAlias = Difference | WeightedSum


def combination(terms: tuple[tuple[str, float], ...]) -> Combination:
    """What is computed from features with these weights.

    >>> combination((("left", 1.0), ("right", -1.0)))
    Difference(minuend='left', subtrahend='right')

    Raises:
        ValueError: They make no combination.
    """
    match terms:
        case ((minuend, 1.0), (subtrahend, -1.0)):
            return Difference(minuend, subtrahend)
    return WeightedSum(terms)


#: A numeric feature by its name, or what is computed from several.
Quantity: TypeAlias = str | Combination


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
    """The previous action, that of the row before; false in the first row of a demonstration."""

    action: str


@dataclass(frozen=True, slots=True)
class LastActionIs:
    """``LAT = action``: the last action taken (paper, III-B).

    LAT is the most recent action that differs from the one being decided.  A decision tree reads
    it from a column, for which that action is known.  A behavior tree is still choosing, so its
    conditions name in `deciding` the action, or PSA group of actions, of their rule.
    """

    action: str
    deciding: tuple[str, ...] = ()


#: Conditions that the state alone decides.
StateCondition: TypeAlias = Threshold | Interval | IsTrue | HasCategory
#: Conditions that earlier actions decide.
HistoryCondition: TypeAlias = PreviousActionIs | LastActionIs
Condition: TypeAlias = StateCondition | HistoryCondition


def features_of(condition: StateCondition) -> tuple[str, ...]:
    """The names of the features that a condition reads: one, or those of a combination.

    >>> features_of(Threshold(Difference("left", "right"), 0.0)), features_of(IsTrue("docked"))
    (('left', 'right'), ('docked',))
    """
    match condition:
        case Threshold(quantity=quantity) | Interval(quantity=quantity):
            return features_in(quantity)
        case IsTrue(feature=name) | HasCategory(feature=name):
            return (name,)


def features_in(quantity: Quantity) -> tuple[str, ...]:
    """The names of the features that a quantity is computed from."""
    return (quantity,) if isinstance(quantity, str) else tuple(name for name, _ in quantity.terms)


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
    """The literal as a rule that triggers `actions` means it; only LAT literals change."""
    if isinstance(literal.condition, LastActionIs):
        return replace(literal, condition=replace(literal.condition, deciding=actions))
    return literal
