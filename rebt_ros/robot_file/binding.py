"""A robot file with the types of its topics: everything in it is known to be there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.checking import CheckedPath, check
from rebt_ros.message_path.compiling import wanted_of
from rebt_ros.message_path.definition import Definitions, Primitive
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.labelling import Labeller, check_values, labeller
from rebt_ros.robot_file.robot_file import RobotFile, Stamp, StateFeature

#: Type of the first field of messages that have a stamp.
_HEADER: Final = "std_msgs/msg/Header"


@dataclass(frozen=True, slots=True)
class BoundFeature:
    """A feature of which it is known what it is in messages."""

    name: str
    path: CheckedPath
    kind: FeatureKind
    categories: Mapping[str, str]
    """Of a categorical feature: names of its values, by what stands in the message; empty where
    any text may stand there."""


@dataclass(frozen=True, slots=True)
class BoundTopic:
    """A topic with what is read of its messages."""

    name: str
    """As in the robot file."""
    kind: str
    """Name of the type of its messages."""
    features: tuple[BoundFeature, ...]
    labellers: Mapping[str, Labeller]
    """What makes labels of its messages, by channel."""
    has_stamp: bool
    """Whether the stamp in its header says when a message is from."""

    def lacks(self) -> Iterator[str]:
        """What its latest message should have and does not, without full stops."""
        for channel, one in self.labellers.items():
            if one.lacks:
                yield (
                    f"messages on {self.name!r} do not have {one.lacks}, which the actions "
                    f"{channel!r} name: see which ones move when they are used"
                )

    @property
    def wanted(self) -> frozenset[tuple[str, ...]]:
        """The attributes of messages that are read, each with all that is in it."""
        return frozenset(
            wanted
            for found in (
                *(wanted_of(feature.path) for feature in self.features),
                *(value.wanted for value in self.labellers.values()),
            )
            for wanted in found
        )


def bind(robot: RobotFile, topic: str, kind: str, definitions: Definitions) -> BoundTopic:
    """Checks what a robot file says of a topic against its type.

    Args:
        robot: The robot file.
        topic: A topic in it.
        kind: Name of the type of its messages.
        definitions: Knows that type, and those in it.

    Raises:
        RobotFileError: They do not fit.
    """
    settings = robot.settings_of(topic)
    if settings.kind and settings.kind.replace("/msg/", "/") != kind.replace("/msg/", "/"):
        raise RobotFileError(
            f"{robot.name}: topic {topic!r} should carry {settings.kind}, and carries {kind}."
        )
    try:
        features = tuple(
            _feature(robot, one, kind, definitions)
            for one in robot.state
            if one.path.topic == topic
        )
        labellers = {
            channel: labeller(source, kind, definitions)
            for channel, source in robot.actions.items()
            if source.topic == topic
        }
        first = definitions(kind).fields[:1]
        has_header = any((one.name, one.kind) == ("header", _HEADER) for one in first)
    except MessagePathError as err:
        raise RobotFileError(f"{robot.name}: {err}") from err
    has_stamp = settings.stamp is Stamp.HEADER
    if has_stamp and not has_header:
        raise RobotFileError(
            f"{robot.name}: topic {topic!r} has 'stamp: header', but {kind} has no header: leave "
            "that out."
        )
    return BoundTopic(topic, kind, features, labellers, has_stamp)


def _feature(
    robot: RobotFile, feature: StateFeature, message: str, definitions: Definitions
) -> BoundFeature:
    path = check(feature.path, message, definitions)
    categories = dict(feature.categories)
    kind = feature.kind
    if kind is None:
        kind = FeatureKind.CATEGORICAL if categories else _kind_of(path)
    if kind is FeatureKind.CATEGORICAL:
        numbers = {name: str(number) for number, name in path.names.items()}
        check_values(path, categories)
        categories = {numbers.get(value, value): name for value, name in categories.items()}
        if not categories:
            categories = {number: name for name, number in numbers.items()}
        if path.kind is Primitive.NUMBER:
            raise RobotFileError(
                f"{robot.name}: feature {feature.name!r} cannot be categorical: {feature.path} "
                "is a number with decimals."
            )
    elif path.kind is Primitive.TEXT:
        raise RobotFileError(
            f"{robot.name}: feature {feature.name!r} cannot be {kind.value}: {feature.path} is a "
            "string."
        )
    return BoundFeature(feature.name, path, kind, categories)


def _kind_of(path: CheckedPath) -> FeatureKind:
    """What a field is by itself."""
    if path.kind is Primitive.TRUTH:
        return FeatureKind.BINARY
    return (
        FeatureKind.CATEGORICAL
        if path.kind is Primitive.TEXT or path.names
        else FeatureKind.NUMERIC
    )
