"""The short way to speak with the simulated robot: arrays of numbers, and words."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.node import Node
from rclpy.subscription import Subscription
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String

from rebt_ros.simulated_robot.robot import Robot, State


class PlainInterface:
    """Publishes `state`, and obeys words.

    Args:
        node: The robot's node.
        topics: Topics of the words.
        obey: Told each word.
    """

    charging = False

    def __init__(self, node: Node, topics: Sequence[str], obey: Callable[[str], None]) -> None:
        self._obey = obey
        self._layout = _layout()
        self._states = node.create_publisher(Float64MultiArray, "state", 10)
        # A queue would only make commands late.
        self.commands: list[Subscription] = [
            node.create_subscription(String, topic, self._on_word, 1)
            for topic in dict.fromkeys(topics)
        ]

    def publish(self, robot: Robot) -> None:
        """Says what the robot measures now."""
        self._states.publish(Float64MultiArray(layout=self._layout, data=robot.state))

    def reset(self) -> None:
        """Nothing goes on from one run to the next."""

    def _on_word(self, message: String) -> None:
        self._obey(message.data)


def _layout() -> MultiArrayLayout:
    """How the values of a state are named."""
    names = ",".join(State._fields)
    size = len(State._fields)
    return MultiArrayLayout(dim=[MultiArrayDimension(label=names, size=size, stride=size)])
