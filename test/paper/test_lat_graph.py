"""The LAT graph, its cycles, its paths, and how often they occurred."""

from __future__ import annotations

import itertools
import time

import networkx as nx
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from lat_examples import (
    LABELS,
    c,
    cycle,
    flat,
    followers,
    lat,
    node,
    occurrences_of,
    pairs,
    rule,
    rule_lists,
    shown_runs,
)

from rebt_ros.paper import lat_cycles
from rebt_ros.paper.lat_cycles import Acyclic, CycleStart, remove_cycles
from rebt_ros.paper.lat_graph import generate_graph
from rebt_ros.paper.lat_nodes import ActionNode, CycleNode, LatGraph
from rebt_ros.paper.lat_occurrences import Occurrences, Runs, rows, runs
from rebt_ros.paper.lat_paths import source_to_sink_paths
from rebt_ros.paper.rules import Rule

NOTHING = Occurrences(())


def collapsed(
    rules: list[Rule], *shown: str, start: CycleStart = CycleStart.MOST_FREQUENT
) -> Acyclic:
    """The graph of the rules without cycles; demonstrations are words of one-letter actions."""
    return remove_cycles(generate_graph(rules), Occurrences(tuple(map(tuple, shown))), start)


# --- the graph ----------------------------------------------------------------------------------


def test_an_edge_leads_from_the_last_action_to_the_action_of_the_rule() -> None:
    graph = generate_graph([rule("go", [c(1)], [lat("turn"), c(2)]), rule("turn", [c(3)])])
    assert graph.nodes == (node("go"), node("turn"))
    assert pairs(graph) == {(node("turn"), node("go"))}


def test_a_negative_lat_literal_makes_no_edge() -> None:
    assert pairs(generate_graph([rule("go", [~lat("turn"), c(2)]), rule("turn", [c(3)])])) == set()


def test_a_last_action_without_a_rule_makes_no_edge() -> None:
    assert pairs(generate_graph([rule("go", [lat("wait")]), rule("turn", [c(3)])])) == set()


def test_a_conjunction_that_can_never_hold_makes_no_edge() -> None:
    two_at_once, itself = [lat("turn"), lat("wait")], [lat("go")]
    rules = [rule("go", two_at_once, itself), rule("turn", [c(1)]), rule("wait", [c(2)])]
    assert pairs(generate_graph(rules)) == set()


def test_a_psa_group_is_one_node_and_stands_for_each_member_as_last_action() -> None:
    rules = [rule(("a", "b"), [c(1)]), rule("b", [c(2)]), rule("d", [lat("b"), c(3)])]
    assert pairs(generate_graph(rules)) == {(node("a", "b"), node("d")), (node("b"), node("d"))}
    assert pairs(generate_graph([*rules[:2], rule("d", [lat("a"), c(3)])])) == {
        (node("a", "b"), node("d"))
    }


def test_a_psa_group_whose_member_follows_another_member_leads_to_itself() -> None:
    group = rule(("a", "b"), [lat("b")])
    assert pairs(generate_graph([group])) == {(node("a", "b"), node("a", "b"))}
    assert pairs(generate_graph([group, rule("b", [c(1)])])) == {
        (node("a", "b"), node("a", "b")),
        (node("b"), node("a", "b")),
    }


def test_two_rules_for_the_same_actions_are_refused() -> None:
    with pytest.raises(ValueError, match="same actions"):
        generate_graph([rule("go", [c(1)]), rule("go", [c(2)])])


def test_a_graph_with_an_edge_to_nowhere_is_refused() -> None:
    with pytest.raises(ValueError, match="does not exist"):
        LatGraph((node("a"),), ((0, 1),))


# --- occurrences --------------------------------------------------------------------------------


def test_runs_are_the_actions_of_each_demonstration_with_repetitions_as_one() -> None:
    table = some.table([[0, 0, 0, 0]] * 7, [0, 0, 2, 0, 0, 0, 2], [0, 0, 0, 0, 1, 1, 1])
    assert runs(table) == (("go", "turn", "go"), ("go", "turn"))


