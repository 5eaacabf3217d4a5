"""Message paths: what is read of messages, and what is said of paths that lead to nothing."""

from __future__ import annotations

import math

import message_examples as some
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, LaserScan

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.checking import check
from rebt_ros.message_path.compiling import attribute_of, getter, wanted_of
from rebt_ros.message_path.definition import Primitive
from rebt_ros.message_path.functions import Angles, euler
from rebt_ros.message_path.parsing import LONGEST_PATH, MOST_PARTS, parse
from rebt_ros.message_path.path import FieldName, Filter, MessagePath
from rebt_ros.ros.message_types import installed, message_class
from rebt_ros.storage.message_types import BagTypes

TYPES = BagTypes()

RIGHT = [
    ("/odom.pose.pose.position.x", 3.0),
    ('"/odom".pose.pose.position."x"', 3.0),
    ("/odom.header.stamp.sec", 7.0),
    ("/odom.child_frame_id", "base"),
    ("/odom.pose.covariance[0]", 0.25),
    ("/odom.pose.covariance[-1]", 0.5),
    ("/odom.pose.covariance[36]", None),
    ("/odom.pose.covariance[-37]", None),
    ("/odom.pose.covariance[34:].@max", 0.5),
    ("/odom.pose.covariance[0:0].@max", 0.25),
    ("/odom.pose.covariance[:-2].@max", 0.25),
    ("/odom.pose.covariance[-1:-1].@length", 1.0),
    ("/odom.pose.covariance[3:2].@length", 0.0),
    ("/odom.pose.covariance[3:2].@max", None),
    ("/odom.pose.covariance.@length", 36.0),
    ("/odom.pose.pose.position.@norm", 5.0),
    ("/odom.pose.pose.orientation.@ypr.yaw", math.pi / 2),
    ("/odom.pose.pose.orientation.@rpy.yaw.@degrees", 90.0),
    ("/odom.pose.pose.orientation.@ypr.roll", 0.0),
    ("/odom.twist.twist.linear.x.@abs", 0.5),
    ("/odom.twist.twist.linear.x.@negative.@sign", 1.0),
    ("/odom.twist.twist.linear.x.@sqrt", None),
    ("/odom.twist.twist.linear.x.@log", None),
    ("/odom.twist.twist.linear.x.@round", 0.0),
    ("/odom.twist.twist.linear.x.@add(1).@mul(-4).@sub(0.5).@div(5)", -0.5),
    ("/odom.twist.twist.linear.x.@cos.@acos", 0.5),
    ("/odom.twist.twist.linear.x.@degrees.@radians", -0.5),
    ("/odom{twist.twist.linear.x<0}.pose.pose.position.x", 3.0),
    ("/odom{twist.twist.linear.x>0}.pose.pose.position.x", None),
    ('/odom{child_frame_id=="base"}.pose.pose.position.x', 3.0),
    ("/odom{child_frame_id!='base'}.pose.pose.position.x", None),
    ("/scan.ranges[0]", 2.0),
    ("/scan.ranges[1]", None),
    ("/scan.ranges[3]", 8.0),
    ("/scan.ranges[4]", 8.0),
    ("/scan.ranges[5]", None),
    ("/scan.ranges[7]", None),
    ("/scan.ranges.@min", 1.5),
    ("/scan.ranges.@max", 8.0),
    ("/scan.ranges.@mean", (2 + 1.5 + 8 + 8 + 4) / 5),
    ("/scan.ranges.@argmin", 2.0),
    ("/scan.ranges.@length", 7.0),
    ("/scan.ranges[3:].@min", 4.0),
    ("/scan.ranges[5:5].@min", None),
    ("/scan.ranges[-95deg:-25deg].@min", 1.5),
    ("/scan.ranges[0deg:90deg].@min", 4.0),
    ("/scan.ranges[0deg:90deg].@argmin", 3.0),
    ("/scan.ranges[60deg:60deg].@max", None),
    ("/scan.ranges[100deg:170deg].@length", 0.0),
    ("/scan.intensities[1:2].@mean", 2.5),
    ("/joint_states.position[left_wheel]", -2.0),
    ('/joint_states.position["odd name"].@mul(2)', 6.0),
    ("/joint_states.position[arm]", None),
    ("/joint_states.velocity[right_wheel]", 0.5),
    ("/joint_states.velocity[left_wheel]", None),
    ("/joint_states.name[1]", "left_wheel"),
    ("/joint_states.name.@length", 3.0),
    ("/joints.transforms[hand].translation.y", 2.5),
    ("/joy.axes[1]", -1.0),
    ("/joy.buttons[1]", 1.0),
    ("/joy.buttons.@argmin", 0.0),
    ("/battery.power_supply_status", 1.0),
    ("/battery{power_supply_status==CHARGING}.voltage", 12.5),
    ("/battery{power_supply_status==1}{present==true}.percentage", 0.75),
    ("/battery{present!=true}.percentage", None),
    ("/battery.present", 1.0),
    ("/battery.cell_voltage.@mean", 4.25),
    ("/battery.temperature", None),
    ('/diagnostics.status[:]{name=="motor"}.level', 1.0),
    ('/diagnostics.status[:]{name=="motor"}{level>WARN}.level', 2.0),
    ('/diagnostics.status[:]{name=="arm"}.level', None),
    ('/diagnostics.status[:]{name=="motor"}.values[0].value', "warm"),
    ('/diagnostics.status[0:1]{name=="motor"}.@length', 1.0),
    ("/diagnostics.status[:].level.@max", 2.0),
    ("/diagnostics.status[2].level", 2.0),
    ("/plan.poses[-1].pose.position.@norm", 10.0),
    ("/plan.poses[:].pose.position.@norm.@mean", 5.0),
    ("/plan.poses[:].pose.position.x.@div(2).@max", 3.0),
    ("/plan.poses[2].pose.position.x", None),
    ("/plan.poses.@length", 2.0),
    ("/docked.data", 1.0),
    ("/mode.data", "auto"),
    ("/cmd_vel.angular.z", -1.0),
    ("/imu.orientation.@ypr.yaw", 0.0),
    ("/fix.status.status", -2.0),
]

