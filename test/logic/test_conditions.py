"""Conditions, literals and conjunctions as values."""

from __future__ import annotations

import math
import re

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import (
    KNOWN,
    Combination,
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
    WeightedSum,
    combination,
    deciding,
    features_of,
)
from rebt_ros.logic.dnf import FALSE, Conjunction, conditions_of

NEAR = some.at_most("distance", 0.3)
DOCKED = Literal(IsTrue("docked"))
CUP = Literal(HasCategory("kind", "cup"))
AFTER_GO = Literal(LastActionIs("go"))


@given(some.literals())
def test_the_negation_of_the_negation_is_the_literal(literal: Literal) -> None:
    assert ~~literal == literal
    assert ~literal != literal
    assert (~literal).condition == literal.condition


labels = st.none() | st.sampled_from(some.LABELS)


@given(some.literals(), some.states, labels, labels)
def test_of_a_literal_and_its_negation_exactly_one_holds(
    literal: Literal, state: tuple[float, ...], last: str | None, previous: str | None
) -> None:
    # A missing value makes every condition false, and so its negation true.
    before = (last, previous)
    assert some.holds(literal, state, *before) is not some.holds(~literal, state, *before)


def test_a_difference_is_of_two_features() -> None:
    with pytest.raises(ValueError, match="the difference of 'distance' and itself is always 0"):
        Difference("distance", "distance")
    assert Difference("distance", "battery") != Difference("battery", "distance")


@pytest.mark.parametrize(
    ("terms", "why"),
    [
        ((("x", 2.0),), "at least two different features, not x"),
        ((("x", 2.0), ("x", 1.0)), "at least two different features, not x, x"),
        ((("x", 2.0), ("y", 0.0)), "the weight of 'y' must be finite and not 0, not 0.0"),
        ((("x", math.inf), ("y", 1.0)), "the weight of 'x' must be finite and not 0, not inf"),
        ((("x", 1.0), ("y", -1.0)), "'x' less 'y' is a difference, not a weighted sum"),
    ],
)
def test_a_weighted_sum_that_is_none_is_refused(
    terms: tuple[tuple[str, float], ...], why: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(why)):
        WeightedSum(terms)


@pytest.mark.parametrize("one", [some.DIFFERENCE, some.SUM])
def test_a_combination_is_made_of_its_terms(one: Combination) -> None:
    assert combination(one.terms) == one


@pytest.mark.parametrize(
    ("condition", "features"),
    [
        (Threshold("distance", 0.3), ("distance",)),
        (Interval("distance", 0.1, 0.3), ("distance",)),
        (Threshold(some.DIFFERENCE, 0.3), ("distance", "battery")),
        (Threshold(some.SUM, 0.3), ("distance", "battery")),
        (Interval(some.DIFFERENCE, 0.1, 0.3), ("distance", "battery")),
        (IsTrue("docked"), ("docked",)),
        (HasCategory("kind", "cup"), ("kind",)),
    ],
)
def test_a_condition_reads_these_features(
    condition: Threshold | Interval | IsTrue | HasCategory, features: tuple[str, ...]
) -> None:
    assert features_of(condition) == features
    tree = nodes.Sequence(
        (*map(nodes.Condition, (Literal(condition), Literal(PreviousActionIs("go")))),)
    )
    assert nodes.features(tree) == set(features)


def test_an_action_before_is_not_lat() -> None:
    assert PreviousActionIs("go") != LastActionIs("go")
    before = Literal(PreviousActionIs("go"))
    assert deciding(before, ("turn",)) == before


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_threshold_is_finite(value: float) -> None:
    with pytest.raises(ValueError, match="'distance' must be finite"):
        Threshold("distance", value)


@pytest.mark.parametrize(
    ("above", "at_most"),
    [(math.nan, 0.5), (0.3, math.nan), (-math.inf, 0.5), (0.3, math.inf)],
)
def test_an_interval_is_finite(above: float, at_most: float) -> None:
    with pytest.raises(ValueError, match="'distance' must be finite"):
        Interval("distance", above, at_most)


@pytest.mark.parametrize(("above", "at_most"), [(0.5, 0.3), (0.3, 0.3), (-0.0, 0.0)])
def test_an_interval_is_not_empty(above: float, at_most: float) -> None:
    with pytest.raises(ValueError, match="'distance' must not be empty"):
        Interval("distance", above, at_most)


def test_the_threshold_above_all_values_is_the_largest_double() -> None:
    assert math.nextafter(KNOWN, math.inf) == math.inf
    assert Threshold("distance", KNOWN).value == KNOWN


@given(some.conjunctions(max_size=6))
def test_a_conjunction_refuses_a_condition_that_it_already_has(conjunction: Conjunction) -> None:
    for literal in conjunction:
        for again in (literal, ~literal):
            with pytest.raises(ValueError, match="may name a condition only once"):
                Conjunction((*conjunction.literals, again))


@given(some.conjunctions(max_size=6), st.sets(some.literals()))
def test_without_removes_the_given_literals_and_keeps_the_order(
    conjunction: Conjunction, unwanted: set[Literal]
) -> None:
    rest = conjunction.without(frozenset(unwanted))
    assert rest.literals == tuple(one for one in conjunction if one not in unwanted)


@given(some.literals(), st.lists(st.sampled_from(some.LABELS)).map(tuple))
def test_only_literals_about_lat_learn_what_is_decided(
    literal: Literal, actions: tuple[str, ...]
) -> None:
    meant = deciding(literal, actions)
    if isinstance(literal.condition, LastActionIs):
        asked = LastActionIs(literal.condition.action, actions)
        assert meant == Literal(asked, literal.positive)
    else:
        assert meant == literal


def test_lat_conditions_of_different_rules_are_different_conditions() -> None:
    assert LastActionIs("go", ("turn",)) != LastActionIs("go", ("wait",))
    assert LastActionIs("go", ("turn",)) != LastActionIs("go")
    both = some.conjunction(deciding(AFTER_GO, ("turn",)), deciding(AFTER_GO, ("wait",)))
    assert len(both) == 2


def test_conditions_are_listed_once_in_the_order_in_which_they_occur() -> None:
    rule = some.dnf([CUP, ~NEAR], [NEAR, DOCKED], [~CUP])
    assert conditions_of(rule) == (CUP.condition, NEAR.condition, DOCKED.condition)
    assert conditions_of(some.TRUE) == conditions_of(FALSE) == ()
