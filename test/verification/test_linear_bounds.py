"""Tests of numbers within linear bounds."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.verification.linear_bounds import Bound, numbers_within

INFINITE = (-math.inf, math.inf)
numbers = st.floats(-10, 10).map(lambda value: round(value, 2))
weights = st.sampled_from((-2.5, -1.0, -0.3, 0.1, 1.0, 7.0))


@st.composite
def boxes(draw: st.DrawFn) -> tuple[list[tuple[float, float]], list[Bound], list[float]]:
    """Ranges and bounds around some numbers, which are given, too."""
    inside = draw(st.lists(numbers, min_size=1, max_size=4))
    room = st.sampled_from((0.01, 0.5, 3.0, math.inf))
    ranges = [(one - draw(room), one + draw(room)) for one in inside]
    bounds = []
    for _ in range(draw(st.integers(1, 3))):
        its = tuple(draw(weights) for _ in inside)
        total = sum(weight * one for weight, one in zip(its, inside, strict=True))
        bounds.append(Bound(its, total - draw(room), total + draw(room)))
    return ranges, bounds, inside


@given(boxes())
def test_numbers_are_found_where_there_are_some(box) -> None:
    ranges, bounds, inside = box
    found = numbers_within(ranges, [1.0] * len(inside), bounds)
    assert found is not None
    for value, (low, high) in zip(found, ranges, strict=True):
        assert low < value <= high
    for bound in bounds:
        total = sum(weight * value for weight, value in zip(bound.weights, found, strict=True))
        assert bound.above < total <= bound.at_most


def test_there_are_none_where_a_sum_cannot_be_so_large() -> None:
    bound = Bound((1.0, 2.0), 3.1, math.inf)
    assert numbers_within([(0.0, 1.0), (0.0, 1.0)], [1.0, 1.0], [bound]) is None
    assert numbers_within([(0.0, 1.0), (0.0, 1.1)], [1.0, 1.0], [bound]) is not None
    assert numbers_within([INFINITE, INFINITE], [1.0, 1.0], [bound]) is not None


def test_a_number_that_may_not_change_stays() -> None:
    fixed = (math.nextafter(0.25, 0), 0.25)
    found = numbers_within([fixed, INFINITE], [1.0, 1.0], [Bound((1.0, 1.0), 0.9, 1.0)])
    assert found is not None
    assert found[0] == 0.25
    assert 0.65 < found[1] <= 0.75


def test_without_any_bound_every_number_will_do() -> None:
    assert numbers_within([INFINITE, (1.0, 2.0)], [1.0, 1.0], []) is not None
