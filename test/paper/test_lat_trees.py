"""Algorithm 2 on the paper's figures, and on rules that they do not show."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from lat_examples import (
    LABELS,
    c,
    complete,
    cycle,
    flat,
    followers,
    lat,
    node,
    pairs,
    renamed,
    rule,
    rule_lists,
    shown_runs,
)
from lat_runs import repeater, run, sequence, steps
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import DEEPEST_TREE
from rebt_ros.beyond_the_paper.single_loops import LoopTrees, loop_trees
from rebt_ros.logic.conditions import LastActionIs, Literal
from rebt_ros.paper.lat_cycles import CycleStart, remove_cycles
from rebt_ros.paper.lat_graph import generate_graph
from rebt_ros.paper.lat_occurrences import Occurrences, Runs
from rebt_ros.paper.lat_trees import LatTree, LeftOut, gen_lat_trees
from rebt_ros.paper.rule_trees import build_inv_set
from rebt_ros.paper.rules import Rule


def either(*alternatives: tuple[Literal, ...]) -> nodes.Selector:
    return nodes.Selector(
        tuple(
            nodes.Sequence(steps(*one)) if len(one) > 1 else nodes.Condition(one[0])
            for one in alternatives
        )
    )


def subtrees(rules: Iterable[Rule], *shown: Iterable[str]) -> list[nodes.Node]:
    return [one.subtree for one in gen_lat_trees(rules, tuple(map(tuple, shown))).trees]


# --- the paper's figures ------------------------------------------------------------------------

#: Figure 2, 1): rule look-up from action to conditions.
FIGURE_2 = [
    rule("A_0", [c(2), lat("A_1")], [c(0), c(3)]),
    rule("A_1", [c(0), c(1)], [c(2)]),
    rule("A_2", [c(4), lat("A_0")], [c(5)]),
]


def test_figure_2_the_graph_leads_from_last_action_to_action() -> None:
    graph = generate_graph(FIGURE_2)
    assert pairs(graph) == {(node("A_1"), node("A_0")), (node("A_0"), node("A_2"))}


def test_figure_2_all_conjunctions_of_the_first_action_and_the_lat_conjunctions_of_the_others() -> (
    None
):
    # C_2 is tested before A_1 and once more before A_0, as it may have changed.
    assert subtrees(FIGURE_2) == [
        sequence(either((c(0), c(1)), (c(2),)), "A_1", c(2), "A_0", c(4), "A_2")
    ]


#: Figure 3: a mobile robot that turns, goes and turns until it has arrived.
FIGURE_3 = [
    rule("turn", [c(0), lat("start")], [c(1), lat("go")]),
    rule("go", [c(2), lat("turn")]),
    rule("start", [c(3)]),
    rule("stop", [c(4), lat("go")], [c(5), lat("turn")]),
]
FIGURE_3_SHOWN = [["start", "turn", "go", "turn", "go", "stop"], ["start", "turn", "go", "turn"]]


def test_figure_3_the_cycle_becomes_a_cycle_node_with_the_edges_of_both_actions() -> None:
    graph = generate_graph(FIGURE_3)
    assert pairs(graph) == {
        (node("start"), node("turn")),
        (node("turn"), node("go")),
        (node("go"), node("turn")),
        (node("go"), node("stop")),
        (node("turn"), node("stop")),
    }
    turn_go = cycle("turn", "go")
    acyclic = remove_cycles(graph, Occurrences(tuple(map(tuple, FIGURE_3_SHOWN)))).graph
    assert pairs(acyclic) == {(node("start"), turn_go), (turn_go, node("stop"))}


def test_figure_3_the_sequence_has_a_repeater_in_the_place_of_the_cycle_node() -> None:
    of_turn = either((c(0), lat_of("start", "turn")), (c(1), lat_of("go", "turn")))
    assert subtrees(FIGURE_3, *FIGURE_3_SHOWN) == [
        sequence(
            c(3),
            "start",
            repeater(of_turn, "turn", c(2), "go"),
            either((c(4),), (c(5),)),
            "stop",
        )
    ]


def lat_of(label: str, *deciding: str) -> Literal:
    return Literal(LastActionIs(label, deciding))


def test_figure_3_a_cycle_with_nothing_around_it_is_a_repeater_alone() -> None:
    rules = [rule("turn", [c(1), lat("go")], [c(0)]), rule("go", [c(2), lat("turn")])]
    (tree,) = gen_lat_trees(rules, (("turn", "go", "turn", "go"),)).trees
    assert tree == LatTree(
        (cycle("turn", "go"),),
        1,
        repeater(either((c(1), lat_of("go", "turn")), (c(0),)), "turn", c(2), "go"),
    )


def test_figure_3_two_loops_through_one_action_become_repeaters_within_each_other() -> None:
    rules = [
        rule("go", [c(0), lat("left")], [c(0), lat("right")], [c(9)]),
        rule("left", [c(1), lat("go")]),
        rule("right", [c(2), lat("go")]),
    ]
    shown = ["left", "go", "left", "go", "left", "go", "right", "go", "right"]
    (tree,) = gen_lat_trees(rules, (tuple(shown),)).trees
    inner = repeater(c(1), lat_of("go", "left"), "left", c(0), "go")
    assert tree.subtree == repeater(inner, c(2), "right")


# --- beyond the figures -------------------------------------------------------------------------


def test_the_start_of_a_cycle_can_be_arbitrary() -> None:
    rules = followers({"a": "b", "b": "a"})
    shown = (("b", "a", "b", "a"),)
    started = {
        start: gen_lat_trees(rules, shown, start=start).trees[0].path for start in CycleStart
    }
    assert started == {
        CycleStart.MOST_FREQUENT: (cycle("b", "a"),),
        CycleStart.ARBITRARY: (cycle("a", "b"),),
    }


def test_conjunctions_that_only_lat_told_apart_are_tested_once() -> None:
    rules = [
        rule("a", [c(0)]),
        rule("b", [c(1), lat("a")]),
        rule("z", [c(2), lat("a"), ~lat("b")], [c(2), c(3), lat("a")]),
    ]
    assert sequence(c(0), "a", c(2), "z") in subtrees(rules)


def test_a_step_whose_only_condition_was_the_last_action_has_none() -> None:
    rules = [rule("a", [c(0)]), rule("b", [lat("a")], [c(1), lat("a")])]
    assert subtrees(rules) == [sequence(c(0), "a", "b")]


def test_a_first_action_that_is_always_right_has_no_condition() -> None:
    assert subtrees([rule("a", []), rule("b", [lat("a"), c(1)])]) == [sequence("a", c(1), "b")]


def test_a_psa_group_is_one_step_and_each_member_can_be_the_last_action() -> None:
    rules = [
        rule(("a", "b"), [c(0)]),
        rule("d", [c(1), lat("b")], [c(2), lat("a")]),
        rule(("e", "f"), [c(3), lat("d")]),
    ]
    first, last = (nodes.ParallelSelector(tuple(map(some.action, group))) for group in ("ab", "ef"))
    (tree,) = gen_lat_trees(rules, (tuple("bde"), tuple("adf"))).trees
    assert tree.subtree == sequence(c(0), first, either((c(1),), (c(2),)), "d", c(3), last)
    assert tree.support == 2


def test_actions_that_follow_none_give_no_tree() -> None:
    result = gen_lat_trees([rule("a", [c(0)]), rule("b", [~lat("a")])])
    assert result.trees == ()
    assert not result.left_out


def test_no_rules_give_no_trees() -> None:
    assert gen_lat_trees([]).trees == ()


def test_inversely_related_conditions_are_inverters_here_too() -> None:
    rules = [rule("a", [c(0)]), rule("b", [~c(0), lat("a")])]
    (tree,) = gen_lat_trees(rules, inv_set=build_inv_set(rules)).trees
    inverted = nodes.Inverter(nodes.Condition(c(0)))
    assert tree.subtree == sequence(c(0), "a", inverted, "b")


def test_trees_that_nobody_showed_are_offered_unless_support_is_asked_for() -> None:
    rules = followers({"a": "", "b": "a", "d": "a"})
    shown = (("a", "b"),)
    assert [one.support for one in gen_lat_trees(rules, shown).trees] == [1, 0]
    least = gen_lat_trees(rules, shown, least_support=1)
    assert [one.support for one in least.trees] == [1]
    assert least.left_out == LeftOut(paths=1)


def test_what_bounds_left_out_is_said() -> None:
    rules = followers({"a": "", "b": "a", "d": "a"})
    assert gen_lat_trees(rules, most_paths=1).left_out == LeftOut(paths=1)
    assert gen_lat_trees([rule(("a", "b"), [lat("b")])]).left_out == LeftOut(self_loops=1)


def test_a_complete_graph_of_30_actions_takes_about_a_second() -> None:
    word = tuple(f"a{place * place % 31 % 30}" for place in range(500))
    for shown in ((), (word,)):
        start = time.process_time()
        trees = gen_lat_trees(complete(30), shown).trees
        # The slowest machine of many that run tests side by side.
        assert time.process_time() - start < 5
        assert all(nodes.depth(one.subtree) < DEEPEST_TREE for one in trees)


# --- single loops -------------------------------------------------------------------------------


def loops(rules: Iterable[Rule], *shown: str, most: int = 9) -> list[tuple[str, int]]:
    """The actions of the single loops and their support."""
    found = single_loops_of(rules, tuple(map(tuple, shown)), most=most)
    return [("".join(flat_labels(one)), one.support) for one in found.trees]


def single_loops_of(rules: Iterable[Rule], shown: Runs, *, most: int = 9) -> LoopTrees:
    rules, occurrences = tuple(rules), Occurrences(shown)
    return loop_trees(rules, gen_lat_trees(rules, occurrences).trees, occurrences, most=most)


def flat_labels(tree: LatTree) -> list[str]:
    return [label for each in flat(tree.path) for label in each.labels]


def test_an_action_that_was_done_twice_in_a_row_is_a_loop_that_tests_its_whole_rule() -> None:
    rules = [rule("a", [c(0)], [c(1), lat("b")]), rule("b", [c(2)])]
    (tree,) = single_loops_of(rules, (tuple("aabaaabb"), ("b",)), most=1).trees
    assert tree.support == 2
    assert tree.subtree == repeater(either((c(0),), (c(1), lat_of("b", "a"))), "a")
    assert loops(rules, "aabaaabb", "b") == [("a", 2), ("b", 1)]


def test_an_action_at_the_end_and_the_beginning_of_demonstrations_is_no_loop() -> None:
    assert loops([rule("a", [c(0)]), rule("b", [c(1)])], "ba", "ab") == []


def test_members_of_a_group_in_a_row_are_a_loop_of_the_group() -> None:
    assert loops([rule(("a", "b"), [c(0)]), rule("d", [c(1)])], "dabad") == [("ab", 1)]


def test_a_simple_cycle_within_others_is_a_loop_of_its_own() -> None:
    rules = followers({"a": "bc", "b": "a", "c": "a"})
    # Each way back from a to a, and from the other one to itself.
    assert loops(rules, "abababacaca") == [("ab", 5), ("ac", 3)]


def test_a_path_that_was_done_twice_in_a_row_is_a_loop() -> None:
    rules = [rule("a", [c(0), ~lat("d")]), rule("b", [c(1), lat("a")]), rule("d", [c(2)])]
    assert loops(rules, "dababd", "ab") == [("ab", 1)]
    assert loops(rules, "dabdab", "ab") == []


def test_loops_beyond_the_number_asked_for_are_counted() -> None:
    rules = [rule("a", [c(0)]), rule("b", [c(1)])]
    assert loops(rules, "aabb", most=0) == []
    assert single_loops_of(rules, (tuple("aabb"),), most=1).left_out == 1


@given(rule_lists(), shown_runs)
def test_what_is_remembered_of_demonstrations_changes_no_tree(
    rules: list[Rule], shown: Runs
) -> None:
    remembering = Occurrences(shown)
    for some_rules in (rules, rules[1:], rules):
        found = gen_lat_trees(some_rules, remembering)
        assert found == gen_lat_trees(some_rules, shown)
        assert loop_trees(some_rules, found.trees, remembering, most=9) == single_loops_of(
            some_rules, shown
        )


# --- executed -----------------------------------------------------------------------------------


def test_executed_a_sequence_tests_conditions_when_it_reaches_their_step_and_not_again() -> None:
    (tree,) = subtrees(FIGURE_2)
    # ticks:             A_1 runs  done: A_0  done: A_2  done
    states = [{0, 1}, {2}, {4}, set()]
    script, statuses = run(tree, *states)
    assert script.begun == ["A_1", "A_0", "A_2"]
    assert statuses == [Status.RUNNING, Status.RUNNING, Status.RUNNING, Status.SUCCESS]
    assert script.halted == []


def test_executed_a_sequence_fails_where_the_condition_of_the_next_step_does_not_hold() -> None:
    (tree,) = subtrees(FIGURE_2)
    script, statuses = run(tree, {2}, set())
    assert script.begun == ["A_1"]
    assert statuses == [Status.RUNNING, Status.FAILURE]


# --- laws ---------------------------------------------------------------------------------------


@given(rule_lists(), shown_runs, st.sampled_from(CycleStart))
def test_each_tree_takes_the_actions_of_its_path_in_order(
    rules: list[Rule], shown: Runs, start: CycleStart
) -> None:
    for tree in gen_lat_trees(rules, shown, start=start).trees:
        taken = [one for one in nodes.walk(tree.subtree) if isinstance(one, nodes.Action)]
        assert taken == [action for one in flat(tree.path) for action in one.actions]


@given(rule_lists(), shown_runs)
def test_lat_is_tested_before_the_first_step_of_a_sequence_or_repeater_only(
    rules: list[Rule], shown: Runs
) -> None:
    for tree in gen_lat_trees(rules, shown).trees:
        for each in nodes.walk(tree.subtree):
            if isinstance(each, nodes.Repeater) or each is tree.subtree:
                late = False
                for step in nodes.children(each):
                    if late and not isinstance(step, nodes.Repeater):
                        assert not any(
                            isinstance(one.literal.condition, LastActionIs)
                            for one in nodes.conditions(step)
                        )
                    late = late or bool(nodes.actions(step))


@given(rule_lists(), shown_runs)
def test_actions_are_known_by_identity_and_not_by_what_their_names_say(
    rules: list[Rule], shown: Runs
) -> None:
    names = dict(zip(LABELS, ("CYCLE", "True", "a b", "a_b", "~(x) & y"), strict=True))
    there = gen_lat_trees(
        renamed(rules, names), tuple(tuple(names[one] for one in each) for each in shown)
    )
    here = gen_lat_trees(rules, shown)
    assert there.left_out == here.left_out
    assert [(one.support, nodes.size(one.subtree)) for one in there.trees] == [
        (one.support, nodes.size(one.subtree)) for one in here.trees
    ]
    assert [[a.labels for a in flat(one.path)] for one in there.trees] == [
        [tuple(names[label] for label in a.labels) for a in flat(one.path)] for one in here.trees
    ]


@given(rule_lists(), shown_runs)
def test_learning_twice_gives_equal_trees(rules: list[Rule], shown: Runs) -> None:
    assert gen_lat_trees(rules, shown) == gen_lat_trees(rules, shown)


#: Prints the trees of rules with competing cycles, PSA groups and many paths.
IN_ANOTHER_PROCESS = """
from lat_examples import complete, followers, rule, lat, c
from rebt_ros.paper.lat_trees import gen_lat_trees
print(gen_lat_trees(complete(7), (tuple("a%d" % (n * n % 31 % 7) for n in range(60)),)))
print(gen_lat_trees(complete(7)))
print(gen_lat_trees([rule(("a", "b"), [lat("x"), c(1)]), rule("b", [lat("a")]),
                     rule("x", [lat("b")], [lat("a"), c(2)]), rule(("x", "a"), [lat("b")])],
                    (tuple("abxabxbabxa"),)))
