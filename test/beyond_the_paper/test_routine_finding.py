"""Routines that are found in demonstrations, and what becomes of them as suggestions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import strategies as some
from py_trees.common import Status

from rebt_ros.behavior_tree import document, nodes
from rebt_ros.behavior_tree.learned_tree import Suggestion, SuggestionKind
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.beyond_the_paper.routines.finding import find_routines
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.learning.suggesting import suggest
from rebt_ros.logic.conditions import Threshold
from rebt_ros.storage.csv_table import read_csv
from rebt_ros.study.edit_distance.bounds import distance_bounds
from rebt_ros.study.edit_distance.labelled_tree import labelled
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    ExperimentConfig,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
    as_behavior_tree,
)
from rebt_ros.study.simulator.configuration_file import parse_config
from rebt_ros.study.simulator.synthetic_robot import ExperimentRobot, simulate
from rebt_ros.study.subtree_text import one_line

SHARED = Path(__file__).resolve().parents[3] / "shared"
SCITOS = SHARED / "data" / "scitos_g5_24.csv"

SEQUENCE, PARALLEL, PSA = GroupKind.SEQUENCE, GroupKind.PARALLEL, GroupKind.PARALLEL_SELECTOR
REPEATER, SELECTOR = GroupKind.REPEATER, GroupKind.SELECTOR


def group(kind: GroupKind, *children: SimulatedNode) -> Group:
    return Group(kind, children)


def act(number: int) -> Act:
    return Act(f"a{number}")


def below(number: int, threshold: float) -> Check:
    return Check(f"v{number}", threshold)


def above(number: int, threshold: float) -> Inverted:
    return Inverted(below(number, threshold))


SIDE_BY_SIDE = group(
    PARALLEL,
    group(SEQUENCE, act(2), group(PSA, act(1), act(0))),
    group(REPEATER, below(0, 0.5), act(1)),
)
ONE_AFTER_THE_OTHER = group(
    SEQUENCE,
    group(REPEATER, above(1, 0.5), act(1), act(3)),
    group(SEQUENCE, act(0), below(0, 0.6), act(2)),
)
EITHER_OR = group(
    PARALLEL,
    group(SEQUENCE, act(3), group(SELECTOR, below(0, 0.4), below(1, 0.4)), act(0)),
    group(REPEATER, above(2, 0.4), act(1), act(2)),
)


def shown(root: Group, ticks: int, seed: int = 0) -> DemonstrationTable:
    """What a robot with that tree demonstrates."""
    robot = ExperimentRobot(ExperimentConfig("test", root), seed)
    return tabulate([simulate(robot, ticks).demonstration])[0]


@cache
def demonstrated() -> DemonstrationTable:
    return shown(SIDE_BY_SIDE, 6000)


@cache
def found() -> tuple[FoundRoutine, ...]:
    return find_routines(demonstrated())


@cache
def one_after_the_other() -> tuple[FoundRoutine, ...]:
    return find_routines(shown(ONE_AFTER_THE_OTHER, 6000))


def missed(root: Group, routines: Sequence[FoundRoutine]) -> list[str]:
    """Subtrees that are not among the routines exactly, with how near the nearest comes."""
    offered = [tree for one in routines if (tree := labelled(one.subtree)) is not None]
    apart = []
    for simulated in map(as_behavior_tree, root.children):
        wanted = labelled(simulated)
        assert wanted is not None
        nearest = min((distance_bounds(wanted, one).upper for one in offered), default=None)
        if nearest != 0:
            apart.append(f"{one_line(simulated)}: {nearest}")
    return apart


# --- finding ------------------------------------------------------------------------------------


def test_streams_that_run_side_by_side_are_recovered_exactly() -> None:
    assert missed(SIDE_BY_SIDE, found()) == []


def test_streams_that_follow_each_other_are_recovered_exactly() -> None:
    assert missed(ONE_AFTER_THE_OTHER, one_after_the_other()) == []


def test_a_guard_of_two_alternatives_is_recovered_exactly() -> None:
    assert missed(EITHER_OR, find_routines(shown(EITHER_OR, 6000))) == []


def test_sequences_of_which_one_always_follows_the_other_are_recovered_exactly() -> None:
    root = group(
        SEQUENCE,
        group(REPEATER, above(1, 0.5), act(1)),
        group(SEQUENCE, act(0), group(PSA, act(2), act(3))),
        group(SEQUENCE, below(0, 0.6), act(4), act(2)),
    )
    assert missed(root, find_routines(shown(root, 12000))) == []


def test_no_two_routines_differ_in_their_thresholds_alone() -> None:
    for routines in (found(), one_after_the_other()):
        shapes = {re.sub(r"(≤|>) [\d.]+", r"\1", one_line(one.subtree)) for one in routines}
        assert len(shapes) == len(routines)


def test_conditions_have_the_thresholds_and_directions_that_decided() -> None:
    repeater = next(one.subtree for one in found() if isinstance(one.subtree, nodes.Repeater))
    condition, action = repeater.children
    assert action == nodes.Action("a1", demonstrated().channel)
    assert isinstance(condition, nodes.Condition)
    assert condition.literal.positive
    assert isinstance(condition.literal.condition, Threshold)
    assert condition.literal.condition.value == pytest.approx(0.5, abs=0.03)


def test_support_counts_how_often_a_routine_was_gone_through() -> None:
    table = demonstrated()
    done = dict(zip(table.actions, np.bincount(table.chosen).tolist(), strict=True))
    for one in found():
        labels = {action.label for action in nodes.actions(one.subtree)}
        assert 0 < one.support <= min(done[label] for label in labels)
        assert one.support * len(labels) <= one.rows <= sum(done[label] for label in labels)
    # Nothing else does these.
    sequence = next(one for one in found() if isinstance(one.subtree, nodes.Sequence))
    assert sequence.support == pytest.approx(done["a0"], rel=0.15)


def test_routines_of_the_best_program_come_first_and_none_twice() -> None:
    subtrees = [one.subtree for one in found()]
    assert len(set(subtrees)) == len(subtrees)
    kinds = [type(one) for one in subtrees[:2]]
    assert sorted(kind.__name__ for kind in kinds) == ["Repeater", "Sequence"]
    assert found()[0].rows >= found()[1].rows


def test_the_same_rows_give_the_same_routines() -> None:
    first = one_after_the_other()
    assert first
    assert find_routines(shown(ONE_AFTER_THE_OTHER, 6000)) == first


# --- nothing to find ----------------------------------------------------------------------------


def test_where_every_row_has_a_state_of_its_own_there_are_no_routines() -> None:
    draw = np.random.default_rng(1)
    states = draw.random((3000, 2))
    features = (Feature("x"), Feature("y"))
    chosen = np.where(states[:, 0] < 0.5, 0, draw.integers(1, 4, size=3000))
    assert find_routines(some.table(states.tolist(), chosen.tolist(), features=features)) == ()


def test_a_few_equal_states_are_chance() -> None:
    # 4 % of the rows follow another one in its state.
    states = [[float(row - (row % 25 == 1))] for row in range(5000)]
    chosen = [row % 25 if row % 25 < 2 else 2 for row in range(5000)]
    assert find_routines(some.table(states, chosen, features=(Feature("x"),))) == ()


def test_a_few_rows_are_too_few() -> None:
    states = [[float(row // 2)] for row in range(190)]
    table = some.table(states, [row % 2 for row in range(190)], features=(Feature("x"),))
    assert find_routines(table) == ()


def test_one_action_is_no_routine() -> None:
    states = [[float(row // 2)] for row in range(1000)]
    table = some.table(states, [0] * len(states), features=(Feature("x"),))
    assert find_routines(replace(table, actions=("go",))) == ()


# --- suggesting ---------------------------------------------------------------------------------


def offered(
    routines: Sequence[FoundRoutine], options: LearnOptions
) -> tuple[tuple[Suggestion, ...], tuple[str, ...]]:
    table = demonstrated()
    trained = fit(table, FitOptions(vocabulary=some.LAT, max_depth=5)).at(0.0)
    return suggest(table, trained, 0.0, options, routines)


def many_routines(number: int) -> list[FoundRoutine]:
    steps = tuple(nodes.Action(label, "action") for label in ("a0", "a1"))
    return [
        FoundRoutine(nodes.Sequence(steps * (length + 1), memory=True), 5, 10)
        for length in range(number)
    ]


@pytest.mark.parametrize("number", [0, 3, 14])
def test_at_most_twelve_suggestions_are_offered_routines_first(number: int) -> None:
    suggestions, notes = offered(many_routines(number), LearnOptions())
    assert len(suggestions) <= 12
    assert len({one.id for one in suggestions}) == len(suggestions)
    are_routines = [one.kind is SuggestionKind.SEQUENCE for one in suggestions]
    assert are_routines == sorted(are_routines, reverse=True)
    # Places are kept for others.
    assert sum(are_routines) == number if number < 5 else 5 <= sum(are_routines) <= 10
    assert not all(are_routines)
    if number > 12:
        (note,) = notes
        assert "left out" in note


@pytest.mark.parametrize("options", [LearnOptions(routines=False), LearnOptions.paper()])
def test_nothing_is_looked_for_unless_asked_for(options: LearnOptions) -> None:
    some_rows = demonstrated().where(np.arange(len(demonstrated())) < 4000)
    kinds = {one.kind for one in learn_from(some_rows, options).learned.suggestions}
    assert kinds.isdisjoint({SuggestionKind.SEQUENCE, SuggestionKind.REPEATER})


# --- learning and running -----------------------------------------------------------------------


@cache
def learning() -> Learning:
    """Of part of the demonstration, the simplest tree, all routines attached."""
    table = demonstrated().where(np.arange(len(demonstrated())) < 4000)
    return learn_from(
        table,
        LearnOptions(
            psa=Use.NEVER,
            history=History.NONE,
            max_depth=3,
            ccp_alpha=0.0,
            attach=("sequence-1", "repeater-1"),
        ),
    )


def test_routines_are_suggested_and_survive_the_document() -> None:
    learned = learning().learned
    kinds = {one.kind for one in learned.suggestions}
    assert {SuggestionKind.SEQUENCE, SuggestionKind.REPEATER} <= kinds
    assert [one.id for one in learned.suggestions if one.attached] == ["sequence-1", "repeater-1"]
    again = document.loads(document.dumps(learned))
    assert again.suggestions == learned.suggestions
    assert again.tree == learned.tree


class Slow:
    """Needs a tick for each action, and notes what it is told to do."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self._running = ""

    def update(self, action: nodes.Action) -> Status:
        if self._running == action.label:
            self._running = ""
            return Status.SUCCESS
        self._running = action.label
        self.begun.append(action.label)
        return Status.RUNNING

    def halt(self, action: nodes.Action) -> None:
        self._running = ""


