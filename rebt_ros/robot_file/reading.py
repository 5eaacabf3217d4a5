"""Reading robot files, from their text or from what recordings and trees carry of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from enum import Enum
from importlib import resources
from pathlib import Path
from typing import Final

from rebt_ros.codec.form import Definitions, Form
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.parsing import parse
from rebt_ros.message_path.path import PLAIN_TOPIC, MessagePath
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.place import Place
from rebt_ros.robot_file.robot_file import (
    ActionSource,
    AxisLabels,
    BehaviorTreeLogActions,
    CallCommand,
    Command,
    Emit,
    GoalCommand,
    JoyActions,
    Json,
    PathActions,
    PublishCommand,
    RobotFile,
    Stamp,
    StateFeature,
    TopicSettings,
    TwistActions,
    WrittenRule,
)
from rebt_ros.robot_file.text import LARGEST, read_yaml

#: Most features, and most of anything else that is listed.
MOST: Final = 1000
#: Most rules.
MOST_RULES: Final = 500

#: Sectors of a Twist where none are named (degrees).
_SECTORS: Final[Mapping[str, float]] = {"forward": 0.0, "left": 90.0, "back": 180.0, "right": -90.0}
_PATH_OR_MAP: Final = "a message path, such as /odom.pose.pose.position.x, or a map"
_LARGEST_AGE: Final = 3600.0
_MOST_BUTTONS: Final = 1000


class _When(Enum):
    """When a message is published."""

    TICK = "tick"
    ONCE = "once"


def json_schema() -> Json:
    """The JSON Schema (draft 2020-12) of robot files."""
    source = resources.files(__package__).joinpath("robot_file.schema.json")
    return json.loads(source.read_text(encoding="utf-8"))


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot file.

    Raises:
        RobotFileError: It cannot be read, or one sentence says what is wrong in which line.
    """
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(LARGEST + 1)
    except OSError as err:
        raise RobotFileError(
            f"the robot file {path} cannot be read ({err.strerror or err}): name a file that can."
        ) from err
    except UnicodeDecodeError as err:
        raise RobotFileError(f"{path} is no text in UTF-8: save it as such.") from err
    return parse_robot_file(text, str(path))


def parse_robot_file(text: str, name: str = "the robot file") -> RobotFile:
    """The robot file of a text.

    Raises:
        RobotFileError: One sentence says what is wrong in which line.
    """
    content, lines, starts = read_yaml(text, name)
    return _robot_file(Place(content, name, lines, starts=starts), name, content)


def robot_file_of(content: Json, name: str) -> RobotFile:
    """The robot file that a recording or a tree carries.

    Args:
        content: `RobotFile.content`.
        name: What carries it, for messages.

    Raises:
        RobotFileError: It is none.
    """
    return _robot_file(Place(content, name, {}), name, content)


