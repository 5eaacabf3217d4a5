"""The least that a Python node can do with messages: it subscribes to what the recorder does, and
drops them.

    python empty_subscriber.py single|events
"""

from __future__ import annotations

import sys

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray, String


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("empty_subscriber")
    for kind, topic in ((Float64MultiArray, "state"), (String, "action")):
        node.create_subscription(kind, topic, lambda _: None, QoSProfile(depth=5000))
    executor = EventsExecutor() if sys.argv[1] == "events" else SingleThreadedExecutor()
    executor.add_node(node)
    print("ready", flush=True)
    executor.spin()


if __name__ == "__main__":
    main()
