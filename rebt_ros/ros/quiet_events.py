"""Endpoints without rclpy's events.

By default, rclpy logs on both sides when a publisher and a subscription do not match.  Our nodes
detect that themselves and say what helps (see `graph_watch`).  The executor would also check these
events, two for each endpoint, whenever it wakes up between a state and its command.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

_NO_PUBLISHER_EVENTS: Final = PublisherEventCallbacks(use_default_callbacks=False)
_NO_SUBSCRIPTION_EVENTS: Final = SubscriptionEventCallbacks(use_default_callbacks=False)


def create_publisher(node: Node, kind: Any, topic: str, qos: QoSProfile | int) -> Publisher:
    """A publisher of a node, without events."""
    return node.create_publisher(kind, topic, qos, event_callbacks=_NO_PUBLISHER_EVENTS)


def create_subscription(
    node: Node,
    kind: Any,
    topic: str,
    callback: Callable[..., None],
    qos: QoSProfile | int,
    group: CallbackGroup | None = None,
) -> Subscription:
    """A subscription of a node, without events.

    Args:
        node: The node.
        kind: Class of the messages.
        topic: Name of the topic.
        callback: Called with each message.
        qos: Quality of service, or the depth of the queue.
        group: Callback group; None for the node's own.
    """
    return node.create_subscription(
        kind,
        topic,
        callback,
        qos,
        callback_group=group,
        event_callbacks=_NO_SUBSCRIPTION_EVENTS,
    )
