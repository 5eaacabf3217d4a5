"""Drives the simulated robot as a person does: with a joystick, and what moves the robot by it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from geometry_msgs.msg import Twist
from rclpy.action.client import ActionClient
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from sensor_msgs.msg import Joy
from test_msgs.action import Fibonacci

from rebt_ros.ros.robots.standard_messages import (
    STATE_TOPICS,
    joystick_of,
    state_of,
    velocity_of,
)
from rebt_ros.simulated_robot.robot import Action, State

#: Up to where to charge, in per cent.
_ENOUGH: Final = 100


class StandardHands:
    """Sees what the robot publishes, and moves the joystick, on `joy`.

    What the joystick says is done at once: a velocity on `cmd_vel`, or a goal of `charge`, as long
    as the button is held.

    Args:
        node: The demonstrator's node.
        see: Told each state, once all its messages have come.
    """

    def __init__(self, node: Node, see: Callable[[State], None]) -> None:
        self._see = see
        self._fresh: dict[str, Any] = {}
        self._joystick = node.create_publisher(Joy, "joy", 10)
        self._velocities = node.create_publisher(Twist, "cmd_vel", 10)
        self._charger = ActionClient(node, Fibonacci, "charge")
        self._charge: _Charge | None = None
        self.actions: Sequence[Publisher] = [self._joystick, self._velocities]
        self.states: Sequence[Subscription] = [
            node.create_subscription(kind, topic, partial(self._on_message, topic), 1)
            for topic, kind in STATE_TOPICS.items()
        ]

    def act(self, action: str | None) -> None:
        """Moves the joystick; None: lets it go."""
        self._joystick.publish(joystick_of(action))
        if action == Action.CHARGE:
            if self._charge is None or self._charge.over:
                self._charge = _Charge(self._charger)
            return
        if self._charge is not None:
            self._charge.cancel()
            self._charge = None
        self._velocities.publish(velocity_of(action))

    def _on_message(self, topic: str, message: Any) -> None:
        self._fresh[topic] = message
        if len(self._fresh) == len(STATE_TOPICS):
            state = state_of(self._fresh)
            self._fresh.clear()
            self._see(state)


class _Charge:
    """A goal of `charge`, wanted until it is cancelled."""

    def __init__(self, client: Any) -> None:
        self.over = False
        self._handle: Any = None
        self._cancelled = False
        if client.server_is_ready():
            goal = Fibonacci.Goal(order=_ENOUGH)
            client.send_goal_async(goal).add_done_callback(self._on_answer)
        else:
            self.over = True

    def cancel(self) -> None:
        """Cancels it, at once or as soon as it is accepted."""
        self._cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_answer(self, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            self.over = True
            return
        self._handle = handle
        if self._cancelled:
            handle.cancel_goal_async()
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future: Any) -> None:
        self.over = True
