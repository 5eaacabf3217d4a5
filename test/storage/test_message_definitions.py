"""Types that a bag defines: they are read as those of ROS are, and never run as code."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mcap_files as mcap
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import InputError, MessagePathError
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.bag_survey import survey_bag
from rebt_ros.storage.message_definitions import parse_definitions
from rebt_ros.storage.message_types import BagTypes
from rebt_ros.storage.robot_bag import read_robot_bag

OWN = """\
# An arm.
uint8 MODE_IDLE=0
uint8 MODE_BUSY=1   # working
string TITLE="arm # 1"
std_msgs/Header header
uint8 mode
float32[3] place
Joint[<=5] joints
string<=10 name "none"
"""
JOINT = "float64 angle 0.5\nbool locked\n"

TEXT = """
topics: {/arm: my_msgs/msg/Own}
state:
  mode: /arm.mode
  z: /arm.place[2]
  elbow: /arm.joints[1].angle
  locked: /arm.joints[:].angle.@max
actions:
  action: /arm.name
"""


def _write(path: Path, plugin: StoragePlugin) -> Path:
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(JOINT, "my_msgs/msg/Joint"))
    types.register(get_types_from_msg(OWN, "my_msgs/msg/Own"))
    kinds: dict[str, Any] = types.types
    stamp = kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        to = writer.add_connection("/arm", "my_msgs/msg/Own", typestore=types)
        for number in range(6):
            joints = [
                kinds["my_msgs/msg/Joint"](angle=angle, locked=False)
                for angle in (0.25, float(number))
            ]
            message = kinds["my_msgs/msg/Own"](
                header=header,
                mode=number % 2,
                place=_floats(0.0, 0.0, number + 0.5),
                joints=joints,
                name="go" if number % 2 else "rest",
            )
            writer.write(to, number, types.serialize_cdr(message, "my_msgs/msg/Own"))
    return path


def _floats(*values: float) -> Any:
    import numpy as np

    return np.array(values, dtype=np.float32)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_type_that_the_bag_defines_is_read(tmp_path: Path, plugin: StoragePlugin) -> None:
    bag = _write(tmp_path / "bag", plugin)
    shown = read_robot_bag(bag, parse_robot_file(TEXT)).demonstration
    # An action has the state before its message.
    assert shown.states[:, 1:].tolist() == [
        [number + 0.5, float(number), max(0.25, number)] for number in range(5)
    ]
    mode = shown.features[0]
    assert (mode.kind, mode.categories) == (FeatureKind.CATEGORICAL, ("IDLE", "BUSY"))
    assert [shown.actions[one] for one in shown.chosen] == ["go", "rest", "go", "rest", "go"]
    [survey], notes = survey_bag(bag)
    assert notes == ()
    assert survey.field(".place[2]") is not None


def test_a_definition_is_its_fields_and_whole_constants() -> None:
    text = f"{OWN}{'=' * 80}\nMSG: my_msgs/Joint\n{JOINT}"
    found = parse_definitions("my_msgs/msg/Own", text)
    assert list(found) == ["my_msgs/msg/Own", "my_msgs/msg/Joint"]
    constants, fields = found["my_msgs/msg/Own"]
    assert constants == [("MODE_IDLE", "uint8", 0), ("MODE_BUSY", "uint8", 1)]
    assert [name for name, _ in fields] == ["header", "mode", "place", "joints", "name"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "my_msgs/Missing one",
        "Own itself",
        f"Other other\n{'=' * 80}\nMSG: my_msgs/Other\nOwn own",
    ],
)
def test_a_type_that_is_empty_not_whole_or_holds_itself_is_unknown(text: str) -> None:
    types = BagTypes({"my_msgs/msg/Own": text})
    if not text:
        with pytest.raises(MessagePathError, match="record it where its package is sourced"):
            types("my_msgs/msg/Own")
        return
    with pytest.raises(MessagePathError, match="the bag does not define it"):
        types("my_msgs/msg/Own")


POINT = "geometry_msgs/msg/Point"
HALVES = ("float64 z\nfloat64 x\nfloat64 y\n", "float64 x\nfloat64 y\nfloat64 z\n")


def _points(path: Path, definitions: Sequence[str], defined_in: str = "ros2msg") -> Path:
    """A topic of three numbers, with as many channels as definitions of its type, and actions."""
    channels = [
        mcap.Channel("/own", "my_msgs/msg/Own" if defined_in != "ros2msg" else POINT, "cdr", *about)
        for about in ((one, defined_in) for one in definitions)
    ]
    channels.append(mcap.Channel("/action", mcap.ACTION))
    messages = []
    for number in range(8):
        data = b"\0\1\0\0" + struct.pack("<ddd", 9.0, number, 2.0)
        messages.append(mcap.Message(number % len(definitions), 2 * number, data))
        messages.append(mcap.Message(len(definitions), 2 * number + 1, mcap.action("go")))
    return mcap.write(path, messages, channels, per_chunk=None)


OF_X = parse_robot_file("state: {x: /own.x}\nactions: {action: /action.data}\n")


def test_a_type_is_what_the_bag_says_where_another_distribution_has_another_one(
    tmp_path: Path,
) -> None:
    bag = _points(tmp_path / "bag.mcap", HALVES[:1])
    shown = read_robot_bag(bag, OF_X).demonstration
    assert shown.states[:, 0].tolist() == [float(number) for number in range(8)]
    [_, survey], _ = survey_bag(bag)
    found = survey.field(".z")
    assert found is not None
    assert found.values == [9.0]


@pytest.mark.parametrize("comment", ["", "# of the arm\n"])
def test_a_type_that_changed_within_a_bag_is_not_misread(tmp_path: Path, comment: str) -> None:
    same = _points(tmp_path / "same.mcap", [HALVES[0], HALVES[0] + comment])
    assert read_robot_bag(same, OF_X).demonstration.states[1, 0] == 1.0
    with pytest.raises(InputError, match=f"defines {POINT} in several ways"):
        read_robot_bag(_points(tmp_path / "bag.mcap", HALVES), OF_X)


def test_how_a_bag_defines_what_is_not_read_is_said(tmp_path: Path) -> None:
    bag = _points(tmp_path / "bag.mcap", ["module my_msgs {};"], "ros2idl")
    with pytest.raises(RobotFileError, match="the bag defines it in ros2idl, which is not read"):
        read_robot_bag(bag, OF_X)


def test_why_a_message_of_a_robot_cannot_be_decoded_is_said(tmp_path: Path) -> None:
    channels = [
        mcap.Channel("/own", "my_msgs/msg/Own", "cdr", "wstring title\nfloat64 x\n"),
        mcap.Channel("/action", mcap.ACTION),
    ]
    data = b"\0\1\0\0" + struct.pack("<Ixxxxd", 0, 1.0)
    action = mcap.Message(1, 2, mcap.action("go"))
    path = mcap.write(tmp_path / "bag.mcap", [mcap.Message(0, 1, data), action], channels)
    with pytest.raises(InputError, match="it has wide strings"):
        read_robot_bag(path, OF_X)
    other = mcap.Message(0, 1, b"\0\7" + data[2:])
    path = mcap.write(tmp_path / "bag.mcap", [other, action], channels)
    with pytest.raises(InputError, match="it begins with 0007"):
        read_robot_bag(path, OF_X)


def test_values_without_a_constant_are_noted(tmp_path: Path) -> None:
    bag = _write(tmp_path / "bag", StoragePlugin.MCAP)
    text = TEXT.replace("mode: /arm.mode", "mode: {path: /arm.mode, categories: [BUSY]}")
    read = read_robot_bag(bag, parse_robot_file(text))
    assert read.demonstration.features[0].categories == ("BUSY",)
    assert read.demonstration.states[:, 0].tolist()[1::2] == [0.0, 0.0]
    assert "feature 'mode' has no value where its field is 0, which is none of its categories" in (
        read.notes
    )


@pytest.mark.parametrize(
    ("labels", "why"),
    [
        ("{MODE_IDLE: rest}", "'/arm.mode' is never 'MODE_IDLE': it is an integer or one of IDLE"),
        ("{01: rest}", "'/arm.mode' is never '01'"),
    ],
)
def test_labels_of_values_that_are_never_there_are_refused(
    tmp_path: Path, labels: str, why: str
) -> None:
    bag = _write(tmp_path / "bag", StoragePlugin.MCAP)
    text = TEXT.replace("action: /arm.name", f"action: {{path: /arm.mode, labels: {labels}}}")
    with pytest.raises(RobotFileError, match=why):
        read_robot_bag(bag, parse_robot_file(text))
    text = TEXT.replace(
        "action: /arm.name", "action: {path: '/arm.joints[0].locked', labels: {yes: go}}"
    )
    with pytest.raises(RobotFileError, match="is never 'yes': it is true or false"):
        read_robot_bag(bag, parse_robot_file(text))


@given(st.text())
def test_whatever_a_bag_says_is_a_definition_or_none(text: str) -> None:
    try:
        kind = BagTypes({"my_msgs/msg/Own": text})("my_msgs/msg/Own")
    except MessagePathError:
        return
    assert kind.name == "my_msgs/msg/Own"
