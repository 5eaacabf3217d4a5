"""Robot files: what they say, what is said of wrong ones, and the labels of each source."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest
import robot_bags as some
from geometry_msgs.msg import TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import BatteryState, Joy
from std_msgs.msg import Bool, String

from rebt_ros.demonstration.categories import MOST_CATEGORIES, Categories
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.robot_file.binding import BoundTopic, bind
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.features import FeatureReader
from rebt_ros.robot_file.labelling import LogLabeller
from rebt_ros.robot_file.reading import (
    json_schema,
    parse_robot_file,
    read_robot_file,
    robot_file_of,
)
from rebt_ros.robot_file.robot_file import BehaviorTreeLogActions, RobotFile
from rebt_ros.robot_file.text import DEEPEST, LARGEST
from rebt_ros.ros.message_types import installed

STATE = "state: {x: /odom.pose.pose.position.x}\n"

WRONG = [
    ("", "it is empty: it needs a part 'state'"),
    ("state:", "line 1: state must be a map, of names and what they stand for, not None"),
    ("state:\n\tx: /odom.x", "cannot start any token): indent with blanks, not with tabs"),
    ("state:\n  x: @abs", "cannot start any token): quote what begins with @"),
    ("state: {x: {path: /odom.x, categories: a}}", "categories must be a list or a map, not 'a'"),
    (f"{STATE}actions: {{a: 5}}", "position.x, or a map, not 5"),
    (f"{STATE}topics: {{/odom: []}}", "topics./odom must be a message type or a map, not []"),
    (
        f"{STATE}actions: {{a: {{twist: /t, sectors: {{f: -90, g: 270}}}}}}",
        "sectors have f and g in the same direction, so that g is never done",
    ),
    ("state: {}", "line 1: state names no feature"),
    ("actions: {}", "needs a part 'state' that names the features"),
    ("- state", "line 1: it must be a map, of names and what they stand for, not ['state']"),
    ("state: {x: /odom.x", "line 1: this is not YAML"),
    ("state: {x: /odom.}", "line 1: state.x is wrong, as message path '/odom.' ends where"),
    (
        "state:\n  x: 3",
        "line 2: state.x must be a message path, such as /odom.pose.pose.position.x",
    ),
    ("state:\n  x:\n    paht: /a.b", "line 3: state.x.paht is unknown here; known are path"),
    ("state:\n  x:\n    kind: binary", "line 2: state.x needs a 'path'"),
    (
        "state:\n  x:\n    path: /a.b\n    kind: number",
        "line 4: state.x.kind must be one of numeric",
    ),
    (
        "state:\n  x:\n    path: /a.b\n    max_age: -1",
        "line 4: state.x.max_age must be a number from",
    ),
    ("state:\n  x:\n    path: /a.b\n    max_age: .nan", "max_age must be a number from"),
    (
        "state:\n  x:\n    path: /a.b\n    categories: []",
        "line 4: state.x.categories name no category",
    ),
    ("state:\n  x:\n    path: /a.b\n    categories: [a, a]", "name a category twice"),
    (
        "state:\n  x: {path: /a.b, kind: numeric, categories: [a]}",
        "are those of a categorical feature, and its kind is numeric",
    ),
    (
        f"{STATE}states: 1",
        "line 2: states is unknown here; known are topics, state, actions, commands, rules",
    ),
    ("state:\n  x: /a.b\n  x: /a.c", "line 3: the key 'x' is there twice"),
    ("state: &a {x: /a.b}", "line 1: anchors (&) and aliases (*) are not read: write it out"),
    ("state: {x: *a}", "anchors (&) and aliases (*) are not read"),
    ("state: !!python/object:os.system {x: /a.b}", "line 1: tags are not read: leave tag:yaml"),
    ("state: {x: !!binary aGVsbG8=}", "tags are not read"),
    ("? [a, b]\n: c", "line 1: a key must be a plain text or number"),
    ("? {a: b}\n: c", "line 1: a key must be a plain text or number"),
    ("[" * 50, f"nested more than {DEEPEST} levels deep"),
    ("state: " + "{a: " * 50, f"nested more than {DEEPEST} levels deep"),
    ("a: b\n---\nc: d", "line 2: a second document begins"),
    ("a: \x00", "is not YAML"),
    ("x" * (LARGEST + 1), f"at most {LARGEST} are read"),
    (f"{STATE}topics: {{/other: nav_msgs/msg/Odometry}}", "neither state nor actions use"),
    (
        f"{STATE}topics: {{/odom: {{stamp: sent}}}}",
        "topics./odom.stamp must be one of received, header",
    ),
    (f"{STATE}actions: {{a: {{topic: /a}}}}", "actions.a needs one of path, joy, twist"),
    (f"{STATE}actions: {{a: {{joy: /a, twist: /b}}}}", "actions.a needs one of path, joy, twist"),
    (f"{STATE}actions: {{a: {{joy: /a}}}}", "actions.a needs 'press', 'hold' or 'axes'"),
    (
        f"{STATE}actions: {{a: {{joy: /a, press: {{A: go}}}}}}",
        "press.A must be named by its number",
    ),
    (f"{STATE}actions: {{a: {{joy: /a, press: {{0: true}}}}}}", "press.0 must be a text, not True"),
    (f"{STATE}actions: {{a: {{joy: /a, axes: {{1: {{0: go}}}}}}}}", "between -1 and 1, and not 0"),
    (f"{STATE}actions: {{a: {{joy: /a, axes: {{1: {{up: go}}}}}}}}", "such as 0.5 or -0.5"),
    (f"{STATE}actions: {{a: {{joy: /a, axes: {{1: {{0.2: a, 0.5: b}}}}}}}}", "a second threshold"),
    (f"{STATE}actions: {{a: {{twist: /a, sectors: {{}}}}}}", "sectors name no sector"),
    (f"{STATE}actions: {{a: {{twist: /a, sectors: {{go: left}}}}}}", "must be a number from -360"),
    (f"{STATE}actions: {{a: {{twist: /a, linear: 0}}}}", "linear must be a number from"),
    (f"{STATE}actions: {{a: {{path: /a.b, emit: always}}}}", "must be one of message, change"),
    (f"{STATE}actions: {{a: {{behavior_tree_log: /log}}}}", "needs 'labels', the nodes that are"),
    (f"{STATE}rules: {{never: go}}", "line 2: rules must be a list, not {'never': 'go'}"),
    (f"{STATE}rules: [{{when: x < 1}}]", "rules.0 needs exactly one of never, always, only"),
    (f"{STATE}rules: [{{never: go, only: go}}]", "rules.0 needs exactly one of never, always"),
    (f"{STATE}rules: [{{only: go}}]", "line 2: rules.0 needs a 'when', as it is an 'only'"),
    (f"{STATE}rules:\n- never: go\n  if: x < 1", "line 4: rules.0.if is unknown here"),
    (f"{STATE}rules: [{{never: go, when: ''}}]", "rules.0.when must be a text, not ''"),
]


@pytest.mark.parametrize(("text", "said"), WRONG)
def test_a_fault_is_one_sentence_with_its_line(text: str, said: str) -> None:
    with pytest.raises(RobotFileError) as caught:
        parse_robot_file(text, "robot.yaml")
    assert said in str(caught.value)
    assert str(caught.value).startswith("robot.yaml")
    assert str(caught.value).endswith(".")


@given(st.text())
def test_whatever_is_given_is_a_robot_file_or_refused(text: str) -> None:
    try:
        parse_robot_file(text)
    except RobotFileError:
        return


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"none.yaml cannot be read \(No such file"):
        read_robot_file(tmp_path / "none.yaml")
    (tmp_path / "latin.yaml").write_bytes(b"\xe4")
    with pytest.raises(RobotFileError, match="is no text in UTF-8"):
        read_robot_file(tmp_path / "latin.yaml")


EVERYTHING = """\
topics:
  /odom: nav_msgs/msg/Odometry
  /scan: {type: sensor_msgs/msg/LaserScan, stamp: header}
