"""Messages of types that robots have, with paths into them; and random ones of both."""

from __future__ import annotations

import array
import math
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Transform, Twist
from hypothesis import strategies as st
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import serialize_message
from sensor_msgs.msg import (
    BatteryState,
    Imu,
    JointState,
    Joy,
    LaserScan,
    MultiDOFJointState,
    NavSatFix,
)
from std_msgs.msg import Bool, String

from rebt_ros.message_path.checking import check
from rebt_ros.message_path.compiling import Getter, getter
from rebt_ros.message_path.definition import Definitions, MessageType, Primitive
from rebt_ros.message_path.parsing import parse
from rebt_ros.message_path.path import (
    AngleSlice,
    Comparison,
    ConstantName,
    Entry,
    FieldName,
    Filter,
    Function,
    Index,
    MessagePath,
    Part,
    Slice,
)
from rebt_ros.storage.message_types import BagTypes

#: Type of the messages on each topic of the examples.
TYPES = {
    "/odom": "nav_msgs/msg/Odometry",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joints": "sensor_msgs/msg/MultiDOFJointState",
    "/joy": "sensor_msgs/msg/Joy",
    "/battery": "sensor_msgs/msg/BatteryState",
    "/imu": "sensor_msgs/msg/Imu",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/docked": "std_msgs/msg/Bool",
    "/mode": "std_msgs/msg/String",
    "/plan": "nav_msgs/msg/Path",
    "/fix": "sensor_msgs/msg/NavSatFix",
    "/none": "std_msgs/msg/Empty",
}


def odometry() -> Odometry:
    """At (3, -4), heading to the left, with a quaternion that is not of length 1."""
    message = Odometry(child_frame_id="base")
    message.header.stamp.sec = 7
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y = 3.0, -4.0
    orientation.z, orientation.w = 2.0, 2.0
    message.pose.covariance[0], message.pose.covariance[35] = 0.25, 0.5
    message.twist.twist.linear.x = -0.5
    return message


def scan() -> LaserScan:
    """Beams at -90, -60, …, 90 degrees: two do not know, two see nothing."""
    return LaserScan(
        angle_min=-math.pi / 2,
        angle_max=math.pi / 2,
        angle_increment=math.pi / 6,
        range_min=0.25,
        range_max=8.0,
        ranges=[2.0, math.nan, 1.5, math.inf, 9.0, 0.125, 4.0],
        intensities=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0],
    )


def full_scan() -> LaserScan:
    """360 beams from 0 degrees on, as far as their number says in decimeters."""
    return LaserScan(
        angle_increment=math.radians(1),
        range_max=100.0,
        ranges=[degrees / 10 for degrees in range(360)],
    )


def joint_states() -> JointState:
    return JointState(
        name=["right_wheel", "left_wheel", "odd name"], position=[1.0, -2.0, 3.0], velocity=[0.5]
    )


def joints() -> MultiDOFJointState:
    arm, hand = Transform(), Transform()
    hand.translation.y = 2.5
    return MultiDOFJointState(joint_names=["arm", "hand"], transforms=[arm, hand])


def battery() -> BatteryState:
    return BatteryState(
        voltage=12.5,
        percentage=0.75,
        temperature=math.nan,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_CHARGING,
        present=True,
        cell_voltage=[4.0, 4.5],
    )


def diagnostics() -> DiagnosticArray:
    motor = DiagnosticStatus(
        level=b"\1", name="motor", values=[KeyValue(key="temperature", value="warm")]
    )
    return DiagnosticArray(
        status=[DiagnosticStatus(name="laser"), motor, DiagnosticStatus(level=b"\2", name="motor")]
    )


def twist() -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = 0.5, -1.0
    return message


def plan() -> Path:
    poses = [PoseStamped(), PoseStamped()]
    poses[1].pose.position.x, poses[1].pose.position.y = 6.0, 8.0
    return Path(poses=poses)


#: A message for each topic.
MESSAGES: dict[str, Callable[[], Any]] = {
    "/odom": odometry,
    "/scan": scan,
    "/joint_states": joint_states,
    "/joints": joints,
    "/joy": lambda: Joy(axes=[0.5, -1.0], buttons=[0, 1, 0]),
    "/battery": battery,
    "/imu": Imu,
    "/diagnostics": diagnostics,
    "/cmd_vel": twist,
    "/docked": lambda: Bool(data=True),
    "/mode": lambda: String(data="auto"),
    "/plan": plan,
    "/fix": NavSatFix,
}


def compiled(text: str, definitions: Definitions, kind: str = "") -> Getter:
    """The getter of a path of the examples, or of a path into messages of another type."""
    path = parse(text)
    return getter(check(path, kind or TYPES[path.topic], definitions))


def as_in_a_bag(message: Any, kind: str, types: BagTypes) -> object:
    """A message as it is read from a bag."""
    return types.decode(serialize_message(message), kind)


# --- random messages and paths ---

_TEXTS = ["", "arm", "left wheel", "motor", "ok"]
_FUNCTIONS = ("abs", "sqrt", "sin", "cos", "degrees", "radians", "round", "sign", "log")
_FLOATS = st.one_of(
    st.sampled_from([0.0, 1.0, -2.5, math.inf, -math.inf, math.nan]), st.floats(width=32)
)
_MOST = {"8": 127, "16": 32767, "32": 2**31 - 1, "64": 2**63 - 1}


