"""A channel carries one command at a time, for runtime, policy, replay and figures alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
import strategies as some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.attaching import resolve
from rebt_ros.learning.evaluation import own_history_choices, teacher_forced_choices
from rebt_ros.learning.named_states import Value
from rebt_ros.learning.options import PsaChoice
from rebt_ros.learning.policy import Policy
from rebt_ros.logic.conditions import LastActionIs, Literal

GO, GRASP, TURN, WAIT = some.ACTIONS


@st.composite
def psa_trees(draw: st.DrawFn) -> nodes.Node:
    """Rules some of which trigger a PSA group that was made a Parallel."""
    several = st.lists(st.sampled_from(some.ACTIONS), min_size=2, max_size=4, unique=True)
    group = several.map(lambda one: resolve(nodes.ParallelSelector(tuple(one)), PsaChoice.PARALLEL))
    asked = st.lists(some.condition_nodes, min_size=1, max_size=2)
    action = st.one_of(st.sampled_from(some.ACTIONS), group)
    rules = draw(st.lists(st.tuples(asked, action), min_size=1, max_size=5))
    root = draw(st.sampled_from((nodes.Selector, nodes.Parallel)))
    return root(tuple(nodes.Sequence((*tests, then)) for tests, then in rules))


def as_measured(state: Sequence[float], features: Sequence[Feature]) -> list[Value]:
    """A row as a policy takes it: categories by their names, None where a value is missing."""
    values: list[Value] = []
    for feature, value in zip(features, state, strict=True):
        if math.isnan(value):
            values.append(None)
        else:
            values.append(feature.categories[int(value)] if feature.categories else value)
    return values


def commanded(tree: nodes.Node, table: DemonstrationTable, kind: RowKind) -> list[int]:
    """What the executor sends in each row, demonstration by demonstration."""
    chosen = []
    for row, state in enumerate(table.states.tolist()):
        if row == 0 or table.demonstration[row] != table.demonstration[row - 1]:
            runtime = TreeRuntime(some.learned(tree, row_kind=kind), tree=executable(tree))
        labels = [one.label for one in runtime.tick(state).commands]
        assert len(labels) <= 1
        chosen.append(table.actions.index(labels[0]) if labels else NO_ACTION)
    return chosen


def chosen_by_policy(tree: nodes.Node, table: DemonstrationTable, kind: RowKind) -> list[int]:
    policy, chosen = Policy(some.learned(tree, row_kind=kind)), []
    for row, state in enumerate(table.states.tolist()):
        if row == 0 or table.demonstration[row] != table.demonstration[row - 1]:
            policy.reset()
        label = policy.act(as_measured(state, table.features))
        chosen.append(NO_ACTION if label is None else table.actions.index(str(label)))
    return chosen


@settings(max_examples=120)
@given(
    st.one_of(psa_trees(), some.trees(max_leaves=8)),
    some.tables(max_rows=25),
    st.sampled_from(RowKind),
)
def test_replay_runtime_and_policy_mean_the_same(
    tree: nodes.Node, table: DemonstrationTable, kind: RowKind
) -> None:
    assume(nodes.actions(tree))
    chosen = own_history_choices(tree, table).tolist()
    assert chosen == commanded(tree, table, kind)
    assert chosen == chosen_by_policy(tree, table, kind)


@pytest.mark.parametrize("kind", RowKind)
def test_of_psa_actions_made_a_parallel_the_best_supported_is_done(kind: RowKind) -> None:
    near = some.at_most("distance", 0.3)
    turned = nodes.Condition(Literal(LastActionIs("turn", ("wait",))))
    group = resolve(some.when(near, then=nodes.ParallelSelector((GO, TURN))), PsaChoice.PARALLEL)
    # What had to leave the channel to another action is no last action either.
    tree = nodes.Selector((group, nodes.Sequence((turned, GRASP)), WAIT))
    table = some.table([(0.0,) * 4, (1.0,) * 4], [0, 3])
    assert own_history_choices(tree, table).tolist() == [0, 3]
    assert commanded(tree, table, kind) == [0, 3]
    assert teacher_forced_choices(group, table).tolist() == [0, NO_ACTION]


def test_a_parallel_of_one_channel_is_one_policy() -> None:
    rules = nodes.Parallel((GO, TURN))
    arm = nodes.Action("lift", "arm")
    assert nodes.policies(rules) == {some.CHANNEL: rules}
    assert nodes.policies(nodes.Parallel((GO, arm))) == {some.CHANNEL: GO, "arm": arm}


def test_what_remembers_a_step_or_takes_several_actions_is_not_reactive() -> None:
    near = nodes.Condition(some.at_most("distance", 0.3))
    for tree, reactive in (
        (nodes.Selector((nodes.Sequence((near, GO)), nodes.Parallel((TURN, WAIT)))), True),
        (nodes.Sequence((near, GO), memory=True), False),
        (nodes.Selector((GO, TURN), memory=True), False),
        (nodes.Repeater((near, GO)), False),
        (nodes.Sequence((GO, TURN)), False),
        (nodes.Inverter(GO), False),
        (nodes.Parallel((nodes.Sequence((near, GO)), TURN)), False),
    ):
        assert nodes.is_reactive(tree) is reactive