state:
  x: /odom.pose.pose.position.x
  near: {path: "/scan.ranges.@min", max_age: 0.5, kind: numeric}
  power: {path: /battery.power_supply_status, categories: {1: charging, 2: used}}
  mode: {path: /mode.data, categories: [auto, manual], kind: categorical}
actions:
  said: /action.data
  phase: {path: /mode.data, labels: {auto: drive}, emit: change}
  arm: {joy: /joy, press: {0: grasp}, hold: {1: lift}, axes: {1: {0.5: up, -0.5: down}},
        hysteresis: 0.2}
  base: {twist: /cmd_vel, sectors: {go: 0, turn: 90}, rest: "", dead_band: 0.1, linear: 0.5,
         angular: 2, hysteresis: 5, emit: change}
  nav: {behavior_tree_log: /log, labels: {FollowPath: follow}}
commands:
  go: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: 0.25}}, when: once}
  grasp: {call: /grasp, type: std_srvs/srv/Trigger}
  dock: {action: /dock, type: nav2_msgs/action/DockRobot, goal: {dock_id: home}}
  stop: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: null}
rules:
  - {never: go, when: near < 0.3}
  - always: stop
    when: x is missing
    channel: base
  - {only: 2, when: mode = auto}
"""


@pytest.mark.parametrize("text", [EVERYTHING, some.ROBOT_FILE, STATE])
def test_what_is_carried_is_the_same_robot_file(text: str) -> None:
    robot = parse_robot_file(text)
    assert robot_file_of(json.loads(json.dumps(robot.content)), "a tree") == robot


@pytest.mark.parametrize("text", [EVERYTHING, some.ROBOT_FILE, STATE])
def test_the_schema_admits_what_is_read(text: str) -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())
    jsonschema.validate(parse_robot_file(text).content, json_schema())


#: Faults that are about more than the form of the file.
_BEYOND_THE_SCHEMA = (
    "a number from.",
    "tags are",
    "is wrong, as message path",
    "use.",
    "twice",
    "second threshold",
    "same direction",
    "its kind is",
)


@pytest.mark.parametrize(
    ("text", "said"), [one for one in WRONG if one[1].endswith("use") or "line 1" not in one[1]]
)
def test_the_schema_refuses_what_is_refused(text: str, said: str) -> None:
    if any(mark in f"{said}." for mark in _BEYOND_THE_SCHEMA) or not text.startswith("state"):
        pytest.skip("no matter of the schema")
    yaml = pytest.importorskip("yaml")
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError):
        pytest.skip("no YAML")
    # Keys are texts in JSON.
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(json.loads(json.dumps(content)), json_schema())


def test_yaml_words_are_texts_but_for_true_false_and_null() -> None:
    robot = parse_robot_file("state: {on: {path: /a.b, categories: [off, no, 1.50, '1']}}")
    assert robot.state[0].name == "on"
    assert list(robot.state[0].categories) == ["off", "no", "1.5", "1"]


def _bound(text: str, topic: str, kind: str) -> BoundTopic:
    return bind(parse_robot_file(text, "robot.yaml"), topic, kind, installed)


def test_features_have_the_kinds_of_their_fields() -> None:
    robot = parse_robot_file(some.ROBOT_FILE)
    kinds = {
        "/odom": "nav_msgs/msg/Odometry",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/battery": "sensor_msgs/msg/BatteryState",
        "/mode": "std_msgs/msg/String",
    }
    found = {
        one.name: one.kind
        for topic, kind in kinds.items()
        for one in bind(robot, topic, kind, installed).features
    }
    numeric, categorical = FeatureKind.NUMERIC, FeatureKind.CATEGORICAL
    assert found == {
        "x": numeric,
        "heading": numeric,
        "ahead": numeric,
        "left": numeric,
        "power": categorical,
        "mode": categorical,
    }


@pytest.mark.parametrize(
    ("text", "topic", "kind", "said"),
    [
        (
            "state: {x: /odom.pos.x}",
            "/odom",
            "nav_msgs/msg/Odometry",
            "robot.yaml: message path '/odom.pos.x': nav_msgs/msg/Odometry has no field 'pos'",
        ),
        (
            "state: {x: /odom.header.stamp.sec}\ntopics: {/odom: nav_msgs/msg/Path}",
            "/odom",
            "nav_msgs/msg/Odometry",
            "topic '/odom' should carry nav_msgs/msg/Path, and carries nav_msgs/msg/Odometry",
        ),
        (
            "state: {x: /mode.data}\ntopics: {/mode: {stamp: header}}",
            "/mode",
            "std_msgs/msg/String",
            "std_msgs/msg/String has no header: leave that out",
        ),
        (
            "state: {x: {path: /mode.data, kind: numeric}}",
            "/mode",
            "std_msgs/msg/String",
            "feature 'x' cannot be numeric: /mode.data is a string",
        ),
        (
            "state: {x: {path: /odom.pose.pose.position.x, kind: categorical}}",
            "/odom",
            "nav_msgs/msg/Odometry",
            "feature 'x' cannot be categorical: /odom.pose.pose.position.x is a number with",
        ),
        (
            f"{STATE}actions: {{a: {{joy: /mode, press: {{0: go}}}}}}",
            "/mode",
            "std_msgs/msg/String",
            "topic '/mode' must carry sensor_msgs/msg/Joy, not std_msgs/msg/String",
        ),
        (
            f"{STATE}actions: {{a: /odom.pose.pose.position.x}}",
            "/odom",
            "nav_msgs/msg/Odometry",
            "gives a number with decimals, of which no label can be made",
        ),
    ],
)
def test_what_does_not_fit_a_topic_is_one_sentence(
    text: str, topic: str, kind: str, said: str
) -> None:
    with pytest.raises(RobotFileError) as caught:
        _bound(text, topic, kind)
    assert said in str(caught.value)


def _values(text: str, topic: str, *messages: Any) -> list[list[str | float]]:
    """What is read, with categories as texts."""
    bound = _bound(text, topic, some.name_of(messages[0]))
    categories: dict[str, Categories] = {}
    reader = FeatureReader(bound, categories)
    rows = []
    for message in messages:
        row: list[str | float] = []
        for name, value in zip(reader.names, reader.read(message, 0), strict=True):
            known = value == value and name in categories
            row.append(categories[name].names[int(value)] if known else value)
        rows.append(row)
    return rows


def test_numbers_that_are_not_finite_are_missing_and_the_others_stay() -> None:
    message = some.odometry(float("inf"))
    message.pose.pose.position.y = 2.0
    text = "state: {" + ", ".join(f"{one}: /o.pose.pose.position.{one}" for one in "xyz") + "}"
    [[x, y, z]] = _values(text, "/o", message)
    assert x != x
    assert (y, z) == (2.0, 0.0)


def test_numbers_that_are_too_large_are_missing() -> None:
    [[x]] = _values("state: {x: /o.pose.pose.position.x}", "/o", some.odometry(1e39))
    assert x != x


def test_constants_and_texts_are_categories() -> None:
    text = "state: {p: /b.power_supply_status, h: {path: /b.power_supply_health, kind: numeric}}"
    message = BatteryState(power_supply_status=1, power_supply_health=3)
    assert _values(text, "/b", message) == [["CHARGING", 3.0]]
    assert _values("state: {m: /m.data}", "/m", String(data="b"), String(data="a")) == [
        ["b"],
        ["a"],
    ]


def test_categories_that_are_named_are_the_only_ones() -> None:
    text = "state: {p: {path: /b.power_supply_status, categories: {1: full, 4: full, 2: used}}}"
    rows = _values(text, "/b", *(BatteryState(power_supply_status=one) for one in (1, 4, 2, 3)))
    assert rows[:3] == [["full"], ["full"], ["used"]]
    assert rows[3][0] != rows[3][0]


def test_a_truth_value_is_binary_or_has_categories() -> None:
    text = "state: {a: /d.data, b: {path: /d.data, categories: {true: docked, false: free}}}"
    assert _values(text, "/d", Bool(data=True), Bool(data=False)) == [
        [1.0, "docked"],
        [0.0, "free"],
    ]


def test_categories_have_an_end() -> None:
    categories = Categories()
    for number in range(MOST_CATEGORIES):
        assert categories.code(str(number)) == number
    code = categories.code("one more")
    assert code != code
    assert categories.code("7") == 7


def test_texts_that_cannot_be_printed_are_written_so_that_they_can() -> None:
    categories = Categories()
    assert categories.code("a\nb") == categories.code("a\\nb")
    empty = categories.code("")
    assert empty != empty


# --- labels ---


def _labels(source: str, *messages: Any) -> list[list[str]]:
    """The labels that a source makes of each of several messages."""
    topic, text = "/topic", f"{STATE}actions: {{a: {source}}}"
    labeller = _bound(text, topic, some.name_of(messages[0])).labellers["a"]
    return [list(labeller.labels(message, 0)) for message in messages]


def test_a_string_is_its_own_label_at_every_message() -> None:
    said = [String(data=one) for one in ("go", "go", "", "turn")]
    assert _labels("/topic.data", *said) == [["go"], ["go"], [""], ["turn"]]


def test_a_table_turns_values_into_labels_and_others_into_none() -> None:
    said = [String(data=one) for one in ("A", "A", "B", "C", "A")]
    source = "{path: /topic.data, labels: {A: go, B: turn}, emit: change}"
    assert _labels(source, *said) == [["go"], [], ["turn"], [""], ["go"]]


def test_an_integer_is_named_by_its_constant_or_by_the_table() -> None:
    states = [BatteryState(power_supply_status=one) for one in (1, 4, 0)]
    assert _labels("/topic.power_supply_status", *states) == [["CHARGING"], ["FULL"], ["UNKNOWN"]]
    source = "{path: /topic.power_supply_status, labels: {1: charge, FULL: drive}}"
    assert _labels(source, *states) == [["charge"], ["drive"], [""]]


def test_a_button_speaks_when_it_is_pressed_and_a_held_one_until_it_is_released() -> None:
    source = "{joy: /topic, press: {0: grasp}, hold: {1: lift}}"
    pressed = [[0, 0], [1, 0], [1, 0], [0, 1], [0, 1], [1, 1], [0, 0]]
    messages = [Joy(buttons=one) for one in pressed]
    assert _labels(source, *messages) == [[], ["grasp"], [], ["lift"], [], ["grasp"], [""]]


def test_an_axis_is_held_until_it_has_gone_back_by_the_hysteresis() -> None:
    source = "{joy: /topic, axes: {0: {0.5: up, -0.5: down}}, hysteresis: 0.25}"
    values = (0.25, 0.5, 0.25, 0.125, -1.0, -0.375, 0.0)
    messages = [Joy(axes=[one]) for one in values]
    assert _labels(source, *messages) == [[], ["up"], [], [""], ["down"], [], [""]]


def test_a_joystick_with_fewer_buttons_and_axes_than_named_says_nothing() -> None:
    source = "{joy: /topic, press: {7: grasp}, axes: {7: {0.5: up}}}"
    assert _labels(source, Joy(buttons=[1], axes=[1.0])) == [[]]


def test_a_velocity_belongs_to_the_nearest_direction() -> None:
    messages = [
        some.twist(*one)
        for one in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.04, 0.0))
    ]
    assert _labels("{twist: /topic}", *messages) == [
        ["stop"],
        ["forward"],
        ["left"],
        ["back"],
        ["right"],
        ["stop"],
    ]


def test_a_direction_near_the_border_stays_in_its_sector() -> None:
    source = "{twist: /topic, emit: change}"
    steps = [(1.0, 0.0), (1.0, 1.1), (1.0, 1.2), (1.0, 2.0), (1.0, 0.9), (1.0, 0.1)]
    assert _labels(source, *(some.twist(*one) for one in steps)) == [
        ["forward"],
        [],
        [],
        ["left"],
        [],
        ["forward"],
    ]


def test_a_velocity_is_scaled_and_rest_may_be_no_action() -> None:
    source = '{twist: /topic, linear: 0.5, angular: 2, dead_band: 0.5, rest: ""}'
    messages = [some.twist(*one) for one in ((0.4, 1.0), (0.2, 0.0), (0.1, 2.0), (0.0, 0.0))]
    assert _labels(source, *messages) == [["forward"], [""], ["left"], [""]]


def test_a_stamped_velocity_is_read_alike() -> None:
    message = TwistStamped()
    message.twist.linear.x = -1.0
    assert _labels("{twist: /topic}", message) == [["back"]]


def test_a_velocity_that_is_not_finite_changes_nothing() -> None:
    messages = [some.twist(1.0, 0.0), some.twist(float("nan"), 0.0)]
    assert _labels("{twist: /topic, emit: change}", *messages) == [["forward"], []]


def test_the_running_node_that_began_last_is_what_is_done() -> None:
    labeller = LogLabeller(BehaviorTreeLogActions("/log", {"FollowPath": "follow", "Spin": "spin"}))

    def labels(*events: tuple[str, str]) -> list[str]:
        log = [SimpleNamespace(node_name=name, current_status=now) for name, now in events]
        return list(labeller.labels(SimpleNamespace(event_log=log), 0))

    assert labels(("FollowPath", "RUNNING"), ("Root", "RUNNING")) == ["follow"]
    assert labels(("FollowPath", "RUNNING")) == []
    assert labels(("Spin", "RUNNING")) == ["spin"]
    assert labels(("Spin", "SUCCESS")) == ["follow"]
    assert labels(("FollowPath", "FAILURE")) == [""]


def test_the_topics_are_those_of_state_and_actions() -> None:
    robot: RobotFile = parse_robot_file(some.ROBOT_FILE)
    assert robot.state_topics == ("/odom", "/scan", "/joint_states", "/battery", "/mode")
    assert robot.action_topics == ("/joy",)


def test_buttons_and_axes_that_a_joystick_does_not_have_are_told() -> None:
    source = "{joy: /topic, press: {0: go}, hold: {9: lift, 4: drop}, axes: {2: {0.5: up}}}"
    robot = parse_robot_file(f"state: {{s: /other.data}}\nactions: {{action: {source}}}", "robot")
    one = bind(robot, "/topic", "sensor_msgs/msg/Joy", installed).labellers["action"]
    assert one.lacks == ""
    one.labels(Joy(buttons=[0] * 5, axes=[0.0] * 3), 0)
    assert one.lacks == "button 9 (there are 5, from 0)"
    one.labels(Joy(buttons=[0] * 10, axes=[0.0]), 0)
    assert one.lacks == "axis 2 (there are 1, from 0)"
    one.labels(Joy(buttons=[0], axes=[]), 0)
    assert one.lacks == "button 4, 9 (there are 1, from 0) and axis 2 (there are 0, from 0)"
    one.labels(Joy(buttons=[0] * 10, axes=[0.0] * 3), 0)
    assert one.lacks == ""
