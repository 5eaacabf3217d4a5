"""LAT is the most recent action of the demonstration that differs from the row's own."""

from __future__ import annotations

import numpy as np
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration.last_action import (
    NO_ACTION,
    ActionHistory,
    last_actions,
    previous_actions,
)

#: Codes of actions, demonstration after demonstration.
recordings = st.lists(st.lists(st.integers(0, 3), max_size=12), max_size=4)


def columns(recording: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
    actions = [code for each in recording for code in each]
    numbers = [number for number, each in enumerate(recording) for _ in each]
    return np.array(actions, dtype=np.int64), np.array(numbers, dtype=np.int64)


def by_definition(actions: np.ndarray, demonstrations: np.ndarray) -> list[int]:
    """Paper, III-B, read word by word."""
    last = []
    for row, action in enumerate(actions):
        earlier = [
            int(actions[other])
            for other in range(row)
            if demonstrations[other] == demonstrations[row] and actions[other] != action
        ]
        last.append(earlier[-1] if earlier else NO_ACTION)
    return last


@given(recordings)
def test_the_column_is_the_papers_definition(recording: list[list[int]]) -> None:
    actions, demonstrations = columns(recording)
    assert last_actions(actions, demonstrations).tolist() == by_definition(actions, demonstrations)


@given(recordings)
def test_the_column_equals_a_history_row_by_row(recording: list[list[int]]) -> None:
    noted: list[int] = []
    history = ActionHistory()
    for demonstration in recording:
        history.clear()
        for code in demonstration:
            last = history.before(str(code))
            noted.append(NO_ACTION if last is None else int(last))
            history.take(str(code))
    assert last_actions(*columns(recording)).tolist() == noted


@given(recordings)
def test_the_arguments_stay_as_they_are(recording: list[list[int]]) -> None:
    actions, demonstrations = columns(recording)
    before = actions.copy(), demonstrations.copy()
    last = last_actions(actions, demonstrations)
    assert last.dtype == np.int64
    assert len(last) == len(actions)
    assert (actions == before[0]).all()
    assert (demonstrations == before[1]).all()


@pytest.mark.parametrize(
    ("actions", "demonstrations", "last"),
    [
        ([], [], []),
        ([0], [0], [-1]),
        ([0, 0, 0], [0, 0, 0], [-1, -1, -1]),
        ([0, 1, 1, 0], [0, 0, 0, 0], [-1, 0, 0, 1]),
        ([0, 1, 2, 1], [0, 0, 0, 0], [-1, 0, 1, 2]),
        # A run goes over the border, its LAT does not.
        ([0, 1, 1, 0], [0, 0, 1, 1], [-1, 0, -1, 1]),
        # Numbers of demonstrations that hold no row are skipped.
        ([0, 1, 0, 1], [2, 2, 5, 5], [-1, 0, -1, 0]),
    ],
)
def test_known_columns(actions: list[int], demonstrations: list[int], last: list[int]) -> None:
    codes = np.array(actions, dtype=np.int64), np.array(demonstrations, dtype=np.int64)
    assert last_actions(*codes).tolist() == last


@given(st.lists(st.sampled_from(some.LABELS)), st.lists(st.sampled_from(some.LABELS)))
def test_a_history_answers_with_the_most_recent_other_action(
    taken: list[str], deciding: list[str]
) -> None:
    others = [action for action in taken if action not in deciding]
    assert ActionHistory(taken).before(*deciding) == (others[-1] if others else None)


def test_a_history_without_a_decision_answers_with_the_last_action() -> None:
    assert ActionHistory(["go", "turn", "turn"]).before() == "turn"
    assert ActionHistory().before() is None


def test_a_group_of_actions_that_is_decided_together_looks_past_all_of_them() -> None:
    history = ActionHistory(["wait", "go", "turn", "go"])
    assert history.before("go") == "turn"
    assert history.before("go", "turn") == "wait"
    assert history.before("go", "turn", "wait") is None


def test_a_cleared_history_knows_nothing() -> None:
    history = ActionHistory(["go", "turn"])
    history.clear()
    assert history.before() is None
    assert history.previous is None


@given(st.lists(st.sampled_from(some.LABELS)))
def test_the_previous_action_is_the_one_taken_before_whether_it_differs_or_not(
    taken: list[str],
) -> None:
    assert ActionHistory(taken).previous == (taken[-1] if taken else None)


@given(st.lists(st.tuples(st.booleans(), st.sampled_from(some.LABELS))))
def test_an_action_that_has_begun_is_in_lat_and_not_yet_the_previous_one(
    done: list[tuple[bool, str]],
) -> None:
    history = ActionHistory()
    for ended, label in done:
        (history.take if ended else history.begin)(label)
    begun = [label for _, label in done]
    ended_ones = [label for ended, label in done if ended]
    assert history.previous == (ended_ones[-1] if ended_ones else None)
    assert history.before() == (begun[-1] if begun else None)
    assert history.taken == ActionHistory(begun).taken


@given(
    st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=20).map(
        lambda rows: ([code for code, _ in rows], np.cumsum([anew for _, anew in rows]).tolist())
    )
)
def test_the_previous_action_of_a_row_is_that_of_the_row_before_in_its_demonstration(
    rows: tuple[list[int], list[int]],
) -> None:
    actions, demonstrations = rows
    previous = previous_actions(
        np.array(actions, dtype=np.int64), np.array(demonstrations, dtype=np.int64)
    )
    assert previous.dtype == np.int64
    assert previous.tolist() == [
        actions[row - 1] if row and demonstrations[row - 1] == demonstrations[row] else NO_ACTION
        for row in range(len(actions))
    ]


def test_a_demonstration_may_begin_with_a_last_action() -> None:
    actions, demonstrations = np.array([0, 0, 1, 2, 1]), np.array([0, 0, 0, 1, 1])
    before = np.array([2, NO_ACTION])
    assert last_actions(actions, demonstrations, before).tolist() == [2, 2, 0, NO_ACTION, 2]


def test_a_history_can_be_continued() -> None:
    history = ActionHistory(["turn", "go", "turn"])
    assert history.taken == ("go", "turn")
    assert ActionHistory(history.taken).taken == history.taken
    assert ActionHistory(history.taken).before("turn") == "go"
