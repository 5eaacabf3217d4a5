"""The action server `charge` of the simulated robot.

A goal's `order` is the charge to reach, in per cent; the feedback, and the result, are the per
cents that were reached.  The type is that of tutorials, as there is no standard one for it.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Any, Final

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future
from test_msgs.action import Fibonacci

from rebt_ros.simulated_robot.robot import Robot

#: Per cents of a full battery.
_FULL: Final = 100


class _Ending(Enum):
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


class ChargeServer:
    """Accepts a goal on the dock alone; one that comes later replaces it.

    Args:
        node: The robot's node.
        robot: The robot.
        asked: Told that somebody asks for it, whether it is accepted or not.
    """

    def __init__(self, node: Node, robot: Robot, asked: Callable[[], None]) -> None:
        self._robot = robot
        self._asked = asked
        self._goal: _Goal | None = None
        self._server = ActionServer(
            node,
            Fibonacci,
            "charge",
            execute_callback=self._execute,
            goal_callback=self._decide,
            cancel_callback=self._cancel,
        )

    @property
    def charging(self) -> bool:
        """Whether the robot charges, and does nothing else."""
        return self._goal is not None

    def tick(self) -> None:
        """Looks how far the charge is."""
        goal = self._goal
        if goal is None:
            return
        if goal.handle.is_cancel_requested:
            self._end(_Ending.CANCELED)
        elif not self._robot.docked:
            self._end(_Ending.ABORTED)
        elif goal.is_reached_at(self._robot.battery):
            self._end(_Ending.SUCCEEDED)

    def reset(self) -> None:
        """Gives the goal up."""
        self._end(_Ending.ABORTED)

    def _decide(self, request: Any) -> GoalResponse:
        self._asked()
        possible = self._robot.docked and 0 < request.order <= _FULL
        return GoalResponse.ACCEPT if possible else GoalResponse.REJECT

    def _cancel(self, handle: Any) -> CancelResponse:
        if self._goal is not None and self._goal.handle == handle:
            self._end(_Ending.CANCELED)
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Fibonacci.Result:
        self._end(_Ending.ABORTED)
        goal = self._goal = _Goal(handle)
        ending = await goal.ended
        # A cancellation is under way until its callback has returned.
        if handle.is_cancel_requested:
            handle.canceled()
        elif ending is _Ending.SUCCEEDED:
            handle.succeed()
        else:
            handle.abort()
        return Fibonacci.Result(sequence=goal.reached)

    def _end(self, ending: _Ending) -> None:
        if self._goal is not None:
            self._goal.ended.set_result(ending)
            self._goal = None


class _Goal:
    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self.ended: Any = Future()
        self.reached: list[int] = []

    def is_reached_at(self, battery: float) -> bool:
        now = int(battery * _FULL)
        if not self.reached or now > self.reached[-1]:
            self.reached.append(now)
            self.handle.publish_feedback(Fibonacci.Feedback(sequence=self.reached))
        return battery * _FULL >= int(self.handle.request.order)
