"""Two thresholds on one quantity as one interval: the same in every state, in fewer conditions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pruned_trees import train
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.behavior_tree.prediction import States, as_it_stands
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.beyond_the_paper.reductions import ALL_REDUCTIONS
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.tree import DecisionTree, Leaf, Split
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import KNOWN, Interval, IsTrue, Literal, Quantity, Threshold
from rebt_ros.logic.factoring import Factored
from rebt_ros.logic.intervals import enclosing_literals, merged, with_intervals
from rebt_ros.paper.rules import leaf_rules

LOW, HIGH, OTHER = (
    some.at_most("distance", 0.1),
    some.at_most("distance", 0.5),
    some.at_most("battery", 0.3),
)
BETWEEN = Literal(Interval("distance", 0.1, 0.5))
DOCKED = Literal(IsTrue("docked"))

#: On, below and above every threshold of the vocabulary, far away, and nowhere.
PLACES = (
    *(
        place
        for value in some.THRESHOLDS
        for place in (math.nextafter(value, -math.inf), value, math.nextafter(value, math.inf))
    ),
    -math.inf,
    math.inf,
    math.nan,
)

literals = some.literals(
    st.one_of(some.thresholds("distance"), some.thresholds(some.DIFFERENCE), some.conditions())
)
#: Like a conjunction that float reduction has left alone, or has not.
lists = st.lists(literals, max_size=6, unique_by=lambda one: one.condition).map(tuple)
#: As they come: intervals are made only once.
without_intervals = lists.map(
    lambda conjunction: tuple(one for one in conjunction if not isinstance(one.condition, Interval))
)
conditions = st.recursive(
    lists.map(Factored),
    lambda inner: st.builds(Factored, lists, st.lists(inner, max_size=3).map(tuple)),
    max_leaves=6,
)


def holds(condition: Factored, state: tuple[float, ...], last: str | None) -> bool:
    return all(some.holds(one, state, last) for one in condition.common) and (
        not condition.alternatives or any(holds(one, state, last) for one in condition.alternatives)
    )


def asked(condition: Factored) -> list[Literal]:
    return [*condition.common, *(one for each in condition.alternatives for one in asked(each))]


@pytest.mark.parametrize("quantity", ["distance", some.DIFFERENCE], ids=str)
@given(data=st.data(), positive=st.booleans())
def test_an_interval_is_what_the_pair_of_thresholds_is_wherever_the_value_lies(
    quantity: Quantity, data: st.DataObject, positive: bool
) -> None:
    interval = data.draw(some.intervals(quantity))
    lower = ~some.at_most(quantity, interval.above)
    upper = some.at_most(quantity, interval.at_most)
    # A difference to 0 is the value itself.
    rows = [(place, 0.0, math.nan, math.nan) for place in PLACES]
    states = States(some.FEATURES, np.array(rows), as_it_stands(ActionHistory()))
    pair = states.satisfy(lower) & states.satisfy(upper)
    literal = Literal(interval, positive)
    assert states.satisfy(literal).tolist() == (pair if positive else ~pair).tolist()
    runtime = TreeRuntime(some.learned(nodes.Condition(literal)))
    ticked = [runtime.tick(row).status is Status.SUCCESS for row in rows]
    assert ticked == states.satisfy(literal).tolist()
    # A missing value makes the condition false, and so its negation true.
    assert ticked[-1] is not positive


@given(conditions, st.lists(some.states, min_size=1, max_size=20), st.sampled_from(some.LABELS))
@example(Factored((~LOW, HIGH)), [(place, 0.0, 0.0, 0.0) for place in PLACES], "go")
def test_the_truth_stays_in_every_state(
    condition: Factored, states: list[tuple[float, ...]], last: str
) -> None:
    reduced = with_intervals(condition)
    for state in states:
        assert holds(reduced, state, last) is holds(condition, state, last)


@given(without_intervals)
def test_no_pair_is_left_and_nothing_else_changes(conjunction: tuple[Literal, ...]) -> None:
    reduced = merged(conjunction)
    assert merged(reduced) == reduced
    rest = [one for one in reduced if one in conjunction]
    assert rest == [one for one in conjunction if one in rest]
    new = [one.condition for one in reduced if one not in conjunction]
    assert all(isinstance(one, Interval) for one in new)
    assert len(conjunction) - len(reduced) == len(new)
    left = [one for one in rest if isinstance(one.condition, Threshold)]
    assert not any(
        lower.condition.quantity == upper.condition.quantity
        and lower.condition.value < upper.condition.value
        for lower in left
        for upper in left
        if upper.positive and not lower.positive
    )


@given(conditions)
def test_conditions_become_fewer_and_none_is_negated(condition: Factored) -> None:
    reduced = asked(with_intervals(condition))
    new = [one for one in reduced if one not in asked(condition)]
    assert len(reduced) <= len(asked(condition)) - len(new)
    assert all(one.positive for one in new)


@pytest.mark.parametrize(
    ("conjunction", "reduced"),
    [
        ((~LOW, HIGH), (BETWEEN,)),
        ((HIGH, ~LOW), (BETWEEN,)),
        ((DOCKED, HIGH, OTHER, ~LOW), (DOCKED, BETWEEN, OTHER)),
        # Both above, both below, on different features: no interval.
        ((~LOW, ~OTHER), (~LOW, ~OTHER)),
        ((~LOW, OTHER), (~LOW, OTHER)),
        ((LOW, HIGH), (LOW, HIGH)),
        # No value lies above the higher and below the lower one.
        ((LOW, ~HIGH), (LOW, ~HIGH)),
        ((LOW, ~LOW), (LOW, ~LOW)),
        # An interval up to the largest number is no way to say that the value is known.
        ((~LOW, some.at_most("distance", KNOWN)), (~LOW, some.at_most("distance", KNOWN))),
        ((), ()),
    ],
)
def test_known_conjunctions(conjunction: tuple[Literal, ...], reduced: tuple[Literal, ...]) -> None:
    assert merged(conjunction) == reduced


def test_each_conjunction_of_a_condition_has_its_own_intervals() -> None:
    # What is asked above and below a Selector does not stand side by side.
    apart = Factored((~LOW,), (Factored((HIGH,)), Factored((DOCKED,))))
    assert with_intervals(apart) == apart
    below = Factored((DOCKED,), (Factored((~LOW, HIGH)), Factored((OTHER,))))
    assert with_intervals(below) == Factored((DOCKED,), (Factored((BETWEEN,)), Factored((OTHER,))))


def test_a_reduced_tree_asks_for_an_interval_unless_told_otherwise() -> None:
    go, turn = some.action("go"), some.action("turn")
    middle = Split(HIGH.condition, Leaf((2, 0)), Leaf((0, 3)))
    tree = DecisionTree((go, turn), Split(LOW.condition, Leaf((0, 4)), middle))
    rules = leaf_rules(tree, lambda leaf: (leaf.most_probable,))
    assert reduced_tree(rules) == nodes.Selector((some.when(BETWEEN, then=go), turn))
    two = reduced_tree(rules, replace(ALL_REDUCTIONS, intervals=False))
    assert two in (
        nodes.Selector((some.when(*pair, then=go), turn)) for pair in ((~LOW, HIGH), (HIGH, ~LOW))
    )


@settings(max_examples=40, deadline=None)
@given(some.tables(min_rows=4), some.vocabularies, st.sampled_from((Root.SELECTOR, Root.PARALLEL)))
def test_intervals_make_a_tree_no_larger(
    table: DemonstrationTable, vocabulary: Vocabulary, root: Root
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=5)
    rules = leaf_rules(trained.tree, lambda leaf: (leaf.most_probable,))
    tree = reduced_tree(rules, root=root)
    plain = reduced_tree(rules, replace(ALL_REDUCTIONS, intervals=False), root)
    assert nodes.size(tree) <= nodes.size(plain)
    for one in nodes.conditions(tree):
        assert one.literal.positive or not isinstance(one.literal.condition, Interval)
    assert not any(isinstance(one.literal.condition, Interval) for one in nodes.conditions(plain))


def thresholds() -> st.SearchStrategy[list[Threshold]]:
    values = st.sampled_from([-1.0, 0.0, 0.5, 2.0, KNOWN])
    return st.lists(st.builds(Threshold, st.sampled_from(["x", "y"]), values), unique=True)


@given(thresholds())
def test_those_that_enclose_are_those_that_are_merged(conditions: list[Threshold]) -> None:
    enclosing = enclosing_literals(conditions)
    for place, lower in enumerate(conditions):
        assert enclosing[2 * place + 1] == 0
        for other, upper in enumerate(conditions):
            together = merged((~Literal(lower), Literal(upper)))
            encloses = bool(enclosing[2 * place] >> (2 * other + 1) & 1)
            assert encloses == (len(together) == 1 and place != other)
