"""A robot file to begin with, made of what was seen on a robot's topics."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from rebt_ros.message_path.definition import Primitive
from rebt_ros.message_path.path import FieldName, Function, Index
from rebt_ros.robot_file.survey import FieldSurvey, TopicSurvey

#: Most features of one topic that are proposed, and of all.
_MOST_OF_TOPIC: Final = 12

_JOY: Final = "sensor_msgs/msg/Joy"
_SCAN: Final = "sensor_msgs/msg/LaserScan"
_TWISTS: Final = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
_STRING: Final = "std_msgs/msg/String"
_LOG: Final = "nav2_msgs/msg/BehaviorTreeLog"

#: Topics that are about the system and not the robot.
_SYSTEM: Final = re.compile(r"/(rosout|parameter_events|clock|diagnostics.*|tf|tf_static)|.*_raw")
_SECTORS: Final = ("right", "front_right", "ahead", "front_left", "left")
_AROUND: Final = (
    ("ahead", -36, 36),
    ("left", 36, 108),
    ("back_left", 108, 180),
    ("back_right", -180, -108),
    ("right", -108, -36),
)
#: A joystick that is sent so often repeats what is held (Hz).
_EVENLY_SENT: Final = 5.0
#: A velocity is at rest below this share of the largest one that was seen.
_DEAD_BAND: Final = 0.1


@dataclass(frozen=True, slots=True)
class _Proposed:
    name: str
    path: str
    comment: str
    wanted: bool
    """Whether it is a feature, or only a comment."""


def proposal(topics: Sequence[TopicSurvey], source: str) -> str:
    """The text of a robot file, with comments.

    Args:
        topics: What was seen.
        source: Where, for the comment at its top.
    """
    shown = [one for one in topics if one.messages and not _SYSTEM.fullmatch(one.topic)]
    actions = list(_actions(shown))
    used = {topic for topic, _ in actions[:1]}
    lines = [
        f"# Made by `describe` from what was seen in {source}; change it as you like.",
        "# Names are yours, and behind them are message paths: docs/robot_file.md.",
        "topics:",
    ]
    states = [one for one in shown if one.topic not in used and not _only_acts(one)]
    proposed = {state.topic: _features(state) for state in states}
    named = _named([one for its in proposed.values() for one in its])
    for one in shown:
        if one.topic in used or any(its.wanted for its in proposed.get(one.topic, ())):
            lines.append(f"  {_key(one.topic)}: {one.kind}")
    lines.append("state:")
    for state in states:
        if proposed[state.topic]:
            lines.append(f"  # {state.topic}, {state.kind}, {state.rate:.3g} Hz")
        for its in proposed[state.topic]:
            lead = "  " if its.wanted else "  # "
            lines.append(f"{lead}{named[id(its)]}: {_quoted(its.path)}  # {its.comment}")
    lines.append("actions:")
    for place, (_, text) in enumerate(actions):
        if place:
            lines.append("  # Or, instead:")
        lines += [f"  {'# ' if place else ''}{line}" for line in text]
    if not actions:
        lines.append("  # Nothing was seen that says what is done: name a topic that does.")
        lines.append("  action: /action.data")
    return "\n".join(lines) + "\n"


def _only_acts(topic: TopicSurvey) -> bool:
    return topic.kind in (_JOY, *_TWISTS, _LOG)


def _actions(topics: Sequence[TopicSurvey]) -> Iterator[tuple[str, list[str]]]:
    """Sources of actions, the most likely one first: the topic of each, and its lines."""
    said = [topic for topic in topics if topic.kind == _STRING and "action" in topic.topic]
    for one in said:
        seen = one.field(".data")
        labels = seen.in_words() if seen else ""
        yield one.topic, [f"action: {_quoted(f'{one.topic}.data')}  # {labels}"]
    for topic in topics:
        if topic.kind == _JOY and (lines := _joy(topic)):
            yield topic.topic, ["action:", f"  joy: {_key(topic.topic)}", *_every(topic), *lines]
    for topic in topics:
        if topic.kind in _TWISTS and (lines := _twist(topic)):
            yield topic.topic, ["action:", f"  twist: {_key(topic.topic)}", *lines]


def _every(topic: TopicSurvey) -> list[str]:
    """That each message is a row, where a joystick is sent all the time."""
    if topic.rate < _EVENLY_SENT:
        return []
    return [f"  emit: message  # sent {topic.rate:.3g} times a second; `change` for few rows"]


def _joy(topic: TopicSurvey) -> list[str]:
    """Buttons and axes that were used."""
    buttons, axes = [], []
    for field in topic.fields:
        match field.path.parts:
            case (FieldName(name="buttons"), Index(index=index)) if field.varies:
                buttons.append(f"{index}: button_{index}")
            case (FieldName(name="axes"), Index(index=index)) if field.varies:
                ends = [f"0.5: axis_{index}_up"] if field.most >= 0.5 else []
                ends += [f"-0.5: axis_{index}_down"] if field.least <= -0.5 else []
                if ends:
                    axes.append(f"{index}: {{{', '.join(ends)}}}")
    lines = (
        [f"  press: {{{', '.join(buttons)}}}  # `hold:` for while it is down"] if buttons else []
    )
    return [*lines, *([f"  axes: {{{', '.join(axes)}}}"] if axes else [])]


def _twist(topic: TopicSurvey) -> list[str]:
    """Scales as large as the largest velocities."""
    lead = ".twist" if topic.kind == _TWISTS[1] else ""
    linear, angular = (topic.field(f"{lead}{one}") for one in (".linear.x", ".angular.z"))
    if linear is None or angular is None or not (linear.varies or angular.varies):
        return []
    lines = [
        f"  {name}: {size:.4g}  # {unit}, the largest that was seen"
        for name, one, unit in (("linear", linear, "m/s"), ("angular", angular, "rad/s"))
        if (size := max(abs(one.least), abs(one.most))) > 0
    ]
    return [
        *lines,
        f"  dead_band: {_DEAD_BAND}  # in shares of these; below it, the action is stop",
        "  sectors: {forward: 0, left: 90, back: 180, right: -90}  # degrees",
    ]


def _features(topic: TopicSurvey) -> list[_Proposed]:
    if topic.kind == _SCAN:
        return _sectors(topic)
    varying = [field for field in topic.fields if field.varies and _is_plain(field)]
    found = [
        _Proposed(_name(topic, one), str(one.path), one.in_words(), wanted=place < _MOST_OF_TOPIC)
        for place, one in enumerate(varying)
    ]
    # What is 0 or empty all the time tells nothing.
    still = [
        field
        for field in topic.fields
        if any(field.values) and not field.varies and _is_plain(field)
    ]
    return found + [
        _Proposed(_name(topic, one), str(one.path), f"always {one.in_words()}", wanted=False)
        for one in still[: max(0, _MOST_OF_TOPIC - len(found))]
    ]


def _is_plain(one: FieldSurvey) -> bool:
    """Whether it may well be a feature; texts that hardly recur are none."""
    return one.kind is not Primitive.TEXT or 2 * len(one.values) <= one.seen or one.seen < 4


def _sectors(topic: TopicSurvey) -> list[_Proposed]:
    """Five sectors of a scan: around the robot, or from its right to its left."""
    scan = topic.first
    count = len(scan.ranges)
    width = math.degrees(scan.angle_increment * max(count - 1, 0))
    first = math.degrees(scan.angle_min)
    if not count or not 0 < width < 1e6:
        return []
    sectors: Sequence[tuple[str, float, float]] = _AROUND
    if width < 350:
        ends = [round(first + width * place / 5) for place in range(6)]
        sectors = [(name, ends[place], ends[place + 1]) for place, name in enumerate(_SECTORS)]
    return [
        _Proposed(
            name,
            f"{topic.topic}.ranges[{low:g}deg:{high:g}deg].@min",
            "the nearest thing there (m)",
            wanted=True,
        )
        for name, low, high in sectors
    ]


def _name(topic: TopicSurvey, one: FieldSurvey) -> str:
    """A short name for a field."""
    words = [
        str(getattr(part, "name", getattr(part, "index", "")))
        for part in one.path.parts
        if not (isinstance(part, FieldName) and part.name in ("data", "pose", "twist", "position"))
        and not (isinstance(part, Function) and part.name in ("ypr", "min"))
        and not (isinstance(part, FieldName) and part.name == "orientation")
    ]
    base = topic.topic.strip("/").replace("/", "_")
    text = "_".join(words) if words else base
    if all(word.isdigit() for word in words) and words:
        text = f"{base}_{text}"
    return re.sub(r"\W+", "_", text).strip("_") or base


def _named(proposed: Sequence[_Proposed]) -> dict[int, str]:
    """A name for each that no other has."""
    names: dict[int, str] = {}
    taken: set[str] = set()
    for one in sorted(proposed, key=lambda one: not one.wanted):
        name, number = one.name, 2
        if name in taken:
            topic = re.sub(r"\W+", "_", one.path.partition(".")[0].strip('/"')).strip("_")
            name = f"{topic}_{one.name}"
        while name in taken:
            name, number = f"{one.name}_{number}", number + 1
        taken.add(name)
        names[id(one)] = name
    return names


def _quoted(text: str) -> str:
    """A text as YAML; in quotes where it could be read as something else."""
    if re.fullmatch(r"[\w/.\[\]@()-]+", text, re.ASCII) and not text.startswith(("[", "@", "-")):
        return text
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _key(text: str) -> str:
    return text if re.fullmatch(r"[/\w]+", text, re.ASCII) else _quoted(text)
