"""What was seen on a topic: its rate, and the values of each of its fields."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from rebt_ros.errors import MessagePathError, listing
from rebt_ros.message_path.checking import check
from rebt_ros.message_path.compiling import Getter, getter
from rebt_ros.message_path.definition import Definitions, Field, MessageType, Primitive
from rebt_ros.message_path.parsing import parse
from rebt_ros.message_path.path import Entry, FieldName, Function, Index, MessagePath, Part

#: Most fields of a topic that are looked at, and elements of an array.
MOST_FIELDS: Final = 80
MOST_ELEMENTS: Final = 32
#: Most different values of a field that are kept.
MOST_VALUES: Final = 8

#: So deep are messages within messages looked at.
_DEEPEST: Final = 6
#: Tell about the other fields, or of times.
_LEFT_OUT: Final = ("covariance", "header", "layout")
_NAMES: Final = ("name", "names", "joint_names")


@dataclass(slots=True)
class FieldSurvey:
    """What was seen of a field."""

    path: MessagePath
    kind: Primitive
    names: dict[int, str]
    """Names that constants give to its values."""
    read: Getter
    seen: int = 0
    """Messages in which it had a value."""
    least: float = 0.0
    most: float = 0.0
    values: list[float | str] = field(default_factory=list)
    """Different values, at most `MOST_VALUES`, in the order in which they came."""

    @property
    def varies(self) -> bool:
        """Whether it had several values."""
        return len(self.values) > 1

    def take(self, message: object, stamp: int) -> None:
        """Takes a message."""
        value = self.read(message, stamp)
        if value is None:
            return
        if not isinstance(value, str):
            self.least = min(value, self.least) if self.seen else value
            self.most = max(value, self.most) if self.seen else value
        self.seen += 1
        if len(self.values) < MOST_VALUES and value not in self.values:
            self.values.append(value)

    def in_words(self) -> str:
        """The values, for a person."""
        if not self.seen:
            return "no value"
        if self.kind is Primitive.TEXT:
            return listing([*map(repr, self.values)], most=4)
        if self.names:
            numbers = [int(value) for value in self.values if not isinstance(value, str)]
            return ", ".join(self.names.get(number, str(number)) for number in numbers[:4])
        if not self.varies:
            return f"{self.least:g}"
        return f"{self.least:.4g} … {self.most:.4g}"


class TopicSurvey:
    """Looks at the messages of a topic.

    Args:
        topic: Its name.
        kind: Name of the type of its messages.
        definitions: Knows that type.

    Raises:
        MessagePathError: It does not.
    """

    def __init__(self, topic: str, kind: str, definitions: Definitions) -> None:
        self.topic = topic
        self.kind = definitions(kind).name
        self.messages = 0
        self.fields: list[FieldSurvey] = []
        self.first: Any = None
        """The first message."""
        self._definitions = definitions
        self._began = self._ended = 0

    @property
    def rate(self) -> float:
        """Messages per second; 0 where there are fewer than two."""
        elapsed = (self._ended - self._began) / 1e9
        return (self.messages - 1) / elapsed if elapsed > 0 else 0.0

    def take(self, message: Any, stamp: int) -> None:
        """Takes a message.

        Args:
            message: The message.
            stamp: When it came, nanoseconds.
        """
        if not self.messages:
            self.first, self._began = message, stamp
            self._open(message)
        self.messages += 1
        self._ended = stamp
        for one in self.fields:
            one.take(message, stamp)

    def field(self, text: str) -> FieldSurvey | None:
        """What was seen at a path behind the topic, such as ``.pose.pose.position.x``."""
        path = parse(f"{MessagePath(self.topic, ())}{text}")
        return next((one for one in self.fields if one.path == path), None)

    def pass_over(self, stamp: int) -> None:
        """Counts a message without looking at it."""
        self.messages += 1
        self._ended = stamp

    def _open(self, message: Any) -> None:
        for parts in self._leaves(self._definitions(self.kind), message, ()):
            if len(self.fields) == MOST_FIELDS:
                return
            self._add(MessagePath(self.topic, parts))

    def _add(self, path: MessagePath) -> None:
        try:
            checked = check(path, self.kind, self._definitions)
        except MessagePathError:
            # A type within it is not known.
            return
        self.fields.append(FieldSurvey(path, checked.kind, checked.names, getter(checked)))

    def _leaves(
        self, kind: MessageType, message: Any, parts: tuple[Part, ...]
    ) -> Iterator[tuple[Part, ...]]:
        """The parts that lead to each value of a message."""
        if len(parts) > _DEEPEST:
            return
        if parts and kind.name == "geometry_msgs/msg/Quaternion":
            yield (*parts, Function("ypr"), FieldName("yaw"))
            return
        for one in kind.fields:
            if any(word in one.name for word in _LEFT_OUT):
                continue
            here = (*parts, FieldName(one.name))
            value = getattr(message, one.attribute)
            if one.is_array:
                yield from self._of_array(kind, one, message, here)
            elif isinstance(one.kind, str):
                yield from self._within(one.kind, value, here)
            else:
                yield here

    def _within(
        self, kind: str, message: Any, parts: tuple[Part, ...]
    ) -> Iterator[tuple[Part, ...]]:
        try:
            definition = self._definitions(kind)
        except MessagePathError:
            return
        yield from self._leaves(definition, message, parts)

    def _of_array(
        self, kind: MessageType, array: Field, message: Any, parts: tuple[Part, ...]
    ) -> Iterator[tuple[Part, ...]]:
        values = getattr(message, array.attribute)
        naming = next((one for name in _NAMES if (one := kind.field(name)) is not None), None)
        if naming is not None and naming.is_array and naming is not array:
            names = list(getattr(message, naming.attribute))[: min(len(values), MOST_ELEMENTS)]
            entries: list[Part] = [Entry(name) for name in names if name and name.isprintable()]
        elif isinstance(array.kind, str) or len(values) > MOST_ELEMENTS:
            entries = []
        else:
            entries = [Index(place) for place in range(len(values))]
        numeric = array.kind in (Primitive.NUMBER, Primitive.INTEGER)
        if not entries:
            yield (*parts, Function("min" if numeric and len(values) else "length"))
        elif naming is not array:
            for entry in entries:
                if isinstance(array.kind, str):
                    place = entries.index(entry)
                    yield from self._within(array.kind, values[place], (*parts, entry))
                else:
                    yield (*parts, entry)
