"""Benchmarks of nodes on a robot's own messages: CPU per message, and from scan to command."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import robot_bags
from geometry_msgs.msg import Twist
from harness import Figure, Settings, alternate, compared, latencies
from recorder_trials import cpu_seconds
from robot_by_hand import scan
from robot_reading import ROBOT_FILE
from ros_processes import NodeProcess, Peer, own_domain
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

import rebt_ros
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions

_BY_HAND = Path(__file__).with_name("robot_by_hand.py")

#: Messages per second of the three topics together.
_RATE = 300

_TYPES = """\
topics: {/odom: nav_msgs/msg/Odometry, /scan: sensor_msgs/msg/LaserScan, /joy: sensor_msgs/msg/Joy}
"""

_DRIVER = """\
state: {ahead: {path: "/scan.ranges[-36deg:36deg].@min", max_age: 600}}
actions: {action: /action.data}
topics: {/scan: sensor_msgs/msg/LaserScan}
commands:
  go: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: 0.25}}}
  back: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: -0.25}}}
"""


@contextmanager
def _node(
    name: str, domain: int, directory: Path, parameters: dict[str, object], *by_hand: str
) -> Iterator[NodeProcess]:
    command = [sys.executable, str(_BY_HAND), *by_hand] if by_hand else None
    with NodeProcess(
        f"{name}_node", domain, directory, {} if by_hand else parameters, command=command
    ) as node:
        node.says("ready" if by_hand else {"recorder": "recording "}.get(name, "enabled: "))
        yield node


def recorder_cpu(settings: Settings) -> list[Figure]:
    """CPU per message of the recorder, beside a subscriber that reads the same fields."""
    seconds = settings.size(10, 1)
    subjects: dict[str, tuple[str, ...]] = {
        "ours": (),
        "single": ("read", "single"),
        "events": ("read", "events"),
    }
    found = alternate(
        {
            name: partial(_cost, by_hand, seconds, settings.directory)
            for name, by_hand in subjects.items()
        },
        settings.rounds,
    )
    best, other = sorted(("single", "events"), key=lambda name: found[name].least)
    label = (
        f"recorder with a robot file, CPU per message at {_RATE} Hz / a subscriber that reads the "
        f"same fields ({best} executor)"
    )
    detail = f"with the {other} executor: {found[other].least:.0f} µs"
    return [compared(label, {"ours": found["ours"], "limit": found[best]}, 1.3, "µs", detail)]


def _cost(by_hand: tuple[str, ...], seconds: int, directory: Path) -> float:
    """Microseconds of CPU per message."""
    own = Path(tempfile.mkdtemp(dir=directory))
    (own / "robot.yaml").write_text(ROBOT_FILE + _TYPES)
    with (
        own_domain() as domain,
        _node("recorder", domain, own, {"robot_file": "robot.yaml"}, *by_hand) as node,
    ):
        before = cpu_seconds(node.process.pid)
        done = subprocess.run(
            [sys.executable, str(_BY_HAND), "load", str(seconds), str(_RATE)],
            env=os.environ
            | {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        return (cpu_seconds(node.process.pid) - before) / int(done.stdout) * 1e6


def latency(settings: Settings) -> list[Figure]:
    """From a scan to the velocity that it leads to, at 50 Hz."""
    scans = settings.size(500, 30)
    directory = settings.directory
    (directory / "robot.yaml").write_text(_DRIVER)
    messages: list[tuple[int, str, Any]] = []
    for number in range(40):
        near = number % 2 == 1
        messages.append((2 * number, "/scan", scan(0.5 if near else 4.0)))
        messages.append((2 * number + 1, "/action", String(data="back" if near else "go")))
    bag = robot_bags.write_bag(directory / "bag", messages)
    reading = InputOptions(robot=parse_robot_file(_DRIVER))
    (directory / "tree.json").write_text(dumps(rebt_ros.learn(bag, reading=reading).learned))
    parameters: dict[str, object] = {
        "robot_file": "robot.yaml",
        "tree_file": "tree.json",
        "enabled": True,
        "tick_on": "state",
        "novelty": "ignore",
    }

    def measure(*by_hand: str) -> list[float]:
        with (
            own_domain() as domain,
            _node("executor", domain, directory, parameters, *by_hand),
            Peer(domain) as peer,
        ):
            return _round_trips(peer, scans)

    found: dict[tuple[str, ...], list[list[float]]] = {("answer",): [], (): []}
    for _ in range(settings.rounds):
        for by_hand, trips in found.items():
            trips.append(measure(*by_hand))
    label = "scan -> Twist, {}, at 50 Hz / a node that does the same by hand"
    return latencies(label, found[()], found["answer",])


def _round_trips(peer: Peer, scans: int) -> list[float]:
    """Milliseconds from each scan, which asks for another velocity than the one before."""
    heard: list[tuple[float, float]] = []
    peer.node.create_subscription(
        Twist,
        "/cmd_vel",
        lambda message: heard.append((time.perf_counter(), message.linear.x)),
        10,
    )
    publisher: Any = peer.connect(LaserScan, "/scan")
    peer.wait_until(lambda: peer.node.count_publishers("/cmd_vel"))
    messages = (scan(4.0), scan(0.5))

    def answered() -> list[tuple[float, float]]:
        publisher.publish(messages[0])
        return heard

    # Until both have found each other, scans or velocities can get lost.
    peer.wait_until(answered)
    trips = []
    for number in range(scans + 20):
        wanted = (0.25, -0.25)[number % 2]
        heard.clear()
        sent = time.perf_counter()
        publisher.publish(messages[number % 2])
        peer.wait_until(lambda wanted=wanted: any(value == wanted for _, value in heard))
        took = next(when for when, value in heard if value == wanted) - sent
        if number >= 20:
            trips.append(1e3 * took)
        while time.perf_counter() < sent + 0.02:
            peer.node.executor.spin_once(timeout_sec=0.001)
    return trips
