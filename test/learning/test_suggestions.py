"""Suggested subtrees: what is offered, and what happens when it is accepted."""

from __future__ import annotations

from dataclasses import replace

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from lat_examples import c, followers, rule
from lat_runs import CONDITIONS, Script, repeater, run, sequence
from pruned_trees import train

from rebt_ros.behavior_tree import document, nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Root, Suggestion, SuggestionKind, Unit
from rebt_ros.behavior_tree.wording import how_often
from rebt_ros.errors import OptionError
from rebt_ros.learning import suggesting
from rebt_ros.learning.attaching import attach, going_on_after_loops, mark, resolve
from rebt_ros.learning.options import ALL, LearnOptions, PsaChoice
from rebt_ros.learning.suggestions import lat_suggestions, psa_suggestions
from rebt_ros.paper.lat_trees import gen_lat_trees

RULES = [
    rule("a", [c(0)], support=3),
    rule(("b", "d"), [c(1)], support=5),
    rule(("e", "a"), [c(2), c(3)], [c(2), c(4)], support=9),
]
FIRST, SECOND, THIRD = (
    Suggestion(f"lat-sequence-{place}", SuggestionKind.LAT_SEQUENCE, 0, sequence(label))
    for place, label in enumerate("abd", start=1)
)
OFFERED = (FIRST, SECOND, THIRD)
MAIN = nodes.Selector((some.when(c(0), then=some.action("a")), some.action("b")))


# --- offering -----------------------------------------------------------------------------------


def test_each_rule_with_several_actions_is_a_psa_suggestion_the_best_supported_first() -> None:
    first, second = psa_suggestions(RULES)
    group = nodes.ParallelSelector((some.action("e"), some.action("a")))
    alternatives = nodes.Selector((nodes.Condition(c(3)), nodes.Condition(c(4))))
    assert first == Suggestion(
        "psa-1",
        SuggestionKind.PSA,
        9,
        nodes.Sequence((nodes.Condition(c(2)), alternatives, group)),
    )
    assert (second.id, second.support) == ("psa-2", 5)


def test_sequences_and_repeaters_are_counted_by_kind_in_the_order_of_their_support() -> None:
    rules = followers({"a": "", "b": "a", "d": "a", "x": "y", "y": "x"})
    trees = gen_lat_trees(rules, (tuple("ad"), tuple("xyxy"), tuple("ad"))).trees
    offered = lat_suggestions(trees)
    assert [(one.id, one.kind, one.support) for one in offered] == [
        ("lat-sequence-1", SuggestionKind.LAT_SEQUENCE, 2),
        ("lat-repeater-1", SuggestionKind.LAT_REPEATER, 1),
        ("lat-sequence-2", SuggestionKind.LAT_SEQUENCE, 0),
    ]
    assert [one.subtree for one in offered] == [one.subtree for one in trees]
    assert not any(one.attached for one in offered)


def test_suggestions_survive_the_document() -> None:
    rules = followers({"a": "be", "b": "a", "d": "ab", "e": ""})
    offered = (*psa_suggestions(RULES), *lat_suggestions(gen_lat_trees(rules).trees))
    actions = tuple(map(some.action, "abde"))
    learned = LearnedTree(CONDITIONS, actions, MAIN, some.PROVENANCE, offered)
    assert document.loads(document.dumps(learned)) == learned


# --- attaching ----------------------------------------------------------------------------------


def test_what_is_attached_stands_behind_the_rules_in_the_order_of_the_suggestions() -> None:
    attached = attach(MAIN, OFFERED, ["lat-sequence-3", "lat-sequence-1"])
    assert attached == nodes.Selector((*MAIN.children, FIRST.subtree, THIRD.subtree))


def test_all_are_attached_unless_told_otherwise() -> None:
    everything = (*MAIN.children, *(one.subtree for one in OFFERED))
    assert attach(MAIN, OFFERED) == attach(MAIN, OFFERED, [ALL]) == nodes.Selector(everything)
    parallel = nodes.Parallel(MAIN.children)
    assert attach(parallel, OFFERED) == nodes.Parallel(everything)


def test_what_is_attached_in_front_comes_before_the_rules() -> None:
    attached = attach(MAIN, OFFERED, ["lat-sequence-2"], in_front=True)
    assert attached == nodes.Selector((SECOND.subtree, *MAIN.children))


def test_a_main_tree_of_one_rule_gets_a_root() -> None:
    single = some.when(c(0), then=some.action("a"))
    assert attach(single, [FIRST], root=Root.PARALLEL) == nodes.Parallel((single, FIRST.subtree))
    assert attach(single, [FIRST]) == nodes.Selector((single, FIRST.subtree))


def test_nothing_to_attach_leaves_the_tree_as_it_is() -> None:
    for tree in (MAIN, some.when(c(0), then=some.action("a")), some.action("a")):
        assert attach(tree, OFFERED, []) == tree
        assert attach(tree, []) == tree


def test_what_is_attached_already_is_not_attached_again() -> None:
    assert attach(MAIN, mark(OFFERED, [ALL])) == MAIN


def test_marking_tells_what_is_attached() -> None:
    marked = mark(OFFERED, ["lat-sequence-2"])
    assert marked == (FIRST, replace(SECOND, attached=True), THIRD)
    assert all(one.attached for one in mark(marked, [ALL]))


