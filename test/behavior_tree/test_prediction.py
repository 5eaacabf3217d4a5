"""Prediction on many states at once equals a first tick of the runtime in each of them."""

from __future__ import annotations

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes, prediction
from rebt_ros.behavior_tree.prediction import (
    States,
    as_it_stands,
    choose,
    history_columns,
    triggered,
)
from rebt_ros.behavior_tree.runtime import Tick, TreeRuntime
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs

GO, GRASP, TURN, WAIT = some.ACTIONS

rows = st.lists(some.states, max_size=12)
taken = st.lists(st.sampled_from(some.LABELS), max_size=6)


def values(drawn: list[tuple[float, ...]]) -> np.ndarray:
    return np.array(drawn, dtype=np.float64).reshape(len(drawn), len(some.FEATURES))


def first_ticks(tree: nodes.Node, drawn: list[tuple[float, ...]], earlier: list[str]) -> list[Tick]:
    """What a runtime of its own, with the given history, does in each state."""
    learned = some.learned(tree)
    return [
        TreeRuntime(learned, histories={some.CHANNEL: ActionHistory(earlier)}).tick(state)
        for state in drawn
    ]


@settings(max_examples=120)
@given(some.trees(repeaters=False), rows, taken)
def test_what_is_triggered_is_what_a_first_tick_takes(
    tree: nodes.Node, drawn: list[tuple[float, ...]], earlier: list[str]
) -> None:
    history = as_it_stands(ActionHistory(earlier))
    ticked = triggered(tree, States(some.FEATURES, values(drawn), history))
    assert tuple(ticked) == nodes.actions(tree)
    for row, tick in enumerate(first_ticks(tree, drawn, earlier)):
        assert {action for action, where in ticked.items() if where[row]} == set(tick.actions)


@settings(max_examples=80)
@given(some.trees(repeaters=False), rows, taken)
def test_what_is_chosen_is_the_command_of_a_first_tick(
    tree: nodes.Node, drawn: list[tuple[float, ...]], earlier: list[str]
) -> None:
    states = States(some.FEATURES, values(drawn), as_it_stands(ActionHistory(earlier)))
    chosen = choose(tree, some.ACTIONS, states)
    assert chosen.dtype == np.int64
    for code, tick in zip(chosen.tolist(), first_ticks(tree, drawn, earlier), strict=True):
        assert len(tick.commands) <= 1
        assert code == (some.ACTIONS.index(tick.commands[0]) if tick.commands else NO_ACTION)


@settings(max_examples=60)
@given(some.trees(repeaters=False), rows, st.integers(1, 5), st.data())
def test_many_rows_in_parts_are_like_all_at_once(
    tree: nodes.Node, drawn: list[tuple[float, ...]], size: int, data: st.DataObject
) -> None:
    codes = st.lists(
        st.integers(NO_ACTION, len(some.LABELS) - 1), min_size=len(drawn), max_size=len(drawn)
    )
    previous, last = (np.array(data.draw(codes), dtype=np.int64) for _ in range(2))
    columns = history_columns(some.LABELS, previous, last)
    states = [States(some.FEATURES, values(drawn), columns) for _ in range(4)]
    whole, ticked = choose(tree, some.ACTIONS, states[0]), triggered(tree, states[1])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "_ROWS_AT_A_TIME", size)
        assert choose(tree, some.ACTIONS, states[2]).tolist() == whole.tolist()
        in_parts = triggered(tree, states[3])
    assert {one: where.tolist() for one, where in in_parts.items()} == {
        one: where.tolist() for one, where in ticked.items()
    }


@settings(max_examples=80)
@given(some.rule_trees(), rows, taken)
def test_what_a_tree_of_rules_chooses_is_what_its_tick_takes(
    tree: nodes.Node, drawn: list[tuple[float, ...]], earlier: list[str]
) -> None:
    states = States(some.FEATURES, values(drawn), as_it_stands(ActionHistory(earlier)))
    for code, tick in zip(
        choose(tree, some.ACTIONS, states).tolist(),
        first_ticks(tree, drawn, earlier),
        strict=True,
    ):
        assert tick.actions == (() if code == NO_ACTION else (some.ACTIONS[code],))