#: What is wrong with a path, and a part of the sentence that says so.
WRONG = [
    (
        "/odom.pos.x",
        "nav_msgs/msg/Odometry has no field 'pos'; it has header, child_frame_id, pose",
    ),
    ("/odom.pose.pose.position.w", "geometry_msgs/msg/Point has no field 'w'; it has x, y, z."),
    ("/odom", "it ends at nav_msgs/msg/Odometry, which is no single value; it has header"),
    ("/odom.header.stamp", "it ends at builtin_interfaces/msg/Time, which is no single value"),
    ("/odom.pose.pose.position.x.y", "there is no field 'y' in a number"),
    ("/odom.pose.pose.position.x[0]", "[0] needs an array, and there is a number"),
    ("/odom.pose.pose[0]", "[0] needs an array, and there is geometry_msgs/msg/Pose"),
    ("/odom.pose.covariance", "it ends at an array: choose an element, as [0], or make one value"),
    ("/odom.pose.covariance[:]", "it gives several values: make one of them with .@min, .@max"),
    ("/odom.pose.covariance[0:1].@abs", "it gives several values"),
    ("/odom.pose.covariance.x", "there is no field 'x' in an array, each element a number"),
    ("/odom.pose.covariance[7.5]", "has '7.5]' where there must be a whole number, or an angle"),
    ("/odom.pose.covariance[99999999999]", "where there must be a whole number"),
    ("/odom.pose.covariance[0", "ends where there must be ']'"),
    ("/odom.pose.covariance[0:", "ends where there must be ']'"),
    ("/odom.pose.covariance[", "ends where there must be an index, a slice such as 0:4, or a name"),
    ("/odom.pose.covariance[]", "has ']' where there must be an index, a slice such as 0:4"),
    ("/odom.pose.covariance[0,1]", "has ',1]' where there must be ']'"),
    ("/odom.pose.covariance[0:1:2]", "has ':2]' where there must be ']'"),
    ("/odom.pose.covariance[$i]", "variables have no value here: write it"),
    ("/odom.pose.covariance[-15deg:15deg].@min", "only the ranges of a LaserScan have"),
    ("/odom.pose.covariance[15deg]", "has '15deg]' where there must be two angles"),
    ("/odom.pose.covariance[left]", "does not name the elements of 'covariance'"),
    ("/odom.pose.pose.orientation.@ypr", ".@ypr gives roll, pitch and yaw: choose one"),
    ("/odom.pose.pose.orientation.@ypr.heading", "gives roll, pitch, yaw, and no 'heading'"),
    ("/odom.pose.pose.orientation.@ypr.@abs", ".@abs needs a number, and there is roll, pitch"),
    ("/odom.pose.pose.position.@ypr.yaw", ".@ypr needs a quaternion (x, y, z and w), and there is"),
    ("/odom.pose.pose.@norm", ".@norm needs a vector (x, y and z), and there is geometry_msgs"),
    ("/odom.twist.twist.linear.x.@norm", ".@norm needs several numbers, and there is a number"),
    ("/odom.twist.twist.linear.x.@min", ".@min needs several numbers, and there is a number"),
    ("/odom.twist.twist.linear.x.@length", ".@length needs an array, and there is a number"),
    ("/odom.twist.twist.linear.x.@foo", "there is no function .@foo; there are abs, acos, add"),
    ("/odom.twist.twist.linear.x.@add", ".@add needs a number, as .@add(2)"),
    ("/odom.twist.twist.linear.x.@add()", "has ')' where there must be a number"),
    ("/odom.twist.twist.linear.x.@add(x)", "has 'x)' where there must be a number"),
    ("/odom.twist.twist.linear.x.@add(1", "ends where there must be ')'"),
    ("/odom.twist.twist.linear.x.@mul(1e400)", "has '1e400)' where there must be a number"),
    ("/odom.twist.twist.linear.x.@div(0)", ".@div(0) divides by 0"),
    ("/odom.twist.twist.linear.x.@abs(1)", ".@abs(1) takes no number: write .@abs"),
    ("/odom.twist.twist.linear.x.@", "ends where there must be the name of a function"),
    ("/odom.twist.twist.linear.x.@delta.@derivative", "at most one of .@delta and .@derivative"),
    ("/odom.twist.twist.linear.@delta", ".@delta needs a number, and there is geometry_msgs"),
    ("/odom.child_frame_id.@abs", ".@abs needs a number, and there is a string"),
    ("/odom{child_frame_id==3}.header.stamp.sec", "'child_frame_id', which is a string, with 3"),
    ("/odom{header.stamp.sec=='x'}.child_frame_id", "'sec', which is an integer, with 'x'"),
    ("/odom{child_frame_id=3}.header.stamp.sec", "where there must be one of ==, !=, <=, >=, <, >"),
    ("/odom{child_frame_id==}.header.stamp.sec", "where there must be a number, a text in quotes"),
    ("/odom{child_frame_id=='x'.header.stamp.sec", "where there must be '}'"),
    ("/odom{==3}.header.stamp.sec", "where there must be the name of a field to compare"),
    ("/odom{pose==3}.child_frame_id", "{pose==3} compares 'pose', which is no single value"),
    ("/odom{pose.covariance==3}.child_frame_id", "'covariance', which is no single value"),
    ("/odom{pose.pos.x==3}.child_frame_id", "PoseWithCovariance has no field 'pos'"),
    ("/odom{child_frame_id.x==3}.child_frame_id", "asks for a field of 'child_frame_id'"),
    ("/odom.child_frame_id{x==1}", "{x==1} compares a field, and there is a string"),
    ("/odom.", "ends where there must be the name of a field, or @ and that of a function"),
    ("/odom..x", "has '.x' where there must be the name of a field"),
    ("/odom/.pose", "has '/.pose' where there must be a dot and a field"),
    ("/odom pose", "has ' pose' where there must be a dot and a field"),
    (" /odom", "has ' /odom' where there must be the name of a topic"),
    ("", "ends where there must be the name of a topic"),
    ('""', "where there must be the name of a topic"),
    ("/scan.ranges", "it ends at an array"),
    ("/scan.ranges[-15deg:15].@min", "where there must be a slice whose ends are both angles"),
    ("/scan.ranges[-15deg:].@min", "where there must be a slice whose ends are both angles"),
    ("/scan.ranges[0deg:999deg].@min", "has '999deg].@min' where there must be an angle from"),
    ("/scan.ranges[left]", "LaserScan does not name the elements of 'ranges'"),
    ("/scan.intensities[0deg:9deg].@min", "only the ranges of a LaserScan have"),
    ("/joint_states.position[a][b]", "[b] names an element of a number"),
    ("/joint_states.name[a]", "JointState does not name the elements of 'name'"),
    ("/joint_states.name.@min", ".@min needs several numbers, and there is an array, each element"),
    ("/joint_states.name", "choose an element, as [0], or count them with .@length"),
    ("/battery{power_supply_status==EMPTY}.voltage", "there are UNKNOWN, CHARGING, DISCHARGING"),
    ("/battery{voltage==EMPTY}.voltage", "no constant for 'voltage'; there is none"),
    ("/battery{present==1}.voltage", "'present', which is a bool, with 1"),
    ("/battery{present>true}.voltage", "compares true and false, which are only equal"),
    ("/battery.present.@abs", ".@abs needs a number, and there is a bool"),
    ("/diagnostics.status{name=='x'}.level", "filters elements: put [:] before it"),
    ("/diagnostics.status[:].level", "it gives several values"),
    ("/diagnostics.status[:].level.@delta", ".@delta needs a single value"),
    ("/diagnostics.status[:]{name=='x'}.values[:].key", "in each of several elements"),
    ("/diagnostics.status[:].values.@length", "in each of several elements"),
    ("/none.data", "std_msgs/msg/Empty has no field 'data'; it has no fields"),
]


