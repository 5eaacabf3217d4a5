"""Bags of a robot's own messages: the table that a robot file makes of them, and the trees."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
import robot_bags as some
import warm_processes
from rosbags.rosbag2 import StoragePlugin
from std_msgs.msg import Float64MultiArray, String

import rebt_ros
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import InputError, OptionError, RebtError
from rebt_ros.offline.check_and_explain import check, row_of
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import load
from rebt_ros.storage.robot_bag import read_robot_bag

ROBOT = parse_robot_file(some.ROBOT_FILE, "robot.yaml")


def _value(demonstration: Demonstration, row: int, name: str) -> float | str:
    place = [one.name for one in demonstration.features].index(name)
    feature, value = demonstration.features[place], float(demonstration.states[row, place])
    if feature.kind is FeatureKind.CATEGORICAL and not math.isnan(value):
        return feature.categories[int(value)]
    return value


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_becomes_the_rows_that_its_messages_tell(
    tmp_path: Path, plugin: StoragePlugin
) -> None:
    read = read_robot_bag(some.write_bag(tmp_path / "bag", some.shown(2), plugin), ROBOT)
    shown = read.demonstration
    assert [shown.actions[one] for one in shown.chosen] == [
        "forward",
        "grasp",
        "back",
        "forward",
        "release",
        "back",
    ]
    assert _value(shown, 0, "mode") == "fetch"
    assert _value(shown, 3, "mode") == "carry"
    assert _value(shown, 0, "power") == "DISCHARGING"
    assert _value(shown, 3, "power") == "CHARGING"
    assert _value(shown, 0, "ahead") == 5.0
    assert _value(shown, 1, "ahead") == 0.5
    assert [_value(shown, row, "gripper") for row in range(6)] == [0.8, 0.8, 0.0, 0.0, 0.0, 0.8]
    assert _value(shown, 1, "heading") == pytest.approx(0.5)
    assert read.account is not None
    assert read.account.missing == 0
    assert read.robot is ROBOT


def test_the_names_of_topics_need_no_slash(tmp_path: Path) -> None:
    robot = parse_robot_file(some.ROBOT_FILE.replace(" /", " ").replace('"/', '"'))
    bag = some.write_bag(tmp_path / "bag", some.shown(2))
    mine, its = (read_robot_bag(bag, one).demonstration for one in (ROBOT, robot))
    assert np.array_equal(mine.states, its.states, equal_nan=True)


def test_fields_that_are_missing_leave_the_others(tmp_path: Path) -> None:
    messages = some.shown(2)
    for place, (stamp, topic, message) in enumerate(messages):
        if topic == "/scan":
            message.ranges = message.ranges[:4]
        if topic == "/joint_states":
            message.name, message.position = ["arm"], [9.0]
        if topic == "/odom":
            message.pose.pose.position.x = math.nan
        messages[place] = (stamp, topic, message)
    shown = read_robot_bag(some.write_bag(tmp_path / "bag", messages), ROBOT).demonstration
    assert len(shown) == 6
    for name in ("left", "gripper", "x"):
        assert all(math.isnan(float(_value(shown, row, name))) for row in range(6))
    assert _value(shown, 0, "ahead") == 5.0


def test_sampled_rows_hold_an_action(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown(2))
    shown = read_robot_bag(bag, ROBOT, sample_rate=100.0).demonstration
    assert len(shown) > 6
    assert set(shown.actions) == {"forward", "grasp", "back", "release"}


def test_messages_are_taken_by_the_stamps_in_their_headers_where_that_is_asked(
    tmp_path: Path,
) -> None:
    text = "topics: {/odom: {stamp: header}, /joy: {stamp: header}}\n"
    text += "state: {x: /odom.pose.pose.position.x}\n"
    text += "actions: {a: {joy: /joy, press: {0: go}}}\n"
    late, act, early = some.odometry(2.0), some.joy(0), some.odometry(1.0)
    for seconds, message in ((20, late), (15, act), (10, early)):
        message.header.stamp.sec, message.header.stamp.nanosec = seconds, 5
    bag = some.write_bag(
        tmp_path / "bag",
        [(1, "/odom", late), (2, "/odom", early), (3, "/joy", act)],
    )
    by_header = read_robot_bag(bag, parse_robot_file(text)).demonstration
    assert by_header.states.tolist() == [[1.0]]
    assert by_header.stamps.tolist() == [15_000_000_005]
    received = read_robot_bag(bag, parse_robot_file(text.replace("header", "received")))
    assert received.demonstration.stamps.tolist() == [3]


def test_headers_that_tell_no_time_are_noted_where_they_should(tmp_path: Path) -> None:
    text = "topics: {/odom: {stamp: header}}\nstate: {x: /odom.pose.pose.position.x}\n"
    text += "actions: {a: {joy: /joy, press: {0: go}}}\n"
    odometry = [some.odometry(float(place)) for place in range(3)]
    odometry[1].header.stamp.sec = 1_700_000_000
    press = [some.joy(0), some.joy(), some.joy(0)]
    messages = [(some.BEGIN + place, "/odom", one) for place, one in enumerate(odometry)]
    messages += [(some.BEGIN + 3 + place, "/joy", one) for place, one in enumerate(press)]
    bag = some.write_bag(tmp_path / "bag", messages)
    read = read_robot_bag(bag, parse_robot_file(text))
    assert [note for note in read.notes if "header" in note] == [
        "2 of 3 messages on '/odom' have no time in their headers (0): leave out 'stamp: header' "
        "there, or have their publisher fill it in"
    ]
    assert not [note for note in read.notes if "seconds old" in note]
    assert not read_robot_bag(bag, parse_robot_file(text.replace("header", "received"))).notes


def test_a_difference_is_that_of_one_message_to_the_next(tmp_path: Path) -> None:
    text = "state: {speed: /odom.pose.pose.position.x.@derivative}\nactions: {a: /a.data}"
    second = 1_000_000_000
    messages = [(second * one, "/odom", some.odometry(one * one * 1.0)) for one in range(4)]
    messages += [(second * one + 1, "/a", String(data="go")) for one in range(4)]
    messages.sort(key=lambda one: one[0])
    bag = some.write_bag(tmp_path / "bag", messages)
    states = read_robot_bag(bag, parse_robot_file(text)).demonstration.states[:, 0]
    assert np.array_equal(states, [math.nan, 1.0, 3.0, 5.0], equal_nan=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("state: {x: /none.x}\nactions: {a: /mode.data}", "has no messages on '/none', which rob"),
        ("state: {x: /odom.x}\nactions: {a: /mode.data}", "nav_msgs/msg/Odometry has no field 'x'"),
        ("state: {x: /odom.pose.pose.position.x}", "robot.yaml has no part 'actions'"),
        ("state: {x: /mode.data}\nactions: {a: /void.data}", "'/void', which robot.yaml names"),
        (
            "state: {x: /mode.data}\nactions: {a: {joy: /joy, press: {9: go}}}",
            "gives no rows: no message on /joy is an action to the robot file",
        ),
    ],
)
def test_a_robot_file_that_does_not_fit_a_bag_is_one_sentence(
    tmp_path: Path, text: str, said: str
) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown(2))
    with pytest.raises(RebtError) as caught:
        read_robot_bag(bag, parse_robot_file(text, "robot.yaml"))
    assert said in str(caught.value)


def test_options_beside_a_robot_file_that_it_replaces_are_refused(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown(2))
    with pytest.raises(OptionError, match="leave those out"):
        load([bag], InputOptions(robot=ROBOT, action_topics=("/joy",)))
    (tmp_path / "table.csv").write_text("x,action\n1,go\n")
    with pytest.raises(OptionError, match="the options name a robot file, but no input is a bag"):
        load([tmp_path / "table.csv"], InputOptions(robot=ROBOT))


def test_a_tree_says_where_its_features_are(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown())
    learned = rebt_ros.learn([bag], reading=InputOptions(robot=ROBOT)).learned
    assert learned.robot == ROBOT
    assert loads(dumps(learned)) == learned
    assert json.loads(dumps(learned))["robot"] == ROBOT.content
    # Without being told where they are.
    [replayed] = rebt_ros.replay(learned, [bag])
    assert replayed.own_history_agreement == 1.0


def test_a_document_with_a_robot_file_that_is_none_is_refused(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown())
    document = json.loads(dumps(rebt_ros.learn(bag, reading=InputOptions(robot=ROBOT)).learned))
    document["robot"]["state"]["x"] = "/odom["
    with pytest.raises(RebtError, match=r"the document's robot file: state.x is wrong"):
        loads(json.dumps(document))
    del document["robot"]
    with pytest.raises(RebtError, match="document lacks 'robot'"):
        loads(json.dumps(document))


def test_the_commands_learn_and_replay_by_a_robot_file(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown())
    (tmp_path / "robot.yaml").write_text(some.ROBOT_FILE)

    def run(command: str, *arguments: object) -> subprocess.CompletedProcess[str]:
        return warm_processes.run(f"rebt_ros.commands.{command}", *arguments)

    robot = ("--robot", tmp_path / "robot.yaml")
    learned = run("learn", bag, *robot, "--out", tmp_path / "learned")
    assert learned.returncode == 0, learned.stderr
    tree = tmp_path / "learned" / "tree.json"
    for options in ((), robot):
        replayed = run("replay", tree, bag, *options)
        assert replayed.returncode == 0, replayed.stderr
        assert "own history    100.00%" in replayed.stdout
    (tmp_path / "robot.yaml").write_text("state:\n  x: /odom.pos.x\nactions: {a: /mode.data}")
    wrong = run("learn", bag, *robot)
    assert wrong.returncode != 0
    assert "nav_msgs/msg/Odometry has no field 'pos'; it has header" in wrong.stderr
    assert len(wrong.stderr.strip().splitlines()) == 1


def test_arrays_and_strings_are_read_by_a_robot_file_as_without_one(tmp_path: Path) -> None:
    messages = []
    for number in range(6):
        array = Float64MultiArray(data=[float(number), 1.0])
        messages += [(2 * number, "/state", array)]
        messages += [(2 * number + 1, "/action", String(data="go" if number % 2 else "stop"))]
    bag = some.write_bag(tmp_path / "bag", messages)
    text = "state: {a: '/state.data[0]', b: '/state.data[1]'}\nactions: {/action: /action.data}"
    [mine] = load([bag], InputOptions(robot=parse_robot_file(text))).demonstrations
    [its] = load([bag]).demonstrations
    assert np.array_equal(mine.states, its.states)
    assert (mine.actions, mine.channels) == (its.actions, its.channels)
    assert np.array_equal(mine.chosen, its.chosen)


def test_bad_messages_are_refused_or_counted(tmp_path: Path) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown(2), StoragePlugin.SQLITE3)
    [file] = bag.glob("*.db3")
    sqlite3 = pytest.importorskip("sqlite3")
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE messages SET data = x'0001000003' WHERE id = 20")
    with pytest.raises(InputError, match="cannot be decoded as"):
        read_robot_bag(bag, ROBOT)
    read = read_robot_bag(bag, ROBOT, skip_bad=True)
    assert read.account is not None
    assert read.account.left_out == {"cannot be used": 1}


def test_a_tree_that_says_where_its_features_are_is_checked_and_explained_by_a_bag(
    tmp_path: Path,
) -> None:
    bag = some.write_bag(tmp_path / "bag", some.shown())
    learned = rebt_ros.learn([bag], reading=InputOptions(robot=ROBOT)).learned
    [rows] = check(learned, inputs=[bag]).rows
    assert rows.features == learned.features
    assert row_of(learned, 1, None, [bag]).values == tuple(rows.states[1].tolist())
