"""The policy object does what the executor's tree does, tick by tick, in each of its episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import strategies as some
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import StateEncoder, TreeRuntime, executable
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.lags import with_lags
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError, RebtError
from rebt_ros.learning.named_states import Encoding
from rebt_ros.learning.policy import Decision, Policy
from rebt_ros.logic.conditions import (
    Condition,
    Difference,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
    WeightedSum,
)
from rebt_ros.storage.tree_file import write_tree

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR = some.at_most("distance", 0.3)

#: As `some.FEATURES`, but categories are numbers, as messages send them; and two rows back.
PRESENT = (*some.FEATURES[:3], replace(some.FEATURES[3], categories=("0", "1", "2")))
FEATURES = with_lags(some.table([(0.0,) * 4], [0], features=PRESENT), 2).features

numeric = st.sampled_from(
    (
        "distance",
        "battery",
        "distance[t-1]",
        "battery[t-2]",
        some.DIFFERENCE,
        Difference("distance", "distance[t-1]"),
        some.SUM,
        WeightedSum((("distance", 2.5), ("distance[t-1]", -2.5), ("battery[t-2]", 0.1))),
    )
)
conditions: st.SearchStrategy[Condition] = st.one_of(
    st.builds(Threshold, numeric, st.sampled_from(some.THRESHOLDS)),
    st.builds(IsTrue, st.sampled_from(("docked", "docked[t-1]"))),
    st.builds(HasCategory, st.sampled_from(("kind", "kind[t-2]")), st.sampled_from("012")),
    some.previous_actions,
    some.last_actions(),
)
condition_nodes = st.builds(nodes.Condition, some.literals(conditions))
anything = some.trees(st.one_of(condition_nodes, st.sampled_from(some.ACTIONS)))


@st.composite
def rules(draw: st.DrawFn, channel: str = some.CHANNEL) -> nodes.Node:
    """A Selector over rules with conditions, which takes one action per tick, or none."""
    asked = st.lists(condition_nodes, min_size=1, max_size=2)
    drawn = draw(st.lists(st.tuples(asked, st.sampled_from(some.LABELS)), min_size=1, max_size=5))
    return nodes.Selector(
        tuple(nodes.Sequence((*tests, nodes.Action(then, channel))) for tests, then in drawn)
    )


side_by_side = st.builds(lambda *both: nodes.Parallel(both), rules(), rules("arm"))

#: What messages can hold; 5 is a category that was never shown.
messages = st.tuples(
    some.numbers,
    some.numbers,
    st.sampled_from((0.0, 1.0, math.nan)),
    st.sampled_from((0.0, 1.0, 2.0, 5.0, math.nan)),
)


class Executed:
    """An episode of the executor's tree."""

    def __init__(self, learned: LearnedTree) -> None:
        self._encoder = StateEncoder(learned.features)
        tree = executable(learned.tree)
        self._channels = list(nodes.policies(tree))
        self._runtime = TreeRuntime(learned, tree=tree)

    def act(self, message: Sequence[float]) -> Decision:
        """The command of each channel is what is sent."""
        commands = self._runtime.tick(self._encoder.encode({"state": message})).commands
        latest = {action.channel: action.label for action in commands}
        if len(self._channels) == 1:
            return latest.get(self._channels[0])
        return {channel: latest.get(channel) for channel in self._channels}


@settings(max_examples=200)
@given(
    st.one_of(anything, rules(), side_by_side),
    st.sampled_from(RowKind),
    st.lists(messages, min_size=1, max_size=8),
)
# What an Inverter turns into a failure is not the last action of a tick.
@example(nodes.Selector((nodes.Inverter(nodes.Sequence((GO,))), TURN)), RowKind.EVENT, [(0.0,) * 4])
@example(nodes.Selector((nodes.Repeater((GO, TURN)), WAIT)), RowKind.SAMPLE, [(0.0,) * 4] * 5)
@example(
    nodes.Sequence((GO, TURN, nodes.Condition(NEAR)), memory=True), RowKind.EVENT, [(1.0,) * 4]
)
def test_a_policy_does_what_the_executors_tree_does(
    tree: nodes.Node, kind: RowKind, script: list[tuple[float, ...]]
) -> None:
    assume(nodes.actions(tree))
    learned = some.learned(tree, FEATURES, kind)
    policy, executed = Policy(learned), Executed(learned)
    for message in script:
        assert policy.act(message) == executed.act(message)


