"""When messages were sent, in a time that can be compared."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from enum import Enum
from itertools import chain
from typing import Any, Final

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.utilities import get_rmw_implementation_identifier

#: A message that came so long before it was sent (ns) was sent by another clock.
_TOLERANCE: Final = 1_000_000

#: An endpoint's id begins with the vendor and the machine in Fast DDS, which goes by this itself to
#: tell whether memory can be shared: eprosima::fastrtps::rtps::GuidPrefix_t::is_on_same_host_as.
_HOST: Final = slice(0, 4)
_WITH_HOST: Final = ("rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")


class PairBy(Enum):
    """What says which state an action belongs to."""

    AUTO = "auto"
    """When they were sent, where all of that is one machine's time; else when they came."""
    SENT = "sent"
    RECEIVED = "received"


class SendingTime:
    """Knows whether publishers have the clock of this machine.

    Args:
        node: Whose subscriptions it is about.
        topics: Topics that it subscribes to.
        pair_by: What is wanted.
    """

    def __init__(self, node: Node, topics: Sequence[str], pair_by: PairBy) -> None:
        self._node = node
        self._topics = topics
        self._pair_by = pair_by
        self.comparable = pair_by is not PairBy.RECEIVED
        """Whether messages are taken by when they were sent."""

    def of(self, info: dict[str, Any]) -> int | None:
        """When a message was sent, nanoseconds; None where that cannot be compared."""
        sent = info.get("source_timestamp")
        if not sent or not self.comparable:
            return None
        if self._pair_by is PairBy.AUTO and sent > received_at(info) + _TOLERANCE:
            return None
        return int(sent)

    def look(self) -> list[str]:
        """Looks at who publishes; to be called every now and then.

        Returns:
            The topics that nobody publishes.
        """
        found = {topic: self._node.get_publishers_info_by_topic(topic) for topic in self._topics}
        if self._pair_by is PairBy.AUTO:
            self.comparable = self._all_here(chain.from_iterable(found.values()))
        return [topic for topic, publishers in found.items() if not publishers]

    def _all_here(self, publishers: Iterable[TopicEndpointInfo]) -> bool:
        if get_rmw_implementation_identifier() not in _WITH_HOST:
            return False
        name = (self._node.get_name(), self._node.get_namespace())
        own = {
            _host(one)
            for one in self._node.get_subscriptions_info_by_topic(self._topics[0])
            if (one.node_name, one.node_namespace) == name
        }
        # A node of this name on another machine would leave it open which one this is.
        return len(own) == 1 and own.issuperset(map(_host, publishers))


def _host(endpoint: TopicEndpointInfo) -> bytes:
    return bytes(endpoint.endpoint_gid[_HOST])


def received_at(info: dict[str, Any]) -> int:
    """When a message was received, nanoseconds; not every middleware says."""
    return info.get("received_timestamp") or info.get("source_timestamp") or time.time_ns()