def test_rows_are_the_actions_of_each_demonstration() -> None:
    table = some.table([[0, 0, 0, 0]] * 7, [0, 0, 2, 0, 0, 0, 2], [0, 0, 0, 0, 1, 1, 1])
    assert rows(table) == (("go", "go", "turn", "go"), ("go", "go", "turn"))


def test_a_path_occurs_inside_one_demonstration_without_gaps() -> None:
    shown = Occurrences((tuple("abca"), tuple("bacb")))
    assert shown.count([node("a"), node("b")]) == 1
    assert shown.count([node("b"), node("a")]) == 1
    assert shown.count([node("a"), node("c"), node("b")]) == 1
    assert shown.count([node("a"), node("d")]) == 0


def test_a_psa_group_occurs_by_any_of_its_members() -> None:
    assert Occurrences((tuple("acbc"),)).count([node("a", "b"), node("c")]) == 2


def test_a_cycle_occurs_once_however_often_it_is_passed_without_a_break() -> None:
    loop = cycle("a", "b")
    assert Occurrences((tuple("ababab"),)).count([loop]) == 1
    assert Occurrences((tuple("ababcab"),)).count([loop]) == 2
    assert Occurrences((tuple("acb"),)).count([loop]) == 0


def test_a_cycle_can_be_left_in_the_middle_of_its_last_pass_but_not_of_its_first() -> None:
    path = [cycle("a", "b"), node("c")]
    assert Occurrences((tuple("ababac"),)).count(path) == 1
    assert Occurrences((tuple("ac"),)).count(path) == 0


def test_a_nested_cycle_is_passed_once_or_more_in_each_pass() -> None:
    assert Occurrences((tuple("ababcabc"),)).count([cycle(cycle("a", "b"), "c")]) == 1


def test_an_occurrence_is_followed_to_its_end_however_long_it_is() -> None:
    word = tuple("ab" * 700 + "c" + "ab" * 3)
    assert Occurrences((word,)).count([cycle("a", "b")]) == 2


some_paths = st.lists(
    st.recursive(
        st.lists(st.sampled_from(LABELS), min_size=1, max_size=2, unique=True).map(
            lambda labels: node(*labels)
        ),
        lambda inner: st.lists(inner, min_size=2, max_size=3).map(lambda path: cycle(*path)),
        max_leaves=4,
    ),
    min_size=1,
    max_size=3,
)


@given(some_paths, shown_runs)
def test_counting_everywhere_at_once_is_counting_place_by_place(
    path: list[ActionNode | CycleNode], shown: Runs
) -> None:
    assert Occurrences(shown).count(path) == occurrences_of(path, shown)


# --- cycles -------------------------------------------------------------------------------------


def test_a_cycle_becomes_a_node_with_all_its_edges() -> None:
    rules = followers({"s": "", "t": "sg", "g": "t", "e": "g", "f": "t"})
    graph = collapsed(rules, "stgtge").graph
    loop = cycle("t", "g")
    assert graph.nodes == (node("s"), loop, node("e"), node("f"))
    assert pairs(graph) == {(node("s"), loop), (loop, node("e")), (loop, node("f"))}


def test_a_cycle_starts_with_its_most_frequent_rotation() -> None:
    rules = followers({"a": "c", "b": "a", "c": "b"})
    assert collapsed(rules, "bcabc", "bca").graph.nodes == (cycle("b", "c", "a"),)
    assert collapsed(rules, "cab").graph.nodes == (cycle("c", "a", "b"),)


def test_of_equally_frequent_rotations_the_one_that_was_shown_first_starts() -> None:
    rules = followers({"a": "b", "b": "a"})
    assert collapsed(rules, "babab").graph.nodes == (cycle("b", "a"),)


def test_an_arbitrary_start_is_the_first_in_the_order_of_the_rules() -> None:
    rules = followers({"a": "c", "b": "a", "c": "b"})
    for shown in ("bcabc", ""):
        graph = collapsed(rules, shown, start=CycleStart.ARBITRARY).graph
        assert graph.nodes == (cycle("a", "b", "c"),)


