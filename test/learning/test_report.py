"""What a person is told about a learned tree before it drives."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.report import FORECAST, ActionReport, LearningReport, report_on
from rebt_ros.logic.conditions import Literal, PreviousActionIs

GO, GRASP, TURN, WAIT = some.ACTIONS
LEVELS = JudgedLevels(
    np.array([0.0, 0.1]),
    np.array([[[6, 0, 3, 0], [6, 0, 0, 0]]]),
    np.array([[8, 0, 4, 0]]),
    np.array([3, 2]),
    np.array([4, 6]),
)


def reported(
    table: DemonstrationTable,
    tree: nodes.Node = GO,
    history: History = History.NONE,
    levels: JudgedLevels | None = None,
    ccp_alpha: float = 0.0,
) -> LearningReport:
    return report_on(table, tree, history, levels, ccp_alpha)


def rows_of(
    places: list[float], chosen: list[int], demonstration: list[int] | None = None
) -> DemonstrationTable:
    return some.table([(place, 0.0, 0.0, 0.0) for place in places], chosen, demonstration)


def test_each_action_that_was_shown_has_its_rows_and_its_recall() -> None:
    shown = rows_of([float(n) for n in range(12)], [0] * 8 + [2] * 4)
    report = reported(shown, nodes.Selector((TURN, GO)), levels=LEVELS)
    assert [(one.label, one.rows, one.recall, one.taken) for one in report.actions] == [
        ("go", 8, 0.75, True),
        ("turn", 4, 0.75, True),
    ]
    assert report.mean_recall == 0.75
    assert report.agreement == 0.75
    assert report.most_frequent == 8 / 12
    assert report.rows == 12
    assert list(report.notes()) == []


def test_the_figures_are_those_of_the_level_that_was_chosen() -> None:
    shown = rows_of([float(n) for n in range(12)], [0] * 8 + [2] * 4)
    for ccp_alpha in (0.1, 0.5):
        report = reported(shown, GO, levels=LEVELS, ccp_alpha=ccp_alpha)
        assert [one.recall for one in report.actions] == [0.75, 0.0]
        assert report.mean_recall == 0.375
        assert report.agreement == 0.5


@pytest.mark.parametrize(
    ("agreement", "recall", "noted"),
    [
        (0.6, 0.5, True),
        (0.6, 0.54, True),
        (0.6, 0.7, False),
        (0.7, 0.5, False),
        (None, None, False),
    ],
)
def test_a_forecast_no_better_than_the_most_frequent_action_is_noted(
    agreement: float | None, recall: float | None, *, noted: bool
) -> None:
    actions = tuple(ActionReport(label, 5, recall, taken=True) for label in ("go", "turn"))
    report = LearningReport(actions, recall, agreement, 0.7, 0, 0, 10)
    found = [note for note in report.notes() if "always taking the most frequent action" in note]
    assert found == [report.doubt] * noted


def test_an_action_that_the_tree_never_takes_is_named() -> None:
    shown = rows_of([float(n) for n in range(5)], [0, 0, 0, 2, 3])
    shown.chosen[4] = 2
    assert list(reported(shown).notes()) == ["the tree never takes 'turn', which was shown 2 times"]
    shown.chosen[3] = 0
    assert list(reported(shown).notes()) == ["the tree never takes 'turn', which was shown 1 time"]


def test_equal_states_with_different_actions_are_counted() -> None:
    # Three rows at 0.5, of which one differs; two at 0.7 that agree; one alone.
    shown = rows_of([0.5, 0.5, 0.5, 0.7, 0.7, 0.9], [0, 0, 2, 2, 2, 0])
    report = reported(shown, nodes.Selector((TURN, GO)))
    assert report.conflicts == report.conflicts_after_history == 3
    assert list(report.notes()) == [
        "states alone do not decide: in 3 of 6 rows another action was shown in an equal state"
    ]


def test_what_was_done_before_can_decide_instead() -> None:
    shown = rows_of([0.5] * 6, [0, 2, 0, 2, 2, 0])
    tree = nodes.Selector((some.when(Literal(PreviousActionIs("go")), then=TURN), GO))
    with_it = reported(shown, tree, History.PREVIOUS)
    assert (with_it.conflicts, with_it.conflicts_after_history) == (6, 3)
    assert list(with_it.notes()) == [
        "states alone do not decide: in 6 of 6 rows another action was shown in an equal state "
        "(3 also after the same action)"
    ]
    # What the tree may not test decides nothing.
    assert reported(shown, tree).conflicts_after_history == 6


@settings(max_examples=100)
@given(some.tables(max_rows=20), st.sampled_from((History.NONE, History.PREVIOUS)))
def test_conflicts_are_those_of_a_comparison_row_by_row(
    table: DemonstrationTable, history: History
) -> None:
    situations: dict[object, list[int]] = defaultdict(list)
    after: dict[object, list[int]] = defaultdict(list)
    for row, state in enumerate(table.states.tolist()):
        # A missing value is like another, and 0 has two signs.
        key = tuple("missing" if math.isnan(value) else value + 0.0 for value in state)
        situations[key].append(int(table.chosen[row]))
        after[key, int(table.previous[row])].append(int(table.chosen[row]))
    wanted = [
        sum(len(its) for its in groups.values() if len(set(its)) > 1)
        for groups in (situations, after)
    ]
    report = reported(table, history=history)
    assert report.conflicts == wanted[0]
    assert report.conflicts_after_history == wanted[history is History.PREVIOUS]


def test_a_few_conflicts_of_very_many_rows_are_not_mentioned() -> None:
    places = [float(n) for n in range(3000)]
    places[1] = places[0]
    shown = rows_of(places, [0] + [2] * 2999)
    report = reported(shown, nodes.Selector((TURN, GO)))
    assert report.conflicts == 2
    assert list(report.notes()) == []


def test_the_answer_names_the_forecast_what_to_hold_against_it_and_each_recall() -> None:
    shown = rows_of([float(n) for n in range(12)], [0] * 8 + [2] * 4)
    report = reported(shown, GO, levels=LEVELS, ccp_alpha=0.1)
    assert report.in_short() == (
        f"Forecast: 50.0% agreement in cross-validation ({FORECAST}), where always taking the most "
        "frequent action would reach 66.7%; mean recall 37.5%: 0.0% of 'turn', 75.0% of 'go'. "
        "Never taken: 'turn'."
    )
    assert reported(shown).in_short() == (
        "There is no forecast, as there are too few rows; always taking the most frequent action "
        "would reach 66.7%. Never taken: 'turn'."
    )


@pytest.mark.parametrize(
    ("actions", "named"),
    [
        (("GO", "go", "go ", "stop", "turn"), "'GO', 'go', 'go '"),
        (("turn-left", "turn_left", "Turn left", "left"), "'turn-left', 'turn_left', 'Turn left'"),
        (('"go"', "go", "stop"), "'\"go\"', 'go'"),
        (("0", "0.0", "00", "1"), "'0', '0.0', '00'"),
        (("zur\u00fcck", "zuru\u0308ck", "go"), r"'zur\xfcck', 'zuru\u0308ck'"),
        (("vel+1", "vel-1", "turn 1", "turn-1", "nan", "NaNny"), None),
    ],
)
def test_actions_that_may_be_the_same_are_noted(
    actions: tuple[str, ...], named: str | None
) -> None:
    report = LearningReport(
        tuple(ActionReport(one, 1, None, taken=True) for one in actions), None, None, 0.2, 0, 0, 5
    )
    said = f"{named} are different actions: write them alike if they are one"
    assert list(report.notes()) == ([said] if named else [])


def test_nothing_is_said_of_recall_where_nothing_was_judged() -> None:
    report = reported(rows_of([0.0, 1.0], [0, 2]))
    assert report.mean_recall is None
    assert report.agreement is None
    assert {one.recall for one in report.actions} == {None}
    assert report.figures()["mean recall"] == "unknown"
    assert report.as_json()["recall"] == {"go": None, "turn": None}


def test_the_summary_has_the_report(tmp_path: Path) -> None:
    rows = [f"{place / 10},{'go' if place < 20 else 'dock'}" for place in range(40)]
    # The same state once more, with another action.
    rows[10] = "0.9,dock"
    table = tmp_path / "table.csv"
    table.write_text("\n".join(["x,action", *rows]) + "\n", encoding="utf-8")
    result = rebt_ros.learn([table], out=tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    (learning,) = result.learnings
    assert summary["report"] == json.loads(json.dumps(learning.report.as_json()))
    report = summary["report"]
    assert report["rows_of_actions"] == {"dock": 21, "go": 19}
    assert report["most_frequent_action"] == 21 / 40
    assert report["conflicting_rows"] == 2
    assert report["cross_validated_agreement"] == pytest.approx(learning.report.agreement)
    assert any("states alone do not decide: in 2 of 40 rows" in note for note in result.notes)