@settings(max_examples=60)
@given(some.literals(), some.tables(max_rows=12))
def test_literals_hold_where_their_definition_says_with_the_history_from_columns(
    literal: Literal, table: DemonstrationTable
) -> None:
    columns = history_columns(table.actions, table.previous, table.last)
    satisfied = States(table.features, table.states, columns).satisfy(literal)
    labels = dict(enumerate(table.actions))
    assert satisfied.tolist() == [
        some.holds(literal, state, labels.get(last), labels.get(previous))
        for state, last, previous in zip(
            table.states.tolist(), table.last.tolist(), table.previous.tolist(), strict=True
        )
    ]


def test_a_column_of_lat_is_read_whatever_is_decided() -> None:
    states = States(some.FEATURES, np.zeros((3, 4)), COLUMNS)
    for deciding in ((), ("turn",), ("go", "turn")):
        after_go = Literal(LastActionIs("go", deciding))
        assert states.satisfy(after_go).tolist() == [False, True, False]
        assert states.satisfy(~after_go).tolist() == [True, False, True]


#: First the previous action, then LAT.
COLUMNS = history_columns(("go", "turn"), np.array([1, NO_ACTION, 0]), np.array([NO_ACTION, 0, 1]))


def test_the_previous_action_has_a_column_of_its_own() -> None:
    states = States(some.FEATURES, np.zeros((3, 4)), COLUMNS)
    doing_go = Literal(PreviousActionIs("go"))
    assert states.satisfy(doing_go).tolist() == [False, False, True]
    assert states.satisfy(~doing_go).tolist() == [True, True, False]


@pytest.mark.parametrize("condition", [LastActionIs("grasp"), PreviousActionIs("grasp")])
def test_an_action_that_a_column_does_not_know_was_never_done_before(
    condition: LastActionIs | PreviousActionIs,
) -> None:
    states = States(some.FEATURES, np.zeros((3, 4)), COLUMNS)
    never = Literal(condition)
    assert not states.satisfy(never).any()
    assert states.satisfy(~never).all()


def test_a_history_as_it_stands_tells_the_previous_action_and_lat_apart() -> None:
    history = ActionHistory(["turn", "go"])
    states = States(some.FEATURES, np.zeros((2, 4)), as_it_stands(history))
    assert states.satisfy(Literal(PreviousActionIs("go"))).all()
    assert states.satisfy(Literal(LastActionIs("turn", ("go",)))).all()
    # It has begun, and is in LAT, but nothing has ended since.
    history.begin("wait")
    assert states.satisfy(Literal(PreviousActionIs("go"))).all()
    assert states.satisfy(Literal(LastActionIs("wait"))).all()
    history.clear()
    for condition in (PreviousActionIs("go"), LastActionIs("wait")):
        assert not states.satisfy(Literal(condition)).any()


def test_a_condition_that_is_tested_again_gives_the_same_answer() -> None:
    drawn = values([(0.1, 0, 0, 0), (0.9, 0, 0, 0)])
    states = States(some.FEATURES, drawn, as_it_stands(ActionHistory()))
    near = some.at_most("distance", 0.3)
    twice = nodes.Sequence((some.when(~near, then=GO), some.when(near, then=TURN)))
    triggered(twice, states)
    assert states.satisfy(near).tolist() == [True, False]
    assert states.satisfy(~near).tolist() == [False, True]


@pytest.mark.parametrize(
    ("tree", "chosen"),
    [
        (GO, 0),
        (nodes.Sequence((TURN, GO)), 0),
        (nodes.Selector((TURN, GO)), 2),
        (nodes.ParallelSelector((WAIT, GO)), 3),
        (nodes.Parallel((GRASP, GO)), 1),
        (nodes.Parallel((GRASP, nodes.Sequence((GO, WAIT)))), 1),
        (nodes.Parallel((nodes.Sequence((GRASP, GO)), WAIT)), 0),
        (nodes.Sequence((nodes.Parallel((GRASP, GO)), WAIT)), 3),
        (nodes.Repeater((TURN, WAIT)), 3),
        (nodes.Selector((nodes.Inverter(GRASP), GO)), 0),
        (nodes.Condition(some.at_most("distance", 0.3)), NO_ACTION),
    ],
)
def test_known_trees(tree: nodes.Node, chosen: int) -> None:
    states = States(some.FEATURES, np.zeros((2, 4)), as_it_stands(ActionHistory()))
    assert choose(tree, some.ACTIONS, states).tolist() == [chosen] * 2


def test_no_rows_give_no_choices() -> None:
    states = States(some.FEATURES, np.empty((0, 4)), as_it_stands(ActionHistory()))
    assert choose(GO, some.ACTIONS, states).tolist() == []
    assert len(states) == 0
