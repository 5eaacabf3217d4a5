"""Which conditions no shown row needs, and what a tree does without them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st
from pruned_trees import train

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import States, choose, history_columns
from rebt_ros.beyond_the_paper import needless_conditions
from rebt_ros.beyond_the_paper.needless_conditions import without_needless_conditions
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning import evaluation
from rebt_ros.logic.conditions import Condition, Interval, IsTrue, Literal
from rebt_ros.paper.rules import leaf_rules

GO, GRASP, TURN, WAIT = some.ACTIONS
DOCKED = Literal(IsTrue("docked"))
CHARGED = ~some.at_most("battery", 0.95)
LEFT, RIGHT = ~some.at_most("bearing", 0.25), some.at_most("bearing", -0.25)
FEATURES = (
    Feature("docked", FeatureKind.BINARY),
    Feature("battery", FeatureKind.NUMERIC),
    Feature("bearing", FeatureKind.NUMERIC),
)


def rows(*shown: tuple[float, float, float, nodes.Action]) -> DemonstrationTable:
    """Of docked, battery and bearing, and what was done there."""
    states = [row[:3] for row in shown]
    chosen = [some.LABELS.index(row[3].label) for row in shown]
    return some.table(states, chosen, features=FEATURES)


#: The robot was never shown docked unless its target was to the left.
SHOWN = rows(
    (1, 0.5, 1.0, WAIT),
    (1, 0.96, 1.0, TURN),
    (0, 0.5, 1.0, TURN),
    (0, 0.5, 0.0, GO),
    (0, 0.9, -1.0, GRASP),
)


def test_a_condition_that_only_came_first_is_left_out() -> None:
    tree = nodes.Selector(
        (
            some.when(LEFT, DOCKED, ~CHARGED, then=WAIT),
            some.when(LEFT, then=TURN),
            some.when(RIGHT, then=GRASP),
            GO,
        )
    )
    assert without_needless_conditions(tree, SHOWN) == nodes.Selector(
        (some.when(DOCKED, ~CHARGED, then=WAIT), *tree.children[1:])
    )


def test_of_conditions_either_of_which_would_do_a_comparison_goes() -> None:
    tree = nodes.Selector((some.when(DOCKED, some.at_most("battery", 0.6), then=WAIT), GO))
    shown = rows((1, 0.5, 0.0, WAIT), (0, 0.9, 0.0, GO))
    rule = some.when(DOCKED, then=WAIT)
    assert without_needless_conditions(tree, shown) == nodes.Selector((rule, GO))


def test_an_alternative_that_another_one_covers_is_left_out() -> None:
    either = nodes.Selector(
        (nodes.Condition(DOCKED), some_of(LEFT, CHARGED), nodes.Condition(RIGHT))
    )
    tree = nodes.Selector((nodes.Sequence((either, TURN)), GO))
    shown = rows((1, 0.99, 1.0, TURN), (0, 0.99, 1.0, TURN), (0, 0.5, 0.0, GO), (0, 0.99, 0.0, GO))
    assert without_needless_conditions(tree, shown) == nodes.Selector(
        (some.when(LEFT, then=TURN), GO)
    )


def some_of(*literals: Literal) -> nodes.Sequence:
    return nodes.Sequence(tuple(map(nodes.Condition, literals)))


def test_an_interval_keeps_the_limit_that_is_needed() -> None:
    ahead = Literal(Interval("bearing", -0.25, 0.25))
    tree = nodes.Selector((some.when(ahead, then=GO), TURN))
    shown = rows((0, 0.5, 0.0, GO), (0, 0.5, 1.0, TURN))
    rule = some.when(some.at_most("bearing", 0.25), then=GO)
    assert without_needless_conditions(tree, shown) == nodes.Selector((rule, TURN))
    both = rows((0, 0.5, 0.0, GO), (0, 0.5, 1.0, TURN), (0, 0.5, -1.0, TURN))
    assert without_needless_conditions(tree, both) == tree


def test_a_rule_that_no_row_shows_stays_as_it_is() -> None:
    tree = nodes.Selector((some.when(DOCKED, CHARGED, then=WAIT), some.when(LEFT, then=TURN), GO))
    shown = rows((0, 0.5, 1.0, TURN), (0, 0.5, 0.0, GO))
    assert without_needless_conditions(tree, shown) == tree


def test_rows_that_do_not_count_need_nothing() -> None:
    tree = nodes.Selector((some.when(DOCKED, LEFT, then=WAIT), GO))
    shown = rows((1, 0.5, 1.0, WAIT), (1, 0.5, 0.0, GO), (0, 0.5, 1.0, GO))
    assert without_needless_conditions(tree, shown) == tree
    counting = np.array([True, False, True])
    assert without_needless_conditions(tree, shown, counting) == nodes.Selector(
        (some.when(DOCKED, then=WAIT), GO)
    )


@pytest.mark.parametrize(
    "tree",
    [
        nodes.Parallel((some.when(DOCKED, LEFT, then=WAIT), some.when(~DOCKED, then=GO))),
        some.when(DOCKED, LEFT, then=WAIT),
        nodes.Selector((some.when(DOCKED, LEFT, then=WAIT), GO), memory=True),
        nodes.Selector((nodes.Sequence((WAIT, nodes.Condition(DOCKED), GO)), TURN)),
    ],
)
def test_other_trees_than_rules_in_order_of_priority_stay_as_they_are(tree: nodes.Node) -> None:
    assert without_needless_conditions(tree, SHOWN) == tree


@settings(max_examples=80, deadline=None)
@given(
    table=some.tables(min_rows=2, max_rows=40),
    history=st.sampled_from((History.NONE, History.PREVIOUS)),
)
def test_shown_rows_are_decided_as_before_by_no_condition_too_many(
    table: DemonstrationTable, history: History
) -> None:
    trained = train(table, vocabulary=Vocabulary(history), max_depth=5)
    tree = reduced_tree(leaf_rules(trained.tree, lambda leaf: (leaf.most_probable,)))
    found = without_needless_conditions(tree, table)
    choices = evaluation.teacher_forced_choices
    assert choices(found, table).tolist() == choices(tree, table).tolist()
    assert nodes.size(found) <= nodes.size(tree)
    assert without_needless_conditions(found, table) == found
    for fewer in _with_a_condition_less(found):
        assert _branches(fewer, table) != _branches(found, table)


def _branches(tree: nodes.Node, table: DemonstrationTable) -> list[int]:
    """The child of the root that acts in each row."""
    children = tree.children if isinstance(tree, nodes.Selector) else (tree,)
    numbered = [nodes.Action(str(place), table.channel) for place in range(len(children))]
    told_apart = nodes.Selector(
        tuple(
            nodes.Sequence((*child.children[:-1], number))
            if isinstance(child, nodes.Sequence)
            else number
            for child, number in zip(children, numbered, strict=True)
        )
    )
    history = history_columns(table.actions, table.previous, table.last)
    states = States(table.features, table.states, history)
    return choose(told_apart, tuple(numbered), states).tolist()


def _with_a_condition_less(tree: nodes.Node) -> Iterator[nodes.Node]:
    """The tree without any one of the conditions that have others beside them."""
    children = nodes.children(tree)
    beside = sum(map(_only_tells, children)) > 1
    for place, child in enumerate(children):
        if beside and isinstance(child, nodes.Condition):
            yield nodes.with_children(tree, (*children[:place], *children[place + 1 :]))
        for fewer in _with_a_condition_less(child):
            yield nodes.with_children(tree, (*children[:place], fewer, *children[place + 1 :]))


def _only_tells(node: nodes.Node) -> bool:
    return not nodes.actions(node)


@settings(max_examples=40, deadline=None)
@given(st.lists(some.conditions(), max_size=9, unique=True), some.tables(), st.booleans())
def test_few_conditions_tell_the_rows_apart_as_many_do(
    conditions: list[Condition], table: DemonstrationTable, some_count: bool
) -> None:
    shown = np.arange(len(table)) % 3 > 0 if some_count else None
    few = needless_conditions._distinct(conditions, table, shown)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(needless_conditions, "_FEW", -1)
        many = needless_conditions._distinct(conditions, table, shown)
    assert _cells(*few) == _cells(*many)


def _cells(count: int, satisfied: list[int]) -> list[list[bool]]:
    """Cells by the conditions that each of them satisfies."""
    return sorted([bool(its >> cell & 1) for its in satisfied] for cell in range(count))


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 200])
def test_rows_of_any_number_of_conditions_are_told_apart(count: int) -> None:
    holds = np.random.default_rng(count).random((300, count)) < 0.01
    found = needless_conditions._different(needless_conditions._words(holds))
    bits = np.unpackbits(found.view(np.uint8), axis=1, count=count).astype(bool)
    assert len(bits) == len({row.tobytes() for row in bits})
    assert {row.tobytes() for row in bits} == {row.tobytes() for row in holds}
