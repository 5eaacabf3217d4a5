"""The board: a snapshot and the changes after it are all that a browser needs."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.studio.board import Board, Section

VALUES = st.dictionaries(
    st.sampled_from("abc"), st.none() | st.integers() | st.lists(st.text(max_size=2), max_size=2)
)
STEPS = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["update", "replace"]), st.sampled_from(Section), VALUES),
        st.tuples(st.sampled_from(["take", "join"]), st.none(), st.none()),
    ),
    max_size=30,
)


def apply(shown: dict[str, dict[str, Any]], changes: dict[str, dict[str, Any]]) -> None:
    """What a browser does."""
    for section, values in changes.items():
        for key, value in values.items():
            if value is None:
                shown[section].pop(key, None)
            else:
                shown[section][key] = value


@given(STEPS)
def test_whoever_joins_when_sees_the_same_in_the_end(
    steps: list[tuple[str, Section | None, dict[str, Any] | None]],
) -> None:
    board = Board()
    browsers = [board.snapshot()]
    for what, section, values in [*steps, ("take", None, None)]:
        if what == "join":
            browsers.append(board.snapshot())
        elif what == "take":
            changes = board.take_changes()
            for shown in browsers:
                apply(shown, changes)
        elif section is not None and values is not None:
            getattr(board, what)(section, values)
    assert all(shown == board.snapshot() for shown in browsers)
    assert board.take_changes() == {}


def test_who_reads_is_told_once_until_the_changes_are_taken() -> None:
    board = Board()
    told: list[int] = []
    board.update(Section.VALUES, {"x": 1})
    board.listen(lambda: told.append(1))
    assert told == [1]
    board.update(Section.VALUES, {"x": 2})
    assert told == [1]
    assert board.take_changes() == {"values": {"x": 2}}
    board.update(Section.VALUES, {"x": 2})
    assert told == [1]
    board.update(Section.VALUES, {"x": 3})
    assert told == [1, 1]
