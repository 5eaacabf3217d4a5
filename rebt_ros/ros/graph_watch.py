"""What in the graph keeps a node from doing its job: nobody there, other types, QoS, no clock."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from typing import Any

from rclpy.clock import ROSClock
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

#: How long a node may wait for others before it says so in its log (seconds).
_PATIENCE = 5.0


class GraphWatch:
    """Finds what is wrong, and logs each finding once.

    Args:
        node: The node that it is about.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._since: dict[str, float] = {}
        self._logged: set[str] = set()

    def unheard(self, subscriptions: Iterable[Subscription]) -> list[str]:
        """Why subscriptions hear nothing, or not all; none where nothing is wrong."""
        return self._noted(
            (sentence, waits) for one in subscriptions for sentence, waits in self._about(one)
        )

    def several(self, topics: Iterable[str], what: str, advice: str) -> list[str]:
        """Topics on which several nodes publish though one should.

        Args:
            topics: Their names.
            what: What is published there, in the plural.
            advice: What helps.
        """
        found = []
        for topic in topics:
            names = sorted(map(_name, self._node.get_publishers_info_by_topic(self._full(topic))))
            if len(names) > 1:
                sentence = f"{len(names)} nodes publish {what} on {topic} ({', '.join(names)})"
                found.append((f"{sentence}: {advice}", False))
        return self._noted(found)

    def unread(self, topics: Iterable[str]) -> list[str]:
        """Topics to which nobody listens."""
        return self._noted(
            (f"nobody listens to {topic}", True)
            for topic in topics
            if not self._node.count_subscribers(topic)
        )

    def timeless(self) -> list[str]:
        """That simulated time does not come, where it is in use."""
        clock = self._node.get_clock()
        simulated = isinstance(clock, ROSClock) and clock.ros_time_is_active
        waits = simulated and clock.now().nanoseconds == 0
        sentence = "use_sim_time is set, and waiting for /clock: start the simulator, or unset it"
        return self._noted([(sentence, True)] if waits else [])

    def note(self, sentence: str, *, waits: bool) -> None:
        """Logs a finding of somebody else, once.

        Args:
            sentence: Without a full stop.
            waits: Whether it may well change, so that it is logged only after a while.
        """
        self._noted([(sentence, waits)])

    def _about(self, subscription: Subscription) -> Iterator[tuple[str, bool]]:
        """What is wrong with it, and whether that may well change."""
        topic = subscription.topic_name
        publishers = self._node.get_publishers_info_by_topic(topic)
        if not publishers:
            yield f"nobody publishes on {topic}", True
        wanted = _type_of(subscription)
        for one in publishers:
            if one.topic_type != wanted:
                yield f"{_name(one)} publishes {one.topic_type} on {topic}, not {wanted}", False
                continue
            fit, reason = qos_check_compatible(one.qos_profile, subscription.qos_profile)
            if fit == QoSCompatibility.ERROR:
                reason = reason.strip().rstrip(";").removeprefix("ERROR: ")
                yield (
                    f"{_name(one)} offers incompatible QoS on {topic}, and none of its messages is "
                    f"received ({reason})",
                    False,
                )

    def _noted(self, findings: Iterable[tuple[str, bool]]) -> list[str]:
        """The findings; logs those that are new, or that waited in vain for long enough."""
        now = time.monotonic()
        sentences = []
        for sentence, waits in findings:
            sentences.append(sentence)
            began = self._since.setdefault(sentence, now)
            if sentence not in self._logged and now - began >= (_PATIENCE if waits else 0.0):
                self._logged.add(sentence)
                self._node.get_logger().warning(f"{sentence}.")
        return sentences

    def _full(self, topic: str) -> str:
        return str(self._node.resolve_topic_name(topic))


def _name(endpoint: TopicEndpointInfo) -> str:
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def _type_of(subscription: Subscription) -> str:
    kind: Any = subscription.msg_type
    package, interface, *_ = kind.__module__.split(".")
    return f"{package}/{interface}/{kind.__name__}"
