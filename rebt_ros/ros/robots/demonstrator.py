"""The scripted demonstrator as a node: it answers every state of the robot with an action."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from rebt_ros.demonstration.fields import names_of, values_of
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.graph_watch import GraphWatch
from rebt_ros.ros.parameters import Parameters
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import State

#: How long to wait for those who are there and not connected yet (seconds).
_PATIENCE = 5.0


def declare_settings(node: Node) -> bool:
    """Declares and reads the parameters.

    Returns:
        Whether to drive from the start.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    enabled = declare.flag("enabled", True, "Whether to drive from the start.")()
    declare.refuse_others()
    return enabled


class Patience:
    """Waits for what may never come, a while each time.

    Args:
        limit: How long, in seconds.
        clock: Tells the time in seconds.
    """

    def __init__(self, limit: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._limit = limit
        self._clock = clock
        self._since: float | None = None

    def lasts(self, missing: bool) -> bool:
        """Whether to go on waiting, as long as something is missing; begins anew if it was not."""
        if not missing:
            self._since = None
            return False
        if self._since is None:
            self._since = self._clock()
        return self._clock() - self._since <= self._limit


class DemonstratorNode(Node):
    """Drives the simulated robot while it is enabled.

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("demonstrator")
        self._enabled = declare_settings(self)
        self._faults = Faults(self.get_logger())
        self._watch = GraphWatch(self)
        self._patience = Patience(_PATIENCE)
        self._answered = 0
        self._actions = self.create_publisher(String, "action", 10)
        self._states = self.create_subscription(Float64MultiArray, "state", self._on_state, 1)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self._diagnostics = Diagnostics(self, "demonstration", self._report)
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
            self._answered += 1

    def _is_heard(self) -> bool:
        """Whether all who listen to the actions will get them; waits for them a while only."""
        connected = self._actions.get_subscription_count()
        there = self.count_subscribers(self._actions.topic_name)
        if self._patience.lasts(missing=connected < there):
            return False
        if connected >= there:
            return True
        self._faults.note(
            "subscriber not connected",
            f"{there - connected} of {there} subscribers of {self._actions.topic_name} are not "
            "connected and get no actions: check their types and QoS.",
        )
        return True

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        response.success = True
        response.message = self._what_it_does()
        return response

    def _what_it_does(self) -> str:
        return "driving the robot." if self._enabled else "not driving the robot."

    def _report(self) -> Report:
        watch = self._watch
        values = {"enabled": self._enabled, "actions": self._answered, **self._faults.counts}
        findings = [*watch.unheard([self._states]), *watch.unread([self._actions.topic_name])]
        problems = watch.say(findings if self._enabled else ())
        if self._enabled and self._faults.recent:
            problems.insert(0, self._faults.recent)
        message = self._what_it_does().rstrip(".")
        return Report(Level.WARN if problems else Level.OK, "; ".join((message, *problems)), values)


def main(args: list[str] | None = None) -> None:
    """Runs the demonstrator."""
    lifetime.run(DemonstratorNode, args)


if __name__ == "__main__":
    main()
