"""The way of real robots to speak: standard messages, velocities, and an action server."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import Twist
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import Joy
from std_msgs.msg import String

from rebt_ros.ros.robots.charging import ChargeServer
from rebt_ros.ros.robots.standard_messages import STATE_TOPICS, state_messages
from rebt_ros.simulated_robot.robot import Robot, Velocity


class StandardInterface:
    """Publishes odometry, scan and the like, obeys `cmd_vel`, and charges on request.

    Args:
        node: The robot's node.
        robot: The robot.
        obey: Told each velocity, and None where it is asked to charge.
        answer: Told that the driver has answered a state while the robot charges, when nothing is
            sent to it: by what a joystick or the executor says.  None where time does not wait.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        obey: Callable[[Velocity | None], None],
        answer: Callable[[], None] | None,
    ) -> None:
        self._node = node
        self._obey = obey
        self._publishers = {
            topic: node.create_publisher(kind, topic, 10) for topic, kind in STATE_TOPICS.items()
        }
        # A queue would only make commands late.
        self.commands: Sequence[Subscription] = [
            node.create_subscription(Twist, "cmd_vel", self._on_velocity, 1)
        ]
        self._charger = ChargeServer(node, robot, lambda: obey(None))
        if answer is not None:
            self._answer = answer
            for kind, topic in ((Joy, "joy"), (String, "command")):
                node.create_subscription(kind, topic, self._on_answer, 1)

    @property
    def charging(self) -> bool:
        """Whether the robot charges, and does nothing else."""
        return self._charger.charging

    def publish(self, robot: Robot) -> None:
        """Says what the robot measures now."""
        self._charger.tick()
        stamp = self._node.get_clock().now().to_msg()
        messages = state_messages(robot, stamp, charging=self.charging)
        for topic, message in messages.items():
            self._publishers[topic].publish(message)

    def reset(self) -> None:
        """Gives up what goes on."""
        self._charger.reset()

    def _on_answer(self, message: Any) -> None:
        if self.charging:
            self._answer()

    def _on_velocity(self, message: Twist) -> None:
        self._obey(Velocity(message.linear.x, message.angular.z))
