"""The recorder on a robot's own messages: the same table and tree as from a bag of them."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

import robot_bags as some
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_processes import LATCHED, NodeProcess, Peer, values_of
from std_msgs.msg import Bool, String

import rebt_ros
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.table import tabulate
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import load

TYPES = """\
topics:
  /odom: nav_msgs/msg/Odometry
  /scan: sensor_msgs/msg/LaserScan
"""


_STRINGS = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("other")
publisher = node.create_publisher(String, "/docked", 10)
rclpy.spin(node)
"""


def _recorder(
    domain: int, directory: Path, text: str = some.ROBOT_FILE, **parameters: object
) -> NodeProcess:
    (directory / "robot.yaml").write_text(text)
    return NodeProcess(
        "recorder_node", domain, directory, {"robot_file": "robot.yaml", **parameters}
    )


class _Bag:
    """What `ros2 bag record` writes beside the recorder: messages in the order of their sending."""

    def __init__(self, peer: Peer, messages: list[Any]) -> None:
        self.messages: list[tuple[int, str, Any]] = []
        for topic, kind in {topic: type(message) for _, topic, message in messages}.items():
            peer.node.create_subscription(kind, topic, partial(self._take, topic), 1000)

    def _take(self, topic: str, message: Any, info: dict[str, Any]) -> None:
        self.messages.append((info["source_timestamp"], topic, message))


def _record(
    domain: int, peer: Peer, directory: Path, messages: list[Any], text: str, listeners: int = 1
) -> Demonstration:
    with _recorder(domain, directory, text) as recorder:
        for _, topic, message in messages if listeners > 1 else ():
            peer.connect(type(message), topic, subscribers=listeners)
        for place, (_, topic, message) in enumerate(messages):
            peer.publish(message, topic)
            if place % 10 == 0:
                peer.spin_once()
        assert peer.call("/recorder/record", False).success
        assert recorder.stop() == 0
    [recorded] = load([directory / "demonstrations"]).demonstrations
    return recorded


@pytest.mark.parametrize("text", [some.ROBOT_FILE, TYPES + some.ROBOT_FILE])
def test_a_bag_that_is_written_beside_the_recorder_gives_its_table_and_its_tree(
    domain: int, peer: Peer, tmp_path: Path, text: str
) -> None:
    messages = some.shown(12)
    listening = _Bag(peer, messages)
    recorded = _record(domain, peer, tmp_path, messages, text, listeners=2)
    peer.wait_until(lambda: len(listening.messages) == len(messages), what="the bag")
    bag = some.write_bag(tmp_path / "bag", sorted(listening.messages, key=lambda one: one[0]))
    robot = parse_robot_file(text)
    reading = InputOptions(robot=robot)
    [bagged] = load([bag], reading).demonstrations
    [live], [offline] = tabulate([recorded]), tabulate([bagged])
    assert len(live) == 36
    assert live.features == offline.features
    assert live.actions == offline.actions
    assert np.array_equal(live.states, offline.states, equal_nan=True)
    assert np.array_equal(live.chosen, offline.chosen)
    learned = [
        rebt_ros.learn([tmp_path / "demonstrations"]).learned,
        rebt_ros.learn([bag], reading=reading).learned,
    ]
    assert learned[0].tree == learned[1].tree
    assert learned[0].robot == learned[1].robot == robot


@pytest.mark.parametrize("stamp", ["header", "received"])
def test_the_stamp_in_the_header_says_which_state_an_action_belongs_to_where_that_is_wanted(
    domain: int, peer: Peer, tmp_path: Path, stamp: str
) -> None:
    text = (
        "state: {x: /odom.pose.pose.position.x}\nactions: {a: {joy: /joy, press: {0: grasp}}}\n"
        f"topics: {{/odom: {{stamp: {stamp}}}, /joy: {{stamp: {stamp}}}}}"
    )
    messages = []
    # The camera of an odometry that is slow to compute: it tells late what was before the action.
    for number in range(6):
        for topic, message, moment in (
            ("/odom", some.odometry(10.0 * number), 10 * number),
            ("/joy", some.joy(), 10 * number + 1),
            ("/odom", some.odometry(10.0 * number + 5.0), 10 * number + 5),
            ("/joy", some.joy(0), 10 * number + 3),
        ):
            message.header.stamp.sec, message.header.stamp.nanosec = 1_700_000_000, moment
            messages.append((0, topic, message))
    recorded = _record(domain, peer, tmp_path, messages, text)
    held = [10.0 * number + (5.0 if stamp == "received" else 0.0) for number in range(6)]
    assert recorded.states[:, 0].tolist() == held


