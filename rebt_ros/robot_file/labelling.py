"""Making labels of the messages of a source of actions."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Protocol, TypeAlias

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.checking import CheckedPath, check
from rebt_ros.message_path.compiling import Value, getter, wanted_of
from rebt_ros.message_path.definition import Definitions, Primitive
from rebt_ros.robot_file.robot_file import (
    ActionSource,
    AxisLabels,
    BehaviorTreeLogActions,
    Emit,
    JoyActions,
    PathActions,
    TwistActions,
)

_JOY: Final = "sensor_msgs/msg/Joy"
_TWIST: Final = "geometry_msgs/msg/Twist"
_STAMPED: Final = "geometry_msgs/msg/TwistStamped"
_LOG: Final = "nav2_msgs/msg/BehaviorTreeLog"
#: As integers are written, always in the same way.
_INTEGER: Final = re.compile(r"0|-?[1-9]\d*", re.ASCII)


#: Attributes that lead to a value, or to a message with all that is in it.
Attributes: TypeAlias = tuple[str, ...]


class Labeller(Protocol):
    """Makes labels of messages that come one after the other."""

    wanted: tuple[Attributes, ...]
    """The attributes of messages that are read, each with all that is in it."""
    acts: bool
    """Whether somebody does something, by the latest message."""
    lacks: str
    """What is wanted and the latest message does not have, for people; empty for nothing."""

    def labels(self, message: Any, stamp: int) -> Sequence[str]:
        """What a message says that is done from now on; empty labels for nothing any longer.

        Args:
            message: The message.
            stamp: When it is from, nanoseconds.
        """


def labeller(source: ActionSource, kind: str, definitions: Definitions) -> Labeller:
    """What makes labels of a source's messages.

    Raises:
        MessagePathError: Its messages are of a type that it cannot be made of.
    """
    match source:
        case PathActions():
            return PathLabeller(source, kind, definitions)
        case JoyActions():
            _check_kind(source.topic, kind, _JOY)
            return JoyLabeller(source)
        case TwistActions():
            _check_kind(source.topic, kind, _TWIST, _STAMPED)
            return TwistLabeller(source, stamped=kind == _STAMPED)
        case BehaviorTreeLogActions():
            _check_kind(source.topic, kind, _LOG)
            return LogLabeller(source)


def _check_kind(topic: str, kind: str, *wanted: str) -> None:
    if kind not in wanted:
        raise MessagePathError(f"topic {topic!r} must carry {' or '.join(wanted)}, not {kind}.")


class _Changes:
    """Passes labels on that differ from the one before."""

    def __init__(self, emit: Emit) -> None:
        self._always = emit is Emit.MESSAGE
        self._last = ""

    def of(self, label: str) -> Sequence[str]:
        if label == self._last and (not self._always or not label):
            return ()
        self._last = label
        return (label,)


class PathLabeller:
    """Labels from a string, an integer or a truth value.

    Args:
        source: What is wanted.
        kind: Name of the type of the messages.
        definitions: Knows that type.

    Raises:
        MessagePathError: There is no such value in the messages.
    """

    def __init__(self, source: PathActions, kind: str, definitions: Definitions) -> None:
        path = check(source.path, kind, definitions)
        if path.kind is Primitive.NUMBER:
            raise MessagePathError(
                f"message path {str(source.path)!r} gives a number with decimals, of which no "
                "label can be made: choose a string, an integer or a bool."
            )
        check_values(path, source.labels)
        self.wanted = wanted_of(path)
        self._get = getter(path)
        self._labels = source.labels
        self.acts = False
        self.lacks = ""
        self._text = _written(path.kind, path.names)
        self._changes = _Changes(source.emit)

    def labels(self, message: Any, stamp: int) -> Sequence[str]:
        """See `Labeller`."""
        value = self._get(message, stamp)
        text, name = ("", "") if value is None else self._text(value)
        label = self._labels.get(text, self._labels.get(name, "")) if self._labels else name
        self.acts = bool(label)
        return self._changes.of(label)


def check_values(path: CheckedPath, values: Iterable[str]) -> None:
    """Refuses values, as they stand in a robot file, that a path never gives.

    Raises:
        MessagePathError: It says which there are.
    """
    if path.kind is Primitive.TRUTH:
        wrong = [value for value in values if value not in ("true", "false")]
        there = "true or false"
    elif path.kind in (Primitive.INTEGER, Primitive.BYTE):
        names = path.names.values()
        wrong = [value for value in values if value not in names and not _INTEGER.fullmatch(value)]
        there = " or ".join(["an integer", *([f"one of {', '.join(names)}"] if names else [])])
    else:
        return
    if wrong:
        raise MessagePathError(f"{str(path.path)!r} is never {wrong[0]!r}: it is {there}.")


def _written(kind: Primitive, names: Mapping[int, str]) -> Callable[[Value], tuple[str, str]]:
    """A value as it stands in a robot file, and its name."""

    def written(value: Value) -> tuple[str, str]:
        if isinstance(value, str) or value is None:
            return value or "", value or ""
        if kind is Primitive.TRUTH:
            text = "true" if value else "false"
            return text, text
        text = str(int(value))
        return text, names.get(int(value), text)

    return written


class JoyLabeller:
    """Labels from the buttons and axes of a joystick.

    Args:
        source: What is wanted.
    """

    def __init__(self, source: JoyActions) -> None:
        self.wanted: tuple[Attributes, ...] = (("buttons",), ("axes",))
        self._source = source
        self.acts = False
        self.lacks = ""
        self._sizes = -1, -1
        self._down: set[int] = set()
        self._held = ""

    def labels(self, message: Any, stamp: int) -> Sequence[str]:
        """See `Labeller`."""
        source, buttons = self._source, message.buttons
        if (sizes := (len(buttons), len(message.axes))) != self._sizes:
            self._sizes, self.lacks = sizes, _beyond(source, *sizes)
        down = {one for one in {*source.press, *source.hold} if one < len(buttons) and buttons[one]}
        pressed = [source.press[one] for one in source.press if one in down - self._down]
        self._down = down
        held = next((label for one, label in source.hold.items() if one in down), "")
        held = held or self._axis(message.axes)
        self.acts = bool(held or pressed)
        again = bool(held) and self._source.emit is Emit.MESSAGE
        changed = [held] if again or held != self._held else []
        self._held = held
        # What is pressed lasts until something else is done.
        return [*changed, *pressed]

    def _axis(self, values: Sequence[float]) -> str:
        for place, labels in self._source.axes.items():
            if place < len(values):
                found = _axis_label(labels, values[place], self._held, self._source.hysteresis)
                if found:
                    return found
        return ""


def _beyond(source: JoyActions, buttons: int, axes: int) -> str:
    """The buttons and axes that a joystick with so many does not have."""
    wanted = (("button", {*source.press, *source.hold}, buttons), ("axis", {*source.axes}, axes))
    return " and ".join(
        f"{what} {', '.join(map(str, beyond))} (there are {count}, from 0)"
        for what, places, count in wanted
        if (beyond := sorted(place for place in places if place >= count))
    )


def _axis_label(labels: AxisLabels, value: float, held: str, hysteresis: float) -> str:
    if labels.above is not None:
        threshold, label = labels.above
        if value >= threshold - hysteresis * (held == label):
            return label
    if labels.below is not None:
        threshold, label = labels.below
        if value <= threshold + hysteresis * (held == label):
            return label
    return ""


class TwistLabeller:
    """Labels from the direction of a velocity.

    Args:
        source: What is wanted.
        stamped: Whether messages are of type TwistStamped.
    """

    def __init__(self, source: TwistActions, *, stamped: bool) -> None:
        lead = ("twist",) if stamped else ()
        self.wanted: tuple[Attributes, ...] = (*lead, "linear", "x"), (*lead, "angular", "z")
        self._source = source
        self._stamped = stamped
        self._now = ""
        self.acts = False
        self.lacks = ""
        self._changes = _Changes(source.emit)

    def labels(self, message: Any, stamp: int) -> Sequence[str]:
        """See `Labeller`."""
        twist = message.twist if self._stamped else message
        x, z = twist.linear.x / self._source.linear, twist.angular.z / self._source.angular
        if math.isfinite(x) and math.isfinite(z):
            self._now = self._label(math.hypot(x, z), math.degrees(math.atan2(z, x)))
        self.acts = self._now not in ("", self._source.rest)
        return self._changes.of(self._now)

    def _label(self, speed: float, direction: float) -> str:
        source = self._source
        moving = bool(self._now) and self._now != source.rest
        # Where it moves, the dead band is smaller, and where it rests, larger.
        margin = source.hysteresis / 100 * (-1 if moving else 1)
        if speed <= source.dead_band * (1 + margin):
            return source.rest
        off = {label: _between(direction, its) for label, its in source.sectors.items()}
        nearest = min(off, key=off.__getitem__)
        stays = moving and self._now in off
        if stays and off[self._now] - off[nearest] <= 2 * source.hysteresis:
            return self._now
        return nearest


def _between(first: float, second: float) -> float:
    """The angle between two directions (degrees)."""
    return abs((first - second + 180) % 360 - 180)


class LogLabeller:
    """The label of the node that runs, among those that are actions.

    Of several, it is that of the one that has begun last.

    Args:
        source: What is wanted.
    """

    def __init__(self, source: BehaviorTreeLogActions) -> None:
        self.wanted: tuple[Attributes, ...] = (("event_log",),)
        self._labels = source.labels
        self.acts = False
        self.lacks = ""
        self._running: dict[str, str] = {}
        self._changes = _Changes(Emit.CHANGE)

    def labels(self, message: Any, stamp: int) -> Sequence[str]:
        """See `Labeller`."""
        said: list[str] = []
        for event in message.event_log:
            label = self._labels.get(event.node_name)
            if label is None:
                continue
            self._running.pop(event.node_name, None)
            if event.current_status == "RUNNING":
                self._running[event.node_name] = label
        self.acts = bool(self._running)
        said += self._changes.of(next(reversed(self._running.values()), ""))
        return said
