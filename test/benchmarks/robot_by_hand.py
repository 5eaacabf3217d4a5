"""What somebody writes who has no robot file, and a robot to measure it with.

python robot_by_hand.py read single|events   # subscribes, and reads fields of each message
python robot_by_hand.py answer               # answers each scan with a velocity
python robot_by_hand.py load SECONDS RATE    # publishes; prints how many messages that were
"""

from __future__ import annotations

import contextlib
import math
import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Joy, LaserScan

BEAMS = 360
#: Beams of the five sectors of 72 degrees, of which the first is ahead.
SECTORS = ((324, 397), (36, 109), (108, 181), (180, 253), (252, 325))


def nearest(scan: LaserScan, first: int, last: int) -> float:
    """The nearest thing between two beams, as a LaserScan says it."""
    ranges = np.asarray(scan.ranges)
    part = np.concatenate((ranges, ranges))[first:last]
    return min(float(part[part >= scan.range_min].min(initial=np.inf)), scan.range_max)


def read(node: Node) -> None:
    """Reads what the robot file of robot_reading.py names."""
    found: list[tuple[float, ...]] = []

    def on_odometry(message: Odometry) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        twist = message.twist.twist
        yaw = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        found.append((place.x, place.y, yaw, twist.linear.x, twist.angular.z))

    def on_scan(message: LaserScan) -> None:
        found.append(tuple(nearest(message, *sector) for sector in SECTORS))

    def on_joystick(message: Joy) -> None:
        found.append((message.axes[1], message.buttons[0]))

    for kind, topic, take in (
        (Odometry, "/odom", on_odometry),
        (LaserScan, "/scan", on_scan),
        (Joy, "/joy", on_joystick),
    ):
        node.create_subscription(kind, topic, take, QoSProfile(depth=5000))


def answer(node: Node) -> None:
    """Drives on where nothing is ahead."""
    publisher = node.create_publisher(Twist, "/cmd_vel", 10)

    def on_scan(message: LaserScan) -> None:
        velocity = Twist()
        velocity.linear.x = 0.25 if nearest(message, *SECTORS[0]) > 1.0 else -0.25
        publisher.publish(velocity)

    node.create_subscription(LaserScan, "/scan", on_scan, 1)


def scan(ahead: float) -> LaserScan:
    """A scan in which everything else is far away."""
    return LaserScan(
        angle_max=math.radians(359),
        angle_increment=math.radians(1),
        range_min=0.25,
        range_max=10.0,
        ranges=[ahead] * 10 + [6.0] * (BEAMS - 10),
    )


def load(node: Node, seconds: float, rate: float) -> int:
    """Publishes the three topics in turn; returns how many messages were sent."""
    odometry = Odometry()
    odometry.pose.pose.orientation.w = 1.0
    joystick = Joy(axes=[0.0, 1.0], buttons=[0, 0])
    messages = [("/odom", odometry), ("/scan", scan(2.0)), ("/joy", joystick)]
    publishers = [
        (node.create_publisher(type(message), topic, QoSProfile(depth=5000)), message)
        for topic, message in messages
    ]
    while not all(publisher.get_subscription_count() for publisher, _ in publishers):
        time.sleep(0.01)
    begin, count = time.monotonic(), int(seconds * rate)
    for number in range(count):
        publisher, message = publishers[number % len(publishers)]
        publisher.publish(message)
        time.sleep(max(0.0, begin + (number + 1) / rate - time.monotonic()))
    for publisher, _ in publishers:
        publisher.wait_for_all_acked()
    return count


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("by_hand")
    what, *arguments = sys.argv[1:]
    if what == "load":
        print(load(node, *map(float, arguments)), flush=True)
        return
    read(node) if what == "read" else answer(node)
    executor = EventsExecutor() if arguments == ["events"] else SingleThreadedExecutor()
    executor.add_node(node)
    node.get_logger().info("ready")
    print("ready", flush=True)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