def fill(draw: st.DrawFn, message: Any, installed: Callable[[str], type[Any]]) -> Any:
    """Gives random values to a message of rclpy, and returns it."""
    for name, kind in message.get_fields_and_field_types().items():
        setattr(message, name, _drawn(draw, getattr(message, name), kind, installed))
    return message


def _drawn(draw: st.DrawFn, before: Any, kind: str, installed: Callable[[str], type[Any]]) -> Any:
    if kind.startswith("sequence<"):
        element = kind.removeprefix("sequence<").removesuffix(">")
        several = [_drawn(draw, None, element, installed) for _ in range(draw(st.integers(0, 3)))]
        return array.array(before.typecode, several) if hasattr(before, "typecode") else several
    if kind.endswith("]"):
        element, _, length = kind.removesuffix("]").partition("[")
        return [_drawn(draw, None, element, installed) for _ in range(int(length))]
    if kind == "boolean":
        return draw(st.booleans())
    if kind == "octet":
        return bytes([draw(st.integers(0, 3))])
    if kind == "string":
        return draw(st.sampled_from(_TEXTS))
    if kind in ("float", "double"):
        return draw(_FLOATS)
    if "/" not in kind:
        most = _MOST[kind.lstrip("uint")]
        return draw(st.one_of(st.integers(0, 4), st.integers(0, most)))
    return fill(draw, installed(kind)(), installed)


@st.composite
def paths(draw: st.DrawFn, kind: MessageType, definitions: Definitions) -> MessagePath:
    """Random paths that messages of a type have."""
    parts: list[Part] = []
    while True:
        if draw(st.integers(0, 5)) == 0:
            parts += _filter(draw, kind)
        field = draw(st.sampled_from(kind.fields))
        parts.append(FieldName(field.name))
        if isinstance(field.kind, str):
            kind = definitions(field.kind)
            if field.is_array:
                parts.append(Index(draw(st.integers(-3, 3))))
            if {one.name for one in kind.fields} == set("xyzw") and draw(st.booleans()):
                order, angle = (
                    draw(st.sampled_from(["ypr", "rpy"])),
                    draw(st.sampled_from(["yaw", "pitch", "roll"])),
                )
                parts += [Function(order), FieldName(angle)]
                return MessagePath("/topic", (*parts, *_scalars(draw)))
            if {one.name for one in kind.fields} == set("xyz") and draw(st.booleans()):
                return MessagePath("/topic", (*parts, Function("norm"), *_scalars(draw)))
            continue
        if field.is_array:
            return MessagePath("/topic", (*parts, *_of_array(draw, field.kind, kind, field.name)))
        numeric = field.kind not in (Primitive.TEXT, Primitive.TRUTH)
        return MessagePath("/topic", (*parts, *(_scalars(draw) if numeric else ())))


def _of_array(draw: st.DrawFn, kind: Primitive, record: MessageType, name: str) -> tuple[Part, ...]:
    numeric = kind not in (Primitive.TEXT, Primitive.TRUTH)
    names = {one.name for one in record.fields} & {"name", "joint_names"}
    choices = ["index", "length"]
    choices += ["reduce", "slice"] if numeric else []
    choices += ["entry"] if names and name not in names else []
    choices += ["angle"] if name == "ranges" else []
    choice = draw(st.sampled_from(choices))
    if choice == "index":
        return (Index(draw(st.integers(-4, 4))), *(_scalars(draw) if numeric else ()))
    if choice == "entry":
        return (Entry(draw(st.sampled_from(_TEXTS[1:]))), *(_scalars(draw) if numeric else ()))
    if choice == "length":
        return (Function("length"), *_scalars(draw))
    reducer = Function(draw(st.sampled_from(["min", "max", "mean", "argmin", "norm", "length"])))
    if choice == "reduce":
        return (reducer, *_scalars(draw))
    ends = st.none() | st.integers(-4, 4)
    angles = st.integers(-360, 360)
    part = (
        AngleSlice(draw(angles), draw(angles))
        if choice == "angle"
        else Slice(draw(ends), draw(ends))
    )
    return (part, *(_scalars(draw)[:1]), reducer, *_scalars(draw))


def _scalars(draw: st.DrawFn) -> tuple[Part, ...]:
    functions = [
        Function(draw(st.sampled_from(_FUNCTIONS))) for _ in range(draw(st.integers(0, 2)))
    ]
    if draw(st.booleans()):
        functions.append(Function(draw(st.sampled_from(["add", "mul", "div"])), 2.5))
    return tuple(functions)


def _filter(draw: st.DrawFn, kind: MessageType) -> list[Part]:
    single = [one for one in kind.fields if isinstance(one.kind, Primitive) and not one.is_array]
    if not single:
        return []
    field = draw(st.sampled_from(single))
    names = list(kind.names_of(field.name).values())
    comparison = draw(st.sampled_from(Comparison))
    if field.kind is Primitive.TEXT:
        return [Filter((field.name,), comparison, draw(st.sampled_from(_TEXTS)))]
    if field.kind is Primitive.TRUTH:
        return [Filter((field.name,), Comparison.DIFFERENT, draw(st.booleans()))]
    if names and draw(st.booleans()):
        return [Filter((field.name,), comparison, ConstantName(draw(st.sampled_from(names))))]
    return [Filter((field.name,), comparison, draw(st.sampled_from([0, 1, 2.5, -1e9])))]