@settings(max_examples=100)
@given(st.one_of(anything, rules(), side_by_side), st.integers(1, 4), st.data())
def test_episodes_side_by_side_do_not_know_of_each_other(
    tree: nodes.Node, count: int, data: st.DataObject
) -> None:
    assume(nodes.actions(tree))
    learned = some.learned(tree, FEATURES)
    policy = Policy(learned)
    policy.reset(count)
    executed = [Executed(learned) for _ in range(count)]
    numbers = st.lists(st.integers(0, count - 1), unique=True, max_size=count)
    for _ in range(data.draw(st.integers(1, 6))):
        for anew in (begun := data.draw(numbers)):
            executed[anew] = Executed(learned)
        policy.reset(begun)
        acting = data.draw(numbers)
        states = [data.draw(messages) for _ in acting]
        assert policy.act_many(states, acting) == [
            executed[number].act(state) for number, state in zip(acting, states, strict=True)
        ]
    states = [data.draw(messages) for _ in range(count)]
    assert policy.act_many(states) == [
        one.act(state) for one, state in zip(executed, states, strict=True)
    ]


@given(rules(), st.lists(messages, min_size=1, max_size=5))
def test_a_state_by_names_is_the_state_in_the_order_of_the_features(
    tree: nodes.Node, script: list[tuple[float, ...]]
) -> None:
    ordered, named = (Policy(some.learned(tree, FEATURES)) for _ in range(2))
    assert ordered.features == ("distance", "battery", "docked", "kind")
    for message in script:
        by_name = dict(zip(reversed(ordered.features), reversed(message), strict=True))
        # What is missing need not be named.
        known = {name: value for name, value in by_name.items() if not math.isnan(value)}
        assert ordered.act(message) == named.act(known)


# --- values -----------------------------------------------------------------------------------

CUP = Literal(HasCategory("kind", "cup"))
ONE = Literal(HasCategory("kind", "1"))
DOCKED = Literal(IsTrue("docked"))


@pytest.mark.parametrize(
    ("literal", "values", "holds"),
    [
        (NEAR, {"distance": 0.3}, True),
        (NEAR, {"distance": np.float32(0.25)}, True),
        (NEAR, {"distance": 0}, True),
        (NEAR, {"distance": 0.4}, False),
        (NEAR, {"distance": None}, False),
        (NEAR, {}, False),
        (DOCKED, {"docked": True}, True),
        (DOCKED, {"docked": False}, False),
        (DOCKED, {"docked": 1}, True),
        (CUP, {"kind": "cup"}, True),
        (CUP, {"kind": "box"}, False),
        # Never shown, and so as good as missing.
        (CUP, {"kind": "plate"}, False),
        (CUP, {"kind": None}, False),
        (CUP, {"kind": 1}, False),
        (~CUP, {"kind": "plate"}, True),
        (some.at_most(some.DIFFERENCE, 0.0), {"distance": 1, "battery": 2}, True),
        (some.at_most(some.DIFFERENCE, 0.0), {"distance": 1}, False),
    ],
)
def test_values_are_numbers_truth_values_categories_or_missing(
    literal: Literal, values: dict[str, float | bool | str | None], holds: bool
) -> None:
    policy = Policy(some.learned(some.when(literal, then=GO)))
    assert policy.act(values) == ("go" if holds else None)


@pytest.mark.parametrize(("value", "holds"), [(1, True), (1.0, True), ("1", True), (2.0, False)])
def test_a_number_can_name_a_category(value: float | str, holds: bool) -> None:
    policy = Policy(some.learned(some.when(ONE, then=GO), PRESENT))
    assert policy.act({"kind": value}) == ("go" if holds else None)


# --- what it remembers ------------------------------------------------------------------------

BY_TURNS = nodes.Selector((some.when(Literal(PreviousActionIs("go")), then=TURN), GO))
HERE = (0.0, 0.0, 0.0, "box")


def test_the_previous_action_is_the_one_of_the_step_before_and_none_after_a_reset() -> None:
    policy = Policy(some.learned(BY_TURNS))
    assert [policy.act(HERE) for _ in range(4)] == ["go", "turn", "go", "turn"]
    assert policy.act(HERE) == "go"
    policy.reset()
    assert policy.act(HERE) == "go"


def test_only_the_episodes_that_are_named_begin_anew() -> None:
    policy = Policy(some.learned(BY_TURNS))
    policy.reset(3)
    assert policy.act_many([HERE] * 3) == ["go"] * 3
    policy.reset([1])
    assert policy.act_many([HERE] * 3) == ["turn", "go", "turn"]
    assert policy.act_many([HERE], [1]) == ["turn"]
    # `act` is for the first one.
    assert policy.act(HERE) == "go"


def test_a_step_without_an_action_leaves_the_history_as_it_was() -> None:
    tree = nodes.Selector(
        (some.when(Literal(PreviousActionIs("go")), NEAR, then=TURN), some.when(NEAR, then=GO))
    )
    policy = Policy(some.learned(tree))
    far = (1.0, 0.0, 0.0, "box")
    assert [policy.act(one) for one in (HERE, far, HERE)] == ["go", None, "turn"]


