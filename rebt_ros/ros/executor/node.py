"""The executor: runs the learned tree on the robot's state and sends its commands."""

from __future__ import annotations

import gc
import sys
from typing import Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.errors import RebtError
from rebt_ros.live.tick_explanation import explained
from rebt_ros.ros import lifetime
from rebt_ros.ros.command_channels import DRIVING_QOS, CommandChannels
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.executor.driving import Driving
from rebt_ros.ros.executor.persons import Persons
from rebt_ros.ros.executor.preparation import Preparation
from rebt_ros.ros.executor.reporting import Reporting
from rebt_ros.ros.executor.robot_commands import RobotCommands
from rebt_ros.ros.executor.rule_check import rule_check
from rebt_ros.ros.executor.settings import declare_settings
from rebt_ros.ros.executor.state_topics import StateTopics
from rebt_ros.ros.executor.tick_clock import TickClock
from rebt_ros.ros.executor.tree_intake import TreeIntake
from rebt_ros.ros.executor.tree_program import TreeProgram
from rebt_ros.ros.executor.watching import Watching
from rebt_ros.ros.quiet_events import create_publisher

#: Time between two looks at what topics carry (seconds).
_LOOK_PERIOD: Final = 0.5

#: How long another thread may keep a tick waiting (seconds); Python's default is 5 ms.
_HAND_OVER: Final = 0.0005


class ExecutorNode(Node):
    """Ticks the latest tree at a fixed rate or, if asked for, as soon as a state arrives.

    Trees come in by `TreeIntake`, states by `StateTopics`, what a person does by `Persons`;
    `Driving` has the tree's hands on the robot, and `Reporting` says how it goes, and
    `Watching` shows the tree to other programs.

    Raises:
        RebtError: A parameter makes no sense, or what it names cannot be used.
    """

    def __init__(self) -> None:
        super().__init__("executor")
        self._settings = settings = declare_settings(self)
        faults = Faults(self.get_logger())
        self._watching = Watching(self, settings.watching)
        commands = (
            RobotCommands(
                self, settings.robot, lambda text: faults.note("failed command", f"{text}.")
            )
            if settings.robot
            else None
        )
        channels = CommandChannels(
            self,
            settings.action_result_topic,
            settings.every_tick,
            lambda text: faults.note("unknown action result", _not_understood(text)),
            commands,
        )
        # Open before there is a tree, whose first command may then be heard.
        channels.follow([DEFAULT_CHANNEL])
        histories: dict[str, ActionHistory] = {}
        preparation = Preparation(settings, channels, histories, rule_check(settings))
        says = create_publisher(self, Bool, "~/driving", DRIVING_QOS)
        clock = TickClock(self, self._on_clock_set_back)
        self._driving = Driving(
            settings,
            clock,
            channels,
            histories,
            faults,
            lambda driving: says.publish(Bool(data=driving)),
            self._watching,
        )
        self._topics = StateTopics(self, clock.now, faults, self._on_state)
        self._intake = TreeIntake(
            self,
            settings.learner,
            preparation,
            self._topics,
            channels,
            self._driving,
            faults,
            self._on_tree,
        )
        self._persons = Persons(self, settings, channels, commands, self._driving)
        if settings.tree_file is not None:
            self._intake.open(settings.tree_file)
        self.create_service(SetBool, "~/enable", self._enable)
        self.create_service(Trigger, "~/explain", self._explain)
        self._timer = self.create_timer(1.0 / settings.rate, self._driving.tick, clock=clock.clock)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_LOOK_PERIOD, self._look_at_publishers, clock=steady)
        self._reporting = Reporting(
            self,
            settings,
            commands,
            channels,
            self._topics,
            self._driving,
            self._persons,
            self._intake,
            faults,
            self._watching,
        )
        self._driving.tell()
        self._begin()

    def _begin(self) -> None:
        """Says what it is about to do."""
        if self._settings.learner:
            self.get_logger().info(
                f"following the trees of {self._settings.learner}, on "
                f"{self._intake.documents.topic_name}."
            )
        self.get_logger().info(
            f"enabled: {self._reporting.condition}."
            if self._driving.enabled
            else "disabled until ~/enable is called."
        )

    def close(self) -> None:
        """Interrupts what runs."""
        self._intake.close()
        self._driving.close()
        self._watching.close()

    # --- what comes in ---

    def _on_tree(self) -> None:
        self._driving.tell()
        # Who has sent it waits for that.
        self._reporting.publish()

    def _on_state(self, topic: str, reader: TreeProgram | None) -> None:
        self._intake.try_candidate()
        if self._settings.tick_on_state and reader in (None, self._driving.program):
            self._tick_on(topic)

    def _tick_on(self, topic: str) -> None:
        """Ticks on a state that has just arrived; the timer's next tick is a whole period away."""
        program = self._driving.program
        if program is None or topic not in program.inputs.topics:
            return
        # Lagged features look back at ticks that are evenly spaced: those of the timer.
        if program.inputs.lagged:
            return
        self._driving.tick()
        self._timer.reset()

    def _look_at_publishers(self) -> None:
        self._topics.look()
        self._persons.look()

    def _on_clock_set_back(self) -> None:
        self._topics.forget()
        self._driving.set_back()

    # --- what is asked ---

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data:
            self._driving.enable()
        else:
            self._driving.disable()
        response.success = True
        response.message = (
            f"enabled: {self._reporting.condition}." if self._driving.enabled else "disabled."
        )
        self.get_logger().info(response.message)
        return response

    def _explain(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Says why the last tick did what it did."""
        tick = self._driving.last_tick
        if tick is None:
            response.message = f"there was no tick yet: {self._reporting.condition}."
            return response
        try:
            response.message = explained(tick)
            response.success = True
        except RebtError as err:
            response.message = str(err)
        return response


def _not_understood(text: str) -> str:
    return (
        f"the action result {text!r} is not understood: "
        "send 'success' or 'failure', or 'label:success' or 'label:failure'."
    )


def main(args: list[str] | None = None) -> None:
    """Runs the executor."""
    # The thread that reads trees hands the interpreter over to a tick that is due.
    sys.setswitchinterval(_HAND_OVER)
    # A search through all that there is takes longer than a tick, and there is next to no garbage
    # to be found, as trees are taken apart: it is made a hundred times less often.
    young, middle, old = gc.get_threshold()
    gc.set_threshold(young, middle, 100 * max(old, 1))
    gc.freeze()
    lifetime.run(ExecutorNode, args)


if __name__ == "__main__":
    main()
