"""Trees that a person changes: every change can be taken back."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import OptionError
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import LearnOptions, PsaChoice, Use
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.logic.conditions import (
    Difference,
    Interval,
    Literal,
    Quantity,
    Threshold,
    WeightedSum,
)
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.studio import draft
from rebt_ros.studio.draft import Change, Draft
from rebt_ros.studio.learning_view import (
    bar_edges,
    changed_rows,
    differences_in_words,
    draft_view,
    histogram,
    learning_view,
    levels_view,
)
from rebt_ros.verification.rules_file import loads as rules


@cache
def learned() -> Learning:
    """A policy with PSA nodes, suggestions and several pruning levels."""
    random = np.random.default_rng(1)

    def row(place: int) -> Row:
        x, y = random.uniform(0, 1, 2)
        label = ("left", "right")[random.integers(2)] if x < 0.3 else "go" if x < y else "stop"
        return Row(place * 10**8, "action", label, None, (x, y))

    features = (Feature("x"), Feature("y"))
    shown = [
        Demonstration.from_rows(name, features, map(row, range(60)), RowKind.EVENT)
        for name in ("one", "two", "three")
    ]
    return learn_from(tabulate(shown)[0], LearnOptions(psa=Use.ALWAYS, delta=0.9))


def a_threshold(learning: Learning) -> tuple[str, float]:
    for path, node in paths.walk(learning.learned.tree):
        if isinstance(node, nodes.Condition) and isinstance(node.literal.condition, Threshold):
            return paths.text_of(path), node.literal.condition.value
    raise AssertionError


def test_a_change_can_be_taken_back_and_made_again() -> None:
    path, value = a_threshold(learned())
    before = Draft.begin(learned())
    after = before.changed("moving it", draft.with_threshold(path, value + 0.1))
    assert (before.undoes, before.redoes) == (None, None)
    assert (after.undoes, after.redoes) == ("moving it", None)
    back = after.undone()
    assert back.learning is before.learning
    assert back.redoes == "moving it"
    assert back.redone().learning is after.learning
    assert after.reset().learning is before.learning
    assert after.reset().undone().learning is after.learning
    with pytest.raises(OptionError, match="nothing to undo"):
        before.undone()
    with pytest.raises(OptionError, match="nothing to redo"):
        after.redone()
    # What was taken back is forgotten once something else is done.
    assert back.changed("removing", draft.removed("0")).redoes is None


KINDS = st.sampled_from(["level", "attach", "detach", "psa", "threshold", "remove", "move"])


def a_change(kind: str, learning: Learning, number: int, by: int) -> Change:
    walked = [paths.text_of(path) for path, _ in paths.walk(learning.learned.tree)]
    path = walked[number % len(walked)]
    offered = [suggestion.id for suggestion in learning.learned.suggestions] or ["none"]
    suggestion = offered[number % len(offered)]
    return {
        "level": draft.chosen_level(number),
        "attach": draft.attached(suggestion),
        "detach": draft.detached(suggestion),
        "psa": draft.resolved(path, PsaChoice.SELECTOR),
        "threshold": draft.with_threshold(path, by / 3),
        "remove": draft.removed(path),
        "move": draft.moved(path, by),
    }[kind]


@settings(max_examples=25)
@given(st.lists(st.tuples(KINDS, st.integers(0, 30), st.integers(-3, 3)), max_size=8))
def test_whatever_is_done_gives_a_valid_tree_or_a_sentence_and_undo_leads_back(
    changes: list[tuple[str, int, int]],
) -> None:
    now, passed = Draft.begin(learned()), []
    for kind, number, by in changes:
        refused = "."
        try:
            after = now.changed(kind, a_change(kind, now.learning, number, by))
        except OptionError as err:
            refused = str(err)
        else:
            passed.append(now)
            now = after
        assert refused.endswith(".")
        view = draft_view(now.learning, learned().learned, None)
        assert len(view["view"]["nodes"]) == nodes.size(now.learning.learned.tree)
    for before in reversed(passed):
        now = now.undone()
        assert dumps(now.learning.learned) == dumps(before.learning.learned)


@pytest.mark.parametrize("path", ["", "9", "0.0.0.0.0.0", "-1", "0.", "x", "0 ", "²"])
def test_a_path_that_leads_nowhere_is_a_sentence(path: str) -> None:
    for change in (draft.removed(path), draft.moved(path, 1), draft.with_threshold(path, 0.5)):
        with pytest.raises(OptionError, match=r"the tree has changed since"):
            Draft.begin(learned()).changed("x", change)


def test_what_changes_is_counted_in_rows_and_told_in_words() -> None:
    before = learned()
    assert changed_rows(before, before.learned) == {"rows": 0, "of": 180, "demonstrations": {}}
    assert list(differences_in_words(before.learned, before.learned)) == []
    assert changed_rows(before, None) is None
    path, value = a_threshold(before)
    after = draft.with_threshold(path, value + 0.2)(before)
    changed = changed_rows(after, before.learned)
    assert changed is not None
    assert 0 < changed["rows"] == sum(changed["demonstrations"].values())
    words = list(differences_in_words(before.learned, after.learned))
    assert any(sentence.startswith("no longer: ") for sentence in words)
    assert any(sentence.startswith("new: ") for sentence in words)


def test_conditions_in_another_order_are_no_change() -> None:
    before = learned().learned

    def turned(node: nodes.Node) -> nodes.Node:
        children = nodes.children(node)
        if not isinstance(node, nodes.Sequence | nodes.Selector):
            return node
        if nodes.actions(node):
            tests = [child for child in children if not nodes.actions(child)]
            rest = [child for child in children if nodes.actions(child)]
            if list(children) == tests + rest:
                children = (*reversed(tests), *rest)
        else:
            children = children[::-1]
        return replace(node, children=tuple(map(turned, children)))

    after = replace(before, tree=turned(before.tree))
    assert after.tree != before.tree
    assert list(differences_in_words(before, after)) == []


def test_rules_are_proven_or_broken_before_anything_is_published() -> None:
    text = "rules:\n- never: go\n  when: x < 0.2\n- never: go\n"
    view = draft_view(learned(), None, rules(text, "rules.yaml"))
    assert [rule["kept"] for rule in view["rules"]] == [True, False]
    assert view["rules"][1]["sentence"].startswith("where ")
    unknown = draft_view(learned(), None, rules("rules:\n- never: fly\n", "r.yaml"))
    assert unknown["rules"][0]["kept"] is None
    assert "fly" in unknown["rules"][0]["sentence"]


def test_rules_of_the_robot_file_are_asked_as_well() -> None:
    robot = parse_robot_file(
        "state: {x: /odom.pose.pose.position.x}\nactions: {action: /action.data}\n"
        "rules:\n- never: go\n  when: x < 0.2\n- never: go\n"
    )
    its = learned()
    learning = replace(its, learned=replace(its.learned, robot=robot))
    assert [rule["kept"] for rule in draft_view(learning, None, None)["rules"]] == [True, False]
    same = rules("rules:\n- never: go\n", "rules.yaml")
    assert [rule["kept"] for rule in draft_view(learning, None, same)["rules"]] == [False, True]


def test_levels_and_recall_are_those_of_what_was_learned() -> None:
    levels = levels_view(learned())
    leaves = [level["leaves"] for level in levels]
    assert leaves == sorted(leaves, reverse=True)
    assert sum(level["chosen"] for level in levels) == 1
    view = learning_view(learned(), levels)
    assert (view["rows"], view["demonstrations"], view["channel"]) == (180, 3, "action")
    assert view["recalls"].keys() == {"go", "left", "right", "stop"}


def test_a_histogram_counts_what_a_condition_compares() -> None:
    path, _ = a_threshold(learned())
    bars = histogram(learned(), path)
    assert bars["quantity"] in {"x", "y"}
    assert sum(map(sum, bars["counts"].values())) == 180
    assert len(bars["edges"]) == len(bars["counts"]["go"]) + 1
    with pytest.raises(OptionError, match=r"no node at 9.*changed since"):
        histogram(learned(), "9")
    action = next(
        path for path, node in paths.walk(learned().learned.tree) if isinstance(node, nodes.Action)
    )
    with pytest.raises(OptionError, match="compares no number"):
        histogram(learned(), paths.text_of(action))


@pytest.mark.parametrize(
    ("quantity", "words"),
    [
        (Difference("x", "y"), "x − y"),
        (WeightedSum((("x", 1.0), ("y", 2.5))), "x + 2.5 × y"),
        ("y", "y"),
    ],
)
def test_a_histogram_is_of_what_is_computed_from_several_features(
    quantity: Quantity, words: str
) -> None:
    its = learned()
    terms = {"y": 1.0} if isinstance(quantity, str) else dict(quantity.terms)
    values = sum(
        weight * its.table.states[:, place]
        for place, name in enumerate(("x", "y"))
        if (weight := terms.get(name))
    )
    bars = histogram(with_condition(its, Interval(quantity, 0.0, 0.5)), "0")
    assert bars["quantity"] == words
    assert (bars["edges"][0], bars["edges"][-1]) == pytest.approx((min(values), max(values)))
    assert {label: sum(counts) for label, counts in bars["counts"].items()} == {
        label: (its.table.chosen == code).sum() for code, label in enumerate(its.table.actions)
    }
    # What was dragged on it counts from then on.
    changed = draft.with_threshold("0", 0.25)(with_condition(its, Threshold(quantity, 0.5)))
    node = paths.node_at(changed.learned.tree, (0,))
    assert node == nodes.Condition(Literal(Threshold(quantity, 0.25)))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False)))
@example([0.0, 5e-324])
@example([-1.7e308, 1.7e308])
def test_a_histogram_of_any_values_has_bars_or_is_refused_in_a_sentence(
    values: list[float],
) -> None:
    try:
        edges = bar_edges(np.array(values), "x")
    except OptionError as err:
        refusal = str(err)
    else:
        assert np.isfinite(edges).all()
        assert edges[0] <= min(values) <= max(values) <= edges[-1]
        return
    assert re.fullmatch(r"(there is no histogram of )?x.*[.]", refusal)


def with_condition(learning: Learning, condition: Threshold | Interval) -> Learning:
    """A policy whose tree begins with a condition."""
    action = next(iter(nodes.actions(learning.learned.tree)))
    tree = nodes.Sequence((nodes.Condition(Literal(condition)), action))
    return learning.edited(lambda _: tree)
