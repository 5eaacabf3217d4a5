"""The executor with a tree that says where its features are in a robot's own messages."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import robot_bags as some
from ros_processes import LATCHED, NodeProcess, Peer
from std_msgs.msg import String

import rebt_ros
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions

TEXT = """\
state:
  ahead: {path: "/scan.ranges[-30deg:30deg].@min", max_age: 600}
  mode: {path: /mode.data, max_age: 600}
actions:
  action: /action.data
"""


def _document(directory: Path, text: str = TEXT) -> str:
    """A tree that stops where something is near, and else goes on or turns as the mode says."""
    messages: list[tuple[int, str, Any]] = []
    for number in range(40):
        near, mode = number % 2 == 1, "turn" if number % 4 < 2 else "drive"
        label = "stop" if near else "left" if mode == "turn" else "go"
        for topic, message in (
            ("/scan", some.scan(0.5 if near else 4.0)),
            ("/mode", String(data=mode)),
            ("/action", String(data=label)),
        ):
            messages.append((len(messages), topic, message))
    bag = some.write_bag(directory / "bag", messages)
    robot = parse_robot_file(text, "robot.yaml")
    return dumps(rebt_ros.learn(bag, reading=InputOptions(robot=robot)).learned)


def _drive(peer: Peer, ahead: float, mode: str, wanted: str) -> None:
    """Waits for a command in a state."""
    commands = peer.listen(String, "command")

    def heard() -> bool:
        peer.publish(some.scan(ahead), "/scan")
        peer.publish(String(data=mode), "/mode")
        peer.spin_once()
        return bool(commands) and commands[-1].data == wanted

    peer.wait_until(heard, what=f"the command {wanted}")


@pytest.mark.parametrize("tick_on", ["timer", "state"])
def test_a_tree_drives_on_a_robots_own_messages(
    domain: int, peer: Peer, tmp_path: Path, tick_on: str
) -> None:
    (tmp_path / "tree.json").write_text(_document(tmp_path))
    parameters = {"tree_file": "tree.json", "enabled": True, "tick_on": tick_on}
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        _drive(peer, 4.0, "drive", "go")
        _drive(peer, 0.5, "drive", "stop")
        _drive(peer, 4.0, "turn", "left")
        # A mode that was never shown, and a scan that sees nothing, are missing, and no fault.
        peer.publish(String(data="dance"), "/mode")
        peer.publish(some.scan(math.nan), "/scan")
        _drive(peer, 0.5, "turn", "stop")
        assert executor.stop() == 0


def test_a_tree_that_comes_over_a_topic_takes_over_once_its_topics_are_heard(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        trees = peer.connect(String, "behavior_tree", LATCHED)
        trees.publish(String(data=_document(tmp_path)))
        _drive(peer, 4.0, "drive", "go")
        assert executor.stop() == 0


def test_a_tree_that_does_not_fit_the_robot_is_refused_or_told(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    document = json.loads(_document(tmp_path))
    document["robot"]["topics"] = {"/scan": "nav2_msgs/msg/Costmap"}

    def says(part: str) -> bool:
        status = peer.diagnostics.get("executor: execution")
        return status is not None and part in status.message

    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        trees = peer.connect(String, "behavior_tree", LATCHED)
        trees.publish(String(data=json.dumps(document)))
        peer.wait_until(lambda: says("install ros-jazzy-nav2-msgs"), what="a refusal")
        del document["robot"]["topics"]
        trees.publish(String(data=json.dumps(document)))
        peer.node.create_publisher(String, "/scan", 10)
        wanted = "std_msgs/msg/String has no field 'ranges'"
        peer.wait_until(lambda: says(wanted), what="what is wrong with the topic")
        assert executor.stop() == 0


def test_the_state_is_as_old_as_its_features_may_be(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    text = TEXT.replace('@min", max_age: 600', '@min", max_age: 0.05')
    (tmp_path / "tree.json").write_text(_document(tmp_path, text))
    parameters = {"tree_file": "tree.json", "enabled": True, "state_timeout": 600.0}
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        _drive(peer, 4.0, "drive", "go")

        def stale() -> bool:
            status = peer.diagnostics.get("executor: execution")
            return status is not None and "waiting for state: /scan (" in status.message

        peer.wait_until(stale, what="a stale scan")
        assert executor.stop() == 0
