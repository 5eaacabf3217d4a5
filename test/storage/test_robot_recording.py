"""Recordings by a robot file: missing values, categories and texts come back as they were."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import robot_bags as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.recording import RecordingWriter, read_recording
from rebt_ros.storage.recording_files import MARK

ROBOT = parse_robot_file(some.ROBOT_FILE)
FEATURES = (
    Feature("x", topic="/odom", index=0),
    Feature("power", FeatureKind.CATEGORICAL, ("used", "full"), "/battery", 0),
    Feature("mode", topic="/mode", index=0),
    Feature("docked", FeatureKind.BINARY, topic="/docked", index=0),
)


def _write(directory: Path, rows: list[tuple[float, float, str, float]]) -> Path:
    categories = {"power": Categories(("used", "full")), "mode": Categories()}
    with RecordingWriter(
        directory, FEATURES, ["action"], robot=ROBOT, categories=categories
    ) as writer:
        for stamp, (x, power, mode, docked) in enumerate(rows):
            code = categories["mode"].code(mode)
            writer.write(Row(stamp, "action", mode or "go", None, (x, power, code, docked)))
    return writer.path


def _read(path: Path) -> list[tuple[float, float, str, float]]:
    shown = read_recording(path).demonstration
    names = shown.features[2].categories
    return [
        (x, power, "" if math.isnan(code) else names[int(code)], docked)
        for x, power, code, docked in shown.states.tolist()
    ]


def test_what_was_written_is_read(tmp_path: Path) -> None:
    nan = math.nan
    rows = [(1.0, 0.0, "b", 1.0), (nan, 1.0, "a", nan), (2.0, nan, "", 0.0), (3.0, 0.0, "b", 0.0)]
    path = _write(tmp_path, rows)
    assert np.array_equal(
        np.array([[one[0], one[1], one[3]] for one in _read(path)]),
        np.array([[one[0], one[1], one[3]] for one in rows]),
        equal_nan=True,
    )
    assert [one[2] for one in _read(path)] == ["b", "a", "", "b"]
    read = read_recording(path)
    assert read.robot == ROBOT
    assert read.demonstration.features[1] == FEATURES[1]
    assert read.demonstration.features[2].kind is FeatureKind.CATEGORICAL
    assert read.demonstration.actions == ("a", "b", "go")


def test_a_text_that_was_never_there_is_a_number_that_is_missing(tmp_path: Path) -> None:
    shown = read_recording(_write(tmp_path, [(1.0, 0.0, "", 1.0)])).demonstration
    assert shown.features[2].kind is FeatureKind.NUMERIC
    assert np.isnan(shown.states[:, 2]).all()


@given(texts=st.lists(st.text(), min_size=1, max_size=9))
def test_any_text_comes_back(texts: list[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    categories = Categories()
    expected = ["" if not one else categories.names[int(categories.code(one))] for one in texts]
    path = _write(tmp_path_factory.mktemp("texts"), [(0.0, 0.0, one, 0.0) for one in expected])
    assert [one[2] for one in _read(path)] == expected


def _changed(path: Path, change: str) -> Path:
    """The recording with another first line of the same length."""
    line, rest = path.read_bytes().split(b"\n", 1)
    head = json.loads(line.removeprefix(MARK))
    changes = {
        "category": lambda: head["features"][1].update(categories=["used"]),
        "kind": lambda: head["features"][1].update(kind="odd"),
        "robot": lambda: head.update(robot={"state": {}}),
        "text": lambda: head["features"][0].update(kind="text"),
    }
    changes[change]()
    path.write_bytes((MARK + json.dumps(head).encode()).ljust(len(line)) + b"\n" + rest)
    return path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("category", "'power' holds a value that is none of its categories"),
        ("kind", "kind must be one of numeric, binary, categorical, text, not"),
        ("robot", "its robot file: state names no feature"),
        ("text", "'x' holds a text that is not there"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path: Path, change: str, said: str) -> None:
    path = _write(tmp_path, [(99.0, 1.0, "a", 1.0)])
    with pytest.raises(InputError) as caught:
        read_recording(_changed(path, change))
    assert said in str(caught.value)