@pytest.mark.parametrize(("path", "value"), RIGHT)
def test_a_path_gives_what_stands_in_the_message_live_and_in_a_bag(
    path: str, value: float | str | None
) -> None:
    topic = parse(path).topic
    message = some.MESSAGES[topic]()
    recorded = some.as_in_a_bag(message, some.TYPES[topic], TYPES)
    live, offline = (
        some.compiled(path, installed)(message, 0),
        some.compiled(path, TYPES)(recorded, 0),
    )
    assert live == offline
    assert live == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize(("path", "said"), WRONG)
def test_a_wrong_path_is_one_sentence_that_names_the_part_at_fault(path: str, said: str) -> None:
    for definitions in (installed, TYPES):
        with pytest.raises(MessagePathError) as caught:
            some.compiled(path, definitions)
        text = str(caught.value)
        assert said in text
        assert text.startswith("message path ")
        assert text.endswith(".")


def test_the_sentence_about_a_field_says_what_stands_there_instead() -> None:
    with pytest.raises(MessagePathError) as caught:
        some.compiled("/odom.pos.x", installed)
    assert str(caught.value) == (
        "message path '/odom.pos.x': nav_msgs/msg/Odometry has no field 'pos'; "
        "it has header, child_frame_id, pose, twist."
    )


