"""What the tests of recordings share: rows that are hard to write, and when two are the same."""

from __future__ import annotations

from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature

FEATURES = (
    Feature("front", topic="/state", index=0),
    Feature('left, "near"', topic="/state", index=1),
)
ROWS = (
    Row(1_700_000_000_000_000_001, "/action", "go", None, (0.1, -2.0)),
    Row(1_700_000_000_000_000_002, "/action", 'say "hi", twice', "go", (1 / 3, 5e-324)),
    Row(1_700_000_000_000_000_003, "/action", "go", 'say "hi", twice', (1e38, -0.0)),
)


def assert_same(one: Demonstration, other: Demonstration) -> None:
    assert one.features == other.features
    assert one.states.tobytes() == other.states.tobytes()
    assert one.stamps.tolist() == other.stamps.tolist()
    assert (one.actions, one.channels) == (other.actions, other.channels)
    assert one.chosen.tolist() == other.chosen.tolist()
    assert one.channel.tolist() == other.channel.tolist()