def test_an_attached_sequence_runs_step_after_step() -> None:
    learned = learning().learned
    first = next(one for one in learned.suggestions if one.id == "sequence-1")
    assert [action.label for action in nodes.actions(first.subtree)] == ["a2", "a1", "a0"]
    slow = Slow()
    runtime = TreeRuntime(learned, slow, executable(learned.tree))
    for _ in range(3):
        runtime.tick([0.9])
    # The second step, a PSA node, tries its first action.
    assert slow.begun == ["a2", "a1"]


def test_an_attached_repeater_runs_as_long_as_its_condition_holds() -> None:
    learned = learning().learned
    repeater = next(one for one in learned.suggestions if one.id == "repeater-1").subtree
    slow = Slow()
    runtime = TreeRuntime(learned, slow, repeater)
    for _ in range(8):
        tick = runtime.tick([0.2])
        assert tick.status is Status.RUNNING
    assert len(slow.begun) >= 3
    assert set(slow.begun) == {"a1"}
    for _ in range(2):
        tick = runtime.tick([0.9])
    assert tick.status is Status.FAILURE


# --- published configurations -------------------------------------------------------------------


@pytest.mark.skipif(not (SHARED / "experiments").is_dir(), reason="no published configurations")
@pytest.mark.parametrize("name", ["expr40", "expr2"])
def test_subtrees_of_published_configurations_are_recovered_exactly(name: str) -> None:
    text = (SHARED / "experiments" / f"{name}.json").read_text()
    config = parse_config(text, name)
    table = tabulate([simulate(ExperimentRobot(config, 0), 8000).demonstration])[0]
    assert missed(config.root, find_routines(table)) == []


@pytest.mark.skipif(not SCITOS.exists(), reason="no recording of the wall-following robot")
def test_the_wall_following_robot_has_no_routines() -> None:
    table = tabulate([read_csv(SCITOS).demonstration])[0]
    assert find_routines(table) == ()
