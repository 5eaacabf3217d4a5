"""The simulated robot as a node: it publishes what it measures and obeys what it is told."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Final, Protocol

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String
from std_srvs.srv import Trigger

from rebt_ros.errors import OptionError
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Level, Report
from rebt_ros.ros.graph_watch import GraphWatch
from rebt_ros.ros.parameters import Parameters
from rebt_ros.ros.robots.plain_interface import PlainInterface
from rebt_ros.ros.robots.standard_interface import StandardInterface
from rebt_ros.simulated_robot.episode import Episode
from rebt_ros.simulated_robot.robot import STANDING, Action, Robot, Velocity
from rebt_ros.simulated_robot.world import furnished_room

_LARGEST_START: Final = 2**31 - 1

#: Runs whose results a late subscriber still hears of.
_REMEMBERED: Final = 1000


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """What the robot was started with; times are simulated seconds."""

    plain: bool
    """Whether it speaks arrays of numbers and words, and not the messages of real robots."""
    command_topics: tuple[str, ...]
    rate: float
    """Time steps per simulated second."""
    speedup: float
    """Maximum number of simulated seconds per second."""
    lockstep: bool
    """Whether time stands still until a state is answered."""
    time_limit: float
    command_timeout: float
    first_start: Callable[[], int]
    """Reads what it is set to by now."""


def declare_settings(node: Node) -> RobotSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    command_topics = declare.texts(
        "command_topics",
        ["command", "action"],
        "String topics to obey in plain mode; the latest message counts.",
    )()
    if not command_topics:
        raise OptionError("parameter 'command_topics' is empty: name at least one topic.")
    settings = RobotSettings(
        plain=declare.flag(
            "plain",
            False,
            "Publish plain arrays and strings instead of the messages of real robots.",
        )(),
        command_topics=command_topics,
        rate=declare.number("rate", 20.0, "Time steps per simulated second (Hz).", 5.0, 200.0)(),
        speedup=declare.number(
            "speedup", 1.0, "Simulated seconds per second, at most.", 1.0, 100.0
        )(),
        lockstep=declare.flag(
            "lockstep",
            False,
            "Stop time until a command answers the latest state, so that a busy computer slows "
            "the simulation down instead of delaying commands.",
        )(),
        time_limit=declare.number(
            "time_limit",
            60.0,
            "Time after which a run counts as lost (simulated seconds).",
            1.0,
            3600.0,
        )(),
        command_timeout=declare.number(
            "command_timeout",
            0.5,
            "How long the robot obeys a command before it stops (simulated seconds; not in "
            "lockstep).",
            0.01,
            60.0,
        )(),
        first_start=declare.integer(
            "first_start",
            0,
            "Number of the start of the first run; later runs count up from it. A new value "
            "takes effect at the next reset.",
            0,
            _LARGEST_START,
            fixed=False,
        ),
    )
    declare.refuse_others()
    return settings


class Interface(Protocol):
    """How the robot and others speak with each other."""

    @property
    def charging(self) -> bool:
        """Whether the robot charges, and does nothing else."""

    @property
    def commands(self) -> Sequence[Subscription]:
        """Where commands come in."""

    def publish(self, robot: Robot) -> None:
        """Says what the robot measures now."""

    def reset(self) -> None:
        """A run begins."""


class RobotNode(Node):
    """Simulates a robot, run after run.

    Every time step it obeys the latest command and publishes its state.  At the beginning of a run
    it stands still, and the run's time with it, until it is commanded.

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("robot")
        self._settings = settings = declare_settings(self)
        self._time_step = 1.0 / settings.rate
        # While time stands still, the state is repeated at the rate of real time.
        self._repeat_every = max(round(settings.speedup), 1)
        self._patience = max(round(settings.command_timeout * settings.rate), 1)
        self._new_first_start = False
        self._runs = 0
        self._command: str | Velocity | None = None
        self._robot = Robot(furnished_room())
        self._interface: Interface = (
            PlainInterface(self, settings.command_topics, self._obey)
            if settings.plain
            else StandardInterface(
                self, self._robot, self._obey, self._answer if settings.lockstep else None
            )
        )
        self._begin(settings.first_start())
        self._open()
        topics = [command.topic_name for command in self._interface.commands]
        self.get_logger().info(
            f"standing at start {self._robot.start}, waiting for a command on "
            f"{' or '.join(topics)}."
        )

    def _open(self) -> None:
        """Opens everything else that publishes or calls back."""
        settings = self._settings
        self._episodes = self.create_publisher(
            String,
            "~/episode",
            QoSProfile(depth=_REMEMBERED, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.add_post_set_parameters_callback(self._on_parameters)
        self.create_timer(1.0 / (settings.rate * settings.speedup), self._on_tick)
        self._watch = GraphWatch(self)
        self._diagnostics = Diagnostics(self, "simulation", self._report)

    def _obey(self, command: str | Velocity | None) -> None:
        self._command = command
        self._answer()
        # Who halts a robot that waits does not begin a run.
        self._under_way |= command != STANDING

    def _answer(self) -> None:
        self._silence = 0
        self._answered = True

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        self._new_first_start |= any(parameter.name == "first_start" for parameter in parameters)

    def _on_tick(self) -> None:
        self._silence += 1
        waits = self._settings.lockstep and not self._answered
        if not self._under_way or waits:
            if self._silence % self._repeat_every == 0:
                self._interface.publish(self._robot)
            return
        self._answered = False
        command = self._command if self._silence <= self._patience else None
        self._episode.step(Action.CHARGE if self._interface.charging else command)
        if self._episode.over:
            self._finish()
        self._interface.publish(self._robot)

    def _finish(self) -> None:
        result = self._episode.result
        self._runs += 1
        self._episodes.publish(String(data=json.dumps({"episode": self._runs, **asdict(result)})))
        self.get_logger().info(
            f"run {self._runs} from start {result.start}: "
            f"{'reached the goal' if result.reached else 'did not reach the goal'} "
            f"after {result.seconds:.1f} s, {result.bumps} bumps."
        )
        self._begin(result.start + 1)

    def _begin(self, start: int) -> None:
        """Stands at a start until the next command."""
        self._robot.begin(start)
        self._interface.reset()
        self._episode = Episode(self._robot, self._settings.time_limit, self._time_step)
        self._under_way = False
        self._answered = False
        self._command = None
        self._silence = 0

    def _report(self) -> Report:
        watch, commands = self._watch, self._interface.commands
        # One who commands is enough.
        findings = [*watch.timeless(), *watch.misfits(commands)]
        if not any(watch.publishing(command.topic_name) for command in commands):
            findings += watch.unheard(commands)
        problems = watch.say(findings)
        message = "under way" if self._under_way else "waiting for a command"
        values = {"run": self._runs + 1, "start": self._robot.start}
        return Report(Level.WARN if problems else Level.OK, "; ".join((message, *problems)), values)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        start = self._settings.first_start() if self._new_first_start else self._robot.start + 1
        self._new_first_start = False
        self._begin(start)
        response.success = True
        response.message = f"standing at start {start}, waiting for a command."
        return response


def main(args: list[str] | None = None) -> None:
    """Runs the simulated robot."""
    lifetime.run(RobotNode, args)


if __name__ == "__main__":
    main()
