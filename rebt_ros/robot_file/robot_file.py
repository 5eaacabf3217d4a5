"""The value of a robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, TypeAlias

from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.message_path.path import MessagePath

#: Texts, numbers, truth values, None, and lists and maps of them.
Json: TypeAlias = Any


class Stamp(Enum):
    """What says when a message is from."""

    RECEIVED = "received"
    """When it was received, or sent, as for all topics where nothing is said."""
    HEADER = "header"
    """The stamp in its header."""


@dataclass(frozen=True, slots=True)
class TopicSettings:
    """What is known of a topic beforehand."""

    kind: str = ""
    """Name of the type of its messages; empty where the topic itself tells."""
    stamp: Stamp = Stamp.RECEIVED


@dataclass(frozen=True, slots=True)
class StateFeature:
    """A feature of the state."""

    name: str
    path: MessagePath
    kind: FeatureKind | None = None
    """None for what its field is by itself."""
    categories: Mapping[str, str] = field(default_factory=dict)
    """Names of its values, by what stands in the message; all others are missing."""
    max_age: float | None = None
    """How long a value is good for (seconds); None for as long as the executor says."""


class Emit(Enum):
    """When a source of actions says something."""

    MESSAGE = "message"
    """With every message."""
    CHANGE = "change"
    """When the action changes."""


@dataclass(frozen=True, slots=True)
class PathActions:
    """A field that says what is done."""

    path: MessagePath
    labels: Mapping[str, str] = field(default_factory=dict)
    """Labels by what stands in the message, other values meaning none; empty: as they are."""
    emit: Emit = Emit.MESSAGE

    @property
    def topic(self) -> str:
        """The topic."""
        return self.path.topic


@dataclass(frozen=True, slots=True)
class AxisLabels:
    """Labels of a joystick's axis."""

    above: tuple[float, str] | None = None
    """Threshold, and what is done while the axis is not below it."""
    below: tuple[float, str] | None = None


@dataclass(frozen=True, slots=True)
class JoyActions:
    """Buttons and axes of sensor_msgs/msg/Joy."""

    topic: str
    press: Mapping[int, str] = field(default_factory=dict)
    """What begins when a button is pressed."""
    hold: Mapping[int, str] = field(default_factory=dict)
    """What is done while a button is held."""
    axes: Mapping[int, AxisLabels] = field(default_factory=dict)
    """What is done while an axis is held."""
    hysteresis: float = 0.1
    """How far an axis goes back before what it stands for ends."""
    emit: Emit = Emit.CHANGE
    """Whether what is held is said again with every message, or when it changes."""


@dataclass(frozen=True, slots=True)
class TwistActions:
    """Sectors of geometry_msgs/msg/Twist or TwistStamped.

    A velocity is a direction in the plane of linear.x (0 degrees) and angular.z (90 degrees), each
    divided by its scale; it belongs to the sector whose direction is nearest.
    """

    topic: str
    sectors: Mapping[str, float]
    """Direction of each label (degrees)."""
    rest: str = "stop"
    """Label within the dead band; empty for none."""
    dead_band: float = 0.05
    """Scaled speed up to which it is at rest."""
    linear: float = 1.0
    """Scale of linear.x (m/s)."""
    angular: float = 1.0
    """Scale of angular.z (rad/s)."""
    hysteresis: float = 10.0
    """How far past the border a direction leaves its sector (degrees), and by how many percent of
    it the dead band is left before rest is."""
    emit: Emit = Emit.MESSAGE


@dataclass(frozen=True, slots=True)
class BehaviorTreeLogActions:
    """The node of another behavior tree that runs, from nav2_msgs/msg/BehaviorTreeLog."""

    topic: str
    labels: Mapping[str, str]
    """Label by name of the nodes that are actions."""


ActionSource: TypeAlias = PathActions | JoyActions | TwistActions | BehaviorTreeLogActions


@dataclass(frozen=True, slots=True)
class PublishCommand:
    """A message that is published."""

    topic: str
    kind: str
    """Name of its type."""
    content: Json = field(default_factory=dict)
    """Values of its fields; all others are 0 or empty."""
    each_tick: bool = True
    """Whether at every tick while it is what is commanded, or once when it begins to be."""


@dataclass(frozen=True, slots=True)
class CallCommand:
    """A service that is called; the action runs until it answers."""

    service: str
    kind: str
    content: Json = field(default_factory=dict)
    """Values of the request's fields."""


@dataclass(frozen=True, slots=True)
class GoalCommand:
    """A goal of an action server; the action runs until there is a result."""

    server: str
    kind: str
    content: Json = field(default_factory=dict)
    """Values of the goal's fields."""


Command: TypeAlias = PublishCommand | CallCommand | GoalCommand

#: The command that is also sent when the tree is halted, disabled or stale.
STOP: Final = "stop"


@dataclass(frozen=True, slots=True)
class WrittenRule:
    """A rule that trees must keep, as it is written; `rebt_ros.verification` reads what it says."""

    kind: str
    """The word that it begins with."""
    action: str
    when: str = ""
    """The condition; empty: everywhere."""
    channel: str = ""
    """Empty where the label of the action tells the channel."""
    action_start: tuple[int, int] | None = field(default=None, compare=False)
    """Line and column of the action, from 1; None where that is not known."""
    when_start: tuple[int, int] | None = field(default=None, compare=False)
    """The same of the condition."""


@dataclass(frozen=True, slots=True)
class RobotFile:
    """Where features and actions are, and what labels do."""

    name: str = field(compare=False)
    """Name of the file, for messages."""
    state: tuple[StateFeature, ...]
    actions: Mapping[str, ActionSource]
    """By channel."""
    topics: Mapping[str, TopicSettings] = field(default_factory=dict)
    commands: Mapping[str, Command] = field(default_factory=dict)
    """By label."""
    rules: tuple[WrittenRule, ...] = ()
    """What trees must keep."""
    content: Json = field(default=None, compare=False)
    """What it was read from, for recordings and trees to carry."""

    @property
    def state_topics(self) -> tuple[str, ...]:
        """The topics of the state, in the order of their first features."""
        return tuple(dict.fromkeys(feature.path.topic for feature in self.state))

    @property
    def action_topics(self) -> tuple[str, ...]:
        """The topics of the actions."""
        return tuple(dict.fromkeys(source.topic for source in self.actions.values()))

    def settings_of(self, topic: str) -> TopicSettings:
        """What is known of a topic."""
        return self.topics.get(topic, TopicSettings())
