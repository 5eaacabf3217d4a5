"""The scripted demonstrator as a node: it answers every state of the robot with an action."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from std_srvs.srv import SetBool

from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.graph_watch import GraphWatch
from rebt_ros.ros.parameters import Parameters
from rebt_ros.ros.robots.plain_hands import PlainHands
from rebt_ros.ros.robots.standard_hands import StandardHands
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import State

#: How long to wait for those who are there and not connected yet (seconds).
_PATIENCE = 5.0


@dataclass(frozen=True, slots=True)
class DemonstratorSettings:
    """What the demonstrator was started with."""

    enabled: bool
    """Drive from the start."""
    plain: bool
    """Whether the robot speaks arrays of numbers and words."""


def declare_settings(node: Node) -> DemonstratorSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    settings = DemonstratorSettings(
        enabled=declare.flag("enabled", True, "Whether to drive from the start.")(),
        plain=declare.flag(
            "plain",
            False,
            "Set this if the robot publishes plain arrays and strings instead of the messages of "
            "real robots.",
        )(),
    )
    declare.refuse_others()
    return settings


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


class Hands(Protocol):
    """What a person drives the robot with."""

    @property
    def states(self) -> Sequence[Subscription]:
        """What is seen."""

    @property
    def actions(self) -> Sequence[Publisher]:
        """What is done."""

    def act(self, action: str | None) -> None:
        """Does something; None: lets go."""


class DemonstratorNode(Node):
    """Drives the simulated robot while it is enabled.

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("demonstrator")
        settings = declare_settings(self)
        self._enabled = settings.enabled
        self._faults = Faults(self.get_logger())
        self._watch = GraphWatch(self)
        self._patience = Patience(_PATIENCE)
        self._answered = 0
        self._hands: Hands = (
            PlainHands(self, self._on_state, self._faults.note)
            if settings.plain
            else StandardHands(self, self._on_state)
        )
        self.create_service(SetBool, "~/enable", self._on_enable)
        self._diagnostics = Diagnostics(self, "demonstration", self._report)
        self.get_logger().info(self._what_it_does())

    def _on_state(self, state: State) -> None:
        if self._enabled and self._is_heard():
            self._hands.act(decide(state))
            self._answered += 1

    def _is_heard(self) -> bool:
        """Whether all who listen to the actions will get them; waits for them a while only."""
        actions = self._hands.actions
        connected = {one.topic_name: one.get_subscription_count() for one in actions}
        there = {one.topic_name: self.count_subscribers(one.topic_name) for one in actions}
        missing = {name: there[name] - connected[name] for name in there}
        if self._patience.lasts(missing=any(count > 0 for count in missing.values())):
            return False
        for name, count in missing.items():
            if count > 0:
                self._faults.note(
                    "subscriber not connected",
                    f"{count} of {there[name]} subscribers of {name} are not connected and get no "
                    "actions: check their types and QoS.",
                )
        return True

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._enabled and not request.data:
            self._hands.act(None)
        self._enabled = request.data
        response.success = True
        response.message = self._what_it_does()
        return response

    def _what_it_does(self) -> str:
        return "driving the robot." if self._enabled else "not driving the robot."

    def _report(self) -> Report:
        watch = self._watch
        values = {"enabled": self._enabled, "actions": self._answered, **self._faults.counts}
        findings = [*watch.unheard(self._hands.states), *watch.unread(self._hands.actions)]
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
