"""Parts of recordings: put together, they are the whole."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import robot_bags as some

from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import OptionError
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.recording import RecordingWriter, read_recording
from rebt_ros.storage.recording_head import Origin, read_head
from rebt_ros.storage.recording_parts import write_part

FEATURES = (
    Feature("x", topic="/odom", index=0),
    Feature("power", FeatureKind.CATEGORICAL, ("used", "full"), "/battery", 0),
    Feature("mode", topic="/mode", index=0),
)
#: Seconds, channel, action, and the state with a text.
ROWS = [
    (0, "arm", "lift", (1.0, 0.0, "b")),
    (1, "base", "go", (math.nan, 1.0, "a")),
    (2, "arm", "drop", (2.0, math.nan, "")),
    (2, "base", "go", (2.5, 0.0, "c")),
    (4, "base", "turn", (3.0, 0.0, "b")),
    (5, "arm", "drop", (4.0, 1.0, "a")),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    mode = Categories()
    with RecordingWriter(
        tmp_path,
        FEATURES,
        ["arm", "base"],
        sample_rate=10.0,
        origin=Origin.TAKEOVER,
        robot=parse_robot_file(some.ROBOT_FILE),
        categories={"power": Categories(("used", "full")), "mode": mode},
    ) as writer:
        for seconds, channel, action, (x, power, text) in ROWS:
            state = (x, power, mode.code(text))
            writer.write(Row(seconds * 10**9, channel, action, None, state))
    return writer.path.rename(tmp_path / "whole.rec")


def rows_of(shown: Demonstration) -> list[tuple[object, ...]]:
    """What can be compared: NaN is None, texts are texts."""
    names = shown.features[2].categories
    return [
        (
            stamp // 10**9,
            shown.channels[channel],
            shown.actions[action],
            *(None if math.isnan(value) else value for value in state[:2]),
            None if math.isnan(state[2]) else names[int(state[2])],
        )
        for stamp, channel, action, state in zip(
            shown.stamps.tolist(),
            shown.channel.tolist(),
            shown.chosen.tolist(),
            shown.states.tolist(),
            strict=True,
        )
    ]


@pytest.mark.parametrize("at", [1.0, 2.0, 3.3, 5.0])
def test_two_parts_are_the_whole(path: Path, at: float) -> None:
    first = write_part(path, -math.inf, at, "first")
    second = write_part(path, at, math.inf, "second")
    whole = read_recording(path)
    parts = [read_recording(part) for part in (first, second)]
    assert [row for part in parts for row in rows_of(part.demonstration)] == rows_of(
        whole.demonstration
    )
    for part, file in zip(parts, (first, second), strict=True):
        assert part.robot == whole.robot
        assert part.demonstration.row_kind is RowKind.SAMPLE
        with file.open("rb") as content:
            assert read_head(file, content).origin is Origin.TAKEOVER
    assert not np.isnan(parts[0].demonstration.stamps).any()


def test_a_part_knows_what_was_done_before_it(path: Path) -> None:
    part = read_recording(write_part(path, 4.0, math.inf, "part")).demonstration
    assert part.before == {"arm": "lift", "base": "go"}


def test_what_was_recorded_stays_as_it_is(path: Path) -> None:
    before = path.read_bytes()
    write_part(path, 0.0, 2.0, "part")
    with pytest.raises(OptionError, match=r"part\.rec already"):
        write_part(path, 0.0, 2.0, "part")
    with pytest.raises(OptionError, match="no rows from 7 to 9 s"):
        write_part(path, 7.0, 9.0, "none")
    assert path.read_bytes() == before
    assert sorted(file.name for file in path.parent.iterdir()) == ["part.rec", "whole.rec"]
