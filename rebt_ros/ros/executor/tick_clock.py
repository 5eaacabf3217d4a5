"""The clock that ticks go by."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.clock import Clock, JumpThreshold
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node

from rebt_ros.live.clock_watch import ClockWatch


class TickClock:
    """Simulated time where that is used; else a clock that nobody sets.

    Args:
        node: The node.
        set_back: Called after simulated time was set back.
    """

    def __init__(self, node: Node, set_back: Callable[[], None]) -> None:
        self._watch = ClockWatch()
        self._simulated = bool(node.get_parameter("use_sim_time").value)
        self.clock = (
            node.get_clock() if self._simulated else Clock(clock_type=ClockType.STEADY_TIME)
        )
        """For timers."""
        if self._simulated:
            back = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1))
            self._jumps = self.clock.create_jump_callback(back, post_callback=lambda _: set_back())

    @property
    def stands(self) -> bool:
        """Whether simulated time has not begun, or has stopped."""
        return self._simulated and self._watch.stands(self.now(), time.monotonic())

    def now(self) -> int:
        """The time, nanoseconds."""
        # What a steady clock of ROS says, at a fraction of the cost: this is asked several times
        # between a state and its command.
        return int(self.clock.now().nanoseconds) if self._simulated else time.monotonic_ns()
