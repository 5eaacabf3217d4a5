"""Exported trees do in BehaviorTree.CPP what they do here."""

from __future__ import annotations

import math
from collections.abc import Iterator
from random import Random

import pytest
import strategies as some
from btcpp_engine import Engine, Ours, Outcomes
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import RowKind

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


def _on(channel: str, node: nodes.Node) -> nodes.Node:
    match node:
        case nodes.Condition():
            return node
        case nodes.Action(label=label):
            return nodes.Action(label, channel)
        case nodes.Inverter(child=child):
            return nodes.Inverter(_on(channel, child))
    children = tuple(_on(channel, child) for child in nodes.children(node))
    if isinstance(node, nodes.Sequence | nodes.Selector):
        return type(node)(children, node.memory)
    return type(node)(children)


ONE_CHANNEL = some.trees().map(_exportable)
#: Of each channel, a tree that acts.
ACTING = ONE_CHANNEL.filter(lambda tree: bool(nodes.actions(tree)))
CHANNELS = st.tuples(ACTING, ACTING).map(
    lambda trees: nodes.Parallel((_on("arm", trees[0]), _on("base", trees[1])))
)
NUMBERS = (-1e30, -0.5, -0.1, 0.0, 0.1, math.nextafter(0.1, 1), 0.2, 0.3, 0.5, 1e30, math.nan)
#: Values of `some.FEATURES`.
VALUES = (NUMBERS, NUMBERS, (0.0, 1.0, math.nan), (0.0, 1.0, 2.0, math.nan))


def _steps(seed: int) -> Iterator[tuple[tuple[float, ...], Outcomes]]:
    """States, some of which stay for a while, and how each action ends in each tick."""
    random = Random(seed)
    state = tuple(map(random.choice, VALUES))
    for _ in range(TICKS):
        if random.random() < 0.6:
            state = tuple(map(random.choice, VALUES))
        yield state, {label: random.choice(ENDINGS) for label in some.LABELS}


def _differences(
    learned: LearnedTree,
    seed: int,
    interrupted_after: int | None = None,
) -> Iterator[str]:
    ours, engine = Ours(learned), Engine(learned)
    for number, (state, outcomes) in enumerate(_steps(seed)):
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


@settings(max_examples=500)
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
