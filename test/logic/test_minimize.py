"""Minimization keeps the truth table and makes rules no larger."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from random import Random

import pytest
import strategies as some
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rebt_ros.logic.conditions import IsTrue, Literal
from rebt_ros.logic.dnf import FALSE, Conjunction, Dnf, conditions_of
from rebt_ros.logic.minimize import minimize

A, B, C = (Literal(IsTrue(name)) for name in "abc")

rules = some.dnfs(some.few_conditions, max_size=8)

#: Has two equally short forms; espresso finds the one or the other, by turns, unless prevented.
EITHER_WAY = some.dnf([A, B], [~A, ~B], [A, C])


def table_of(rule: Dnf) -> list[bool]:
    return [some.truth(rule, true) for true in some.assignments(rule)]


def literals_in(rule: Dnf) -> int:
    return sum(map(len, rule))


@settings(max_examples=150)
@given(rules)
def test_the_truth_table_stays(rule: Dnf) -> None:
    minimized = minimize(rule)
    for true in some.assignments(rule):
        assert some.truth(minimized, true) is some.truth(rule, true)


@settings(max_examples=150)
@given(rules)
def test_no_rule_grows(rule: Dnf) -> None:
    minimized = minimize(rule)
    assert len(minimized) <= len(rule)
    assert set(conditions_of(minimized)) <= set(conditions_of(rule))


@settings(max_examples=150)
@given(rules, rules)
def test_the_truth_table_stays_where_it_is_cared_about(rule: Dnf, dont_care: Dnf) -> None:
    minimized = minimize(rule, dont_care)
    for true in some.assignments(rule, dont_care):
        if not some.truth(dont_care, true):
            assert some.truth(minimized, true) is some.truth(rule, true)


@settings(max_examples=150)
@given(rules)
def test_no_conjunction_can_be_left_out_and_no_literal_either(rule: Dnf) -> None:
    """Espresso's result is irredundant and consists of prime implicants."""
    minimized = minimize(rule)
    wanted = table_of(rule)
    for one in minimized:
        rest = Dnf(tuple(other for other in minimized if other != one))
        assert [some.truth(rest, true) for true in some.assignments(rule)] != wanted
        for literal in one:
            wider = Dnf((*rest.conjunctions, one.without(frozenset({literal}))))
            assert [some.truth(wider, true) for true in some.assignments(rule)] != wanted


# Espresso is a heuristic: no law says so, but it holds for all that was tried.
@settings(max_examples=100, derandomize=True)
@given(rules)
def test_minimizing_again_leaves_no_fewer_conjunctions(rule: Dnf) -> None:
    once = minimize(rule)
    assert len(minimize(once)) == len(once)


@settings(max_examples=100)
@given(rules, st.randoms(use_true_random=False))
def test_the_order_of_the_conjunctions_does_not_change_the_truth_table(
    rule: Dnf, random: Random
) -> None:
    shuffled = list(rule)
    random.shuffle(shuffled)
    reordered = minimize(Dnf(tuple(shuffled)))
    assert table_of(rule) == [some.truth(reordered, true) for true in some.assignments(rule)]


@settings(max_examples=100)
@given(rules, rules, rules)
@example(EITHER_WAY, FALSE, EITHER_WAY)
def test_what_was_minimized_before_does_not_matter(rule: Dnf, dont_care: Dnf, other: Dnf) -> None:
    before = minimize(rule, dont_care)
    minimize(other)
    assert minimize(rule, dont_care) == before


@settings(max_examples=100)
@given(rules)
def test_saying_a_conjunction_twice_changes_nothing(rule: Dnf) -> None:
    assert minimize(Dnf(rule.conjunctions * 2)) == minimize(rule)


@settings(max_examples=100)
@given(rules)
def test_literals_stand_in_the_order_in_which_their_conditions_first_occur(rule: Dnf) -> None:
    order = conditions_of(rule)
    for one in minimize(rule):
        places = [order.index(literal.condition) for literal in one]
        assert places == sorted(places)


