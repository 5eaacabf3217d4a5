"""The state of a tree that says where its features are in messages of any type."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from rclpy.node import Node

from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.schema import Feature
from rebt_ros.live.tree_inputs import Message, TreeInputs
from rebt_ros.robot_file.binding import BoundTopic
from rebt_ros.robot_file.features import FeatureReader
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.ros.graph_watch import Finding
from rebt_ros.ros.robot_files import RobotTopics

#: The newest state only.
_DEPTH: Final = 1


class RobotInputs:
    """Subscribes to the topics that a tree reads, and hands it what it needs of their messages.

    Args:
        node: The node.
        robot: The tree's robot file.
        features: The tree's features.
        inputs: What takes the messages.
        now: Tells the time, nanoseconds.
        heard: Told the topic of each message that was taken.

    Raises:
        RobotFileError: The robot file does not fit the installed types.
    """

    def __init__(
        self,
        node: Node,
        robot: RobotFile,
        features: Iterable[Feature],
        inputs: TreeInputs,
        now: Callable[[], int],
        heard: Callable[[str], None],
    ) -> None:
        self._inputs = inputs
        self._now = now
        self._heard = heard
        # Of each feature, the categories by their positions in the tree.
        names = {
            topic: [one.name for one in robot.state if one.path.topic == topic]
            for topic in robot.state_topics
        }
        self._categories = {
            names[feature.topic][feature.index]: Categories(feature.categories)
            for feature in features
            if feature.topic in names
            and feature.index is not None
            and feature.index < len(names[feature.topic])
            and feature.categories
        }
        wanted = tuple(topic for topic in inputs.topics if topic in names)
        self._topics = RobotTopics(node, robot, wanted, _DEPTH, self._callback)

    @property
    def unheard(self) -> list[str]:
        """The topics on which no message came yet."""
        return [topic for topic in self._inputs.topics if topic not in self._inputs.values]

    def look(self) -> list[Finding]:
        """See `RobotTopics.look`."""
        return self._topics.look()

    def close(self) -> None:
        """Ends the subscriptions."""
        self._topics.close()

    def _callback(self, bound: BoundTopic) -> Callable[..., None]:
        reader = FeatureReader(bound, self._categories)

        def take(message: Any) -> None:
            now = self._now()
            self._inputs.accept(bound.name, Message(reader.read(message, now), now))
            self._heard(bound.name)

        return take
