"""Endpoints without rclpy's events.

By default rclpy says in the log of both sides when a publisher and a subscription do not fit.  Our
nodes find that out themselves, and say what helps (see `graph_watch`).  Each of these events, two
of every endpoint, would be looked at whenever a node wakes up, between a state and its command.
"""

from __future__ import annotations

from typing import Final

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks

#: For ``event_callbacks`` of publishers.
QUIET_PUBLISHER: Final = PublisherEventCallbacks(use_default_callbacks=False)
#: For ``event_callbacks`` of subscriptions.
QUIET_SUBSCRIPTION: Final = SubscriptionEventCallbacks(use_default_callbacks=False)
