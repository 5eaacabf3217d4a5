"""The least that a ROS 2 node in Python is, and that it can do: it answers with a command.

python bare_node.py
"""

from __future__ import annotations

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import Float64MultiArray, String


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("bare")
    command = node.create_publisher(String, "command", 10)

    def answer(state: Float64MultiArray) -> None:
        command.publish(String(data="go" if state.data[0] <= 0.5 else "turn"))

    node.create_subscription(Float64MultiArray, "state", answer, 10)
    node.get_logger().info("ready")
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
