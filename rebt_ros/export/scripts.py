"""Conditions in the scripting language of BehaviorTree.CPP.

A missing number is NaN.  BehaviorTree.CPP 4 takes ``x <= y`` for the opposite of ``x > y``, so that
both hold for NaN, where IEEE 754 says that neither does.  What is written here means the same in
both: a condition on a missing value is false, and its negation true.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import reduce

from rebt_ros.export.blackboard import Variable
from rebt_ros.logic.conditions import (
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    Quantity,
    StateCondition,
    Threshold,
    WeightedSum,
)

#: What subnormal numbers are scaled by, which is exact.
_SCALE = 2.0**100


def number(value: float) -> str:
    """A finite number with every bit.

    The engine cannot read subnormal numbers, and so computes them.

    >>> number(0.1), number(5e-324)
    ('0.1', '(6.26302612502804e-294 * 7.888609052210118e-31)')
    """
    if value and abs(value) < sys.float_info.min:
        return f"({value * _SCALE!r} * {1 / _SCALE!r})"
    return repr(value)


def text(value: str) -> str:
    """A text that `blackboard.texts` has made, in quotes."""
    return f'"{value}"' if "'" in value else f"'{value}'"


def test(condition: StateCondition, positive: bool, variables: Mapping[str, Variable]) -> str:
    """What is true where the condition holds or, if `positive` is false, where it does not.

    Args:
        condition: On the state alone.
        positive: Whether it is to hold.
        variables: By the names of their features.
    """
    match condition:
        case Threshold(quantity=quantity, value=value):
            read, limit = _read(quantity, variables), number(value)
            if positive:
                return f"({read} <= {limit}) && !({read} > {limit})"
            return f"({read} > {limit}) || !({read} <= {limit})"
        case Interval(quantity=quantity, above=above, at_most=at_most):
            read, low, high = _read(quantity, variables), number(above), number(at_most)
            inside = f"({read} > {low}) && ({read} <= {high}) && !({read} > {high})"
            return inside if positive else f"!({inside})"
        case IsTrue(feature=name):
            return f"{variables[name].name} {'==' if positive else '!='} 1"
        case HasCategory(feature=name, category=category):
            its = text(variables[name].categories[category])
            return f"{variables[name].name} {'==' if positive else '!='} {its}"


def _read(quantity: Quantity, variables: Mapping[str, Variable]) -> str:
    match quantity:
        case Difference(minuend=minuend, subtrahend=subtrahend):
            return f"({variables[minuend].name} - {variables[subtrahend].name})"
        case WeightedSum(terms=terms):
            products = (f"({number(weight)} * {variables[name].name})" for name, weight in terms)
            return reduce(lambda total, product: f"({total} + {product})", products)
        case str():
            return variables[quantity].name
    raise AssertionError(quantity)