def test_an_unknown_id_is_refused_with_those_that_there_are() -> None:
    for refused in (attach, lambda _, offered, ids: mark(offered, ids)):
        with pytest.raises(OptionError) as refusal:
            refused(MAIN, OFFERED, ["lat-sequence-1", "lat-sequence-9"])
        assert str(refusal.value) == (
            "there is no suggestion 'lat-sequence-9' to attach: "
            "choose one of lat-sequence-1, lat-sequence-2, lat-sequence-3, or all."
        )
    with pytest.raises(OptionError, match="nothing was suggested"):
        attach(MAIN, [], ["psa-1"])


# --- PSA nodes ----------------------------------------------------------------------------------


@given(some.trees(), st.sampled_from(PsaChoice))
def test_resolving_turns_psa_nodes_into_the_choice_and_leaves_all_else(
    tree: nodes.Node, choice: PsaChoice
) -> None:
    chosen = {PsaChoice.SELECTOR: nodes.Selector, PsaChoice.PARALLEL: nodes.Parallel}[choice]
    resolved = resolve(tree, choice)
    for before, after in zip(nodes.walk(tree), nodes.walk(resolved), strict=True):
        if isinstance(before, nodes.ParallelSelector):
            assert type(after) is chosen
        elif not nodes.children(before):
            assert after == before
        else:
            assert type(after) is type(before)
            assert getattr(after, "memory", None) == getattr(before, "memory", None)


# --- Repeaters in Sequences ---------------------------------------------------------------------

LOOP = repeater(c(0), "a", c(1), "b")


def test_a_sequence_goes_on_after_its_loop_only_when_asked_to() -> None:
    tree = sequence(LOOP, c(2), "d")
    # The loop runs once, and cannot begin again.
    states = [{0}, {1}, {2}, {2}, {2}]
    as_printed, _ = run(tree, *states)
    going_on, _ = run(going_on_after_loops(tree), *states)
    assert as_printed.begun == ["a", "b"]
    assert going_on.begun == ["a", "b", "d"]


def test_a_loop_that_holds_a_loop_starts_again_only_when_asked_to() -> None:
    tree = repeater(LOOP, c(2), "d")
    # a, b, a, and then b's condition fails, so that d is next; then all of it again.
    states = [{0}, {1}, {1}, {0}, {2}, {2}, {0}, {0}]
    going_on, _ = run(going_on_after_loops(tree), *states)
    assert going_on.begun == ["a", "b", "a", "d", "a"]
    assert "d" not in run(tree, *states)[0].begun


def test_a_loop_at_the_end_of_a_sequence_needs_nothing() -> None:
    tree = sequence(c(0), "a", LOOP)
    assert going_on_after_loops(tree) == tree


@given(some.trees())
def test_going_on_after_loops_changes_nothing_where_there_are_none(tree: nodes.Node) -> None:
    if not any(isinstance(one, nodes.Repeater) for one in nodes.walk(tree)):
        assert going_on_after_loops(tree) == tree


def test_the_script_of_these_tests_runs_an_action_for_one_tick() -> None:
    script, statuses = run(some.action("a"), set(), set())
    assert isinstance(script, Script)
    assert [status.name for status in statuses] == ["RUNNING", "SUCCESS"]


def test_support_has_a_unit_and_all_kinds_are_compared_by_rows() -> None:
    two = nodes.Sequence((nodes.Action("a", "action"), nodes.Action("b", "action")))
    psa = Suggestion("psa-1", SuggestionKind.PSA, 5, nodes.ParallelSelector(two.children))
    others = [Suggestion("x", kind, 3, two) for kind in SuggestionKind if kind is not psa.kind]
    assert (psa.kind.unit, psa.rows, how_often(psa)) == (Unit.ROW, 5, "in 5 rows")
    for one in others:
        assert (one.kind.unit, one.rows, how_often(one)) == (Unit.TIME, 6, "3 times")
    assert how_often(replace(psa, support=1)) == "in 1 row"
    assert how_often(replace(others[0], support=1)) == "1 time"


@pytest.mark.parametrize("paper", [True, False])
def test_suggestions_of_all_kinds_are_ranked_by_the_rows_that_show_them(
    monkeypatch: pytest.MonkeyPatch, paper: bool
) -> None:
    three = tuple(nodes.Action(label, "action") for label in "abc")
    offered = (
        Suggestion("psa-1", SuggestionKind.PSA, 8, nodes.ParallelSelector(three)),
        Suggestion("psa-2", SuggestionKind.PSA, 4, nodes.ParallelSelector(three[1:])),
        Suggestion("lat-sequence-1", SuggestionKind.LAT_SEQUENCE, 3, nodes.Sequence(three)),
        Suggestion("lat-repeater-1", SuggestionKind.LAT_REPEATER, 2, nodes.Repeater(three[:1])),
    )
    monkeypatch.setattr(suggesting, "_MOST_SUGGESTIONS", 3)
    monkeypatch.setattr(suggesting, "_of_rules", lambda *arguments: (offered, frozenset(), 0))
    table = some.table([(0.0,) * 4, (1.0,) * 4], [0, 1])
    options = LearnOptions.paper() if paper else LearnOptions()
    found, notes = suggesting.suggest(table, train(table), 0.0, options)
    if paper:
        # It offers all there is, in the order of the algorithms.
        assert (found, notes) == (offered, ())
    else:
        assert [one.id for one in found] == ["lat-sequence-1", "psa-1", "psa-2"]
        assert notes == ("1 more, less supported suggestions are left out",)
