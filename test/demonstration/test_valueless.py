"""Features of messages that have no value in a whole demonstration."""

from __future__ import annotations

from math import nan

import pytest

from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.valueless import valueless


def _shown(name: str, topic: str | None, states: list[tuple[float, float]]) -> Demonstration:
    places = (None, None) if topic is None else (0, 1)
    features = tuple(
        Feature(one, topic=topic, index=place)
        for one, place in zip(("left", "right"), places, strict=True)
    )
    rows = [Row(place, "action", "go", None, state) for place, state in enumerate(states)]
    return Demonstration.from_rows(name, features, rows, RowKind.EVENT)


@pytest.mark.parametrize(
    ("topic", "states", "where"),
    [
        ("/scan", [[(nan, 1.0), (nan, 2.0)]], "'left' has no value in any row"),
        ("/scan", [[(nan, 1.0)], [(nan, 1.0)]], "'left' has no value in any row"),
        ("/scan", [[(1.0, nan)], [(1.0, 2.0)]], "'right' has no value in 1 of 2 demonstrations"),
        ("/scan", [[(1.0, nan), (nan, 2.0)]], ""),
        ("/scan", [[(1.0, 2.0)]], ""),
        # Tables say so column by column.
        (None, [[(nan, 1.0)]], ""),
    ],
)
def test_what_never_has_a_value_is_noted(
    topic: str | None, states: list[list[tuple[float, float]]], where: str
) -> None:
    shown = [_shown(f"run_{place}", topic, one) for place, one in enumerate(states)]
    notes = list(valueless(shown))
    assert len(notes) == bool(where)
    assert all(where in note and f"{topic!r}" in note for note in notes)
