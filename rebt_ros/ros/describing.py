"""Looking at the topics of a running robot."""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Final

from rclpy import init
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.utilities import try_shutdown

from rebt_ros.errors import MessagePathError
from rebt_ros.robot_file.survey import TopicSurvey
from rebt_ros.ros.message_types import installed, message_class

#: Time between two looks at which topics there are (seconds).
_LOOK_PERIOD: Final = 0.5
_DEPTH: Final = 100


def survey_live(seconds: float) -> tuple[tuple[TopicSurvey, ...], tuple[str, ...]]:
    """Looks at all topics that somebody publishes.

    Args:
        seconds: For how long.

    Returns:
        What was seen, sorted by topic, and notes about topics that cannot be read; no full stops.
    """
    init()
    try:
        node = Node("describe")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        surveys: dict[str, TopicSurvey] = {}
        notes: dict[str, str] = {}
        end = time.monotonic() + seconds
        looked = 0.0
        while (now := time.monotonic()) < end:
            if now - looked >= _LOOK_PERIOD:
                looked = now
                _look(node, surveys, notes)
            executor.spin_once(timeout_sec=min(0.1, max(end - now, 0.0)))
        executor.shutdown()
        node.destroy_node()
    finally:
        try_shutdown()
    return tuple(surveys[topic] for topic in sorted(surveys)), tuple(notes.values())


def _look(node: Node, surveys: dict[str, TopicSurvey], notes: dict[str, str]) -> None:
    """Subscribes to the topics that have appeared."""
    for topic, kinds in node.get_topic_names_and_types():
        publishers = node.get_publishers_info_by_topic(topic)
        others = [publisher for publisher in publishers if publisher.node_name != node.get_name()]
        if topic in surveys or topic in notes or not others:
            continue
        try:
            survey = TopicSurvey(topic, kinds[0], installed)
            kind: type[Any] = message_class(kinds[0])
        except MessagePathError as err:
            notes[topic] = f"{topic} is left out: {str(err).rstrip('.')}"
            continue
        surveys[topic] = survey
        # Also heard are publishers that are reliable.
        qos = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(kind, topic, partial(_take, survey), qos)


def _take(survey: TopicSurvey, message: Any) -> None:
    survey.take(message, time.time_ns())