def test_lat_is_remembered_beyond_the_step_before() -> None:
    tree = nodes.Selector((some.when(Literal(LastActionIs("go", ("turn",))), then=TURN), GO))
    policy = Policy(some.learned(tree))
    assert [policy.act(HERE) for _ in range(3)] == ["go", "turn", "turn"]


def test_a_sequence_that_is_gone_through_is_gone_through_again() -> None:
    looping = nodes.Selector(
        (nodes.Sequence((nodes.Condition(NEAR), nodes.Repeater((GO, GRASP, TURN)))), WAIT)
    )
    policy = Policy(some.learned(looping))
    executed = Executed(some.learned(looping))
    script = [(0.0, 0.0, 0.0, 0.0)] * 3 + [(1.0, 0.0, 0.0, 0.0)] + [(0.0, 0.0, 0.0, 0.0)] * 2
    assert [policy.act(one) for one in script] == [executed.act(one) for one in script]


def test_each_channel_has_an_answer() -> None:
    wave = nodes.Action("wave", "arm")
    tree = nodes.Parallel(
        (nodes.Selector((some.when(NEAR, then=GO), TURN)), some.when(NEAR, then=wave))
    )
    policy = Policy(some.learned(tree))
    assert policy.act(HERE) == {some.CHANNEL: "go", "arm": "wave"}
    assert policy.act((1.0, 0.0, 0.0, "box")) == {some.CHANNEL: "turn", "arm": None}
    assert policy.actions == ("go", "turn", "wave")


# --- files and errors -------------------------------------------------------------------------


def test_a_policy_is_public_and_made_from_a_tree_or_its_file(tmp_path: Path) -> None:
    assert rebt_ros.Policy is Policy
    learned = some.learned(BY_TURNS)
    path = tmp_path / "tree.json"
    write_tree(path, learned)
    for tree in (learned, path, str(path)):
        policy = rebt_ros.Policy(tree)
        assert policy.learned == learned
        assert policy.actions == ("turn", "go")
        assert policy.act(HERE) == "go"
    with pytest.raises(RebtError, match=r"nowhere\.json"):
        Policy(tmp_path / "nowhere.json")


@pytest.mark.parametrize(
    ("state", "sentence"),
    [
        (
            {"distance": 1.0, "speed": 2.0},
            "the state has 'speed', which is not a feature of the tree: "
            "it has distance, battery, docked, kind.",
        ),
        (
            {"distance[t-1]": 1.0},
            "the state has 'distance[t-1]', which is not a feature of the tree: "
            "it has distance, battery, docked, kind.",
        ),
        (
            (1.0, 2.0, 3.0),
            "the state has 3 values where the tree has 4 features: "
            "distance, battery, docked, kind.",
        ),
        (
            {"distance": "near"},
            "the feature 'distance' is numeric, not the text 'near'.",
        ),
        ({"docked": "yes"}, "the feature 'docked' is binary, not the text 'yes'."),
    ],
)
def test_a_state_that_does_not_fit_is_refused_in_one_sentence(
    state: dict[str, float | str] | tuple[float, ...], sentence: str
) -> None:
    policy = Policy(some.learned(BY_TURNS, FEATURES))
    with pytest.raises(InputError) as refused:
        policy.act(state)
    assert str(refused.value) == sentence
    # Nothing was done, and nothing is remembered of it.
    assert policy.act((0.0, 0.0, 0.0, 0.0)) == "go"


def test_states_for_other_episodes_than_there_are_are_refused() -> None:
    policy = Policy(some.learned(BY_TURNS))
    with pytest.raises(InputError) as refused:
        policy.act_many([HERE] * 2)
    assert str(refused.value) == (
        "there are 2 states for 1 episodes: call reset with the number of episodes, "
        "and give one state for each."
    )
    policy.reset(2)
    assert policy.act_many([HERE] * 2) == ["go", "go"]


def test_features_of_a_lag_are_read_from_the_steps_before() -> None:
    rising = Literal(Threshold(Difference("x[t-1]", "x"), 0.0))
    (x,) = features = (Feature("x"),)
    lagged = with_lags(some.table([(0.0,)], [0], features=features), 1).features
    assert lagged[0] == x
    assert lagged[1].kind is FeatureKind.NUMERIC
    tree = nodes.Selector((some.when(rising, then=GO), WAIT))
    policy = Policy(some.learned(tree, lagged))
    # At first, nothing is known of the step before.
    assert [policy.act([value]) for value in (1.0, 2.0, 1.5, 1.5)] == ["wait", "go", "wait", "go"]
    policy.reset()
    assert policy.act([3.0]) == "wait"


def test_features_that_all_look_back_have_nothing_to_look_back_at() -> None:
    with pytest.raises(InputError, match="no feature of the current row besides 'x\\[t-1\\]'"):
        Encoding([Feature("x[t-1]", index=0, lag=1)])
