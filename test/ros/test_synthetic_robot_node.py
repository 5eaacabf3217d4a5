"""The synthetic robot as a process, recorded and learned from over real DDS."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from ros_processes import NodeProcess, Peer, values_of
from std_msgs.msg import Bool, Float64MultiArray, String

from rebt_ros.demonstration.last_action import History
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.offline import learning_from_files as offline
from rebt_ros.storage.inputs import load
from rebt_ros.study.simulator.configuration import Act, Check, Group, GroupKind, Inverted
from rebt_ros.study.simulator.configuration_file import format_config, parse_config
from rebt_ros.study.simulator.synthetic_robot import ExperimentRobot, SimulatedRun, simulate

#: Several actions in a tick, repeats, and actions that fail.
TREE = Group(
    GroupKind.PARALLEL,
    (
        Group(GroupKind.REPEATER, (Inverted(Check("/x", 0.3)), Act("a"), Act("b", 0.9))),
        Group(
            GroupKind.SEQUENCE,
            (
                Group(GroupKind.SELECTOR, (Check("/y", 0.5), Check("/x", 0.2))),
                Group(GroupKind.PARALLEL_SELECTOR, (Act("c"), Act("d"))),
            ),
        ),
    ),
)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "tree.json"
    path.write_text(format_config(TREE))
    return path


def simulated(path: Path, seed: int, ticks: int) -> SimulatedRun:
    return simulate(ExperimentRobot(parse_config(path.read_text(), path.stem), seed), ticks)


def rows(shown: Any) -> list[tuple[str, list[float]]]:
    labels = [shown.actions[code] for code in shown.chosen.tolist()]
    return list(zip(labels, shown.states.tolist(), strict=True))


def recorded_rows(peer: Peer, rows: int) -> None:
    """Waits until the recorder reports so many."""
    peer.diagnostics.clear()
    peer.wait_until(
        lambda: (
            (one := peer.diagnostics.get("recorder: recording"))
            and values_of(one)["rows"] == str(rows)
        ),
        what=f"{rows} rows",
    )


def test_what_the_recorder_records_is_what_the_simulation_logs(
    domain: int, peer: Peer, config: Path, tmp_path: Path
) -> None:
    ticks = 300
    parameters = {
        "config": config,
        "seed": 5,
        "ticks": ticks,
        "rate": 200.0,
        "wait_for_subscribers": 1,
    }
    expected = simulated(config, 5, ticks)
    for attempt in range(5):
        directory = tmp_path / str(attempt)
        directory.mkdir()
        with (
            NodeProcess("synthetic_robot_node", domain, directory, parameters) as robot,
            NodeProcess("recorder_node", domain, directory) as recorder,
        ):
            robot.says(f"at the end after {ticks} ticks")
            recorded_rows(peer, len(expected.demonstration))
            assert peer.call("/recorder/record", False).success
            assert (robot.stop(), recorder.stop()) == (0, 0)
        # A recorder that stood still cannot tell which state an action belongs to, and says so.
        if "has the state of its arrival" not in recorder.stderr:
            break
    (recorded,) = load([directory / "demonstrations"]).demonstrations
    assert len(expected.demonstration) > 150
    assert [feature.name for feature in recorded.features] == ["/x", "/y"]
    assert rows(recorded) == rows(expected.demonstration)
    options = LearnOptions(history=History.NONE, psa=Use.NEVER, max_depth=3, ccp_alpha=0.0)
    learned = offline.learn([directory / "demonstrations"], options=options).learned
    assert [(one.name, one.topic) for one in learned.features] == [("/x", "state"), ("/y", "state")]


def test_it_acts_from_the_start_at_its_rate_and_stops_when_told(
    domain: int, peer: Peer, config: Path, tmp_path: Path
) -> None:
    with NodeProcess(
        "synthetic_robot_node", domain, tmp_path, {"config": config, "rate": 100.0}
    ) as robot:
        states = peer.listen(Float64MultiArray, "state")
        actions = peer.listen(String, "action")
        peer.wait_until(lambda: len(states) > 20 and actions)
        (dimension,) = states[0].layout.dim
        assert (dimension.label, dimension.size) == ("/x,/y", 2)
        # Who hears it from the beginning also hears that no action is taken before.
        assert {one.data for one in actions} <= {"", "a", "b", "c", "d"}
        answer = peer.call("/synthetic_robot/enable", False)
        assert answer.success
        assert answer.message.startswith("not acting, ")
        peer.wait_until(lambda: actions[-1].data == "", what="the word that no action is taken")
        assert robot.stop() == 0


def test_every_action_is_followed_by_how_it_ended(
    domain: int, peer: Peer, config: Path, tmp_path: Path
) -> None:
    parameters = {"config": config, "rate": 200.0, "ticks": 60, "wait_for_subscribers": 1}
    with NodeProcess("synthetic_robot_node", domain, tmp_path, parameters):
        outcomes, actions = peer.listen(Bool, "outcome"), peer.listen(String, "action")
        peer.listen(Float64MultiArray, "state")
        peer.wait_until(lambda: len(actions) > 1 and not actions[-1].data)
        expected = simulated(config, 0, 60)
        peer.wait_until(lambda: len(outcomes) == len(expected.succeeded))
    assert [one.data for one in outcomes] == expected.succeeded.tolist()
    assert [one.data for one in actions if one.data] == [
        label for label, _ in rows(expected.demonstration)
    ]


def test_after_its_last_tick_it_does_not_act_again(
    domain: int, peer: Peer, config: Path, tmp_path: Path
) -> None:
    parameters = {"config": config, "rate": 100.0, "ticks": 3}
    with NodeProcess("synthetic_robot_node", domain, tmp_path, parameters) as robot:
        robot.says("at the end after 3 ticks")
        answer = peer.call("/synthetic_robot/enable", True)
        assert not answer.success
        assert answer.message.startswith("at the end after 3 ticks and ")


def test_nodes_without_meaning_are_skipped_with_a_warning(
    domain: int, config: Path, tmp_path: Path
) -> None:
    value = json.loads(config.read_text())
    value["child_list"].append({"name": "DEFAULT", "type_": "DEFAULT"})
    config.write_text(json.dumps(value))
    with NodeProcess("synthetic_robot_node", domain, tmp_path, {"config": config}) as robot:
        robot.says("tree: the root.child_list[2] has type DEFAULT and is skipped.")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "parameter 'config' is empty: give it a configuration file."),
        ({"config": "nowhere.json"}, "nowhere.json does not exist: check its name."),
        ({"config": "tree.json", "running_chance": 1.0}, "the running chance is 1"),
        ({"config": "tree.json", "rate": 0.0}, "parameter 'rate' must be in [0.1, 1000]"),
    ],
)
def test_what_keeps_it_from_starting_is_one_sentence(
    domain: int, config: Path, tmp_path: Path, parameters: dict[str, object], message: str
) -> None:
    with NodeProcess("synthetic_robot_node", domain, tmp_path, parameters) as robot:
        assert robot.wait() == 1
        assert message in robot.stderr
        assert "Traceback" not in robot.stderr
