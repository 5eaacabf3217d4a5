"""The simulated robot as a node: it publishes what it measures and obeys what it is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Final

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String
from std_srvs.srv import Trigger

from rebt_ros.errors import OptionError
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Level, Report
from rebt_ros.ros.graph_watch import GraphWatch
from rebt_ros.ros.parameters import Parameters
from rebt_ros.simulated_robot.episode import Episode
from rebt_ros.simulated_robot.robot import Robot, State
from rebt_ros.simulated_robot.world import furnished_room

_LARGEST_START: Final = 2**31 - 1

#: Runs whose results a late subscriber still hears of.
_REMEMBERED: Final = 1000


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """What the robot was started with; times are simulated seconds."""

    command_topics: tuple[str, ...]
    rate: float
    """Time steps per simulated second."""
    speedup: float
    """Simulated seconds per second, at most."""
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
        "command_topics", ["command", "action"], "String topics to obey; the last word counts."
    )()
    if not command_topics:
        raise OptionError("parameter 'command_topics' is empty: name at least one topic.")
    settings = RobotSettings(
        command_topics=command_topics,
        rate=declare.number("rate", 20.0, "Time steps per simulated second (Hz).", 5.0, 200.0)(),
        speedup=declare.number(
            "speedup", 1.0, "Simulated seconds per second, at most.", 1.0, 100.0
        )(),
        lockstep=declare.flag(
            "lockstep",
            False,
            "Whether time stands still until the latest state is answered by a command, so that a "
            "busy computer slows the simulation down instead of delaying the commands.",
        )(),
        time_limit=declare.number(
            "time_limit", 60.0, "When a run is lost (simulated seconds).", 1.0, 3600.0
        )(),
        command_timeout=declare.number(
            "command_timeout",
            0.5,
            "When the robot stops for want of a command (simulated seconds; not in lockstep).",
            0.01,
            60.0,
        )(),
        first_start=declare.integer(
            "first_start",
            0,
            "Number of the first run's start, from which the others count on; a new value holds "
            "from the next reset on.",
            0,
            _LARGEST_START,
            fixed=False,
        ),
    )
    declare.refuse_others()
    return settings


def _layout() -> MultiArrayLayout:
    """How the values of a state are named."""
    names = ",".join(State._fields)
    size = len(State._fields)
    return MultiArrayLayout(dim=[MultiArrayDimension(label=names, size=size, stride=size)])


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
        self._command: str | None = None
        self._robot = Robot(furnished_room())
        self._layout = _layout()
        self._begin(settings.first_start())
        self._open()
        self.get_logger().info(
            f"standing at start {self._robot.start}, waiting for a command on "
            f"{' or '.join(settings.command_topics)}."
        )

    def _open(self) -> None:
        """Opens everything that publishes or calls back."""
        settings = self._settings
        self._states = self.create_publisher(Float64MultiArray, "state", 10)
        self._episodes = self.create_publisher(
            String,
            "~/episode",
            QoSProfile(depth=_REMEMBERED, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        # A queue would only make commands late.
        self._commands = [
            self.create_subscription(String, topic, self._on_command, 1)
            for topic in dict.fromkeys(settings.command_topics)
        ]
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.add_post_set_parameters_callback(self._on_parameters)
        self.create_timer(1.0 / (settings.rate * settings.speedup), self._on_tick)
        self._watch = GraphWatch(self)
        self._diagnostics = Diagnostics(self, "simulation", self._report)

    def _on_command(self, message: String) -> None:
        self._command = message.data
        self._silence = 0
        self._answered = True
        self._under_way = True

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        self._new_first_start |= any(parameter.name == "first_start" for parameter in parameters)

    def _on_tick(self) -> None:
        self._silence += 1
        if not self._under_way or (self._settings.lockstep and not self._answered):
            if self._silence % self._repeat_every == 0:
                self._publish_state()
            return
        self._answered = False
        self._episode.step(self._command if self._silence <= self._patience else None)
        if self._episode.over:
            self._finish()
        self._publish_state()

    def _publish_state(self) -> None:
        self._states.publish(Float64MultiArray(layout=self._layout, data=self._robot.state))

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
        self._episode = Episode(self._robot, self._settings.time_limit, self._time_step)
        self._under_way = False
        self._answered = False
        self._command = None
        self._silence = 0

    def _report(self) -> Report:
        watch = self._watch
        # One who commands is enough.
        findings = [*watch.timeless(), *watch.misfits(self._commands)]
        if not any(watch.publishing(command.topic_name) for command in self._commands):
            findings += watch.unheard(self._commands)
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
