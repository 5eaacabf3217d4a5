"""Robot files in nodes: the parameter, and subscriptions of types that the graph tells."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from rebt_ros.errors import RebtError
from rebt_ros.robot_file.binding import BoundTopic, bind
from rebt_ros.robot_file.reading import read_robot_file
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.ros.graph_watch import Finding
from rebt_ros.ros.message_types import installed, message_class
from rebt_ros.ros.parameters import Parameters, at_home
from rebt_ros.ros.quiet_events import create_subscription
from rebt_ros.verification.robot_rules import rules_of


def robot_file(declare: Parameters) -> RobotFile | None:
    """Declares the parameter `robot_file`, and reads the file.

    Raises:
        RobotFileError: There is no such file, or it is malformed.
        RuleError: One of its rules is.
    """
    path = declare.text(
        "robot_file",
        "",
        "Robot file (docs/robot_file.md): where features and actions are in the messages of the "
        "robot, and what each label does. Empty for none.",
    )()
    robot = read_robot_file(at_home("robot_file", path)) if path else None
    # Rules that cannot be read are found before anything is recorded or run.
    rules_of(robot)
    return robot


class RobotTopics:
    """Subscribes to the topics of a robot file, as soon as it is known what they carry.

    Topics whose type the robot file tells are subscribed to at once.  The QoS is what all
    publishers offer.

    Args:
        node: The node.
        robot: The robot file.
        topics: Those of its topics that are wanted.
        depth: How many messages may wait.
        callback: Makes what is called with each message and its info.
        group: Callback group of the subscriptions; None for the node's own.

    Raises:
        RobotFileError: The robot file does not fit the installed types.
    """

    def __init__(
        self,
        node: Node,
        robot: RobotFile,
        topics: tuple[str, ...],
        depth: int,
        callback: Callable[[BoundTopic], Callable[..., None]],
        group: CallbackGroup | None = None,
    ) -> None:
        self._node = node
        self._robot = robot
        self._topics = topics
        self._depth = depth
        self._callback = callback
        self._group = group
        self.subscriptions: dict[str, Subscription] = {}
        """By topic, as the robot file names it."""
        self.bound: dict[str, BoundTopic] = {}
        """What the topics carry."""
        self._problems: dict[str, str] = {}
        for topic in topics:
            if kind := robot.settings_of(topic).kind:
                self._bind(topic, installed(kind).name)
                self._subscribe(topic, QoSProfile(depth=depth))

    @property
    def complete(self) -> bool:
        """Whether it is known what all topics carry."""
        return len(self.bound) == len(self._topics)

    def look(self) -> list[Finding]:
        """Looks at who publishes; to be called every now and then.

        Returns:
            What is wrong, one finding for each topic at fault.
        """
        for topic in self._topics:
            publishers = self._node.get_publishers_info_by_topic(self._full(topic))
            if not publishers:
                continue
            if topic not in self.bound:
                self._try_to_bind(topic, publishers[0].topic_type)
            if topic in self.bound:
                self._try_to_follow(topic, [publisher.qos_profile for publisher in publishers])
        return [
            *(Finding(value, waits=False) for value in self._problems.values()),
            *(
                Finding(f"nobody publishes on {topic}", waits=True)
                for topic in self._topics
                if topic not in self.bound and topic not in self._problems
            ),
        ]

    def close(self) -> None:
        """Ends all subscriptions."""
        for subscription in self.subscriptions.values():
            self._node.destroy_subscription(subscription)
        self.subscriptions.clear()

    def _try_to_bind(self, topic: str, kind: str) -> None:
        try:
            self._bind(topic, kind)
        except RebtError as err:
            self._problems[topic] = str(err).rstrip(".")

    def _bind(self, topic: str, kind: str) -> None:
        self.bound[topic] = bind(self._robot, topic, kind, installed)

    def _try_to_follow(self, topic: str, offered: list[QoSProfile]) -> None:
        try:
            self._follow(topic, offered)
        except Exception:  # of rclpy: a name that cannot be, or that this node has another type for
            kind = self.bound[topic].kind
            self._problems[topic] = f"topic {topic!r} cannot be subscribed to as {kind}"
        else:
            self._problems.pop(topic, None)

    def _follow(self, topic: str, offered: list[QoSProfile]) -> None:
        """Subscribes with the QoS that all publishers offer, if that is not so already."""
        wanted = QoSProfile(depth=self._depth)
        if any(one.reliability == ReliabilityPolicy.BEST_EFFORT for one in offered):
            wanted.reliability = ReliabilityPolicy.BEST_EFFORT
        if all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered):
            wanted.durability = DurabilityPolicy.TRANSIENT_LOCAL
        now = self.subscriptions.get(topic)
        if now is not None:
            qos = now.qos_profile
            if (qos.reliability, qos.durability) == (wanted.reliability, wanted.durability):
                return
            self._node.destroy_subscription(now)
        self._subscribe(topic, wanted)

    def _subscribe(self, topic: str, qos: QoSProfile) -> None:
        bound = self.bound[topic]
        kind: type[Any] = message_class(bound.kind)
        self.subscriptions[topic] = create_subscription(
            self._node, kind, topic, self._callback(bound), qos, self._group
        )

    def _full(self, topic: str) -> str:
        return str(self._node.resolve_topic_name(topic))
