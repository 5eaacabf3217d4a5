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
from rebt_ros.demonstration.schema import Feature, sources
from rebt_ros.robot_file.robot_file import RobotFile


class Message(NamedTuple):
    """A state message that was accepted."""

    values: Sequence[float]
    received: int
    """Nanoseconds."""
    names: tuple[str, ...] = ()
    """What the message itself calls its values; empty where it does not."""


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
        self._fields = _fields(learned.features, self._read.values(), default_topic)
        self._places: dict[str, tuple[tuple[str, ...], Mapping[int, int]]] = {}
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

        Where it names its values, and in another order than when the tree was learned, they are
        taken by their names.

        Raises:
            BadMessageError: It has too few values, none of a name that the tree tests, or one that
                the tree tests is not finite; it is left out, so that the topic goes stale unless a
                better one follows.
        """
        message = self._placed(topic, message)
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

    def misfit(self, latest: Mapping[str, Message]) -> str:
        """Which of the messages lacks values that the tree reads, in words; empty for none."""
        for topic, needed in self._encoder.topics.items():
            if topic not in latest:
                continue
            try:
                count = len(self._placed(topic, latest[topic]).values)
            except BadMessageError as err:
                return str(err).rstrip(".")
            if count < needed:
                return f"state topic {topic!r} sends {count} values where the tree reads {needed}"
        return ""

    def _placed(self, topic: str, message: Message) -> Message:
        """The message with its values where the tree reads them.

        Raises:
            BadMessageError: It has none of a name that the tree tests, but others of its names.
        """
        fields = self._fields.get(topic, {})
        if not message.names or not fields:
            return message
        names, places = self._places.get(topic, ((), {}))
        if names != message.names:
            places = _places(topic, message.names, fields)
            self._places[topic] = message.names, places
        if not places:
            return message
        missing = self._encoder.topics[topic] - len(message.values)
        values = [*message.values, *[math.nan] * missing]
        for index, place in places.items():
            values[index] = message.values[place]
        return message._replace(values=values)

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


def _fields(
    features: Sequence[Feature], read: Collection[Feature], default_topic: str
) -> dict[str, dict[int, str]]:
    """What the values of each topic were called that are read, by their index."""
    fields: dict[str, dict[int, str]] = {}
    needed = {(feature.topic, feature.index) for feature in read}
    for feature, source in zip(features, sources(features, default_topic), strict=True):
        if not feature.lag and (source.topic, source.index) in needed:
            name = feature.name.removeprefix(f"{source.topic}/")
            fields.setdefault(source.topic, {})[source.index] = name
    return fields


def _places(topic: str, names: Sequence[str], fields: Mapping[int, str]) -> Mapping[int, int]:
    """Where a message has the values that are read, by their index; empty where they are there.

    Names none of which is known say nothing: those of the features may come from elsewhere.

    Raises:
        BadMessageError: Some are known, and one that is read is missing.
    """
    if not set(names) & set(fields.values()):
        return {}
    for name in fields.values():
        if name not in names:
            raise BadMessageError(
                Fault.NAMES,
                f"state topic {topic!r} has no value called {name!r}, which the tree reads, among "
                f"{', '.join(names)}: publish what was published when it was demonstrated.",
            )
    places = {index: names.index(name) for index, name in fields.items()}
    return {} if all(index == place for index, place in places.items()) else places


def _timeouts(robot: RobotFile, tested: Collection[str]) -> dict[str, int]:
    """How long messages of topics stay fresh (ns): as long as the first of what is tested does."""
    timeouts: dict[str, int] = {}
    for feature in robot.state:
        if feature.max_age is not None and feature.name in tested:
            age, topic = round(feature.max_age * 1e9), feature.path.topic
            timeouts[topic] = min(age, timeouts.get(topic, age))
    return timeouts
