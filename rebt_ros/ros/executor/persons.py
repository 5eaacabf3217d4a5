"""What a person does beside the tree: on topics of labels, and as the robot file says."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Final

from rclpy.node import Node
from rclpy.subscription import Subscription
from std_msgs.msg import String

from rebt_ros.live.takeover import channel_of
from rebt_ros.robot_file.binding import BoundTopic
from rebt_ros.ros.command_channels import CommandChannels
from rebt_ros.ros.executor.driving import Driving
from rebt_ros.ros.executor.robot_commands import RobotCommands
from rebt_ros.ros.executor.settings import ExecutorSettings
from rebt_ros.ros.graph_watch import Finding
from rebt_ros.ros.quiet_events import create_subscription
from rebt_ros.ros.robot_files import RobotTopics

#: Messages of a person that may wait.
_DEPTH: Final = 10


class Persons:
    """Hears what a person does, and has the tree's hands taken off the robot.

    Args:
        node: The node.
        settings: The executor's parameters.
        channels: What the tree commands.
        commands: What labels do beside being sent; None for nothing.
        driving: Told of what a person does.
    """

    def __init__(
        self,
        node: Node,
        settings: ExecutorSettings,
        channels: CommandChannels,
        commands: RobotCommands | None,
        driving: Driving,
    ) -> None:
        self._node = node
        self._takeover_topics = settings.takeover.topics
        self._channels = channels
        self._driving = driving
        self._topics = self._topics_of_robot(settings, commands)
        self.subscriptions: Sequence[Subscription] = [
            create_subscription(node, String, topic, partial(self._on_label, topic), _DEPTH)
            for topic in self._takeover_topics
        ]
        """Those of topics of labels."""

    def look(self) -> None:
        """Looks at who publishes; to be called every now and then."""
        if self._topics is not None:
            self._topics.look()

    def problems(self) -> Iterator[Finding]:
        """What keeps a person from being heard; nobody need be there."""
        if self._topics is None:
            return
        yield from (one for one in self._topics.look() if not one.waits)
        for topic in self._topics.bound.values():
            yield from (Finding(one, waits=False) for one in topic.lacks())

    def _topics_of_robot(
        self, settings: ExecutorSettings, commands: RobotCommands | None
    ) -> RobotTopics | None:
        """Subscribes to what the robot file says that a person does."""
        robot = settings.robot
        if robot is None or commands is None or not settings.takeover.timeout:
            return None
        full = self._node.resolve_topic_name
        # What is commanded there is not a person's, and the others are listened to already.
        others = commands.topics | {full(topic) for topic in self._takeover_topics}
        topics = tuple(topic for topic in robot.action_topics if full(topic) not in others)
        return RobotTopics(self._node, robot, topics, _DEPTH, self._callback)

    def _on_label(self, topic: str, message: String) -> None:
        # Where commands were remapped to that topic, they are not a person's.
        if self._node.resolve_topic_name(topic) in self._channels.topics:
            return
        self._hand_over(topic)
        program = self._driving.program
        channels = program.channels if program else [topic]
        channel = channel_of(topic, channels, self._takeover_topics)
        if message.data and channel is not None:
            self._driving.did(channel, message.data)

    def _callback(self, bound: BoundTopic) -> Callable[..., None]:
        def take(message: Any) -> None:
            for channel, labeller in bound.labellers.items():
                labels = labeller.labels(message, time.time_ns())
                if labeller.acts:
                    self._hand_over(bound.name)
                for label in filter(None, labels):
                    self._driving.did(channel, label)

        return take

    def _hand_over(self, topic: str) -> None:
        if self._driving.hand_over():
            self._node.get_logger().info(f"a person has taken over on {topic}.")
