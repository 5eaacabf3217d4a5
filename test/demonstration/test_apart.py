"""Channels that no demonstration has together."""

from __future__ import annotations

import pytest

from rebt_ros.demonstration.apart import apart
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature


def _shown(name: str, channels: str) -> Demonstration:
    rows = [Row(place, one, "go", None, (0.0,)) for place, one in enumerate(channels.split())]
    return Demonstration.from_rows(name, (Feature("x"),), rows, RowKind.EVENT)


@pytest.mark.parametrize(
    ("demonstrations", "noted"),
    [
        (["/r1/action", "/r2/action"], True),
        (["/action", "/action", "/r2/action"], True),
        (["/action", "/action"], False),
        (["arm base"], False),
        (["arm base", "arm"], False),
        (["arm", "arm base", "base"], False),
        ([], False),
    ],
)
def test_what_may_be_one_action_by_several_names_is_noted(
    demonstrations: list[str], noted: bool
) -> None:
    shown = [_shown(f"run_{place}", one) for place, one in enumerate(demonstrations)]
    notes = list(apart(shown))
    assert len(notes) == noted
    assert all("each is a channel of its own" in note for note in notes)
