"""The simulated robot and its demonstrator, as processes, over real DDS."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_episodes import run_episode
from ros_processes import NodeProcess, Peer
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import Robot, State
from rebt_ros.simulated_robot.world import furnished_room

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
    with NodeProcess("robot_node", domain, tmp_path, {"first_start": 4}):
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
    with NodeProcess("robot_node", domain, tmp_path, {"first_start": 4, "speedup": 5.0}):
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
    parameters = {"first_start": 4, "command_timeout": 60.0}
    with NodeProcess("robot_node", domain, tmp_path, parameters):
        states = peer.listen(Float64MultiArray, "state")
        peer.wait_until(lambda: states)
        start = _bearing(states)
        peer.action("turn_left", "command")
        peer.wait_until(lambda: _bearing(states) != start)
        peer.action("salto\N{SNOWMAN}", "command")
        peer.wait_until(lambda: len({tuple(one.data) for one in states[-10:]}) == 1)


def test_the_demonstrator_drives_it_run_after_run_as_in_the_simulation_alone(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"first_start": 20, "speedup": 40.0, "lockstep": True}
    with (
        NodeProcess("robot_node", domain, tmp_path, parameters),
        NodeProcess("demonstrator_node", domain, tmp_path),
    ):
        late = peer.listen(String, "robot/episode", EPISODES)
        peer.wait_until(lambda: len(late) >= 2)
        assert peer.call("demonstrator/enable", False).success
    runs = [json.loads(one.data) for one in late[:2]]
    assert [(one["episode"], one["start"]) for one in runs] == [(1, 20), (2, 21)]
    for run in runs:
        alone = run_episode(Robot(furnished_room(), run["start"]), decide, 60.0)
        assert (run["reached"], run["bumps"]) == (alone.reached, alone.bumps) == (True, 0)
        assert run["seconds"] == pytest.approx(alone.seconds, abs=1.0)


def test_a_disabled_demonstrator_says_nothing_and_survives_foreign_states(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("demonstrator_node", domain, tmp_path, {"enabled": False}) as node:
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
    parameters = {"time_limit": 1.0, "speedup": 10.0}
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
        peer.listen(*((Float64MultiArray, "state") if "robot" in module else (String, "action")))
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