@pytest.mark.parametrize(
    ("shown", "inner", "outer"), [("abababacaca", "ab", "c"), ("acacacababa", "ac", "b")]
)
def test_of_cycles_that_share_a_node_the_most_frequent_is_collapsed_first(
    shown: str, inner: str, outer: str
) -> None:
    rules = followers({"a": "bc", "b": "a", "c": "a"})
    (whole,) = collapsed(rules, shown).graph.nodes
    assert isinstance(whole, CycleNode)
    assert set(whole.path) == {cycle(*inner), node(outer)}


def test_a_longer_cycle_wins_over_shorter_ones_that_were_closed_less_often() -> None:
    rules = followers({"a": "bc", "b": "ac", "c": "ab"})
    assert collapsed(rules, "abcabcabcabac").graph.nodes == (cycle("a", "b", "c"),)


def test_of_cycles_around_a_cycle_the_most_frequent_is_collapsed_first_too() -> None:
    rules = followers({"a": "bcd", "b": "a", "c": "b", "d": "b"})
    (whole,) = collapsed(rules, "ababababababdababdababdabcab").graph.nodes
    assert isinstance(whole, CycleNode)
    inner, last = whole.path
    assert (inner.labels, last) == (("a", "b", "d"), node("c"))


def test_a_cycle_that_nobody_closed_is_collapsed_all_the_same() -> None:
    rules = followers({"a": "b", "b": "a", "c": "b"})
    assert collapsed(rules).graph.nodes == (cycle("a", "b"), node("c"))


def test_a_cycle_through_a_psa_group_is_found_in_what_its_members_did() -> None:
    rules = [
        rule("a", [c(0), lat("d")]),
        rule(("b", "c"), [c(1), lat("a")]),
        rule("d", [c(2), lat("b")], [c(2), lat("a")]),
        rule("b", [c(3)]),
    ]
    graph = collapsed(rules, "acdabdacd").graph
    assert graph.nodes == (cycle("a", node("b", "c"), "d"), node("b"))
    assert pairs(graph) == {(node("b"), graph.nodes[0])}


def test_self_loops_of_psa_groups_are_dropped_and_counted() -> None:
    acyclic = collapsed([rule(("a", "b"), [lat("b")]), rule("c", [lat("a"), c(1)])], "abac")
    assert (acyclic.self_loops, acyclic.edges) == (1, 0)
    assert pairs(acyclic.graph) == {(node("a", "b"), node("c"))}


def test_cycles_are_not_nested_deeper_than_a_reader_can_follow() -> None:
    # a is closed with b most often, the two with c next, and so on: each cycle holds the last.
    labels = "abcdefghijklm"
    word = "".join(
        "a" + label + "a" + label
        for place, label in enumerate(labels[1:])
        for _ in range(20 - place)
    )
    rules = followers({"a": labels[1:], **dict.fromkeys(labels[1:], "a")})
    acyclic = collapsed(rules, word + "a")
    assert max(one.nesting for one in acyclic.graph.nodes) == lat_cycles.DEEPEST_NESTING
    assert acyclic.edges == len(labels) - 1 - lat_cycles.DEEPEST_NESTING
    assert nx.is_directed_acyclic_graph(nx.DiGraph(acyclic.graph.edges))


@given(rule_lists(), shown_runs, st.sampled_from(CycleStart))
def test_every_action_and_every_edge_between_different_nodes_stays(
    rules: list[Rule], shown: Runs, start: CycleStart
) -> None:
    before = generate_graph(rules)
    acyclic = remove_cycles(before, Occurrences(shown), start)
    after = acyclic.graph
    assert nx.is_directed_acyclic_graph(nx.DiGraph(after.edges))
    assert sorted(flat(after.nodes), key=before.nodes.index) == list(before.nodes)
    assert acyclic.edges == 0
    home = {one: each for each in after.nodes for one in flat([each])}
    moved = {(home[a], home[b]) for a, b in before.pairs() if a != b}
    assert pairs(after) == {(a, b) for a, b in moved if a is not b}


