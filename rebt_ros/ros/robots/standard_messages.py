"""What the simulated robot measures, as the messages that robots publish, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Quaternion, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Joy, LaserScan
from std_msgs.msg import Bool, Header

from rebt_ros.simulated_robot import scanner
from rebt_ros.simulated_robot.robot import RADIUS, VELOCITIES, Action, Robot, State

#: The types of what the robot publishes, by topic, in the order in which it does.
STATE_TOPICS: Final[Mapping[str, Any]] = {
    "odom": Odometry,
    "battery_state": BatteryState,
    "docked": Bool,
    "target": PoseStamped,
    "scan": LaserScan,
}

#: Buttons and axes of the joystick: ahead, to the left, and what charges while it is held.
_AHEAD, _LEFT, _AXES = 1, 3, 4
_CHARGE, _BUTTONS = 0, 2

_EMPTY_VOLTAGE, _FULL_VOLTAGE = 21.0, 25.2


def state_messages(robot: Robot, stamp: Time, *, charging: bool) -> dict[str, Any]:
    """What the robot publishes, by topic.

    Args:
        robot: The robot.
        stamp: For the headers.
        charging: Whether it charges.
    """
    return {
        "odom": _odometry(robot, stamp),
        "battery_state": _battery(robot, stamp, charging),
        "docked": Bool(data=robot.docked),
        "target": _target(robot, stamp),
        "scan": _scan(robot, stamp),
    }


def state_of(messages: Mapping[str, Any]) -> State:
    """What a person sees who has these messages before the eyes.

    Args:
        messages: The latest of each topic of `STATE_TOPICS`.
    """
    scan = messages["scan"]
    turn = messages["target"].pose.orientation
    return State(
        _free(scan, 30.0, 90.0),
        _free(scan, -30.0, 30.0),
        _free(scan, -90.0, -30.0),
        2.0 * math.atan2(turn.z, turn.w),
        messages["battery_state"].percentage,
        float(messages["docked"].data),
    )


def joystick_of(action: str | None) -> Joy:
    """How a person holds the joystick to do something; None: it lies on the table."""
    axes, buttons = [0.0] * _AXES, [0] * _BUTTONS
    if action == Action.CHARGE:
        buttons[_CHARGE] = 1
    elif action in VELOCITIES:
        velocity = VELOCITIES[Action(action)]
        axes[_AHEAD], axes[_LEFT] = velocity.linear, velocity.angular
    return Joy(axes=axes, buttons=buttons)


def velocity_of(action: str | None) -> Twist:
    """The velocity that a word stands for; none moves nothing."""
    message = Twist()
    if action in VELOCITIES:
        message.linear.x, message.angular.z = VELOCITIES[Action(action)]
    return message


def _odometry(robot: Robot, stamp: Time) -> Odometry:
    message = Odometry(header=Header(stamp=stamp, frame_id="odom"), child_frame_id="base_link")
    pose = message.pose.pose
    pose.position.x, pose.position.y = robot.position.x, robot.position.y
    pose.orientation = _turned(robot.heading)
    message.twist.twist.linear.x, message.twist.twist.angular.z = robot.velocity
    return message


def _battery(robot: Robot, stamp: Time, charging: bool) -> BatteryState:
    return BatteryState(
        header=Header(stamp=stamp),
        present=True,
        percentage=robot.battery,
        voltage=_EMPTY_VOLTAGE + (_FULL_VOLTAGE - _EMPTY_VOLTAGE) * robot.battery,
        power_supply_status=(
            BatteryState.POWER_SUPPLY_STATUS_CHARGING
            if charging
            else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        ),
    )


def _target(robot: Robot, stamp: Time) -> PoseStamped:
    """Where the robot has to go, as it sees it: turned towards it, and so far away."""
    message = PoseStamped(header=Header(stamp=stamp, frame_id="base_link"))
    distance = robot.position.distance(robot.target)
    message.pose.position.x = distance * math.cos(robot.bearing)
    message.pose.position.y = distance * math.sin(robot.bearing)
    message.pose.orientation = _turned(robot.bearing)
    return message


def _scan(robot: Robot, stamp: Time) -> LaserScan:
    measured = scanner.ranges(robot.world, robot.position, robot.heading)
    return LaserScan(
        header=Header(stamp=stamp, frame_id="base_link"),
        angle_min=scanner.FIRST_ANGLE,
        angle_max=-scanner.FIRST_ANGLE,
        angle_increment=scanner.ANGLE_STEP,
        range_min=scanner.SHORTEST_RANGE,
        range_max=scanner.LONGEST_RANGE,
        ranges=measured.tolist(),
    )


def _turned(angle: float) -> Quaternion:
    return Quaternion(z=math.sin(angle / 2), w=math.cos(angle / 2))


def _free(scan: LaserScan, first: float, last: float) -> float:
    """Free meters before the robot's hull between two directions (degrees)."""
    begin, end = (
        round((math.radians(angle) - scan.angle_min) / scan.angle_increment)
        for angle in (first, last)
    )
    measured: list[float] = [
        distance for distance in scan.ranges[begin : end + 1] if not math.isnan(distance)
    ]
    nearest: float = min([*measured, scan.range_max])
    return max(nearest - RADIUS, 0.0)