@pytest.mark.parametrize("path", [path for path, _ in RIGHT])
def test_a_path_is_written_as_it_is_read(path: str) -> None:
    once = parse(path)
    assert parse(str(once)) == once


def test_paths_that_are_too_long_are_refused() -> None:
    with pytest.raises(MessagePathError, match=f"at most {LONGEST_PATH} are read"):
        parse("/a" + ".b" * LONGEST_PATH)
    with pytest.raises(MessagePathError, match=f"more than {MOST_PARTS} parts"):
        parse("/a" + ".b" * (MOST_PARTS + 1))


@given(st.text())
def test_whatever_is_given_is_a_path_or_refused(text: str) -> None:
    try:
        path = parse(text)
    except MessagePathError:
        return
    assert parse(str(path)) == path


@given(
    # Short enough for the bound on a path's length, filters and escapes included.
    topic=st.text(min_size=1, max_size=10),
    names=st.lists(st.text(min_size=1, max_size=10), max_size=3),
    value=st.one_of(st.booleans(), st.floats(allow_nan=False, allow_infinity=False)),
)
def test_any_names_can_be_written(topic: str, names: list[str], value: bool | float) -> None:
    filters = [Filter(tuple(names), comparison, value) for comparison in some.Comparison if names]
    path = MessagePath(topic, (*map(FieldName, names), *filters))
    assert parse(str(path)) == path