@given(rule_lists(), shown_runs)
def test_each_step_of_a_cycle_is_an_edge_of_the_graph(rules: list[Rule], shown: Runs) -> None:
    before = generate_graph(rules)
    edges = pairs(before)
    waiting = list(remove_cycles(before, Occurrences(shown)).graph.nodes)
    while waiting:
        one = waiting.pop()
        if isinstance(one, CycleNode):
            assert len(one.path) > 1
            for here, there in itertools.pairwise((*one.path, one.path[0])):
                assert any((a, b) in edges for a in flat([here]) for b in flat([there]))
            waiting.extend(one.path)


# --- paths --------------------------------------------------------------------------------------


def test_paths_come_with_the_best_supported_first_and_a_count_of_the_others() -> None:
    graph = generate_graph(followers({"a": "", "b": "a", "c": "a", "d": "bc"}))
    shown = Occurrences((tuple("acd"), tuple("acd"), tuple("abd")))
    found = source_to_sink_paths(graph, shown, most=1)
    assert [
        ("".join(one.labels[0] for one in path.nodes), path.support) for path in found.paths
    ] == [("acd", 2)]
    assert found.left_out == 1


def test_paths_below_the_least_support_are_left_out() -> None:
    graph = generate_graph(followers({"a": "", "b": "a", "c": "a", "d": "bc"}))
    shown = Occurrences((tuple("acd"),))
    assert [path.support for path in source_to_sink_paths(graph, shown, most=9).paths] == [1, 0]
    found = source_to_sink_paths(graph, shown, most=9, least_support=1)
    assert ([path.support for path in found.paths], found.left_out) == ([1], 1)


def test_an_action_without_edges_is_no_path_but_a_cycle_without_edges_is() -> None:
    graph = collapsed(followers({"a": "b", "b": "a", "c": ""}), "abab").graph
    found = source_to_sink_paths(graph, NOTHING, most=9)
    assert [path.nodes for path in found.paths] == [(cycle("a", "b"),)]
    assert found.left_out == 0


@given(rule_lists(), shown_runs, st.integers(0, 5))
def test_the_bounded_search_finds_the_best_of_all_paths(
    rules: list[Rule], shown: Runs, most: int
) -> None:
    occurrences = Occurrences(shown)
    graph = remove_cycles(generate_graph(rules), occurrences).graph
    engine = nx.DiGraph(graph.edges)
    every = [
        tuple(graph.nodes[place] for place in path)
        for source in engine
        for sink in engine
        if engine.in_degree(source) == 0 and engine.out_degree(sink) == 0
        for path in nx.all_simple_paths(engine, source, sink)
    ]
    linked = {one for path in every for one in path}
    every += [(one,) for one in graph.nodes if isinstance(one, CycleNode) and one not in linked]
    found = source_to_sink_paths(graph, occurrences, most=10**6)
    assert sorted(map(repr, every)) == sorted(repr(path.nodes) for path in found.paths)
    assert found.left_out == 0
    for path in found.paths:
        assert path.support == occurrences_of(path.nodes, shown)
    supports = [path.support for path in found.paths]
    assert supports == sorted(supports, reverse=True)
    bounded = source_to_sink_paths(graph, occurrences, most=most)
    assert bounded.paths == found.paths[:most]
    assert bounded.left_out == len(every) - len(bounded.paths)


# --- large graphs -------------------------------------------------------------------------------


def test_of_millions_of_paths_the_supported_ones_are_found_and_the_others_counted() -> None:
    labels = [f"a{place}" for place in range(30)]
    rules = followers({label: labels[:place] for place, label in enumerate(labels)})
    graph = generate_graph(rules)
    shown = ("a0", "a3", "a7", "a29")
    start = time.process_time()
    found = source_to_sink_paths(graph, Occurrences((shown, shown)), most=64)
    assert time.process_time() - start < 5
    assert len(found.paths) == 64
    assert tuple(one.labels[0] for one in found.paths[0].nodes) == shown
    assert [path.support for path in found.paths[:2]] == [2, 0]
    assert found.left_out == 2**28 - 64
