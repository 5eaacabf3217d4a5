"""The executor's channels: on each, commands go out and results of actions come in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

from py_trees.common import Status
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import String

from rebt_ros.behavior_tree import nodes
from rebt_ros.errors import DocumentError
from rebt_ros.live.action_results import ActionResults
from rebt_ros.ros.executor.robot_commands import RobotCommands
from rebt_ros.ros.quiet_events import create_publisher, create_subscription

#: Of the topic on which the executor says whether it drives; who comes later hears the latest.
DRIVING_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def topic_of(base: str, channel: str, channels: Sequence[str]) -> str:
    """The topic of a channel: `base`, or a topic below it where there are several channels.

    Raises:
        DocumentError: A channel's name cannot be part of a topic's name.
    """
    if len(channels) < 2:
        return base
    topic = f"{base}/{channel.strip('/')}"
    try:
        validate_topic_name(topic)
    except InvalidTopicNameException as err:
        raise DocumentError(
            f"the tree has the channel {channel!r}, which is no name of a topic: rename the label "
            "column, with letters, digits and underscores, and learn again."
        ) from err
    return topic


class CommandChannels:
    """Carries out the actions of a tree, on a topic for each of its channels.

    Args:
        node: What publishes and subscribes.
        result_topic: Where the robot says how actions ended; empty if they are done at once.
        every_tick: Whether a command is sent at every tick, or only when it changes.
        not_understood: Told of results that are no results.
        robot: What labels do beside being sent; None for nothing.
    """

    def __init__(
        self,
        node: Node,
        result_topic: str,
        every_tick: bool,
        not_understood: Callable[[str], None],
        robot: RobotCommands | None = None,
    ) -> None:
        self._robot = robot
        self._node = node
        self._result_topic = result_topic
        self._every_tick = every_tick
        self._not_understood = not_understood
        self._channels: dict[str, _Channel] = {}

    def topics_of(self, channels: Sequence[str]) -> list[str]:
        """The topics that following these channels takes.

        Raises:
            DocumentError: A channel's name cannot be part of a topic's name.
        """
        bases = ["command", self._result_topic] if self._result_topic else ["command"]
        return [topic_of(base, channel, channels) for base in bases for channel in channels]

    def follow(self, channels: Sequence[str]) -> None:
        """Makes these the channels.

        Raises:
            DocumentError: A channel's name cannot be part of a topic's name; nothing has changed.
        """
        topics = {
            channel: (
                topic_of("command", channel, channels),
                topic_of(self._result_topic, channel, channels) if self._result_topic else "",
            )
            for channel in channels
        }
        # A topic that stays keeps its publisher, so that nobody has to discover it anew.
        open_now = {channel.topics: channel for channel in self._channels.values()}
        self._channels = {
            name: (
                open_now.pop(pair)
                if pair in open_now
                else _Channel(self._node, *pair, self._not_understood)
            )
            for name, pair in topics.items()
        }
        for channel in open_now.values():
            channel.close()

    @property
    def topics(self) -> frozenset[str]:
        """The full names of the topics that commands are sent on."""
        return frozenset(channel.topic for channel in self._channels.values())

    @property
    def publishers(self) -> Iterable[Publisher]:
        """What sends the commands."""
        return [channel.publisher for channel in self._channels.values()]

    @property
    def results(self) -> Iterable[Subscription]:
        """What hears how actions ended."""
        return [
            channel.subscription
            for channel in self._channels.values()
            if channel.subscription is not None
        ]

    @property
    def sent(self) -> dict[str, str | None]:
        """The latest command of each channel; None where it rests."""
        return {name: channel.sent for name, channel in self._channels.items()}

    def begin_tick(self) -> None:
        """Must be called before each tick of the tree."""
        for channel in self._channels.values():
            if channel.results:
                channel.results.begin_tick()
        if self._robot is not None:
            self._robot.begin_tick()

    def send(self, commands: Sequence[nodes.Action]) -> int:
        """Sends the commands of a tick, at most one for each channel.

        Returns:
            How many commands went out.
        """
        if self._robot is not None:
            for command in commands:
                begins = self._channels[command.channel].sent != command.label
                self._robot.send(command.label, begins=begins)
        return sum(
            self._channels[command.channel].send(command.label, self._every_tick)
            for command in commands
        )

    def stop(self) -> None:
        """Does what the robot file says is to be done when the tree is halted."""
        if self._robot is not None:
            self._robot.stop()

    def send_to_all(self, label: str) -> None:
        """Sends a command that is none of the tree's on every channel."""
        for channel in self._channels.values():
            channel.publish(label)

    def rest(self) -> None:
        """What is commanded next is sent, be it what was commanded last."""
        for channel in self._channels.values():
            channel.sent = None

    def update(self, action: nodes.Action) -> Status:
        """How it goes with an action: done at once, or as the robot says."""
        long = None if self._robot is None else self._robot.update(action.label)
        if long is not None:
            return long
        results = self._channels[action.channel].results
        return results.update(action) if results else Status.SUCCESS

    def halt(self, action: nodes.Action) -> None:
        """An action is interrupted."""
        if self._robot is not None:
            self._robot.halt(action.label)
        channel = self._channels.get(action.channel)
        if channel and channel.results:
            channel.results.halt(action)


class _Channel:
    def __init__(
        self, node: Node, commands: str, results: str, not_understood: Callable[[str], None]
    ) -> None:
        self.topics = (commands, results)
        self.results = ActionResults() if results else None
        self.sent: str | None = None
        self._node = node
        self._not_understood = not_understood
        self.publisher = create_publisher(node, String, commands, 10)
        self.subscription = (
            create_subscription(node, String, results, self._on_result, 10) if results else None
        )

    def send(self, label: str, every_tick: bool) -> bool:
        started = self.results is not None and self.results.started
        due = every_tick or started or label != self.sent
        if due:
            self.publish(label)
        self.sent = label
        return due

    @property
    def topic(self) -> str:
        return str(self.publisher.topic_name)

    def publish(self, label: str) -> None:
        self.publisher.publish(String(data=label))

    def close(self) -> None:
        self._node.destroy_publisher(self.publisher)
        if self.subscription is not None:
            self._node.destroy_subscription(self.subscription)

    def _on_result(self, message: String) -> None:
        if self.results is not None and not self.results.report(message.data):
            self._not_understood(message.data)
