"""What in the graph keeps a node from doing its job: nobody there, other types, QoS, no clock."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from rclpy.duration import Infinite
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from rebt_ros.live.clock_watch import ClockWatch
from rebt_ros.ros.node_clock import simulated_time

#: How long a node may wait for others before it says so in its log (seconds).
_PATIENCE: Final = 5.0

#: Who has opened an endpoint becomes known later than the endpoint, or never without ROS.
_UNKNOWN: Final = "an unknown node"

#: An endpoint's id begins with that of its process; nodes in different ones may have equal names.
_PROCESS: Final = slice(0, 12)


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that is wrong."""

    sentence: str
    """Without a full stop."""
    waits: bool
    """Whether it may well pass by itself, so that the log can wait."""


class GraphWatch:
    """Finds what is wrong.

    Args:
        node: The node that it is about.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._since: dict[str, float] = {}
        self._logged: set[str] = set()
        self._clock = ClockWatch()

    def say(self, findings: Iterable[Finding]) -> list[str]:
        """Logs what is new, or has waited in vain for long enough; once, until it comes back.

        Args:
            findings: All that is wrong now.

        Returns:
            Their sentences, in the same order.
        """
        now = time.monotonic()
        waiting = {finding.sentence: finding.waits for finding in findings}
        self._since = {one: self._since.get(one, now) for one in waiting}
        self._logged.intersection_update(waiting)
        for sentence, waits in waiting.items():
            patience = _PATIENCE if waits else 0.0
            if sentence not in self._logged and now - self._since[sentence] >= patience:
                self._logged.add(sentence)
                self._node.get_logger().warning(f"{sentence}.")
        return list(waiting)

    def unheard(
        self, subscriptions: Iterable[Subscription], helps: Mapping[str, str] | None = None
    ) -> Iterator[Finding]:
        """Why subscriptions hear nothing, or not all; see `misfits`."""
        for subscription in subscriptions:
            if not self._publishers(subscription.topic_name):
                yield Finding(f"nobody publishes on {subscription.topic_name}", waits=True)
            yield from self.misfits([subscription], helps)

    def misfits(
        self, subscriptions: Iterable[Subscription], helps: Mapping[str, str] | None = None
    ) -> Iterator[Finding]:
        """Publishers that subscriptions cannot hear.

        Args:
            subscriptions: Those of this node.
            helps: What helps against publishers of best effort, by the full name of the topic.
        """
        for subscription in subscriptions:
            topic, wanted = subscription.topic_name, _type_of(subscription)
            for publisher in self._publishers(topic):
                if publisher.topic_type != wanted:
                    name = _name(publisher)
                    yield Finding(
                        f"{name} publishes {publisher.topic_type} on {topic}, not {wanted}",
                        waits=name == _UNKNOWN,
                    )
                    continue
                fit, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
                if fit == QoSCompatibility.ERROR:
                    name = _name(publisher)
                    is_brief = publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
                    advice = (helps or {}).get(topic, "") if is_brief else ""
                    yield Finding(
                        f"{name} offers incompatible QoS on {topic}, and none of its messages is "
                        f"received ({_plain(reason)}){f': {advice}' if advice else ''}",
                        waits=name == _UNKNOWN,
                    )

    def several(self, topic: str, what: str, advice: str) -> Iterator[Finding]:
        """That several nodes publish where a single one should.

        Args:
            topic: Name of the topic.
            what: What is published there, in the plural.
            advice: What helps.
        """
        names = self.publishing(topic)
        if len(names) > 1:
            who = ", ".join(names)
            yield Finding(
                f"{len(names)} nodes publish {what} on {topic} ({who}): {advice}",
                waits=_UNKNOWN in names,
            )

    def latched(self, subscriptions: Iterable[Subscription]) -> Iterator[Finding]:
        """Subscriptions that miss what publishers keep for those who ask for it."""
        for subscription in subscriptions:
            publishers = self._publishers(subscription.topic_name)
            if publishers and all(
                one.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in publishers
            ):
                yield Finding(
                    f"what was published on {subscription.topic_name} before this node was there "
                    "is not received (durability: transient local): publish the state regularly",
                    waits=True,
                )

    def mixed(self, states: Iterable[Subscription]) -> Iterator[Finding]:
        """State topics on which several nodes publish, as several robots do without namespaces."""
        for subscription in states:
            yield from self.several(
                subscription.topic_name,
                "states",
                "they are taken for those of a single robot; stop all but one, or give each robot "
                "a namespace",
            )

    def publishing(self, topic: str) -> list[str]:
        """The full names of the nodes that publish on a topic, sorted; equal names may recur."""
        nodes = {
            (bytes(publisher.endpoint_gid[_PROCESS]), _name(publisher))
            for publisher in self._publishers(topic)
        }
        return sorted(name for _, name in nodes)

    def unread(self, publishers: Iterable[Publisher]) -> Iterator[Finding]:
        """Publishers to which nobody listens, or nobody who can hear them."""
        for publisher in publishers:
            topic, sent = publisher.topic_name, _type_of(publisher)
            subscriptions = self._node.get_subscriptions_info_by_topic(topic)
            if not subscriptions:
                yield Finding(f"nobody listens to {topic}", waits=True)
            for subscription in subscriptions:
                name = _name(subscription)
                if subscription.topic_type != sent:
                    yield Finding(
                        f"{name} listens to {topic} for {subscription.topic_type}, not {sent}",
                        waits=name == _UNKNOWN,
                    )
                    continue
                fit, reason = qos_check_compatible(_offered(publisher), subscription.qos_profile)
                if fit == QoSCompatibility.ERROR:
                    yield Finding(
                        f"{name} requests incompatible QoS on {topic}, and receives no message "
                        f"({_plain(reason)})",
                        waits=name == _UNKNOWN,
                    )

    def timeless(self) -> Iterator[Finding]:
        """That simulated time does not come, or does not go on, where it is in use."""
        now = simulated_time(self._node)
        if now is None or not self._clock.stands(now, time.monotonic()):
            return
        yield Finding(
            "use_sim_time is set, and /clock has stopped: let the simulator go on"
            if now
            else "use_sim_time is set, and waiting for /clock: start the simulator, or unset it",
            waits=True,
        )

    def _publishers(self, topic: str) -> list[TopicEndpointInfo]:
        full = str(self._node.resolve_topic_name(topic))
        return list(self._node.get_publishers_info_by_topic(full))


def _name(endpoint: TopicEndpointInfo) -> str:
    if "_NODE_NAME_UNKNOWN_" in endpoint.node_name:
        return _UNKNOWN
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def _offered(publisher: Publisher) -> QoSProfile:
    """The QoS of a publisher of this node, as others see it."""
    qos = publisher.qos_profile
    # What was left open counts as zero here.
    return QoSProfile(
        depth=qos.depth,
        reliability=qos.reliability,
        durability=qos.durability,
        deadline=qos.deadline if qos.deadline.nanoseconds else Infinite,
        liveliness_lease_duration=qos.liveliness_lease_duration
        if qos.liveliness_lease_duration.nanoseconds
        else Infinite,
    )


def _plain(reason: str) -> str:
    """Why QoS does not fit, without what else the middleware says."""
    return reason.strip().rstrip(";").removeprefix("ERROR: ")


def _type_of(endpoint: Subscription | Publisher) -> str:
    kind: Any = endpoint.msg_type
    package, interface, *_ = kind.__module__.split(".")
    return f"{package}/{interface}/{kind.__name__}"
