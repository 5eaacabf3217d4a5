"""The command `describe`: what is on topics, and a robot file that can be learned by at once."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import robot_bags as some
import warm_processes
from ros_processes import CHECKOUT, Peer
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import String

import rebt_ros
from rebt_ros.robot_file.proposal import proposal
from rebt_ros.robot_file.reading import parse_robot_file, read_robot_file
from rebt_ros.robot_file.survey import MOST_FIELDS, TopicSurvey
from rebt_ros.ros.message_types import installed
from rebt_ros.storage.bag_survey import survey_bag
from rebt_ros.storage.input_options import InputOptions


def _describe(*arguments: object, domain: int | None = None) -> subprocess.CompletedProcess[str]:
    variables = {} if domain is None else {"ROS_DOMAIN_ID": str(domain)}
    return warm_processes.run("rebt_ros.commands.describe", *arguments, **variables)


def _survey(topic: str, messages: Sequence[Any]) -> TopicSurvey:
    survey = TopicSurvey(topic, some.name_of(messages[0]), installed)
    for place, message in enumerate(messages):
        survey.take(message, place * 100_000_000)
    return survey


def test_a_bag_is_described_and_learned_from_by_what_was_proposed(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown())
    out = tmp_path / "robot.yaml"
    done = _describe(bag, "--out", out)
    assert done.returncode == 0, done.stderr
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert any(line.startswith("/odom nav_msgs/msg/Odometry 36 messages, ") for line in lines)
    assert "* .pose.pose.orientation.@ypr.yaw 0 … 0.5" in lines
    assert "* .power_supply_status DISCHARGING, CHARGING" in lines
    assert "* .data 'fetch', 'carry'" in lines
    assert ".position[arm] 9" in lines
    robot = read_robot_file(out)
    assert set(robot.state_topics) == {"/odom", "/scan", "/joint_states", "/battery", "/mode"}
    learned = rebt_ros.learn([bag], reading=InputOptions(robot=robot)).learned
    labels = {"button_0", "button_1", "axis_1_up", "axis_1_down"}
    assert {one.label for one in learned.actions} == labels
    again = _describe(bag, "--out", out)
    assert again.returncode != 0
    assert "is there already: name another file, or say --force" in again.stderr
    assert _describe(bag, "--out", out, "--force").returncode == 0


def test_the_running_robot_is_described(domain: int, peer: Peer, tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    command = [sys.executable, "-m", "rebt_ros.commands.describe", "--live"]
    environment = dict(os.environ, ROS_DOMAIN_ID=str(domain))
    environment["PYTHONPATH"] = os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    modes = peer.node.create_publisher(String, "/mode", 10)
    scans = peer.node.create_publisher(LaserScan, "/scan", 10)
    with subprocess.Popen(
        [*command, "--seconds", "8", "--out", str(out)], env=environment, stdout=subprocess.PIPE
    ) as process:

        def ended() -> bool:
            modes.publish(String(data="auto"))
            scans.publish(some.scan(2.0))
            return process.poll() is not None

        peer.wait_until(ended, what="the description")
        assert process.returncode == 0
        assert process.stdout is not None
        assert b"sensor_msgs/msg/LaserScan" in process.stdout.read()
    assert "/scan" in read_robot_file(out).state_topics


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "name a bag, or say --live for the running robot, and not both"),
        (("bag", "--live"), "name a bag, or say --live"),
        (("none",), "none"),
        (("--live", "--seconds", "-1"), "--seconds must lie between 0.1 and 3600"),
    ],
)
def test_a_mistake_is_one_sentence(arguments: tuple[str, ...], said: str) -> None:
    done = _describe(*arguments)
    assert done.returncode != 0
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_scans_become_five_sectors_around_the_robot_or_before_it() -> None:
    around = LaserScan(angle_increment=math.radians(1), range_max=9.0, ranges=[1.0] * 360)
    text = proposal([_survey("/scan", [around])], "a test")
    assert 'back_right: "/scan.ranges[-180deg:-108deg].@min"' in text
    half = proposal([_survey("/scan", [some.scan(1.0)])], "a test")
    assert 'front_left: "/scan.ranges[18deg:54deg].@min"' in half


def test_velocities_are_scaled_by_the_largest_that_was_seen() -> None:
    twists = [some.twist(0.25, 0.0), some.twist(0.0, -2.0)]
    text = proposal([_survey("/odom", [some.odometry(1.0), some.odometry(2.0)]),
                     _survey("/cmd_vel", twists)], "a test")  # fmt: skip
    robot = parse_robot_file(text)
    [source] = robot.actions.values()
    assert (source.topic, getattr(source, "linear", 0), getattr(source, "angular", 0)) == (
        "/cmd_vel",
        0.25,
        2.0,
    )


def test_names_of_features_differ_and_odd_ones_are_quoted() -> None:
    states = [JointState(name=["odd joint", "arm"], position=[one, -one]) for one in (1.0, 2.0)]
    surveys = [_survey(f"/{side}/joint_states", states) for side in ("left", "right")]
    robot = parse_robot_file(proposal(surveys, "a test"))
    names = [one.name for one in robot.state]
    assert len(set(names)) == 4
    assert str(robot.state[0].path) == '/left/joint_states.position["odd joint"]'


def test_large_messages_are_looked_at_in_part() -> None:
    names = [f"joint_{number}" for number in range(500)]
    survey = _survey("/joints", [JointState(name=names, position=[0.0] * 500)])
    assert len(survey.fields) <= MOST_FIELDS


def test_topics_of_unknown_types_are_noted_and_left_out(tmp_path: Path) -> None:
    sqlite3 = pytest.importorskip("sqlite3")
    from rosbags.rosbag2 import StoragePlugin

    bag = some.write_bag(tmp_path / "bag", some.shown(2), StoragePlugin.SQLITE3)
    [file] = bag.glob("*.db3")
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE topics SET type = 'my_msgs/msg/Own' WHERE name = '/mode'")
    surveys, notes = survey_bag(bag)
    assert "/mode" not in {one.topic for one in surveys}
    assert "/mode is left out: the type my_msgs/msg/Own is none of ROS 2 Jazzy" in " ".join(notes)
