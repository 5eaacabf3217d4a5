"""A robot that acts as a configuration of the paper's experiments says, in a random environment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, Float64MultiArray, MultiArrayDimension, String
from std_srvs.srv import SetBool

from rebt_ros.demonstration.fields import dimension_labels_of
from rebt_ros.errors import OptionError
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Level, Report
from rebt_ros.ros.graph_watch import GraphWatch
from rebt_ros.ros.parameters import Parameters, at_home
from rebt_ros.storage.text import read_text
from rebt_ros.study.simulator.configuration_file import parse_config
from rebt_ros.study.simulator.synthetic_robot import (
    REPEATS,
    RUNNING_CHANCE,
    ExperimentRobot,
    published_variables,
)

_LARGEST: Final = 2**31 - 1

#: Messages that are kept for a subscriber that is late; a tick can do many actions.
_QUEUE: Final = 1000

#: How long to wait until subscribers have heard that acting begins (seconds).
_GREETING: Final = 1.0


@dataclass(frozen=True, slots=True)
class SyntheticRobotSettings:
    """What the robot was started with."""

    config: Path
    seed: int
    rate: float
    """Ticks of the tree per second."""
    ticks: int
    """Until the robot stops for good; 0 for no end."""
    running_chance: float
    repeats: int
    enabled: bool
    audience: int
    """Number of subscribers that state and action must each have before the robot starts to act."""


def declare_settings(node: Node) -> SyntheticRobotSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    path = declare.text(
        "config", "", "Configuration file of an experiment; ~ is your home directory."
    )()
    settings = SyntheticRobotSettings(
        config=at_home("config", path),
        seed=declare.integer(
            "seed", 0, "Random seed; the same seed gives the same robot.", -_LARGEST, _LARGEST
        )(),
        rate=declare.number("rate", 10.0, "Ticks of the tree per second.", 0.1, 1000.0)(),
        ticks=declare.integer(
            "ticks", 0, "Number of ticks after which the robot stops; 0 for no limit.", 0, _LARGEST
        )(),
        running_chance=declare.number(
            "running_chance",
            RUNNING_CHANCE,
            "Probability that an action is still running when ticked; below 1.",
            0.0,
            1.0,
        )(),
        repeats=declare.integer(
            "repeats", REPEATS, "Number of times that Repeaters run their children.", 1, _LARGEST
        )(),
        enabled=declare.flag("enabled", True, "Act from the start.")(),
        audience=declare.integer(
            "wait_for_subscribers",
            0,
            "Subscribers that state and action must have each before the robot begins to act.",
            0,
            1000,
        )(),
    )
    declare.refuse_others()
    if not path:
        raise OptionError("parameter 'config' is empty: give it a configuration file.")
    return settings


class SyntheticRobotNode(Node):
    """Senses and acts by chance, and publishes both, as a robot and its demonstrator would.

    At every tick it publishes its state, and then each action that is done, with how it ended.
    An empty action says that none is taken: it is sent before the first tick and after the last.

    Raises:
        RebtError: A parameter makes no sense, or the configuration cannot be read.
    """

    def __init__(self) -> None:
        super().__init__("synthetic_robot")
        settings = declare_settings(self)
        self._ticks, self._audience = settings.ticks, settings.audience
        self._enabled = settings.enabled
        config = parse_config(read_text(settings.config), settings.config.stem)
        for note in config.notes:
            self.get_logger().warning(f"{note}.")
        self._robot = ExperimentRobot(
            config,
            settings.seed,
            running_chance=settings.running_chance,
            repeats=settings.repeats,
            variables=published_variables(config),
        )
        self._ticked = 0
        self._done = 0
        self._begun = False

        self._layout = Float64MultiArray().layout
        labels = dimension_labels_of(self._robot.variables)
        size = len(self._robot.variables) if len(labels) == 1 else 1
        self._layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=size) for label in labels
        ]
        qos = QoSProfile(depth=_QUEUE)
        self._states = self.create_publisher(Float64MultiArray, "state", qos)
        self._actions = self.create_publisher(String, "action", qos)
        self._outcomes = self.create_publisher(Bool, "outcome", qos)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.create_timer(1.0 / settings.rate, self._on_tick)
        self._watch = GraphWatch(self)
        self._diagnostics = Diagnostics(self, "acting", self._report)
        self.get_logger().info(f"{config.name}: {self._what_it_does()}")

    def _on_tick(self) -> None:
        if not self._enabled or (not self._begun and not self._begin()):
            return
        done = self._robot.step()
        self._ticked += 1
        self._done += len(done)
        self._publish_state()
        for action in done:
            self._actions.publish(String(data=action.label))
            self._outcomes.publish(Bool(data=action.succeeded))
        if self._over:
            self._end()
            self.get_logger().info(self._what_it_does())

    @property
    def _over(self) -> bool:
        return self._ticks > 0 and self._ticked >= self._ticks

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if not request.data:
            self._end()
        elif not self._over:
            self._enabled = True
        response.success = self._enabled == request.data
        response.message = self._what_it_does()
        return response

    def _begin(self) -> bool:
        """Makes sure that all who listen already hear states and actions in their order.

        A subscriber that this node knows may not know this node yet: what is sent until then it
        gets late, and that on one topic after what is sent later on another.

        Returns:
            Whether there are enough subscribers to begin.
        """
        topics = (self._states, self._actions)
        if any(topic.get_subscription_count() < self._audience for topic in topics):
            return False
        self._publish_state()
        self._actions.publish(String())
        for publisher in topics:
            publisher.wait_for_all_acked(Duration(seconds=_GREETING))
        self._begun = True
        return True

    def _end(self) -> None:
        if self._begun:
            self._actions.publish(String())
        self._enabled = self._begun = False

    def _publish_state(self) -> None:
        self._states.publish(Float64MultiArray(layout=self._layout, data=self._robot.state))

    def _report(self) -> Report:
        watch, topics = self._watch, (self._states, self._actions)
        findings = [*watch.timeless(), *watch.unread(topics)]
        problems = watch.say(findings if self._enabled and not self._over else ())
        values = {"enabled": self._enabled, "ticks": self._ticked, "actions": self._done}
        message = self._what_it_does().rstrip(".")
        return Report(Level.WARN if problems else Level.OK, "; ".join((message, *problems)), values)

    def _what_it_does(self) -> str:
        if self._over:
            return f"at the end after {self._ticked} ticks and {self._done} actions."
        so_far = f"{self._ticked} ticks and {self._done} actions so far."
        if not self._enabled:
            return f"not acting, {so_far}"
        waiting = f" once it has {self._audience} subscribers" if self._audience else ""
        return f"acting{'' if self._begun else waiting}, {so_far}"


def main(args: list[str] | None = None) -> None:
    """Runs the synthetic robot."""
    lifetime.run(SyntheticRobotNode, args)


if __name__ == "__main__":
    main()
