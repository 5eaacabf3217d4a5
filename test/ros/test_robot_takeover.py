"""A joystick in the hands of a person who corrects a tree that drives by a Twist."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import robot_bags as some
from geometry_msgs.msg import Twist
from ros_processes import AGES, NodeProcess, Peer
from sensor_msgs.msg import Joy
from test_corrections import PARAMETERS, origins, recorded

from rebt_ros.storage.inputs import load
from rebt_ros.storage.recording_head import Origin

ROBOT = """\
state: {ahead: {path: "/scan.ranges[-30deg:30deg].@min", max_age: 600}}
actions: {action: {joy: /joy, emit: message, axes: {1: {0.5: go, -0.5: back}}}}
commands:
  go: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: 0.25}}}
  back: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: -0.25}}}
  stop: {publish: /cmd_vel, type: geometry_msgs/msg/Twist}
"""


class Course:
    """A robot that sees how far it is to a wall, and a person beside it."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self.velocities: list[float] = []
        peer.node.create_subscription(Twist, "/cmd_vel", self._on_velocity, 1000)

    def show(self, ahead: float, axis: float, rows: int) -> None:
        """A person holds the joystick for so many messages, and lets it go."""
        for _ in range(rows):
            self._peer.publish(some.scan(ahead), "/scan")
            self._peer.publish(some.joy(axis=axis), "/joy")
            self._peer.spin_once()
        self._peer.publish(some.joy(), "/joy")

    def until(self, ahead: float, condition: Callable[[], Any], what: str) -> None:
        """Nobody touches the joystick until the condition holds."""

        def moved() -> Any:
            self._peer.publish(some.scan(ahead), "/scan")
            return condition()

        self._peer.wait_until(moved, what=what)

    def driven(self, ahead: float, velocity: float) -> None:
        """Waits until the executor has driven for a while."""
        self.velocities.clear()
        self.until(ahead, lambda: len(self.velocities) > 30, "velocities")
        assert self.velocities[-1] == velocity

    def _on_velocity(self, message: Twist) -> None:
        self.velocities.append(message.linear.x)


def test_a_takeover_by_joystick_becomes_a_correction(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "robot.yaml").write_text(ROBOT)
    robot = {"robot_file": "robot.yaml"}
    executing = robot | {
        "rate": 50.0,
        # Longer than this process may stand still while it sends what a person does.
        "takeover_timeout": 4.0,
        "state_timeout": AGES,
        "novelty": "ignore",
    }
    with (
        NodeProcess("recorder_node", domain, tmp_path, robot | {"state_wait": 0.2}),
        NodeProcess("learner_node", domain, tmp_path, PARAMETERS),
        NodeProcess("executor_node", domain, tmp_path, executing),
    ):
        course = Course(peer)
        # The recorder and the executor.
        peer.connect(Joy, "/joy", subscribers=2)
        peer.connect(type(some.scan(1.0)), "/scan")
        course.show(4.0, 1.0, 10)
        course.show(6.0, -1.0, 10)
        recorded(peer, 20)
        assert "20 rows of 1 demonstration" in peer.call("/learner/relearn").message
        assert peer.call("/executor/enable", True).success

        # It goes on where a wall is near, of which it was shown nothing.
        course.driven(4.0, 0.25)
        course.driven(0.5, 0.25)
        course.show(0.5, -1.0, 10)
        recorded(peer, 30, takeovers="1", failed_episodes="0")
        course.driven(4.0, 0.25)
        assert peer.call("/recorder/record", False).success

        assert origins(tmp_path / "demonstrations") == [Origin.DEMONSTRATION, Origin.TAKEOVER]
        first, second = load([tmp_path / "demonstrations"]).demonstrations
        assert (len(first), len(second)) == (20, 10)
        assert second.actions == ("back",)
        assert second.before == {"action": "go"}
        assert set(second.states[:, 0].tolist()) == {0.5}

        assert "30 rows of 2 demonstrations" in peer.call("/learner/relearn").message
        course.until(0.5, lambda: course.velocities[-1] == -0.25, "what the person has shown")
        course.driven(4.0, 0.25)
