"""Pulling out what all conjunctions have in common keeps the truth table."""

from __future__ import annotations

import pytest
import strategies as some
from hypothesis import given, settings

from rebt_ros.logic.conditions import Condition, IsTrue, Literal
from rebt_ros.logic.dnf import Dnf
from rebt_ros.logic.factoring import Factored, pull_out_common, unfactored
from rebt_ros.logic.inverses import build_inv_set

A, B, C, D = (Literal(IsTrue(name)) for name in "abcd")

rules = some.dnfs(some.few_conditions, min_size=1, max_size=6)


def value(factored: Factored, true: frozenset[Condition]) -> bool:
    common = all((one.condition in true) is one.positive for one in factored.common)
    alternatives = factored.alternatives
    return common and (not alternatives or any(value(one, true) for one in alternatives))


@settings(max_examples=150)
@given(rules)
def test_the_truth_table_stays(rule: Dnf) -> None:
    for form in (pull_out_common(rule), unfactored(rule)):
        for true in some.assignments(rule):
            assert value(form, true) is some.truth(rule, true)


@given(rules)
def test_the_common_literals_are_exactly_those_of_all_conjunctions(rule: Dnf) -> None:
    factored = pull_out_common(rule)
    assert set(factored.common) == set.intersection(*(set(one) for one in rule))
    assert len(set(factored.common)) == len(factored.common)


@given(rules)
def test_no_literal_is_left_in_all_alternatives(rule: Dnf) -> None:
    alternatives = pull_out_common(rule).alternatives
    if alternatives:
        assert not set.intersection(*(set(one.common) for one in alternatives))
        assert len(alternatives) == len(rule)


@given(rules)
def test_the_order_of_literals_and_conjunctions_stays(rule: Dnf) -> None:
    factored = pull_out_common(rule)
    first = rule.conjunctions[0].literals
    assert factored.common == tuple(one for one in first if one in factored.common)
    for conjunction, alternative in zip(rule, factored.alternatives, strict=False):
        left = tuple(one for one in conjunction if one not in factored.common)
        assert alternative == Factored(left)


@pytest.mark.parametrize(
    ("rule", "factored"),
    [
        (some.TRUE, Factored(())),
        (some.dnf([A, B]), Factored((A, B))),
        (some.dnf([A, B], [A, C]), Factored((A,), (Factored((B,)), Factored((C,))))),
        (some.dnf([A, B], [C, D]), Factored((), (Factored((A, B)), Factored((C, D))))),
        # A literal and its negation are nothing in common.
        (some.dnf([A, B], [~A, B, C]), Factored((B,), (Factored((A,)), Factored((~A, C))))),
        # One level only, as in the paper: B stays in two of the alternatives.
        (
            some.dnf([A, B, C], [A, B, D], [A, ~C, ~D]),
            Factored((A,), (Factored((B, C)), Factored((B, D)), Factored((~C, ~D)))),
        ),
    ],
)
def test_known_rules(rule: Dnf, factored: Factored) -> None:
    assert pull_out_common(rule) == factored


def test_the_baseline_pulls_nothing_out() -> None:
    assert unfactored(some.dnf([A, B], [A, C])) == Factored(
        (), (Factored((A, B)), Factored((A, C)))
    )
    assert unfactored(some.dnf([A, B])) == Factored((A, B))


def test_inverses_are_the_negative_literals_whose_twins_occur() -> None:
    assert build_inv_set([some.dnf([A, ~B]), some.dnf([B, ~C], [~A])]) == {~A, ~B}
    assert build_inv_set([some.dnf([A, B], [~C])]) == frozenset()
    assert build_inv_set([]) == frozenset()


@given(some.dnfs(some.few_conditions))
def test_inverses_are_negative_and_occur_in_both_signs(rule: Dnf) -> None:
    occurring = {literal for each in rule for literal in each}
    inverse = build_inv_set([rule])
    for literal in occurring:
        wanted = not literal.positive and ~literal in occurring
        assert (literal in inverse) is wanted
    assert inverse <= occurring
