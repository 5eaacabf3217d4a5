"""The running tree on topics, for Foxglove's behavior tree panel and whatever reads Nav2's logs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from rebt_ros.errors import MessagePathError
from rebt_ros.export.watched import NodeStatus, WatchedNode, WatchedTree
from rebt_ros.ros.message_types import message_class
from rebt_ros.ros.quiet_events import create_publisher

XML_TOPIC: Final = "~/tree_xml"
LOG_TOPIC: Final = "~/behavior_tree_log"
#: Who comes later hears the latest tree.
_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: As Nav2's logger has it.
_LOG_DEPTH: Final = 10


class LogTypes(NamedTuple):
    """Nav2's messages: a log, and a change of status in it."""

    log: type[Any]
    change: type[Any]


def log_types() -> LogTypes:
    """Nav2's messages.

    Raises:
        MessagePathError: They are not installed.
    """
    return LogTypes(
        message_class("nav2_msgs/msg/BehaviorTreeLog"),
        message_class("nav2_msgs/msg/BehaviorTreeStatusChange"),
    )


class StatusTopics:
    """Publishes the XML of each tree, and the statuses of its nodes as they change.

    Where nav2_msgs is not installed, it publishes the XML alone, and says so in the log.

    Args:
        node: What publishes.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._xml = create_publisher(node, String, XML_TOPIC, _LATCHED)
        self._tree: WatchedTree | None = None
        self._before: Mapping[int, str] = {}
        # Whether those who listen know the statuses of all nodes.
        self._known = False
        self._listeners = 0
        self._log: Any = None
        try:
            self._types = log_types()
        except MessagePathError as err:
            node.get_logger().warning(
                f"the XML of trees is on {self._xml.topic_name}, and no topic has the statuses of "
                f"their nodes: {err}"
            )
        else:
            self._log = create_publisher(node, self._types.log, LOG_TOPIC, _LOG_DEPTH)

    @property
    def where(self) -> str:
        """The topic that has the statuses, in full, or why none has."""
        return self._log.topic_name if self._log is not None else "none: install nav2_msgs"

    def show(self, tree: WatchedTree | None) -> None:
        """Another tree runs; None for one that is too large to be watched."""
        self._tree, self._before, self._known = tree, {}, False
        self._xml.publish(String(data=tree.xml if tree else ""))

    def tick(self, outcomes: Mapping[int, str]) -> None:
        """The tree was ticked, or halted.

        Args:
            outcomes: From `TreeRuntime.outcomes`; empty where it was halted.
        """
        if self._tree is None or self._log is None:
            return
        listeners = self._log.get_subscription_count()
        if listeners > self._listeners:
            self._known = False
        self._listeners = listeners
        if not listeners:
            self._before = outcomes
            return
        if self._known:
            changes = list(self._tree.changes(self._before, outcomes))
        else:
            # Those of the tree before have the same numbers, and none may be left behind.
            both = zip(self._tree.nodes, self._tree.statuses(outcomes), strict=True)
            changes = [(node, NodeStatus.IDLE, status) for node, status in both]
        self._before, self._known = outcomes, True
        if changes:
            self._log.publish(self._message(changes))

    def _message(self, changes: Iterable[tuple[WatchedNode, NodeStatus, NodeStatus]]) -> Any:
        now = self._node.get_clock().now().to_msg()
        return self._types.log(
            timestamp=now,
            event_log=[
                self._types.change(
                    timestamp=now,
                    node_name=node.name,
                    uid=node.uid,
                    previous_status=before.name,
                    current_status=after.name,
                )
                for node, before, after in changes
            ],
        )
