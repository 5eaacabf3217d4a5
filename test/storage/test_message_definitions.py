"""Types that a bag defines: they are read as those of ROS are, and never run as code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import MessagePathError
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
def test_a_type_that_is_not_whole_or_holds_itself_is_unknown_or_empty(text: str) -> None:
    types = BagTypes({"my_msgs/msg/Own": text})
    if not text:
        assert types("my_msgs/msg/Own").fields == ()
        return
    with pytest.raises(MessagePathError, match="the bag does not define it"):
        types("my_msgs/msg/Own")


@given(st.text())
def test_whatever_a_bag_says_is_a_definition_or_none(text: str) -> None:
    try:
        kind = BagTypes({"my_msgs/msg/Own": text})("my_msgs/msg/Own")
    except MessagePathError:
        return
    assert kind.name == "my_msgs/msg/Own"
