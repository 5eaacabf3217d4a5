"""The state as a running tree needs it, without ROS: topics that it reads, and their freshness."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import StateEncoder
from rebt_ros.demonstration.builder import BadMessageError, Fault
from rebt_ros.demonstration.schema import sources
from rebt_ros.robot_file.robot_file import RobotFile


class Message(NamedTuple):
    """A state message that was accepted."""

    values: Sequence[float]
    received: int
    """Nanoseconds."""


class TreeInputs:
    """The latest values of the features that a tree tests; others need not be published at all.

    Times are nanoseconds of one clock.

    Args:
        learned: The tree and its features.
        default_topic: Topic of features that came from a table, in their order there.
        timeout: How long a message stays fresh, where the tree's robot file does not say.
    """

    def __init__(self, learned: LearnedTree, default_topic: str, timeout: int) -> None:
        tested = nodes.features(learned.tree)
        self._read = {
            place: replace(feature, topic=source.topic, index=source.index)
            for place, (feature, source) in enumerate(
                zip(learned.features, sources(learned.features, default_topic), strict=True)
            )
            if feature.name in tested
        }
        robot = learned.robot
        self._may_miss = robot is not None
        self._encoder = StateEncoder(tuple(self._read.values()), coded=self._may_miss)
        self._state = [math.nan] * len(learned.features)
        self._timeout = timeout
        self._timeouts = {} if robot is None else _timeouts(robot, tested)
        self._latest: dict[str, Message] = {}
        self.topics = tuple(self._encoder.topics)
        """The state topics that the tree reads."""
        self.lagged = any(feature.lag for feature in learned.features)
        """Whether the tree looks back at earlier ticks."""

    @property
    def values(self) -> Mapping[str, Sequence[float]]:
        """The values of the newest message of each topic."""
        return {topic: message.values for topic, message in self._latest.items()}

    def accept(self, topic: str, message: Message) -> None:
        """Takes a message of one of the topics.

        Raises:
            BadMessageError: It has too few values, or one that the tree tests is not finite; it is
                left out, so that the topic goes stale unless a better one follows.
        """
        needed = self._encoder.topics[topic]
        if len(message.values) < needed:
            raise BadMessageError(
                Fault.LENGTH,
                f"state topic {topic!r} sent {len(message.values)} values where the tree needs "
                f"{needed}: publish what was published when it was demonstrated.",
            )
        for feature in self._read.values():
            assert feature.index is not None
            if self._may_miss or feature.topic != topic:
                continue
            if not math.isfinite(message.values[feature.index]):
                raise BadMessageError(
                    Fault.NOT_FINITE,
                    f"state topic {topic!r} sent {message.values[feature.index]} for feature "
                    f"{feature.name!r}: replace it with a finite number before publishing.",
                )
        self._latest[topic] = message

    def forget(self) -> None:
        """Forgets all messages, as where the clock was set back: what it says of them is wrong."""
        self._latest.clear()

    def too_short(self, latest: Mapping[str, Message]) -> str:
        """Which of the messages has too few values for the tree, in words; empty for none."""
        for topic, needed in self._encoder.topics.items():
            if topic in latest and len(latest[topic].values) < needed:
                return (
                    f"state topic {topic!r} sends {len(latest[topic].values)} values "
                    f"where the tree reads {needed}"
                )
        return ""

    def stale(self, now: int) -> dict[str, str]:
        """The topics without a fresh message, and the age of their last one, in words."""
        stale: dict[str, str] = {}
        for topic in self._encoder.topics:
            message = self._latest.get(topic)
            if message is None:
                stale[topic] = "never received"
            # A negative age is that of a clock that was set back.
            elif not 0 <= now - message.received <= self._timeouts.get(topic, self._timeout):
                stale[topic] = f"{(now - message.received) / 1e9:.1f} s old"
        return stale

    def state(self) -> Sequence[float]:
        """The encoded state for `TreeRuntime.tick`, once every topic has sent a message.

        To be called once per tick: lagged features look back at what it returned before.
        """
        values = self._encoder.encode(self.values)
        for place, value in zip(self._read, values, strict=True):
            self._state[place] = value
        return self._state

    def reset(self) -> None:
        """Empties the window of lagged features, as the ticks to come do not follow the last."""
        self._encoder.reset()


def _timeouts(robot: RobotFile, tested: Collection[str]) -> dict[str, int]:
    """How long messages of topics stay fresh (ns): as long as the first of what is tested does."""
    timeouts: dict[str, int] = {}
    for feature in robot.state:
        if feature.max_age is not None and feature.name in tested:
            age, topic = round(feature.max_age * 1e9), feature.path.topic
            timeouts[topic] = min(age, timeouts.get(topic, age))
    return timeouts
