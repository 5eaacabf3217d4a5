"""What the executor says about itself: its condition, diagnostics, and snapshots of the tree."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import String

from rebt_ros.behavior_tree import nodes
from rebt_ros.ros.command_channels import CommandChannels
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.executor.driving import NOVEL, Driving
from rebt_ros.ros.executor.persons import Persons
from rebt_ros.ros.executor.robot_commands import RobotCommands
from rebt_ros.ros.executor.settings import ExecutorSettings
from rebt_ros.ros.executor.state_topics import StateTopics
from rebt_ros.ros.executor.tree_intake import REFUSED, TreeIntake
from rebt_ros.ros.executor.watching import Watching
from rebt_ros.ros.graph_watch import Finding, GraphWatch
from rebt_ros.ros.quiet_events import create_publisher

#: Least time between two snapshots (seconds).
_SNAPSHOT_PERIOD: Final = 0.2

_STOP_OTHERS: Final = "stop all but one"


class Reporting:
    """Publishes snapshots while someone listens, and diagnostics.

    Args:
        node: The node.
        settings: The executor's parameters.
        commands: What labels do beside being sent; None for nothing.
        channels: What the tree commands.
        topics: What trees read.
        driving: Runs the tree.
        persons: Hears who takes over.
        intake: Takes trees.
        faults: What went wrong.
        watching: Shows the tree to programs.
    """

    def __init__(
        self,
        node: Node,
        settings: ExecutorSettings,
        commands: RobotCommands | None,
        channels: CommandChannels,
        topics: StateTopics,
        driving: Driving,
        persons: Persons,
        intake: TreeIntake,
        faults: Faults,
        watching: Watching,
    ) -> None:
        self._settings = settings
        self._commands = commands
        self._channels = channels
        self._topics = topics
        self._driving = driving
        self._persons = persons
        self._intake = intake
        self._faults = faults
        self._watching = watching
        self._watch = GraphWatch(node)
        self._last_snapshot = ""
        self._watchers = 0
        self._snapshot = create_publisher(node, String, "~/snapshot", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_SNAPSHOT_PERIOD, self._publish_snapshot, clock=steady)
        self._diagnostics = Diagnostics(node, "execution", self._report)

    def publish(self) -> None:
        """Publishes diagnostics now."""
        self._diagnostics.publish()

    @property
    def condition(self) -> str:
        """What the executor does, or what it waits for."""
        if self._driving.program is None:
            return f"waiting for a tree{self._intake.unusable}"
        return self._driving.condition()

    def _publish_snapshot(self) -> None:
        watchers = self._snapshot.get_subscription_count()
        newcomers, self._watchers = watchers > self._watchers, watchers
        program = self._driving.program
        if program is None or not watchers:
            return
        snapshot = json.dumps(
            {
                "document": program.fingerprint,
                "condition": self.condition.split(":")[0],
                "status": program.runtime.root.status.name,
                "tip": program.runtime.tip,
                "commands": self._channels.sent,
                "nodes": program.runtime.snapshot(),
            },
            ensure_ascii=False,
        )
        if newcomers or snapshot != self._last_snapshot:
            self._last_snapshot = snapshot
            self._snapshot.publish(String(data=snapshot))

    def _report(self) -> Report:
        condition, driving = self.condition, self._driving
        values = self._values(condition)
        driving.longest = 0.0
        if self._faults.recent:
            return Report(Level.WARN, f"{condition}; {self._faults.recent}", values)
        unusable = driving.program is None and bool(self._intake.unusable)
        blocked = unusable or (driving.enabled and condition != "running")
        problems = self._problems()
        if problems:
            return Report(Level.WARN, "; ".join((condition, *problems)), values)
        return Report(Level.WARN if blocked else Level.OK, condition, values)

    def _values(self, condition: str) -> dict[str, Any]:
        driving = self._driving
        values: dict[str, Any] = {
            "condition": condition.split(":")[0],
            "enabled": driving.enabled,
            "ticks": driving.ticks,
            "commands": driving.commands,
            "longest tick (ms)": f"{driving.longest * 1e3:.1f}",
            "trees from": self._intake.documents.topic_name,
            "takeovers": driving.takeovers,
            REFUSED: 0,
            NOVEL: 0,
        }
        program = driving.program
        if program is not None:
            learned = program.learned
            values |= {
                "document": program.fingerprint,
                "nodes": nodes.size(learned.tree),
                "actions": len(learned.actions),
                "rows": learned.provenance.rows,
                "own-history agreement": learned.provenance.figures.own_history_agreement,
                "novelty": driving.novelty or "none",
            }
            stale = driving.stale()
            values |= {
                f"state of {topic}": stale.get(topic, "fresh") for topic in program.inputs.topics
            }
        awaited = self._intake.awaited
        if awaited is not None:
            values["the next tree waits for"] = ", ".join(awaited)
        return values | self._watching.values | self._faults.counts

    def _problems(self) -> list[str]:
        """What in the graph keeps the tree from driving, or makes it a matter of chance.

        What a disabled executor lacks it may still get before it is enabled.
        """
        watch, channels, intake = self._watch, self._channels, self._intake
        findings = [
            *watch.several(
                intake.name,
                "trees",
                "chance decides which one drives; name one with the parameter 'learner', or stop "
                "all but one",
            ),
            # Whoever takes over must be heard.
            *watch.misfits([intake.documents, *self._persons.subscriptions]),
            *self._persons.problems(),
            *self._topics.look(),
            *(
                finding
                for topic in sorted(channels.topics)
                for finding in watch.several(topic, "commands", _STOP_OTHERS)
            ),
            *self._without_command(),
            *(Finding(problem, waits=False) for problem in self._watching.problems),
        ]
        if self._settings.learner:
            findings += watch.unheard([intake.documents])
        if self._driving.enabled:
            findings += [
                *watch.timeless(),
                *watch.unheard([*self._topics.subscriptions, *channels.results]),
                *watch.mixed(self._topics.subscriptions),
                *watch.unread(self._publishers()),
            ]
        return watch.say(findings)

    def _publishers(self) -> Iterable[Publisher]:
        """What the robot is to hear: labels only where they are all that it is told."""
        robot = self._settings.robot
        if self._commands is not None and robot is not None and robot.commands:
            return self._commands.publishers
        return self._channels.publishers

    def _without_command(self) -> list[Finding]:
        """Labels of the tree for which the robot file has no command."""
        program, robot = self._driving.program, self._settings.robot
        if program is None or self._commands is None or robot is None:
            return []
        labels = {action.label for action in nodes.actions(program.learned.tree)}
        found = ", ".join(map(repr, self._commands.missing(sorted(labels))))
        return [Finding(f"{robot.name} has no command for {found}", waits=False)] if found else []
