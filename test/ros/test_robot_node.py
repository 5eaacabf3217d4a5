"""The simulated robot and its demonstrator, as processes, over real DDS."""

from __future__ import annotations

import json
import math
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.action.client import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_episodes import run_episode
from ros_processes import NodeProcess, Peer
from sensor_msgs.msg import BatteryState, Joy
from std_msgs.msg import Float64MultiArray, String
from test_msgs.action import Fibonacci

from rebt_ros.ros.robots.standard_messages import STATE_TOPICS, state_messages, state_of
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import Robot, State
from rebt_ros.simulated_robot.world import furnished_room

PLAIN: dict[str, Any] = {"plain": True, "first_start": 4}

#: It stands on the dock with a quarter of its charge, and the scanner sees all there is to see.
DOCKED: dict[str, Any] = {"first_start": 18, "time_limit": 3600.0}

EPISODES = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _bearing(states: list[Float64MultiArray]) -> float:
    return State(*states[-1].data).target_bearing


def _set(peer: Peer, name: str, value: object) -> Any:
    parameter = Parameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    return peer.ask(SetParameters, "robot/set_parameters", request).results[0]


def test_it_publishes_named_states_and_stands_still_until_it_is_commanded(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("robot_node", domain, tmp_path, PLAIN):
        states = peer.listen(Float64MultiArray, "state")
        peer.wait_until(lambda: len(states) >= 10)
        assert {tuple(one.data) for one in states} == {Robot(furnished_room(), 4).state}
        (dimension,) = states[0].layout.dim
        assert dimension.label == ",".join(State._fields)
        assert dimension.size == dimension.stride == len(State._fields)


@pytest.mark.parametrize("topic", ["command", "action"])
def test_it_obeys_until_the_command_is_too_old(
    domain: int, peer: Peer, tmp_path: Path, topic: str
) -> None:
    with NodeProcess("robot_node", domain, tmp_path, PLAIN | {"speedup": 5.0}):
        states = peer.listen(Float64MultiArray, "state")
        peer.wait_until(lambda: states)
        start = _bearing(states)
        peer.action("turn_left", topic)
        peer.wait_until(lambda: _bearing(states) != start)
        peer.wait_until(
            lambda: len(states) > 20 and len({tuple(one.data) for one in states[-20:]}) == 1
        )
        # Half a second at one radian per second.
        assert start - _bearing(states) == pytest.approx(0.5, abs=0.06)


def test_an_unknown_word_stops_it(domain: int, peer: Peer, tmp_path: Path) -> None:
    parameters = PLAIN | {"command_timeout": 60.0}
    with NodeProcess("robot_node", domain, tmp_path, parameters):
        states = peer.listen(Float64MultiArray, "state")
        peer.wait_until(lambda: states)
        start = _bearing(states)
        peer.action("turn_left", "command")
        peer.wait_until(lambda: _bearing(states) != start)
        peer.action("salto\N{SNOWMAN}", "command")
        peer.wait_until(lambda: len({tuple(one.data) for one in states[-10:]}) == 1)


@pytest.mark.parametrize("plain", [False, True])
def test_the_demonstrator_drives_it_run_after_run_as_in_the_simulation_alone(
    domain: int, peer: Peer, tmp_path: Path, plain: bool
) -> None:
    parameters = {"first_start": 20, "speedup": 40.0, "lockstep": True, "plain": plain}
    with (
        NodeProcess("robot_node", domain, tmp_path, parameters),
        NodeProcess("demonstrator_node", domain, tmp_path, {"plain": plain}),
    ):
        late = peer.listen(String, "robot/episode", EPISODES)
        peer.wait_until(lambda: len(late) >= 2)
        assert peer.call("demonstrator/enable", False).success
    runs = [json.loads(one.data) for one in late[:2]]
    assert [(one["episode"], one["start"]) for one in runs] == [(1, 20), (2, 21)]
    for run in runs:
        alone = run_episode(Robot(furnished_room(), run["start"]), decide, 60.0)
        assert (run["reached"], run["bumps"]) == (alone.reached, alone.bumps) == (True, 0)
        # What it charges takes as long as others take to say so, unless it is plain.
        if plain:
            assert run["seconds"] == pytest.approx(alone.seconds, abs=1.0)


def test_a_disabled_demonstrator_says_nothing_and_survives_foreign_states(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"enabled": False, "plain": True}
    with NodeProcess("demonstrator_node", domain, tmp_path, parameters) as node:
        actions = peer.listen(String, "action")
        state = Robot(furnished_room(), 4).state
        peer.state(*state, labels=[",".join(State._fields)])
        assert "driving" in peer.call("demonstrator/enable", True).message
        for values in ([], [1.0], [float("nan")] * 9):
            peer.state(*values)
        node.says("is left out")
        peer.state(*state, labels=[",".join(State._fields)])
        peer.wait_until(lambda: actions)
        assert [one.data for one in actions] == [decide(state)]


def test_a_demonstrator_with_a_joystick_lets_it_go_when_it_is_disabled(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("demonstrator_node", domain, tmp_path):
        joysticks, velocities = peer.listen(Joy, "joy"), peer.listen(Twist, "cmd_vel")
        robot = Robot(furnished_room(), 4)
        assert decide(robot.state) == "turn_left"

        def turning() -> bool:
            for topic, message in state_messages(robot, Time(), charging=False).items():
                peer.publish(message, topic)
            peer.spin_once()
            return bool(joysticks and velocities)

        peer.wait_until(turning)
        assert list(joysticks[-1].axes) == [0.0, 0.0, 0.0, 1.0]
        assert (velocities[-1].linear.x, velocities[-1].angular.z) == (0.0, 1.0)
        assert peer.call("demonstrator/enable", False).success
        peer.wait_until(lambda: not any(joysticks[-1].axes) and velocities[-1] == Twist())


def test_it_publishes_standard_messages_of_what_it_measures(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    robot = Robot(furnished_room(), 18)
    with NodeProcess("robot_node", domain, tmp_path, DOCKED):
        heard = {topic: peer.listen(kind, topic) for topic, kind in STATE_TOPICS.items()}
        peer.wait_until(lambda: all(heard.values()))
        messages = {topic: its[-1] for topic, its in heard.items()}
    assert state_of(messages) == pytest.approx(robot.state, abs=0.02)
    pose = messages["odom"].pose.pose
    assert (pose.position.x, pose.position.y) == (robot.position.x, robot.position.y)
    assert 2 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(robot.heading)
    ranges = np.array(messages["scan"].ranges)
    assert np.isinf(ranges).sum() == 83
    assert np.isnan(ranges).sum() == 1
    near = robot.position.distance(robot.target)
    assert messages["target"].pose.position.x == pytest.approx(near * math.cos(robot.bearing))


def test_it_drives_by_velocity_and_not_before_one_that_moves_it(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"first_start": 4, "speedup": 5.0, "command_timeout": 60.0}
    with NodeProcess("robot_node", domain, tmp_path, parameters):
        odometry = peer.listen(Odometry, "odom")
        peer.publish(Twist(), "cmd_vel")
        assert "waiting" in peer.wait_until(peer.anew("robot: simulation")).message
        velocity = Twist()
        velocity.linear.x, velocity.angular.z = 0.5, -math.inf
        peer.publish(velocity, "cmd_vel")
        peer.wait_until(lambda: odometry[-1].twist.twist.linear.x == 0.5)
        assert odometry[-1].twist.twist.angular.z == -1.0
        velocity.linear.x, velocity.angular.z = math.nan, 0.0
        peer.publish(velocity, "cmd_vel")
        peer.wait_until(lambda: odometry[-1].twist.twist == Twist())


def _charge(peer: Peer, client: ActionClient, order: int) -> Any:
    """Asks for a charge; the handle of the goal once it is decided on."""
    peer.wait_until(client.server_is_ready, what="the action server")
    future = client.send_goal_async(Fibonacci.Goal(order=order))
    return peer.wait_until(lambda: future.done() and future.result())


def _result(peer: Peer, handle: Any) -> Any:
    future = handle.get_result_async()
    return peer.wait_until(lambda: future.done() and future.result())


def test_it_charges_on_the_dock_as_far_as_it_is_asked_to(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    client = ActionClient(peer.node, Fibonacci, "charge")
    with NodeProcess("robot_node", domain, tmp_path, DOCKED | {"speedup": 20.0}) as robot:
        batteries = peer.listen(BatteryState, "battery_state")
        for order in (0, 101):
            assert not _charge(peer, client, order).accepted
        result = _result(peer, _charge(peer, client, 40))
        assert result.status == GoalStatus.STATUS_SUCCEEDED
        reached = list(result.result.sequence)
        assert reached == sorted(set(reached))
        assert 24 <= reached[0] < reached[-1] == 40
        peer.wait_until(lambda: batteries[-1].power_supply_status == 2)
        assert batteries[-1].percentage == pytest.approx(0.4, abs=0.02)
        # One that is cancelled, and one that another one replaces.
        handle = _charge(peer, client, 100)
        peer.wait_until(lambda: batteries[-1].power_supply_status == 1)
        handle.cancel_goal_async()
        assert _result(peer, handle).status == GoalStatus.STATUS_CANCELED
        first, second = _charge(peer, client, 100), _charge(peer, client, 1)
        assert _result(peer, first).status == GoalStatus.STATUS_ABORTED
        assert _result(peer, second).status == GoalStatus.STATUS_SUCCEEDED
        assert robot.stop() == 0
        assert "Traceback" not in robot.stderr


def test_it_does_not_charge_off_the_dock_and_gives_up_a_goal_at_a_reset(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    client = ActionClient(peer.node, Fibonacci, "charge")
    with NodeProcess("robot_node", domain, tmp_path, DOCKED) as robot:
        handle = _charge(peer, client, 100)
        assert handle.accepted
        assert peer.call("robot/reset").success
        assert _result(peer, handle).status == GoalStatus.STATUS_ABORTED
        assert not _charge(peer, client, 100).accepted
        assert robot.stop() == 0


def test_it_ends_in_good_order_while_it_charges(domain: int, peer: Peer, tmp_path: Path) -> None:
    client = ActionClient(peer.node, Fibonacci, "charge")
    with NodeProcess("robot_node", domain, tmp_path, DOCKED) as robot:
        assert _charge(peer, client, 100).accepted
        assert robot.stop() == 0
        assert "Traceback" not in robot.stderr


def test_reset_begins_at_the_next_start_or_at_a_new_first_one(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("robot_node", domain, tmp_path):
        assert "start 1," in peer.call("robot/reset").message
        for _ in range(2):
            assert _set(peer, "first_start", 1000).successful
            assert "start 1000," in peer.call("robot/reset").message
            assert "start 1001," in peer.call("robot/reset").message
        assert not _set(peer, "first_start", -1).successful
        assert not _set(peer, "speedup", 2.0).successful
        assert "start 1002," in peer.call("robot/reset").message


def test_a_run_that_takes_too_long_is_told_as_lost(domain: int, peer: Peer, tmp_path: Path) -> None:
    parameters = {"time_limit": 1.0, "speedup": 10.0, "plain": True}
    with NodeProcess("robot_node", domain, tmp_path, parameters):
        episodes = peer.listen(String, "robot/episode", EPISODES)
        peer.action("stop", "command")
        peer.wait_until(lambda: episodes)
        told = json.loads(episodes[0].data)
        assert told["seconds"] == pytest.approx(1.0)
        assert (told["episode"], told["start"], told["reached"]) == (1, 0, False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("module", ["robot_node", "demonstrator_node"])
def test_a_signal_ends_it_in_good_order(
    domain: int, peer: Peer, tmp_path: Path, module: str, number: int
) -> None:
    with NodeProcess(module, domain, tmp_path) as node:
        peer.listen(*((Odometry, "odom") if "robot" in module else (Joy, "joy")))
        assert node.stop(number) == 0
        assert "Traceback" not in node.stderr


@pytest.mark.parametrize(
    ("parameters", "name"),
    [({"speedup": 0.5}, "speedup"), ({"rate": 1}, "rate"), ({"command_topics": [""]}, "command_")],
)
def test_a_parameter_that_makes_no_sense_is_refused_with_a_sentence(
    domain: int, tmp_path: Path, parameters: dict[str, object], name: str
) -> None:
    with NodeProcess("robot_node", domain, tmp_path, parameters) as node:
        assert node.wait() == 1
        assert f"parameter '{name}" in node.stderr
        assert "Traceback" not in node.stderr
