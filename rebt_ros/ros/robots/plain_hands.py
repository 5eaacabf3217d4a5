"""Drives the simulated robot the short way: sees an array of numbers, and says words."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.demonstration.fields import names_of, values_of
from rebt_ros.simulated_robot.robot import State


class PlainHands:
    """Sees `state`, and answers on `action`.

    Args:
        node: The demonstrator's node.
        see: Told each state.
        note: Told the kind of a fault, and what it is.
    """

    def __init__(
        self, node: Node, see: Callable[[State], None], note: Callable[[str, str], object]
    ) -> None:
        self._see = see
        self._note = note
        self._publisher = node.create_publisher(String, "action", 10)
        self.actions: Sequence[Publisher] = [self._publisher]
        self.states: Sequence[Subscription] = [
            node.create_subscription(Float64MultiArray, "state", self._on_state, 1)
        ]

    def act(self, action: str | None) -> None:
        """Says a word; None: says nothing."""
        if action is not None:
            self._publisher.publish(String(data=action))

    def _on_state(self, message: Float64MultiArray) -> None:
        fields, values = names_of(message), values_of(message)
        if fields == State._fields:
            self._see(State(*values))
        else:
            self._note(
                "foreign state",
                f"a state of {len(values)} values is left out: "
                f"its layout must name {', '.join(State._fields)}.",
            )