KINDS = [
    *sorted(set(some.TYPES.values()) - {"std_msgs/msg/Empty"}),
    "sensor_msgs/msg/Range",
    "rcl_interfaces/msg/Log",
]


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=50)
@given(data=st.data())
@pytest.mark.parametrize("kind", KINDS)
def test_live_and_offline_getters_give_the_same_value(kind: str, data: st.DataObject) -> None:
    path = data.draw(some.paths(installed(kind), installed))
    message = some.fill(data.draw, message_class(kind)(), message_class)
    recorded = some.as_in_a_bag(message, kind, TYPES)
    live = getter(check(path, kind, installed))(message, 0)
    checked = check(path, kind, TYPES)
    assert live == getter(checked)(recorded, 0)
    # A bag is read as far as that takes.
    decode = TYPES.decoder(kind, wanted_of(checked))
    assert live == getter(checked)(decode(serialize_message(message)), 0)
    assert live is None or isinstance(live, str) or math.isfinite(live)
    assert parse(str(path)) == path


def test_installed_definitions_are_those_of_bags() -> None:
    def description(kind: some.MessageType) -> object:
        fields = [(one.name, one.kind, one.is_array) for one in kind.fields]
        return kind.name, fields, list(kind.constants.items())

    for kind in KINDS:
        assert description(installed(kind)) == description(TYPES(kind))


def test_a_difference_is_that_to_the_message_before() -> None:
    read = some.compiled("/cmd_vel.linear.x.@delta.@abs", installed)
    message = some.twist()
    assert read(message, 0) is None
    message.linear.x = -1.0
    assert read(message, 5) == 1.5
    message.linear.x = math.nan
    assert read(message, 6) is None
    message.linear.x = -1.25
    assert read(message, 7) == 0.25


def test_a_derivative_is_by_second_and_needs_time_to_pass() -> None:
    read = some.compiled("/cmd_vel.linear.x.@derivative", installed)
    message = some.twist()
    assert read(message, 10) is None
    message.linear.x = 1.0
    assert read(message, 10) is None
    message.linear.x = 2.0
    assert read(message, 500_000_010) == 2.0
    message.linear.x = 3.0
    assert read(message, 0) is None


def test_a_difference_is_taken_between_messages_that_match() -> None:
    read = some.compiled("/battery{present==true}.voltage.@delta", installed)
    message = some.battery()
    read(message, 0)
    message.voltage, message.present = 99.0, False
    assert read(message, 1) is None
    message.voltage, message.present = 13.0, True
    assert read(message, 2) == 0.5


@pytest.mark.parametrize(
    ("beams", "least", "most", "count"),
    [
        ("-15deg:15deg", 0.0, 35.9, 31),
        ("345deg:15deg", 0.0, 35.9, 31),
        ("345deg:360deg", 0.0, 35.9, 16),
        ("90deg:92deg", 9.0, 9.2, 3),
        ("92deg:90deg", 0.0, 35.9, 359),
        ("-180deg:180deg", 0.0, 35.9, 360),
        ("0deg:0deg", 0.0, 0.0, 1),
        ("-270deg:-268deg", 9.0, 9.2, 3),
    ],
)
def test_a_slice_by_angle_goes_around_with_the_scan(
    beams: str, least: float, most: float, count: int
) -> None:
    for function, value in (("min", least), ("max", most), ("length", count)):
        read = some.compiled(f"/scan.ranges[{beams}].@{function}", installed)
        assert read(some.full_scan(), 0) == pytest.approx(value)


def test_a_scan_that_changes_its_angles_is_sliced_anew() -> None:
    read = some.compiled("/scan.ranges[-1deg:1deg].@max", installed)
    assert read(some.full_scan(), 0) == pytest.approx(35.9)
    assert read(some.scan(), 0) == 8.0
    assert read(LaserScan(), 0) is None
    assert read(LaserScan(angle_min=math.nan, ranges=[1.0]), 0) is None


def test_a_scan_without_a_largest_range_says_nothing_of_infinite_ones() -> None:
    scan = LaserScan(ranges=[math.inf, 3.0])
    assert some.compiled("/scan.ranges[0]", installed)(scan, 0) is None
    assert some.compiled("/scan.ranges.@max", installed)(scan, 0) == 3.0
    assert some.compiled("/scan.ranges.@length", installed)(scan, 0) == 2.0
    assert some.compiled("/scan.ranges.@min", installed)(scan, 0) == 3.0


