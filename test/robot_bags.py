"""Bags of a robot's own messages, for tests."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import BatteryState, JointState, Joy, LaserScan
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String

#: Some nanoseconds of 2024.
BEGIN = 1_700_000_000_000_000_000
MILLISECOND = 1_000_000

ROBOT_FILE = """\
# A robot with a scanner and a gripper.
state:
  x: /odom.pose.pose.position.x
  heading: /odom.pose.pose.orientation.@ypr.yaw
  ahead: /scan.ranges[-30deg:30deg].@min
  left: {path: "/scan.ranges[60deg:90deg].@min"}
  gripper: /joint_states.position[gripper]
  power: /battery.power_supply_status
  mode: /mode.data
actions:
  action:
    joy: /joy
    press: {0: grasp, 1: release}
    axes: {1: {0.5: forward, -0.5: back}}
"""


def name_of(message: Any) -> str:
    """The name of a message's type."""
    package, *_, name = (type(message).__module__.split(".")[0], type(message).__name__)
    return f"{package}/msg/{name}"


def write_bag(
    path: Path,
    messages: Iterable[tuple[int, str, Any]],
    plugin: StoragePlugin = StoragePlugin.MCAP,
) -> Path:
    """Writes messages of rclpy with their topics and when they were recorded (ns)."""
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for stamp, topic, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name_of(message), typestore=types)
            writer.write(connections[topic], stamp, serialize_message(message))
    return path


def odometry(x: float, yaw: float = 0.0) -> Odometry:
    message = Odometry()
    message.pose.pose.position.x = x
    message.pose.pose.orientation.z = math.sin(yaw / 2)
    message.pose.pose.orientation.w = math.cos(yaw / 2)
    return message


def scan(ahead: float, left: float = 4.0) -> LaserScan:
    """Seven beams from -90 to 90 degrees."""
    return LaserScan(
        angle_min=-math.pi / 2,
        angle_increment=math.pi / 6,
        range_min=0.1,
        range_max=8.0,
        ranges=[math.inf, 5.0, 6.0, ahead, math.nan, left, left],
    )


def joints(gripper: float, *, first: bool = True) -> JointState:
    """Gripper and arm, in this order or in the other."""
    if first:
        return JointState(name=["gripper", "arm"], position=[gripper, 9.0])
    return JointState(name=["arm", "gripper"], position=[9.0, gripper])


def joy(button: int | None = None, axis: float = 0.0) -> Joy:
    return Joy(axes=[0.0, axis], buttons=[int(one == button) for one in range(3)])


def battery(status: int) -> BatteryState:
    return BatteryState(power_supply_status=status)


def twist(x: float, z: float) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = x, z
    return message


def plain(fronts: Iterable[float]) -> list[tuple[int, str, Any]]:
    """States of one number, `front`, each with an action: go up to 2, turn from there on."""
    messages: list[tuple[int, str, Any]] = []
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label="front", size=1)])
    for front in fronts:
        stamp = BEGIN + 100 * MILLISECOND * len(messages)
        state = Float64MultiArray(layout=layout, data=[front])
        messages.append((stamp, "/state", state))
        action = String(data="go" if front < 2 else "turn")
        messages.append((stamp + MILLISECOND, "/action", action))
    return messages


def shown(rounds: int = 12) -> list[tuple[int, str, Any]]:
    """A robot that goes forward where nothing is ahead, else grasps or releases, then goes back."""
    messages: list[tuple[int, str, Any]] = []

    def add(topic: str, message: Any) -> None:
        messages.append((BEGIN + 10 * MILLISECOND * len(messages), topic, message))

    for number in range(rounds):
        holding = number % 2 == 1
        add("/mode", String(data="carry" if holding else "fetch"))
        add("/battery", battery(1 if number % 3 else 2))
        add("/joint_states", joints(0.0 if holding else 0.8, first=number % 2 == 0))
        for step, distance in enumerate((5.0, 3.0, 1.5)):
            add("/odom", odometry(float(step) + 0.125 * number, 0.25 * step))
            add("/scan", scan(distance + 0.01 * number))
            add("/joy", joy(axis=1.0))
        add("/scan", scan(0.5 + 0.01 * number))
        add("/joy", joy())
        add("/joy", joy(1 if holding else 0))
        add("/joint_states", joints(0.8 if holding else 0.0, first=number % 2 == 1))
        add("/joy", joy(axis=-1.0))
        add("/joy", joy())
    return messages
