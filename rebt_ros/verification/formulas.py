"""Conditions of a tree joined by AND and OR, in negation normal form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from rebt_ros.logic.conditions import Condition, Literal


@dataclass(frozen=True, slots=True)
class AllOf:
    """Holds where all parts do; without parts, everywhere."""

    parts: tuple[Formula, ...] = ()


@dataclass(frozen=True, slots=True)
class AnyOf:
    """Holds where a part does; without parts, nowhere."""

    parts: tuple[Formula, ...] = ()


Formula: TypeAlias = Literal | AllOf | AnyOf


def negated(formula: Formula) -> Formula:
    """Where the formula does not hold.

    >>> negated(AllOf())
    AnyOf(parts=())
    """
    match formula:
        case Literal():
            return ~formula
        case AllOf(parts=parts):
            return AnyOf(tuple(map(negated, parts)))
        case AnyOf(parts=parts):
            return AllOf(tuple(map(negated, parts)))


def conditions_of(formula: Formula) -> Iterator[Condition]:
    """All its conditions, again where they occur again."""
    if isinstance(formula, Literal):
        yield formula.condition
    else:
        for part in formula.parts:
            yield from conditions_of(part)
