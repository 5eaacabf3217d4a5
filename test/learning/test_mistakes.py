"""Rows that look like mistakes: found, left out of what is learned from, and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.learning_file import restored, saved
from rebt_ros.learning.mistakes import intended_actions, without_mistakes
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_from

#: Rows of `to_and_fro` in which something else is done than is meant.
WRONG = (7, 33, 52, 95)


def to_and_fro(wrong: tuple[int, ...] = WRONG) -> DemonstrationTable:
    """Three times to and fro between 0 and 10; a wrong step is a step the other way."""
    place, meant, states, chosen = 5.0, 1, [], []
    for row in range(120):
        if place >= 10 or place <= 0:
            meant = 0 if place >= 10 else 1
        states.append(place)
        chosen.append(1 - meant if row in wrong else meant)
        place += 0.5 if chosen[-1] else -0.5
    return DemonstrationTable(
        channel="action",
        features=(Feature("place"),),
        states=np.array(states)[:, np.newaxis],
        actions=("left", "right"),
        chosen=np.array(chosen),
        demonstrations=("only",),
        demonstration=np.zeros(len(chosen), dtype=np.int64),
        stamps=np.arange(len(chosen)),
        row_kind=RowKind.SAMPLE,
    )


def test_steps_the_other_way_are_mistakes() -> None:
    table = to_and_fro()
    intended = intended_actions(table)
    assert tuple(np.flatnonzero(intended != table.chosen)) == WRONG
    assert (intended[list(WRONG)] == 1 - table.chosen[list(WRONG)]).all()


def test_where_nobody_errs_there_are_no_mistakes() -> None:
    table = to_and_fro(())
    assert (intended_actions(table) == table.chosen).all()
    assert without_mistakes(table, table.chosen) is table


def honking(brief: tuple[int, ...]) -> DemonstrationTable:
    """To and fro after thirty rows of honking, with something else for a row now and then."""
    moving = to_and_fro(())
    chosen = np.append(np.full(30, 2), moving.chosen)
    chosen[30 + np.arange(5, 5 + 9 * len(brief), 9)] = brief
    return replace(
        moving,
        actions=("left", "right", "honk"),
        states=np.vstack([np.full((30, 1), -5.0), moving.states]),
        chosen=chosen,
        demonstration=np.zeros(len(chosen), dtype=np.int64),
        stamps=np.arange(len(chosen)),
        previous=None,  # type: ignore[arg-type]
    )


def test_brief_actions_that_are_always_the_same_are_meant() -> None:
    always = honking((2,) * 12)
    assert (intended_actions(always) == always.chosen).all()
    anything = honking((2, 0, 1, 0, 2, 1, 1, 0, 0, 2, 1, 0))
    assert np.count_nonzero(intended_actions(anything) != anything.chosen) >= 6


def test_what_follows_a_mistake_follows_what_was_meant() -> None:
    table = to_and_fro()
    left = without_mistakes(table, intended_actions(table))
    assert len(left) == len(table) - len(WRONG)
    for row in WRONG:
        [after] = np.flatnonzero(left.stamps == row + 1)
        assert left.previous[after] == 1 - table.chosen[row]


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(replace(to_and_fro(), row_kind=RowKind.EVENT), id="events do not last"),
        pytest.param(to_and_fro().where(np.arange(120) < 12), id="few rows tell nothing"),
    ],
)
def test_no_row_is_a_mistake_where(other: DemonstrationTable) -> None:
    assert (intended_actions(other) == other.chosen).all()


@given(st.sets(st.integers(0, 119), max_size=12))
def test_mistakes_make_the_explanation_smaller_and_leave_half_of_each_action(
    wrong: set[int],
) -> None:
    table = to_and_fro(tuple(wrong))
    intended = intended_actions(table)
    mistaken = intended != table.chosen
    assert ((intended >= 0) & (intended < len(table.actions))).all()
    for action in range(len(table.actions)):
        rows = table.chosen == action
        assert np.count_nonzero(mistaken & rows) <= np.count_nonzero(rows) / 2
    if mistaken.any():
        options = FitOptions(vocabulary=Vocabulary(History.PREVIOUS))
        without = fit(without_mistakes(table, intended), options).explanation
        assert without + np.count_nonzero(mistaken) < fit(table, options).explanation


@given(some.tables())
def test_the_explanation_gets_as_many_rows_wrong_as_it_counts(table: DemonstrationTable) -> None:
    fitted = fit(table)
    wrong = int(np.count_nonzero(fitted.explained(table) != table.chosen))
    assert wrong < fitted.explanation <= fitted.leaves + len(table)


def test_mistakes_are_told_and_not_learned_from() -> None:
    learning = learn_from(to_and_fro(), LearnOptions(reaction_time=0.0, psa="never"))
    assert learning.learned.provenance.rows == 120 - len(WRONG)
    [note] = [one for one in learning.notes if "mistakes" in one]
    assert note.startswith("4 of 120 rows look like mistakes and are left out: ")
    assert learning.decision_tree.tree.leaves == 4
    # Judged is what was shown, whether or not it looks like a mistake.
    assert learning.learned.provenance.figures.held_out_rows == 30
    assert (learning.table.previous[0], len(learning.table)) == (NO_ACTION, 120)


def test_whoever_keeps_mistakes_learns_from_everything() -> None:
    options = LearnOptions(leave_out_mistakes=False, reaction_time=0.0)
    learning = learn_from(to_and_fro(), options)
    assert learning.learned.provenance.rows == 120
    assert not any("mistakes" in note for note in learning.notes)


def test_a_saved_learning_knows_its_mistakes() -> None:
    learning = learn_from(to_and_fro(), LearnOptions(reaction_time=0.0))
    kept = saved(learning)
    assert kept is not None
    again = restored(kept)
    assert (again.evidence.intended == learning.evidence.intended).all()
    assert again.learned == learning.learned
    assert again.report == learning.report
