"""Exported trees do in BehaviorTree.CPP what they do here."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
import strategies as some
from btcpp_engine import Engine, Ours, Outcomes
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import DocumentError
from rebt_ros.export.btcpp import to_btcpp
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)

pytest.importorskip("behaviortreepy", reason="needs behaviortreepy, the engine in Python")

#: Ticks of one tree.
TICKS = 40
ENDINGS = (Status.RUNNING, Status.RUNNING, Status.SUCCESS, Status.FAILURE)


def _exportable(node: nodes.Node) -> nodes.Node:
    """The tree with Sequences instead of Parallels of what can run."""
    match node:
        case nodes.Condition() | nodes.Action():
            return node
        case nodes.Inverter(child=child):
            return nodes.Inverter(_exportable(child))
    children = tuple(map(_exportable, nodes.children(node)))
    match node:
        case nodes.Sequence(memory=memory) | nodes.Selector(memory=memory):
            return type(node)(children, memory)
        case nodes.Parallel() if any(
            isinstance(one, nodes.Action | nodes.Repeater) for one in nodes.walk(node)
        ):
            return nodes.Sequence(children)
    return type(node)(children)


ONE_CHANNEL = some.trees().map(_exportable)
#: Of each channel, a tree that acts.
ACTING = ONE_CHANNEL.filter(lambda tree: bool(nodes.actions(tree)))
CHANNELS = st.tuples(ACTING, ACTING).map(
    lambda trees: nodes.Parallel(
        (some.on_channel("arm", trees[0]), some.on_channel("base", trees[1]))
    )
)


def _values(feature: Feature, tree: nodes.Node) -> list[float]:
    """Values on all sides of what a tree tests, and a missing one."""
    if feature.categories:
        return [*map(float, range(len(feature.categories))), math.nan]
    found = [0.0, 1.0, -1e30, 1e30, math.nan]
    for node in nodes.conditions(tree):
        match node.literal.condition:
            case Threshold(value=end) | Interval(at_most=end):
                found += [math.nextafter(end, -math.inf), end, math.nextafter(end, math.inf)]
    return [value for value in found if not math.isinf(value)]


def _steps(learned: LearnedTree, seed: int) -> Iterator[tuple[tuple[float, ...], Outcomes]]:
    """States, some of which stay for a while, and how each action ends in each tick."""
    random = Random(seed)
    values = [_values(feature, learned.tree) for feature in learned.features]
    state = tuple(map(random.choice, values))
    for _ in range(TICKS):
        if random.random() < 0.6:
            state = tuple(map(random.choice, values))
        yield state, {action.label: random.choice(ENDINGS) for action in learned.actions}


def _differences(
    learned: LearnedTree,
    seed: int,
    interrupted_after: int | None = None,
    text: str | None = None,
) -> Iterator[str]:
    ours, engine = Ours(learned), Engine(learned, text)
    for number, (state, outcomes) in enumerate(_steps(learned, seed)):
        (wanted, status), (done, its) = ours.tick(state, outcomes), engine.tick(state, outcomes)
        if wanted != done:
            yield f"tick {number}: {wanted} here, {done} there"
        # Trees side by side never end.
        if len(nodes.policies(learned.tree)) < 2 and status != its:
            yield f"tick {number}: {status} here, {its} there"
        if number == interrupted_after and (before := ours.interrupt()) != (
            after := engine.interrupt()
        ):
            yield f"interrupted: {before} here, {after} there"


#: Random trees; more for a campaign.
TREES = int(os.environ.get("REBT_ROS_BTCPP", "500"))


@settings(max_examples=TREES)
@given(
    ONE_CHANNEL | CHANNELS, st.integers(0, 10**6), st.sampled_from(RowKind), st.integers(0, TICKS)
)
def test_both_engines_tick_the_same_actions(
    tree: nodes.Node,
    seed: int,
    row_kind: RowKind,
    interrupted_after: int,
) -> None:
    learned = some.learned(tree, row_kind=row_kind)
    assert list(_differences(learned, seed, interrupted_after)) == []


@settings(max_examples=60)
@given(some.learned_trees(), st.integers(0, 10**6))
def test_both_engines_agree_whatever_things_are_called(learned: LearnedTree, seed: int) -> None:
    learned = replace(learned, tree=_exportable(learned.tree), suggestions=())
    try:
        to_btcpp(learned)
    except DocumentError:
        return
    assert list(_differences(learned, seed)) == []


GO, TURN, WAIT = map(some.action, ("go", "turn", "wait"))
NEAR, KNOWN_CUP = Literal(Threshold("distance", 0.3)), Literal(HasCategory("kind", "cup"))
AFTER_GO, LAST_GO = Literal(PreviousActionIs("go")), Literal(LastActionIs("go", ("turn",)))


@pytest.mark.parametrize(
    ("tree", "right", "wrong"),
    [
        pytest.param(
            nodes.Selector((some.when(NEAR, then=GO), TURN)),
            "ReactiveFallback",
            "Fallback",
            id="memory of a Selector",
        ),
        pytest.param(
            some.when(NEAR, then=GO), "ReactiveSequence", "Sequence", id="memory of a Sequence"
        ),
        pytest.param(
            some.when(NEAR, then=GO), " &amp;&amp; !(distance &gt; 0.3)", "", id="missing numbers"
        ),
        pytest.param(
            nodes.Selector((some.when(KNOWN_CUP, then=GO), TURN)), "==", "!=", id="categories"
        ),
        pytest.param(
            nodes.Selector((nodes.Repeater((GO, WAIT)), TURN)),
            "KeepRunningUntilFailure",
            "ForceSuccess",
            id="Repeater",
        ),
        pytest.param(
            nodes.Selector((some.when(AFTER_GO, then=TURN), GO)),
            "_previous_action := _ended",
            "_previous_action := _running",
            id="previous action",
        ),
        pytest.param(
            nodes.Selector((some.when(LAST_GO, then=TURN), some.when(NEAR, then=GO), WAIT)),
            "_last_action_before_turn := _next_last_action_before_turn",
            "_next_last_action_before_turn := ''",
            id="last action",
        ),
    ],
)
def test_a_wrong_mapping_is_noticed(tree: nodes.Node, right: str, wrong: str) -> None:
    learned = some.learned(tree)
    text = to_btcpp(learned)
    assert right in text
    assert not any(list(_differences(learned, seed)) for seed in range(10))
    broken = text.replace(right, wrong)
    assert any(list(_differences(learned, seed, text=broken)) for seed in range(10))


def _factory(learned: LearnedTree, done: list[str]) -> Any:
    import behaviortreepy

    factory = behaviortreepy.BehaviorTreeFactory()
    for action in nodes.actions(learned.tree):

        def carry_out(node: Any, label: str = action.label) -> Any:
            done.append(label)
            return behaviortreepy.NodeStatus.SUCCESS

        factory.register_simple_action(action.label, carry_out)
    return factory


def test_it_is_a_part_of_a_larger_tree_as_the_docs_say() -> None:
    learned = some.learned(
        nodes.Selector((some.when(AFTER_GO, then=TURN), some.when(NEAR, then=GO), WAIT))
    )
    done: list[str] = []
    factory = _factory(learned, done)
    factory.register_behavior_tree_from_text(to_btcpp(learned))
    page = (Path(__file__).resolve().parents[2] / "docs/export.md").read_text(encoding="utf-8")
    [part] = re.findall(r"`(<SubTree [^`]*)`", page)
    factory.register_behavior_tree_from_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="Robot">{part}</BehaviorTree></root>'
    )
    tree = factory.create_tree("Robot")
    tree.root_blackboard().set_double("distance", 0.1)
    for _ in range(3):
        tree.tick_exactly_once()
    tree.root_blackboard().set_double("distance", 0.9)
    tree.tick_exactly_once()
    tree.tick_exactly_once()
    assert done == ["go", "turn", "go", "turn", "wait"]
    # What it remembers is its own.
    assert set(tree.root_blackboard().get_keys()) == {"distance"}


def test_a_variable_that_was_never_set_stops_the_tree_with_its_name() -> None:
    learned = some.learned(some.when(NEAR, then=GO))
    tree = _factory(learned, []).create_tree_from_text(to_btcpp(learned))
    with pytest.raises(RuntimeError, match="distance"):
        tree.tick_exactly_once()
