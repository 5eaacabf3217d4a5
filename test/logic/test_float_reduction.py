"""Float reduction removes subsumed thresholds and keeps the truth in every state."""

from __future__ import annotations

import itertools
import math

import pytest
import strategies as some
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rebt_ros.logic.conditions import IsTrue, Literal, Threshold
from rebt_ros.logic.dnf import FALSE, Dnf, conditions_of
from rebt_ros.logic.float_reduction import float_reduction
from rebt_ros.logic.minimize import minimize

X2, X3, X5 = (some.at_most("distance", value) for value in (0.2, 0.3, 0.5))
Y3 = some.at_most("battery", 0.3)
DOCKED = Literal(IsTrue("docked"))
rules = st.one_of(some.threshold_dnfs, some.dnfs(max_size=4))

#: Values of one feature on, below and above every threshold of the vocabulary, and none at all.
PLACES = (
    *(
        place
        for value in some.THRESHOLDS
        for place in (math.nextafter(value, -math.inf), value, math.nextafter(value, math.inf))
    ),
    math.nan,
)
distance_literals = some.literals(some.thresholds("distance"))
difference_literals = some.literals(some.thresholds(some.DIFFERENCE))


def in_all_states(rule: Dnf, vocabulary: Dnf) -> list[bool]:
    """Truth wherever the numeric features can lie, with the other conditions free."""
    others = [one for one in conditions_of(vocabulary) if not isinstance(one, Threshold)]
    numbers = {one for one in conditions_of(vocabulary) if isinstance(one, Threshold)}
    feasible = {
        frozenset(one for one in numbers if some.holds(Literal(one), (distance, battery)))
        for distance in PLACES
        for battery in PLACES
    }
    return [
        some.truth(rule, thresholds | set(itertools.compress(others, values)))
        for thresholds in feasible
        for values in itertools.product((False, True), repeat=len(others))
    ]


@settings(max_examples=50)
@given(rules)
# The same conjunction in two orders: each implies the other, and one of them must stay.
@example(some.dnf([X2, DOCKED], [DOCKED, X2]))
def test_the_truth_stays_in_every_state_also_where_values_are_missing(rule: Dnf) -> None:
    reduced = float_reduction(rule)
    assert in_all_states(reduced, rule) == in_all_states(rule, rule)


@settings(max_examples=100)
@given(rules)
@example(some.dnf([X2, DOCKED], [DOCKED, X2]))
def test_no_rule_loses_all_its_conjunctions(rule: Dnf) -> None:
    assert bool(len(float_reduction(rule))) is bool(len(rule))


@settings(max_examples=100)
@given(rules)
def test_reducing_again_changes_nothing(rule: Dnf) -> None:
    reduced = float_reduction(rule)
    assert float_reduction(reduced) == reduced


@settings(max_examples=100)
@given(rules)
def test_no_literal_of_a_conjunction_is_implied_by_another_and_no_conjunction_either(
    rule: Dnf,
) -> None:
    reduced = float_reduction(rule)
    for one in reduced:
        for literal in one:
            assert not any(some.implies(other, literal) for other in one if other != literal)
        for other in reduced:
            if other != one:
                assert not all(any(some.implies(mine, its) for mine in one) for its in other)


@settings(max_examples=50)
@given(some.threshold_dnfs)
def test_minimized_rules_keep_their_truth_as_well(rule: Dnf) -> None:
    reduced = float_reduction(minimize(rule))
    assert in_all_states(reduced, rule) == in_all_states(rule, rule)


@pytest.mark.parametrize(
    ("rule", "reduced"),
    [
        (some.dnf([X3, X5]), some.dnf([X3])),
        (some.dnf([X5, X3]), some.dnf([X3])),
        (some.dnf([~X3, ~X5]), some.dnf([~X5])),
        (some.dnf([X2, X3, X5, DOCKED]), some.dnf([X2, DOCKED])),
        (some.dnf([~X2, X5, ~X3]), some.dnf([X5, ~X3])),
        (some.dnf([X3], [X5]), some.dnf([X5])),
        (some.dnf([~X3], [~X5]), some.dnf([~X3])),
        (some.dnf([X3, DOCKED], [X5]), some.dnf([X5])),
        (some.dnf([X3, X5], [X3, DOCKED]), some.dnf([X3])),
        (some.dnf([X3, DOCKED], [DOCKED, X3]), some.dnf([X3, DOCKED])),
        (some.dnf([X3, DOCKED], [X5, ~DOCKED]), some.dnf([X3, DOCKED], [X5, ~DOCKED])),
        (some.dnf([X3, Y3]), some.dnf([X3, Y3])),
        (some.dnf([X3, ~X2]), some.dnf([X3, ~X2])),
        (some.dnf([X3], []), some.TRUE),
        (some.TRUE, some.TRUE),
        (FALSE, FALSE),
    ],
)
def test_known_rules(rule: Dnf, reduced: Dnf) -> None:
    assert float_reduction(rule) == reduced


@given(some.literals())
def test_a_literal_implies_itself_and_not_its_negation(literal: Literal) -> None:
    assert some.implies(literal, literal)
    assert not some.implies(literal, ~literal)


@given(distance_literals, distance_literals, distance_literals)
def test_implication_is_transitive(one: Literal, two: Literal, three: Literal) -> None:
    assert not (some.implies(one, two) and some.implies(two, three)) or some.implies(one, three)


@given(distance_literals, distance_literals)
def test_two_literals_that_imply_each_other_are_the_same(one: Literal, two: Literal) -> None:
    assert (some.implies(one, two) and some.implies(two, one)) is (one == two)


@settings(max_examples=300)
@given(some.literals(), some.literals(some.thresholds()))
def test_an_implication_holds_in_every_state(one: Literal, two: Literal) -> None:
    if some.implies(one, two):
        for place in PLACES:
            for state in ((place, place, 1.0, 1.0), (place, 0.0, 1.0, 1.0)):
                before = ("go", "go")
                assert not some.holds(one, state, *before) or some.holds(two, state, *before)


@given(
    st.one_of(st.tuples(*[literals] * 2) for literals in (distance_literals, difference_literals))
)
def test_every_implication_between_thresholds_of_one_quantity_is_found(
    pair: tuple[Literal, Literal],
) -> None:
    one, two = pair
    # A difference to 0 is the value itself.
    everywhere = all(
        not some.holds(one, (place, 0, 0, 0)) or some.holds(two, (place, 0, 0, 0))
        for place in PLACES
    )
    assert some.implies(one, two) is everywhere


@given(distance_literals, st.one_of(some.literals(some.thresholds("battery")), difference_literals))
def test_thresholds_of_different_quantities_imply_nothing(one: Literal, two: Literal) -> None:
    assert not some.implies(one, two)
    assert not some.implies(two, one)


def test_a_missing_value_lies_above_every_threshold() -> None:
    # So ~(x <= 0.3) implies ~(x <= 0.2) where x is missing, as both hold.
    missing = (math.nan, 0.0, 0.0, 0.0)
    assert some.implies(~X3, ~X2)
    assert some.holds(~X3, missing)
    assert some.holds(~X2, missing)
