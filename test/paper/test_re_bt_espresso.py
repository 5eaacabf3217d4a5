"""Algorithm 1 on the paper's examples, and on rules that trip up naive conversions."""

from __future__ import annotations

import pytest
from algorithm_1 import algorithm_1

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.logic.conditions import IsTrue, LastActionIs, Literal, Threshold
from rebt_ros.logic.dnf import Conjunction, Dnf
from rebt_ros.paper.re_bt_espresso import bt_espresso, re_bt_espresso
from rebt_ros.paper.rule_trees import build_inv_set
from rebt_ros.paper.rules import Rule, delta_close, dt_to_rules, dt_to_rules_psa

A, B, C = (nodes.Action(label, "action") for label in "abc")
NEAR, REACHABLE = Threshold("distance", 0.3), Threshold("distance", 0.5)
HELD, OPEN = IsTrue("held"), IsTrue("open")


def condition(test: Threshold | IsTrue | LastActionIs) -> nodes.Condition:
    return nodes.Condition(Literal(test))


def inverted(test: Threshold | IsTrue | LastActionIs) -> nodes.Inverter:
    return nodes.Inverter(condition(test))


def tree(root: DecisionNode) -> DecisionTree:
    return DecisionTree((A, B, C), root)


ONLY_A, ONLY_B, ONLY_C = Leaf((9, 0, 0)), Leaf((0, 5, 0)), Leaf((0, 0, 3))


def test_figure_1_of_two_thresholds_on_one_side_only_the_strongest_is_tested() -> None:
    dt = tree(Split(REACHABLE, Split(NEAR, ONLY_A, ONLY_B), ONLY_C))
    converted = algorithm_1(dt)
    assert isinstance(converted, nodes.Parallel)
    assert converted.children[0] == nodes.Sequence((condition(NEAR), A))
    baseline = bt_espresso(dt)
    assert isinstance(baseline, nodes.Parallel)
    assert baseline.children[0] == nodes.Sequence((condition(REACHABLE), condition(NEAR), A))


def test_figure_1_a_condition_shared_by_all_conjunctions_is_tested_once_in_front() -> None:
    # a: held and (open or near), split so that espresso leaves two conjunctions.
    dt = tree(Split(HELD, Split(OPEN, ONLY_A, Split(NEAR, ONLY_A, ONLY_B)), ONLY_C))
    converted = algorithm_1(dt)
    assert isinstance(converted, nodes.Parallel)
    either = nodes.Selector((condition(OPEN), condition(NEAR)))
    assert converted.children[0] == nodes.Sequence((condition(HELD), either, A))
    baseline = bt_espresso(dt)
    assert isinstance(baseline, nodes.Parallel)
    repeated = [nodes.Sequence((condition(HELD), condition(one))) for one in (OPEN, NEAR)]
    assert baseline.children[0] == nodes.Sequence((nodes.Selector(tuple(repeated)), A))


def test_figure_1_the_inverse_of_a_condition_is_an_inverter_over_it() -> None:
    converted = algorithm_1(tree(Split(NEAR, ONLY_A, ONLY_B)))
    assert converted == nodes.Parallel(
        (nodes.Sequence((condition(NEAR), A)), nodes.Sequence((inverted(NEAR), B)))
    )


def test_figure_1_actions_that_are_delta_close_stand_under_a_parallel_selector() -> None:
    dt = tree(Split(NEAR, Leaf((8, 10, 1)), ONLY_C))
    converted = algorithm_1(dt, delta=0.3)
    assert converted == nodes.Parallel(
        (
            nodes.Sequence((condition(NEAR), nodes.ParallelSelector((B, A)))),
            nodes.Sequence((inverted(NEAR), C)),
        )
    )


def test_the_baseline_has_negative_conditions_instead_of_inverters() -> None:
    converted = bt_espresso(tree(Split(NEAR, ONLY_A, ONLY_B)))
    assert converted == nodes.Parallel(
        (
            nodes.Sequence((condition(NEAR), A)),
            nodes.Sequence((nodes.Condition(~Literal(NEAR)), B)),
        )
    )


def test_a_single_leaf_becomes_its_action_alone() -> None:
    for root in Root:
        assert algorithm_1(tree(ONLY_B), root=root) == B


def test_an_action_whose_rule_is_always_true_stays_in_the_tree() -> None:
    # Both branches trigger a, so that its rule minimizes to TRUE.
    dt = tree(Split(NEAR, Leaf((4, 0, 0)), Leaf((2, 1, 0))))
    assert nodes.actions(algorithm_1(dt, delta=0.0)) == (A,)
    assert algorithm_1(dt, delta=0.0) == A