@pytest.mark.parametrize(
    ("rule", "minimized"),
    [
        (FALSE, FALSE),
        (some.TRUE, some.TRUE),
        (some.dnf([A], []), some.TRUE),
        (some.dnf([A], [~A]), some.TRUE),
        (some.dnf([A, B], [A, ~B], [~A, B], [~A, ~B]), some.TRUE),
        (some.dnf([A]), some.dnf([A])),
        (some.dnf([A, B], [A, ~B]), some.dnf([A])),
        (some.dnf([A, B], [A]), some.dnf([A])),
        (some.dnf([A, B], [~A, C], [B, C]), some.dnf([A, B], [~A, C])),
        (some.dnf([A], [~A, B]), some.dnf([A], [B])),
        (some.dnf([A, ~B], [~A, B]), some.dnf([A, ~B], [~A, B])),
    ],
    ids=[
        "FALSE",
        "some.TRUE",
        "one conjunction is some.TRUE",
        "excluded middle",
        "all minterms",
        "single literal",
        "merge",
        "absorption",
        "consensus",
        "shorter second",
        "exclusive or",
    ],
)
def test_known_rules(rule: Dnf, minimized: Dnf) -> None:
    assert {frozenset(one) for one in minimize(rule)} == {frozenset(one) for one in minimized}


@pytest.mark.parametrize(
    ("rule", "dont_care", "minimized"),
    [
        (some.dnf([A, B]), some.dnf([A, ~B]), some.dnf([A])),
        (some.dnf([A]), some.dnf([~A]), some.TRUE),
        (some.dnf([A, B]), some.dnf([C]), some.dnf([A, B])),
        (FALSE, some.dnf([A]), FALSE),
        (some.TRUE, some.dnf([A]), some.TRUE),
    ],
)
def test_known_rules_with_states_that_do_not_matter(
    rule: Dnf, dont_care: Dnf, minimized: Dnf
) -> None:
    assert {frozenset(one) for one in minimize(rule, dont_care)} == {
        frozenset(one) for one in minimized
    }


@settings(max_examples=50)
@given(rules)
def test_where_nothing_matters_the_rule_is_constant(rule: Dnf) -> None:
    assert minimize(rule, some.TRUE) in (some.TRUE, FALSE)


def test_a_rule_over_many_conditions_is_minimized() -> None:
    letters = [Literal(IsTrue(f"feature {number}")) for number in range(40)]
    pairs = tuple(Conjunction((one, other)) for one, other in itertools.pairwise(letters))
    splits = tuple(Conjunction((one, ~other)) for one, other in itertools.pairwise(letters))
    minimized = minimize(Dnf(pairs + splits))
    assert {frozenset(one) for one in minimized} == {frozenset({one}) for one in letters[:-1]}


def test_the_result_is_the_same_in_every_process() -> None:
    program = (
        "import random, sys\n"
        "from rebt_ros.logic.conditions import IsTrue, Literal\n"
        "from rebt_ros.logic.dnf import Conjunction, Dnf\n"
        "from rebt_ros.logic.minimize import minimize\n"
        "names = [Literal(IsTrue(name)) for name in 'abcdef']\n"
        "def rule(seed):\n"
        "    source = random.Random(seed)\n"
        "    drawn = [source.sample(names, source.randint(1, 4)) for _ in range(8)]\n"
        "    signed = [[one if source.random() < 0.5 else ~one for one in c] for c in drawn]\n"
        "    return Dnf(tuple(Conjunction(tuple(c)) for c in signed))\n"
        "order = list(range(1000))\n"
        "random.Random(int(sys.argv[1])).shuffle(order)\n"
        "minimized = {seed: minimize(rule(seed)) for seed in order}\n"
        "print([minimized[seed] for seed in range(1000)])\n"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", program, seed],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for seed in ("0", "1", "2")
    }
    assert len(outputs) == 1
    assert outputs.pop().count("Dnf(") == 1000
