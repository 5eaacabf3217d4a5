"""Agreement with a demonstration, the history being the demonstrator's or the tree's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from algorithm_1 import algorithm_1
from hypothesis import given, settings
from hypothesis import strategies as st
from pruned_trees import train

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.evaluation import (
    actions_of,
    agreement,
    decision_tree_choices,
    own_history_choices,
    teacher_forced_choices,
)
from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs
from rebt_ros.paper.rules import leaf_rules

GO, GRASP, TURN, WAIT = some.ACTIONS


def ticked_with_own_history(
    tree: nodes.Node, table: DemonstrationTable, kind: RowKind = RowKind.EVENT
) -> list[int]:
    """A runtime that lives through each demonstration and knows of nothing but its own choices.

    And of what was done before the first one, where the table is part of a larger one.
    """
    chosen = []
    runtime = TreeRuntime(some.learned(tree, row_kind=kind))
    for row, state in enumerate(table.states.tolist()):
        if row == 0 or table.demonstration[row] != table.demonstration[row - 1]:
            history = runtime.histories[some.CHANNEL]
            history.clear()
            if table.previous[row] != NO_ACTION:
                history.previous = table.actions[table.previous[row]]
        actions = runtime.tick(state).actions
        assert len(actions) <= 1
        chosen.append(table.actions.index(actions[0].label) if actions else NO_ACTION)
    return chosen


class OneLastAction(ActionHistory):
    """LAT as a column has it: the same, whatever is decided."""

    last: str | None = None

    def before(self, *deciding: str) -> str | None:
        return self.last


def ticked_with_the_column(tree: nodes.Node, table: DemonstrationTable) -> list[int]:
    chosen = []
    history = OneLastAction()
    runtime = TreeRuntime(some.learned(tree), histories={some.CHANNEL: history})
    labels = dict(enumerate(table.actions))
    for state, last, previous in zip(
        table.states.tolist(), table.last.tolist(), table.previous.tolist(), strict=True
    ):
        history.last, history.previous = labels.get(last), labels.get(previous)
        actions = runtime.tick(state).actions
        chosen.append(table.actions.index(actions[0].label) if actions else NO_ACTION)
    return chosen


@settings(max_examples=150)
@given(some.rule_trees(), some.tables(max_rows=25), st.sampled_from(RowKind))
def test_own_history_choices_are_those_of_a_runtime_that_lives_through_the_rows(
    tree: nodes.Node, table: DemonstrationTable, kind: RowKind
) -> None:
    assert own_history_choices(tree, table).tolist() == ticked_with_own_history(tree, table, kind)


@settings(max_examples=80)
@given(some.rule_trees(), some.tables(max_rows=25), st.data())
def test_a_part_of_a_table_begins_after_what_the_demonstrator_did(
    tree: nodes.Node, table: DemonstrationTable, data: st.DataObject
) -> None:
    first = data.draw(st.integers(0, len(table)))
    part = table.where(np.arange(len(table)) >= first)
    assert own_history_choices(tree, part).tolist() == ticked_with_own_history(tree, part)


@settings(max_examples=80)
@given(
    some.tables(min_rows=2, max_rows=25),
    some.tables(max_rows=25),
    st.sampled_from((Vocabulary(), some.PREVIOUS, some.EVERYTHING)),
    st.sampled_from((0.0, 0.02)),
)
def test_a_decision_tree_chooses_after_its_own_choices_what_its_behavior_trees_choose(
    table: DemonstrationTable,
    other: DemonstrationTable,
    vocabulary: Vocabulary,
    ccp_alpha: float,
) -> None:
    trained = train(table, vocabulary=vocabulary, ccp_alpha=ccp_alpha)
    rules = leaf_rules(trained.tree, lambda leaf: (leaf.most_probable,))
    for rows in (table, other, other.where(np.arange(len(other)) > 0)):
        chosen = decision_tree_choices(trained.predict, trained.vocabulary.history, rows).tolist()
        for tree in (algorithm_1(trained.tree, delta=None), reduced_tree(rules)):
            assert chosen == own_history_choices(tree, rows).tolist()


def test_of_a_decision_tree_that_tests_lat_there_are_no_such_choices() -> None:
    table = rows_of([0, 2, 0, 2])
    trained = train(table, vocabulary=some.LAT)
    with pytest.raises(ValueError, match="LAT depends on the rule that asks"):
        decision_tree_choices(trained.predict, trained.vocabulary.history, table)


@settings(max_examples=80)
@given(some.rule_trees(), some.tables(max_rows=25))
def test_teacher_forced_choices_are_those_of_a_runtime_that_is_told_the_column(
    tree: nodes.Node, table: DemonstrationTable
) -> None:
    assert teacher_forced_choices(tree, table).tolist() == ticked_with_the_column(tree, table)


@settings(max_examples=80)
@given(some.rule_trees(), some.tables(max_rows=25))
def test_without_conditions_on_what_was_done_both_are_the_same(
    tree: nodes.Node, table: DemonstrationTable
) -> None:
    conditions = [one.literal.condition for one in nodes.conditions(tree)]
    if not any(isinstance(one, PreviousActionIs | LastActionIs) for one in conditions):
        assert (own_history_choices(tree, table) == teacher_forced_choices(tree, table)).all()


def last(action: str, *deciding: str) -> Literal:
    return Literal(LastActionIs(action, deciding))


#: Turns after going, and goes otherwise.
COPYCAT = nodes.Selector((some.when(last("go", "turn"), then=TURN), GO))


#: The same of the previous action: turns after going, and goes otherwise.
ALTERNATING = nodes.Selector((some.when(Literal(PreviousActionIs("go")), then=TURN), GO))


def rows_of(chosen: list[int], demonstration: list[int] | None = None) -> DemonstrationTable:
    return some.table([(0.0,) * 4] * len(chosen), chosen, demonstration)


@pytest.mark.parametrize(
    ("demonstration", "own", "forced"),
    [
        # Shown: go, go, turn, go; LAT by the column: none, none, go, turn.
        ([0, 0, 0, 0], [0, 2, 2, 2], [0, 0, 2, 0]),
        # Each demonstration starts without a history.  LAT: none, none | none, turn.
        ([0, 0, 1, 1], [0, 2, 0, 2], [0, 0, 0, 0]),
    ],
)
def test_the_copycat_problem(demonstration: list[int], own: list[int], forced: list[int]) -> None:
    table = rows_of([0, 0, 2, 0], demonstration)
    assert own_history_choices(COPYCAT, table).tolist() == own
    assert teacher_forced_choices(COPYCAT, table).tolist() == forced


@pytest.mark.parametrize(
    ("demonstration", "own", "forced"),
    [
        # Shown: go, go, turn, go; before that: none, go, go, turn.
        ([0, 0, 0, 0], [0, 2, 0, 2], [0, 2, 2, 0]),
        # Each demonstration starts without a history.  Before: none, go | none, turn.
        ([0, 0, 1, 1], [0, 2, 0, 2], [0, 2, 0, 0]),
    ],
)
def test_after_the_demonstrators_previous_action_and_after_its_own(
    demonstration: list[int], own: list[int], forced: list[int]
) -> None:
    table = rows_of([0, 0, 2, 0], demonstration)
    assert own_history_choices(ALTERNATING, table).tolist() == own
    assert teacher_forced_choices(ALTERNATING, table).tolist() == forced


def test_what_was_done_before_a_correction_is_lat_but_not_the_previous_action() -> None:
    corrected = replace(rows_of([2, 2]), before=np.array([0]))
    assert own_history_choices(ALTERNATING, corrected).tolist() == [0, 2]
    assert teacher_forced_choices(ALTERNATING, corrected).tolist() == [0, 0]
    assert own_history_choices(COPYCAT, corrected).tolist() == [2, 2]


def test_a_row_without_a_choice_leaves_the_history_as_it_was() -> None:
    near = some.at_most("distance", 0.3)
    # Turns after going; far away it does nothing at all.
    tree = nodes.Selector(
        (some.when(near, last("go", "turn"), then=TURN), some.when(near, then=GO))
    )
    states = [(0.1, 0, 0, 0), (0.9, 0, 0, 0), (0.9, 0, 0, 0), (0.1, 0, 0, 0)]
    table = some.table(states, [0, 0, 0, 0])
    assert own_history_choices(tree, table).tolist() == [0, NO_ACTION, NO_ACTION, 2]


def test_lat_of_a_group_reaches_back_beyond_the_group() -> None:
    # Waits once, and from then on goes and turns by turns: LAT of the pair stays "wait".
    pair = last("wait", "go", "turn")
    tree = nodes.Selector(
        (
            some.when(pair, last("go", "turn"), ~last("turn", "go"), then=TURN),
            some.when(pair, then=GO),
            WAIT,
        )
    )
    table = rows_of([0] * 6)
    own = own_history_choices(tree, table).tolist()
    assert own == ticked_with_own_history(tree, table)
    assert own == [3, 0, 2, 0, 0, 0]


def test_agreement_is_the_share_of_equal_rows() -> None:
    table = rows_of([0, 1, 2, 3])
    assert agreement(table.chosen, table) == 1.0
    assert agreement(np.array([0, 1, 0, NO_ACTION]), table) == 0.5
    assert agreement(np.array([NO_ACTION] * 4), table) == 0.0
    nothing = table.where(np.zeros(4, dtype=bool))
    assert agreement(nothing.chosen, nothing) is None


def test_the_actions_of_a_table_are_on_its_channel_in_the_order_of_its_codes() -> None:
    assert actions_of(rows_of([0])) == some.ACTIONS


def test_no_rows_give_no_choices() -> None:
    nothing = rows_of([])
    for tree in (GO, COPYCAT, ALTERNATING):
        assert own_history_choices(tree, nothing).tolist() == []
        assert teacher_forced_choices(tree, nothing).tolist() == []


def test_a_correction_is_judged_with_what_the_robot_did_before_it() -> None:
    after_turn = nodes.Condition(Literal(LastActionIs("turn", ("go",))))
    tree = nodes.Selector((nodes.Sequence((after_turn, GO)), WAIT))
    shown = some.table([(0.0, 0.0, 0.0, 0.0)] * 2, [0, 0])
    assert own_history_choices(tree, shown).tolist() == [3, 3]
    corrected = replace(shown, before=np.array([2]))
    assert own_history_choices(tree, corrected).tolist() == [0, 0]
