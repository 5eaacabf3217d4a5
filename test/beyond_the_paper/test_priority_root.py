"""What each reduction past the paper does to a tree of rules."""

from __future__ import annotations

from dataclasses import replace

import strategies as some
from hypothesis import given, settings
from pruned_trees import train

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.beyond_the_paper.reductions import ALL_REDUCTIONS, Reductions
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import IsTrue, Literal
from rebt_ros.paper.rules import Rule, leaf_rules

GO, GRASP, TURN, WAIT = some.ACTIONS
A, B, C, D = (Literal(IsTrue(name)) for name in "abcd")
NONE = Reductions(domain=False, repeated_factoring=False, priority=False, intervals=False)

#: a and (b or c), or else d: after nothing is common to all, a is common to two of three.
RULES = (
    Rule((GO,), some.dnf([A, B], [A, C], [D]), 5),
    Rule((TURN,), some.dnf([~A, ~D], [~B, ~C, ~D]), 4),
)


def test_factoring_once_leaves_what_only_some_conjunctions_share() -> None:
    once = reduced_tree(RULES, NONE, Root.PARALLEL)
    assert nodes.size(once.children[0]) == 10
    assert [str(one.literal.condition.feature) for one in _conditions(once.children[0])] == [
        *"abacd"
    ]


def test_repeated_factoring_divides_it_out() -> None:
    again = reduced_tree(RULES, replace(NONE, repeated_factoring=True), Root.PARALLEL)
    assert nodes.size(again.children[0]) == 9
    assert sorted(one.literal.condition.feature for one in _conditions(again.children[0])) == [
        *"abcd"
    ]


def _conditions(tree: nodes.Node) -> list[nodes.Condition]:
    return [one for one in nodes.walk(tree) if isinstance(one, nodes.Condition)]


@settings(max_examples=25)
@given(some.tables(min_rows=2, max_rows=15))
def test_priority_is_for_selectors_alone(table: DemonstrationTable) -> None:
    rules = leaf_rules(train(table).tree, lambda leaf: (leaf.most_probable,))
    without = replace(ALL_REDUCTIONS, priority=False)
    assert reduced_tree(rules, ALL_REDUCTIONS, Root.PARALLEL) == reduced_tree(
        rules, without, Root.PARALLEL
    )


def test_infeasible_combinations_are_dont_cares_in_trees_of_up_to_40_leaves() -> None:
    assert ALL_REDUCTIONS.made_in(40).domain
    assert not ALL_REDUCTIONS.made_in(41).domain
    assert replace(ALL_REDUCTIONS.made_in(41), domain=True) == ALL_REDUCTIONS
    assert not NONE.made_in(40).domain