def test_entries_are_found_wherever_they_are_now() -> None:
    read = some.compiled("/joint_states.position[left_wheel]", installed)
    assert read(some.joint_states(), 0) == -2.0
    assert read(JointState(name=["left_wheel"], position=[5.0]), 0) == 5.0
    assert read(JointState(), 0) is None
    assert read(JointState(name=["left_wheel"]), 0) is None
    assert read(JointState(name=["arm", "left_wheel"], position=[1.0]), 0) is None
    assert read(some.joint_states(), 0) == -2.0


def test_what_a_path_gives_is_known_before_there_is_a_message() -> None:
    def kind(text: str) -> Primitive:
        path = parse(text)
        return check(path, some.TYPES[path.topic], installed).kind

    assert kind("/docked.data") is Primitive.TRUTH
    assert kind("/mode.data") is Primitive.TEXT
    assert kind("/battery.power_supply_status") is Primitive.INTEGER
    assert kind("/battery.power_supply_status.@abs") is Primitive.NUMBER


def test_constants_name_the_values_of_enumerations() -> None:
    status = check(parse("/battery.power_supply_status"), some.TYPES["/battery"], installed)
    assert status.names == {
        0: "UNKNOWN",
        1: "CHARGING",
        2: "DISCHARGING",
        3: "NOT_CHARGING",
        4: "FULL",
    }
    level = check(parse("/d.level"), "diagnostic_msgs/msg/DiagnosticStatus", installed)
    assert level.names == {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE"}
    # Two integers, of which the constants could be either's.
    marker = check(parse("/m.type"), "visualization_msgs/msg/Marker", installed)
    assert marker.names == {}


def test_a_plain_number_is_read_as_one_attribute() -> None:
    def attribute(text: str) -> str | None:
        path = parse(text)
        return attribute_of(check(path, some.TYPES[path.topic], installed))

    assert attribute("/odom.pose.pose.position.x") == "pose.pose.position.x"
    assert attribute("/odom.child_frame_id") is None
    assert attribute("/odom.pose.covariance[0]") is None


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4), st.sampled_from(Angles))
def test_angles_turn_axes_as_the_quaternion_does(components: list[float], order: Angles) -> None:
    x, y, z, w = components
    length = math.hypot(*components)
    angles = euler(order, x, y, z, w)
    if length < 1e-3:
        return
    assert angles is not None
    roll, pitch, yaw = angles
    about = {"r": ((1, 0, 0), roll), "p": ((0, 1, 0), pitch), "y": ((0, 0, 1), yaw)}
    turned = (0.0, 0.0, 0.0, 1.0)
    for axis in order.value:
        (i, j, k), angle = about[axis]
        half = math.sin(angle / 2)
        turned = _product(turned, (i * half, j * half, k * half, math.cos(angle / 2)))
    # A quaternion and its negative are the same rotation.
    cosine = abs(sum(a * b for a, b in zip(turned, components, strict=True))) / length
    assert cosine == pytest.approx(1, abs=1e-6)


def _product(
    first: tuple[float, float, float, float], second: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    a, b, c, d = first
    e, f, g, h = second
    return (
        d * e + a * h + b * g - c * f,
        d * f - a * g + b * h + c * e,
        d * g + a * f - b * e + c * h,
        d * h - a * e - b * f - c * g,
    )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nav2_msgs/msg/Costmap", "install ros-jazzy-nav2-msgs, or source the workspace"),
        ("nav_msgs/msg/Odometrie", "the package nav_msgs has no message 'Odometrie'"),
        ("nav_msgs", "is no name of a message type"),
        ("os/msg/Path", "the package os of os/msg/Path is not installed"),
        ("../nav_msgs/msg/Odometry", "is no name of a message type"),
        ("nav_msgs/msg/GetMap", "the package nav_msgs has no message 'GetMap'"),
        ("nav_msgs/srv/GetMap", "is no name of a message type"),
    ],
)
def test_a_type_that_is_not_installed_is_named_with_what_helps(name: str, said: str) -> None:
    with pytest.raises(MessagePathError, match=said):
        installed(name)


def test_a_type_that_a_bag_does_not_define_is_named() -> None:
    with pytest.raises(MessagePathError, match="my_msgs/msg/Own is none of ROS 2 Jazzy"):
        TYPES("my_msgs/msg/Own")
