"""Benchmarks of reading a robot's own messages by a robot file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from harness import Figure, Settings, alternate, compared, timed
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.demonstration.table import tabulate
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.robot_bag import read_robot_bag

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_BEAMS = 360

ROBOT_FILE = """\
state:
  x: /odom.pose.pose.position.x
  y: /odom.pose.pose.position.y
  heading: /odom.pose.pose.orientation.@ypr.yaw
  speed: /odom.twist.twist.linear.x
  turning: /odom.twist.twist.angular.z
  ahead: /scan.ranges[-36deg:36deg].@min
  left: /scan.ranges[36deg:108deg].@min
  right: /scan.ranges[-108deg:-36deg].@min
  back_left: /scan.ranges[108deg:180deg].@min
  back_right: /scan.ranges[-180deg:-108deg].@min
actions:
  action: {joy: /joy, press: {0: grasp}, axes: {1: {0.5: forward, -0.5: back}}}
"""
ROBOT = parse_robot_file(ROBOT_FILE)


def robot_bag(settings: Settings) -> list[Figure]:
    """A bag of Odometry, LaserScan and Joy into a table."""
    messages = settings.size(200_000, 2000)
    figures = []
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        path = settings.directory / plugin.name.lower()
        _write(path, messages, plugin)
        spreads = alternate(
            {
                "ours": timed(
                    lambda path=path: tabulate([read_robot_bag(path, ROBOT).demonstration])
                ),
                "limit": timed(lambda path=path: _bare_loop(path)),
            },
            settings.rounds,
        )
        name = (
            f"Odometry, LaserScan ({_BEAMS}), Joy -> table, {plugin.name.lower()}, {messages:,} "
            "messages / bare rosbags loop that reads the same fields"
        )
        figures.append(compared(name, spreads, 1.3))
    return figures


def _bare_loop(path: Path) -> list[tuple[float, ...]]:
    """Deserialises every message, and reads by hand what the robot file names."""
    found: list[tuple[float, ...]] = []
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            message: Any = _TYPES.deserialize_cdr(data, connection.msgtype)
            if connection.topic == "/odom":
                pose, twist = message.pose.pose, message.twist.twist
                turn = pose.orientation
                yaw = math.atan2(
                    2 * (turn.w * turn.z + turn.x * turn.y),
                    1 - 2 * (turn.y * turn.y + turn.z * turn.z),
                )
                place = pose.position
                found.append((place.x, place.y, yaw, twist.linear.x, twist.angular.z))
            elif connection.topic == "/scan":
                ranges = message.ranges
                # Of what is there, and not farther than the sensor sees.
                found.append(
                    tuple(
                        min(float(part[part >= message.range_min].min()), message.range_max)
                        for part in (
                            np.concatenate((ranges[324:], ranges[:37])),
                            ranges[36:109],
                            ranges[252:325],
                            ranges[108:181],
                            ranges[180:253],
                        )
                    )
                )
            else:
                found.append((message.axes[1], message.buttons[0]))
    return found


def _write(path: Path, messages: int, plugin: StoragePlugin) -> None:
    kinds, chance = _TYPES.types, np.random.default_rng(0)
    vector, header = kinds["geometry_msgs/msg/Vector3"], _header()
    names = {
        "/odom": "nav_msgs/msg/Odometry",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/joy": "sensor_msgs/msg/Joy",
    }
    ranges = chance.uniform(0.3, 12.0, (50, _BEAMS)).astype(np.float32)
    samples: dict[str, list[bytes]] = {name: [] for name in names}
    for number in range(50):
        yaw = number / 10
        made = {
            "/odom": _odometry(header, number / 10, yaw, vector),
            "/scan": kinds[names["/scan"]](
                header=header,
                angle_min=0.0,
                angle_max=math.radians(359),
                angle_increment=math.radians(1),
                time_increment=0.0,
                scan_time=0.1,
                range_min=0.25,
                range_max=10.0,
                ranges=ranges[number],
                intensities=np.zeros(_BEAMS, dtype=np.float32),
            ),
            "/joy": kinds[names["/joy"]](
                header=header,
                axes=np.array([0.0, float(number % 3 - 1)], dtype=np.float32),
                buttons=np.array([number % 7 == 0, 0], dtype=np.int32),
            ),
        }
        for topic, message in made.items():
            samples[topic].append(bytes(_TYPES.serialize_cdr(message, names[topic])))
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        to = {
            topic: writer.add_connection(topic, name, typestore=_TYPES)
            for topic, name in names.items()
        }
        topics = list(names)
        for number in range(messages):
            topic = topics[number % 3]
            writer.write(to[topic], number * 10**7, samples[topic][number // 3 % 50])


def _header() -> Any:
    stamp = _TYPES.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    return _TYPES.types["std_msgs/msg/Header"](stamp=stamp, frame_id="base")


def _odometry(header: Any, place: float, yaw: float, vector: Any) -> Any:
    kinds = _TYPES.types
    pose = kinds["geometry_msgs/msg/Pose"](
        position=kinds["geometry_msgs/msg/Point"](x=place, y=-place, z=0.0),
        orientation=kinds["geometry_msgs/msg/Quaternion"](
            x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
        ),
    )
    twist = kinds["geometry_msgs/msg/Twist"](
        linear=vector(x=place, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=yaw)
    )
    covariance = np.zeros(36)
    return kinds["nav_msgs/msg/Odometry"](
        header=header,
        child_frame_id="base",
        pose=kinds["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=covariance),
        twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=covariance),
    )
