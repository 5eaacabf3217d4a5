"""Simulated time, where a node uses it."""

from __future__ import annotations

from rclpy.clock import ROSClock
from rclpy.node import Node


def simulated_time(node: Node) -> int | None:
    """The time on ``/clock`` (ns), 0 before its first message; None where it is not in use."""
    clock = node.get_clock()
    if not (isinstance(clock, ROSClock) and clock.ros_time_is_active):
        return None
    return int(clock.now().nanoseconds)
