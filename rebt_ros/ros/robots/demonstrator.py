"""The scripted demonstrator as a node: it answers every state of the robot with an action."""

from __future__ import annotations

import time

from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from rebt_ros.demonstration.fields import names_of, values_of
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.parameters import Parameters
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import State

#: How long to wait for those who are there and not connected yet (seconds).
_PATIENCE = 5.0


class DemonstratorNode(Node):
    """Drives the simulated robot while it is enabled.

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("demonstrator")
        self._enabled = Parameters(self).flag("enabled", True, "Whether to drive from the start.")()
        self._faults = Faults(self.get_logger())
        self._waiting_since: float | None = None
        self._actions = self.create_publisher(String, "action", 10)
        self.create_subscription(Float64MultiArray, "state", self._on_state, 1)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.get_logger().info(self._what_it_does())

    def _on_state(self, message: Float64MultiArray) -> None:
        if not self._enabled:
            return
        fields, values = names_of(message), values_of(message)
        if fields != State._fields:
            self._faults.note(
                "foreign state",
                f"a state of {len(values)} values is left out: "
                f"its layout must name {', '.join(State._fields)}.",
            )
            return
        if self._is_heard():
            self._actions.publish(String(data=decide(values)))

    def _is_heard(self) -> bool:
        """Whether all who listen to the actions will get them; waits for them a while only."""
        if self._actions.get_subscription_count() >= self.count_subscribers("action"):
            return True
        self._waiting_since = self._waiting_since or time.monotonic()
        return time.monotonic() - self._waiting_since > _PATIENCE

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        response.success = True
        response.message = self._what_it_does()
        return response

    def _what_it_does(self) -> str:
        return "driving the robot." if self._enabled else "not driving the robot."


def main(args: list[str] | None = None) -> None:
    """Runs the demonstrator."""
    lifetime.run(DemonstratorNode, args)


if __name__ == "__main__":
    main()