def test_a_condition_or_its_negation_is_no_condition() -> None:
    dt = tree(Split(HELD, Split(OPEN, ONLY_A, ONLY_B), Split(OPEN, ONLY_A, ONLY_B)))
    assert algorithm_1(dt, root=Root.SELECTOR) == nodes.Selector(
        (nodes.Sequence((condition(OPEN), A)), nodes.Sequence((inverted(OPEN), B)))
    )


def test_actions_with_similar_names_stay_different_actions() -> None:
    similar = tuple(nodes.Action(label, "action") for label in ("a", "a b", "a_b"))
    dt = DecisionTree(similar, Split(NEAR, ONLY_A, Split(HELD, ONLY_B, ONLY_C)))
    assert set(nodes.actions(algorithm_1(dt))) == set(similar)


def test_last_action_conditions_know_the_action_that_their_rule_decides() -> None:
    dt = tree(Split(LastActionIs("c"), ONLY_A, ONLY_B))
    converted = algorithm_1(dt, root=Root.SELECTOR)
    assert converted == nodes.Selector(
        (
            nodes.Sequence((condition(LastActionIs("c", ("a",))), A)),
            nodes.Sequence((nodes.Condition(~Literal(LastActionIs("c", ("b",)))), B)),
        )
    )


def test_rules_come_with_the_best_supported_first_and_each_leaf_in_one() -> None:
    dt = tree(Split(NEAR, ONLY_C, Split(HELD, ONLY_A, Leaf((4, 0, 0)))))
    near, held = Literal(NEAR), Literal(HELD)
    assert dt_to_rules(dt) == (
        Rule((A,), Dnf((Conjunction((~near, held)), Conjunction((~near, ~held)))), 13),
        Rule((C,), Dnf((Conjunction((near,)),)), 3),
    )
    assert dt_to_rules_psa(dt, 0.0) == dt_to_rules(dt)


@pytest.mark.parametrize(
    ("delta", "close"),
    [(0.0, (1,)), (0.29, (1,)), (0.3, (0, 1)), (0.8, (0, 1, 2)), (1.0, (0, 1, 2))],
)
def test_delta_close_actions_have_at_least_the_stated_share_of_the_largest(
    delta: float, close: tuple[int, ...]
) -> None:
    assert delta_close(Leaf((7, 10, 2, 0)), delta) == close


def test_learning_twice_gives_equal_trees_also_with_the_baseline_in_between() -> None:
    dt = tree(Split(REACHABLE, Split(HELD, Leaf((8, 10, 1)), ONLY_A), Split(NEAR, ONLY_C, ONLY_B)))
    first = algorithm_1(dt, delta=0.3)
    bt_espresso(dt)
    assert algorithm_1(dt, delta=0.3) == first


def test_algorithm_1_returns_the_main_tree_and_the_lat_trees_beside_it() -> None:
    after_a = LastActionIs("a")
    dt = tree(Split(NEAR, ONLY_A, Split(after_a, ONLY_B, ONLY_C)))
    found = re_bt_espresso(dt, (("a", "b", "c"), ("a", "b")))
    assert found.main == algorithm_1(dt)
    assert build_inv_set(dt_to_rules_psa(dt, 0.3))
    assert [
        ("".join(label for node in one.path for label in node.labels), one.support)
        for one in found.lat.trees
    ] == [("ab", 2)]
    assert nodes.actions(found.lat.trees[0].subtree) == (A, B)


def test_an_action_of_a_single_row_is_triggered_and_one_of_none_is_not() -> None:
    assert delta_close(Leaf((0, 1, 0)), 0.3) == (1,)
    assert delta_close(Leaf((0, 1, 1)), 0.0) == (1, 2)
    assert delta_close(Leaf((0, 1, 1)), 1.0) == (1, 2)


def test_delta_is_that_of_the_paper_unless_it_is_given() -> None:
    apart = Leaf((69, 100)), Leaf((100, 70))
    tree = DecisionTree((A, B), Split(IsTrue("x"), *apart))
    assert re_bt_espresso(tree) == re_bt_espresso(tree, delta=0.3)
    assert re_bt_espresso(tree) != re_bt_espresso(tree, delta=0.32)
    assert re_bt_espresso(tree) != re_bt_espresso(tree, delta=0.29)


def test_of_a_group_the_best_supported_action_stands_first() -> None:
    # Over both leaves b has more rows than a, although a is the most probable of one of them.
    leaves = Leaf((10, 9, 0)), Leaf((8, 10, 0))
    (found,) = dt_to_rules_psa(DecisionTree((A, B, C), Split(IsTrue("x"), *leaves)), 0.3)
    assert found.actions == (B, A)
    equal = Leaf((10, 8, 0)), Leaf((8, 10, 0))
    (found,) = dt_to_rules_psa(DecisionTree((A, B, C), Split(IsTrue("x"), *equal)), 0.3)
    assert found.actions == (A, B)