class CarriedRobotFile(Form[RobotFile]):
    """The content of a robot file inside other JSON: of a recording or a tree made by it.

    Args:
        name: What to call it in messages.

    Raises:
        RobotFileError: By `decode`, where it is none.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def decode(self, value: Json) -> RobotFile:
        """The robot file of its content."""
        return robot_file_of(value, self._name)

    def encode(self, value: RobotFile) -> Json:
        """Its content."""
        return value.content

    def schema(self, definitions: Definitions) -> Json:
        """That of any object."""
        return {"type": "object"}


def _robot_file(place: Place, name: str, content: Json) -> RobotFile:
    if place.value is None:
        place.refuse("is empty: it needs a part 'state'")
    fields = place.fields("topics", "state", "actions", "commands", "rules")
    if "state" not in fields:
        place.refuse("needs a part 'state' that names the features")
    state = tuple(_feature(key, its) for key, its in _listed(fields["state"]))
    if not state:
        fields["state"].refuse("names no feature")
    actions = (
        {key: _source(its) for key, its in _listed(fields["actions"])}
        if "actions" in fields
        else {}
    )
    for key, its in _listed(fields["actions"]) if "actions" in fields else ():
        if not PLAIN_TOPIC.fullmatch(key):
            its.refuse("must have a name as topics have: letters, digits, _ and /")
    topics = (
        {key: _topic(its) for key, its in _listed(fields["topics"])} if "topics" in fields else {}
    )
    commands = (
        {key: _command(its) for key, its in _listed(fields["commands"])}
        if "commands" in fields
        else {}
    )
    rules = tuple(map(_rule, fields["rules"].elements())) if "rules" in fields else ()
    if len(rules) > MOST_RULES:
        fields["rules"].refuse(f"has {len(rules)} rules: at most {MOST_RULES} are read")
    robot = RobotFile(name, state, actions, topics, commands, rules, content)
    used = {*robot.state_topics, *robot.action_topics}
    for key, its in _listed(fields["topics"]) if "topics" in fields else ():
        if key not in used:
            its.refuse("is a topic that neither state nor actions use")
    return robot


def _listed(place: Place) -> list[tuple[str, Place]]:
    found = list(place.items())
    if len(found) > MOST:
        place.refuse(f"has {len(found)} entries: at most {MOST} are read")
    for key, its in found:
        if not key or not key.isprintable():
            its.refuse("has a name that cannot be printed")
    return found


def _topic(place: Place) -> TopicSettings:
    if isinstance(place.value, str):
        return TopicSettings(place.text())
    if not place.is_map:
        place.must_be("a message type or a map")
    fields = place.fields("type", "stamp")
    return TopicSettings(
        fields["type"].text() if "type" in fields else "",
        fields["stamp"].one_of(Stamp) if "stamp" in fields else Stamp.RECEIVED,
    )


def _feature(name: str, place: Place) -> StateFeature:
    if isinstance(place.value, str):
        return StateFeature(name, _path(place))
    if not place.is_map:
        place.must_be(_PATH_OR_MAP)
    fields = place.fields("path", "kind", "categories", "max_age")
    if "path" not in fields:
        place.refuse("needs a 'path'")
    kind = fields["kind"].one_of(FeatureKind) if "kind" in fields else None
    categories = _categories(fields["categories"]) if "categories" in fields else {}
    if categories and kind not in (None, FeatureKind.CATEGORICAL):
        fields["categories"].refuse(
            f"are those of a categorical feature, and its kind is {kind.value}" if kind else ""
        )
    age = fields["max_age"].number(1e-3, _LARGEST_AGE) if "max_age" in fields else None
    return StateFeature(name, _path(fields["path"]), kind, categories, age)


def _categories(place: Place) -> dict[str, str]:
    """Names by value; of a list, each value is its own name."""
    if isinstance(place.value, list):
        texts = [element.text() for element in place.elements()]
        if len(set(texts)) < len(texts):
            place.refuse("name a category twice")
        found = dict(zip(texts, texts, strict=True))
    elif not place.is_map:
        place.must_be("a list or a map")
    else:
        found = {key: its.text() for key, its in _listed(place)}
    if not found:
        place.refuse("name no category")
    return found


def _path(place: Place) -> MessagePath:
    try:
        return parse(place.text())
    except MessagePathError as err:
        place.refuse(f"is wrong, as {str(err).rstrip('.')}")


def _source(place: Place) -> ActionSource:
    if isinstance(place.value, str):
        return PathActions(_path(place))
    if not place.is_map:
        place.must_be(_PATH_OR_MAP)
    kinds = [key for key, _ in place.items() if key in _SOURCES]
    if len(kinds) != 1:
        place.refuse(f"needs one of {', '.join(_SOURCES)}, which says what kind of source it is")
    return _SOURCES[kinds[0]](place)


def _path_actions(place: Place) -> ActionSource:
    fields = place.fields("path", "labels", "emit")
    return PathActions(_path(fields["path"]), _labels(fields, "labels"), _emit(fields))


def _joy_actions(place: Place) -> ActionSource:
    fields = place.fields("joy", "press", "hold", "axes", "hysteresis", "emit")
    press, hold = (
        {_button(its, key): label for key, (its, label) in _places(fields, name).items()}
        for name in ("press", "hold")
    )
    axes = (
        {_button(its, key): _axis(its) for key, its in _listed(fields["axes"])}
        if "axes" in fields
        else {}
    )
    if not (press or hold or axes):
        place.refuse("needs 'press', 'hold' or 'axes'")
    hysteresis = fields["hysteresis"].number(0, 1) if "hysteresis" in fields else 0.1
    emit = _emit(fields, Emit.CHANGE)
    return JoyActions(fields["joy"].text(), press, hold, axes, hysteresis, emit)


def _places(fields: Mapping[str, Place], name: str) -> dict[str, tuple[Place, str]]:
    if name not in fields:
        return {}
    return {key: (its, its.text()) for key, its in _listed(fields[name])}


def _button(place: Place, key: str) -> int:
    if not (key.isascii() and key.isdecimal()) or int(key) >= _MOST_BUTTONS:
        place.refuse("must be named by its number, from 0 on")
    return int(key)


def _axis(place: Place) -> AxisLabels:
    """Labels by threshold: positive ones are reached from below, negative ones from above."""
    above = below = None
    for key, its in _listed(place):
        try:
            threshold = float(key)
        except ValueError:
            its.refuse("must be a threshold between -1 and 1, such as 0.5 or -0.5")
        if not 0 < abs(threshold) <= 1:
            its.refuse("must be a threshold between -1 and 1, and not 0")
        if threshold > 0 and above is None:
            above = (threshold, its.text())
        elif threshold < 0 and below is None:
            below = (threshold, its.text())
        else:
            its.refuse("is a second threshold on the same side")
    if above is None and below is None:
        place.refuse("needs a threshold, such as 0.5")
    return AxisLabels(above, below)


def _twist_actions(place: Place) -> ActionSource:
    fields = place.fields(
        "twist", "sectors", "rest", "dead_band", "linear", "angular", "hysteresis", "emit"
    )
    sectors = dict(_SECTORS)
    if "sectors" in fields:
        sectors = {key: its.number(-360, 360) for key, its in _listed(fields["sectors"])}
    if not sectors:
        fields["sectors"].refuse("name no sector")
    directions: dict[float, str] = {}
    for key, degrees in sectors.items():
        other = directions.setdefault(degrees % 360, key)
        if other != key:
            fields["sectors"].refuse(
                f"have {other} and {key} in the same direction, so that {key} is never done"
            )

    def number(name: str, default: float, least: float, most: float) -> float:
        return fields[name].number(least, most) if name in fields else default

    rest = "stop"
    if "rest" in fields:
        rest = fields["rest"].text() if fields["rest"].value not in ("", None) else ""
    return TwistActions(
        fields["twist"].text(),
        sectors,
        rest,
        number("dead_band", 0.05, 0, 1e6),
        number("linear", 1.0, 1e-6, 1e6),
        number("angular", 1.0, 1e-6, 1e6),
        number("hysteresis", 10.0, 0, 90),
        _emit(fields),
    )


def _log_actions(place: Place) -> ActionSource:
    fields = place.fields("behavior_tree_log", "labels")
    labels = _labels(fields, "labels")
    if not labels:
        place.refuse("needs 'labels', the nodes that are actions with the label of each")
    return BehaviorTreeLogActions(fields["behavior_tree_log"].text(), labels)


def _command(place: Place) -> Command:
    kinds = [key for key, _ in place.items() if key in _COMMANDS]
    if len(kinds) != 1:
        place.refuse(f"needs one of {', '.join(_COMMANDS)}, which says what it does")
    return _COMMANDS[kinds[0]](place)


def _publish_command(place: Place) -> Command:
    fields = _of_a_kind(place, "publish", "message", "when")
    when = fields["when"].one_of(_When) if "when" in fields else _When.TICK
    return PublishCommand(
        fields["publish"].text(),
        fields["type"].text(),
        _content(fields, "message"),
        when is _When.TICK,
    )


def _call_command(place: Place) -> Command:
    fields = _of_a_kind(place, "call", "request")
    return CallCommand(fields["call"].text(), fields["type"].text(), _content(fields, "request"))


def _goal_command(place: Place) -> Command:
    fields = _of_a_kind(place, "action", "goal")
    return GoalCommand(fields["action"].text(), fields["type"].text(), _content(fields, "goal"))


def _rule(place: Place) -> WrittenRule:
    fields = place.fields(*_RULE_KINDS, "when", "channel")
    kinds = [kind for kind in _RULE_KINDS if kind in fields]
    if len(kinds) != 1:
        place.refuse(f"needs exactly one of {', '.join(_RULE_KINDS)}, with an action")
    kind = kinds[0]
    if kind == "only" and "when" not in fields:
        place.refuse("needs a 'when', as it is an 'only'")
    when = fields.get("when")
    return WrittenRule(
        kind,
        fields[kind].text(),
        "" if when is None else when.text(),
        fields["channel"].text() if "channel" in fields else "",
        fields[kind].start,
        None if when is None else when.start,
    )


def _of_a_kind(place: Place, name: str, *others: str) -> dict[str, Place]:
    fields = place.fields(name, "type", *others)
    if "type" not in fields:
        place.refuse("needs a 'type', such as geometry_msgs/msg/Twist")
    return fields


def _content(fields: Mapping[str, Place], name: str) -> Json:
    if name not in fields or fields[name].value is None:
        return {}
    # Whatever is no map is refused.
    dict(fields[name].items())
    return fields[name].value


def _labels(fields: Mapping[str, Place], name: str) -> dict[str, str]:
    return {key: label for key, (_, label) in _places(fields, name).items()}


def _emit(fields: Mapping[str, Place], default: Emit = Emit.MESSAGE) -> Emit:
    return fields["emit"].one_of(Emit) if "emit" in fields else default


#: What a rule can demand.
_RULE_KINDS: Final = ("never", "always", "only")

#: What a source is by the key that names its topic.
_SOURCES: Final[Mapping[str, Callable[[Place], ActionSource]]] = {
    "path": _path_actions,
    "joy": _joy_actions,
    "twist": _twist_actions,
    "behavior_tree_log": _log_actions,
}

#: What a command is by the key that names its topic, service or server.
_COMMANDS: Final[Mapping[str, Callable[[Place], Command]]] = {
    "publish": _publish_command,
    "call": _call_command,
    "action": _goal_command,
}
