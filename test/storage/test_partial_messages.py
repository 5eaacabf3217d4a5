"""Messages that are decoded in part: the same values as those of the whole, and damage named."""

from __future__ import annotations

import struct
from typing import Any

import message_examples as some
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_typestore

from rebt_ros.storage.message_definitions import parse_definitions
from rebt_ros.storage.partial_messages import PartialDecoder

TYPES = get_typestore(Stores.ROS2_JAZZY)


def _decoder(topic: str, *wanted: str) -> PartialDecoder:
    attributes = [tuple(one.split(".")) if one else () for one in wanted]
    return PartialDecoder(some.TYPES[topic], attributes, TYPES.fielddefs)


def _data(topic: str) -> bytes:
    return bytes(serialize_message(some.MESSAGES[topic]()))


def test_what_is_wanted_is_there_and_the_rest_is_not() -> None:
    message: Any = _decoder("/odom", "pose.pose.position", "twist.twist.linear.x").decode(
        _data("/odom")
    )
    position = message.pose.pose.position
    assert (position.x, position.y, message.twist.twist.linear.x) == (3.0, -4.0, -0.5)
    assert not hasattr(message, "header")
    assert not hasattr(message.twist.twist, "angular")


def test_arrays_and_sequences_of_all_kinds_are_read() -> None:
    odometry: Any = _decoder("/odom", "pose.covariance").decode(_data("/odom"))
    assert (odometry.pose.covariance[0], odometry.pose.covariance[35]) == (0.25, 0.5)
    joints: Any = _decoder("/joint_states", "position", "name").decode(_data("/joint_states"))
    assert joints.name == ["right_wheel", "left_wheel", "odd name"]
    assert joints.position.tolist() == [1.0, -2.0, 3.0]
    joy: Any = _decoder("/joy", "buttons").decode(_data("/joy"))
    assert joy.buttons.tolist() == [0, 1, 0]
    battery: Any = _decoder("/battery", "").decode(_data("/battery"))
    assert (battery.present, battery.power_supply_status) == (True, 1)
    assert battery.cell_voltage.tolist() == [4.0, 4.5]


def test_both_orders_of_bytes_are_read() -> None:
    whole = TYPES.deserialize_cdr(_data("/odom"), some.TYPES["/odom"])
    for little in (True, False):
        data = bytes(TYPES.serialize_cdr(whole, some.TYPES["/odom"], little_endian=little))
        message: Any = _decoder("/odom", "pose", "child_frame_id").decode(data)
        assert message.child_frame_id == "base"
        assert message.pose.pose.position.y == -4.0
        assert np.array_equal(message.pose.covariance, whole.pose.covariance)


def test_sequences_of_messages_are_read_whole() -> None:
    message: Any = _decoder("/diagnostics", "status").decode(_data("/diagnostics"))
    assert [one.name for one in message.status] == ["laser", "motor", "motor"]
    assert [one.level for one in message.status] == [0, 1, 2]
    assert message.status[1].values[0].value == "warm"
    plan: Any = _decoder("/plan", "poses").decode(_data("/plan"))
    assert [one.pose.position.y for one in plan.poses] == [0.0, 8.0]


def test_wide_strings_and_arrays_of_strings_are_read_as_ros_writes_them() -> None:
    messages = pytest.importorskip("test_msgs.msg")
    serialize = pytest.importorskip("rclpy.serialization").serialize_message
    message = messages.WStrings(
        wstring_value="a\u00e9\U0001f600",
        array_of_wstrings=["", "x", "\u30cf"],
        unbounded_sequence_of_wstrings=["yz"],
    )
    text = (
        "wstring wstring_value\nwstring a\nwstring b\nwstring wstring_value_default3\n"
        "wstring[3] array_of_wstrings\nwstring[<=3] c\nwstring[] unbounded_sequence_of_wstrings\n"
    )
    name = "test_msgs/msg/WStrings"
    read: Any = PartialDecoder(name, [()], parse_definitions(name, text)).decode(serialize(message))
    assert read.wstring_value == message.wstring_value
    assert read.wstring_value_default3 == message.wstring_value_default3
    assert read.array_of_wstrings == message.array_of_wstrings
    assert read.unbounded_sequence_of_wstrings == ["yz"]
    arrays = messages.Arrays(string_values=["", "go", "stop"], string_values_default=["1", "", "3"])
    kinds = "bool byte char float32 float64 int8 uint8 int16 uint16 int32 uint32 int64 uint64"
    before = "".join(f"{one}[3] of_{one}\n" for one in kinds.split())
    definitions = parse_definitions("a/msg/B", f"{before}string[3] texts\n")
    found: Any = PartialDecoder("a/msg/B", [("texts",)], definitions).decode(serialize(arrays))
    assert found.texts == ["", "go", "stop"]


def test_a_wide_string_of_whole_characters_is_read_and_one_that_is_cut_is_refused() -> None:
    definitions = parse_definitions("a/msg/B", "wstring text\n")
    decoder = PartialDecoder("a/msg/B", [("text",)], definitions)
    for text in ("", "go", "\U0001f600"):
        data = b"\0\1\0\0" + struct.pack("<I", len(text)) + text.encode("utf-32-le")
        read: Any = decoder.decode(data)
        assert read.text == text
    with pytest.raises(ValueError, match="longer than its message"):
        decoder.decode(data[:-1])


TOPICS = sorted(some.MESSAGES)


@given(st.sampled_from(TOPICS), st.data())
def test_a_message_that_is_cut_is_refused_or_read_as_far_as_it_is_wanted(
    topic: str, data: st.DataObject
) -> None:
    whole = _data(topic)
    damaged = bytearray(whole[: data.draw(st.integers(0, len(whole)))])
    for _ in range(data.draw(st.integers(0, 3))):
        if damaged:
            damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        _decoder(topic, "").decode(bytes(damaged))
    except (ValueError, struct.error):
        return
