"""The condition of a rule as it is written: names that no tree has been asked about yet.

`grammar` makes these values from text, and `resolving` makes conditions of a tree of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias


class Sign(Enum):
    """How two sides are compared."""

    BELOW = "<"
    AT_MOST = "<="
    ABOVE = ">"
    AT_LEAST = ">="
    EQUAL = "="
    DIFFERENT = "!="


@dataclass(frozen=True, slots=True)
class Word:
    """A name: of a feature, a category or an action."""

    text: str
    at: int
    """Where it begins, in characters of the condition from 0; so for all values here."""


@dataclass(frozen=True, slots=True)
class Number:
    """A number, and how it was written."""

    value: float
    text: str
    at: int


@dataclass(frozen=True, slots=True)
class Term:
    """``weight * feature``."""

    weight: float
    feature: Word

    @property
    def at(self) -> int:
        """Where its feature begins."""
        return self.feature.at


@dataclass(frozen=True, slots=True)
class Sum:
    """``front + 0.5 * left - right``."""

    terms: tuple[Term, ...]
    at: int


Side: TypeAlias = Word | Number | Sum


@dataclass(frozen=True, slots=True)
class Comparison:
    """``left sign right``."""

    left: Side
    sign: Sign
    right: Side


@dataclass(frozen=True, slots=True)
class Truth:
    """A binary feature is 1, or 0."""

    feature: Word
    value: bool = True


@dataclass(frozen=True, slots=True)
class Presence:
    """What is measured is known, or missing."""

    measured: Word | Sum
    known: bool


@dataclass(frozen=True, slots=True)
class Doing:
    """The previous action."""

    action: Word


@dataclass(frozen=True, slots=True)
class LastAction:
    """The last action taken (LAT) is this one, or is not."""

    action: Word
    equal: bool


@dataclass(frozen=True, slots=True)
class Not:
    """Where the inner one does not hold."""

    inner: Expression


@dataclass(frozen=True, slots=True)
class And:
    """Where all parts hold; there are two or more."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Where a part holds; there are two or more."""

    parts: tuple[Expression, ...]


Expression: TypeAlias = Comparison | Truth | Presence | Doing | LastAction | Not | And | Or