def test_an_array_that_shrinks_and_a_field_that_turns_nan_are_missing_and_nothing_is_lost(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    messages = some.shown(4)
    for _, topic, message in messages[len(messages) // 2 :]:
        if topic == "/scan":
            message.ranges = message.ranges[:4]
        if topic == "/odom":
            message.pose.pose.position.x = math.nan
    recorded = _record(domain, peer, tmp_path, messages, some.ROBOT_FILE)
    names = [one.name for one in recorded.features]
    assert len(recorded) == 12
    for name in ("x", "left"):
        column = recorded.states[:, names.index(name)]
        assert not np.isnan(column[:6]).any()
        assert np.isnan(column[7:]).all()
    assert not np.isnan(recorded.states[:, names.index("ahead")]).any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "state: {x: /odom.pos.x}\nactions: {a: /a.data}\n"
            "topics: {/odom: nav_msgs/msg/Odometry}",
            "robot.yaml: message path '/odom.pos.x': nav_msgs/msg/Odometry has no field 'pos'; it",
        ),
        (
            "state: {x: /o.x}\nactions: {a: /a.data}\ntopics: {/o: nav2_msgs/msg/Costmap}",
            "install ros-jazzy-nav2-msgs, or source the workspace",
        ),
        (
            "state: {x: /o.x}\nactions: {a: /a.data}\nstates: 1",
            "robot.yaml, line 3: states is unknown",
        ),
        ("state: {x: /o.x}", "robot.yaml has no part 'actions'"),
    ],
)
def test_a_robot_file_that_cannot_be_used_ends_the_recorder_with_a_sentence(
    domain: int, tmp_path: Path, text: str, said: str
) -> None:
    with _recorder(domain, tmp_path, text) as recorder:
        assert recorder.wait() == 1
        assert said in " ".join(recorder.stderr.split())
        assert "Traceback" not in recorder.stderr


def test_topics_beside_a_robot_file_are_refused(domain: int, tmp_path: Path) -> None:
    with _recorder(domain, tmp_path, state_topics=["other"]) as recorder:
        assert recorder.wait() == 1
        assert "parameter 'robot_file' is set, which says what the topics are" in recorder.stderr


def test_what_the_graph_does_not_have_is_said_while_the_recorder_waits(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    text = "state: {x: /odom.pose.pose.position.x, d: /docked.data}\nactions: {a: /mode.data}"

    def says(part: str) -> bool:
        status = peer.diagnostics.get("recorder: recording")
        return status is not None and part in status.message

    with _recorder(domain, tmp_path, text) as recorder:
        peer.wait_until(lambda: says("nobody publishes on /odom"), what="a warning")
        # A type that has no such field, instead of the right one.
        peer.node.create_publisher(Bool, "/odom", 10)
        wanted = "message path '/odom.pose.pose.position.x': std_msgs/msg/Bool has no field 'pose'"
        peer.wait_until(lambda: says(wanted), what="a sentence")
        assert recorder.stop() == 0


def test_publishers_of_best_effort_are_heard_and_types_that_change_are_told(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    text = "state: {d: /docked.data}\nactions: {a: /mode.data}"
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    with _recorder(domain, tmp_path, text) as recorder:
        docked = peer.connect(Bool, "/docked", best_effort)
        mode = peer.connect(String, "/mode")
        ready = peer.listen(Bool, "/recorder/ready", LATCHED)

        def send() -> bool:
            docked.publish(Bool(data=True))
            return any(one.data for one in ready)

        peer.wait_until(send, what="the recorder to be ready")

        def rows() -> bool:
            docked.publish(Bool(data=True))
            mode.publish(String(data="go"))
            status = peer.diagnostics.get("recorder: recording")
            return status is not None and int(values_of(status)["rows"]) > 0

        peer.wait_until(rows, what="rows")
        # A robot that is started anew, with another type; one process has one type for a topic.
        command = [sys.executable, "-c", _STRINGS]
        with NodeProcess("other", domain, tmp_path, command=command):
            wanted = "publishes std_msgs/msg/String on /docked, not std_msgs/msg/Bool"
            peer.wait_until(
                lambda: wanted in peer.diagnostics["recorder: recording"].message,
                what="a warning",
            )
        assert peer.call("/recorder/record", False).success
        assert recorder.stop() == 0