labels = ["n%d" % n for n in range(12)]
print(gen_lat_trees(followers({one: labels[:n] for n, one in enumerate(labels)})))
"""


def test_the_trees_do_not_depend_on_the_order_of_sets() -> None:
    here = Path(__file__).parents[1]
    printed = {
        subprocess.run(
            [sys.executable, "-c", IN_ANOTHER_PROCESS],
            cwd=here,
            env={
                **os.environ,
                "PYTHONHASHSEED": seed,
                "PYTHONPATH": os.pathsep.join([str(here), str(here.parent), *sys.path]),
            },
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        ).stdout
        for seed in ("0", "1", "2")
    }
    assert len(printed) == 1
    assert "CycleNode" in printed.pop()


def test_a_loop_that_is_a_tree_already_is_not_offered_twice() -> None:
    rules = followers({"a": "bc", "b": "a", "c": "a"})
    occurrences = Occurrences((tuple("abababacaca"),))
    trees = gen_lat_trees(rules, occurrences).trees
    loops_alone = loop_trees(rules, trees, occurrences, most=9).trees
    assert loops_alone
    again = loop_trees(rules, (*trees, *loops_alone), occurrences, most=9)
    assert not {one.path for one in again.trees} & {one.path for one in loops_alone}


def test_where_no_loops_are_asked_for_none_are_left_out() -> None:
    rules = [rule("a", [c(0)]), rule("b", [c(1)])]
    assert single_loops_of(rules, (tuple("aabb"),), most=0) == LoopTrees((), 0)
