"""Nodes where the terminal, the home or the paths are not what one expects: they start and work."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from executor_examples import learned, where_x_is_small
from ros_processes import NodeProcess, Peer, command_of
from std_msgs.msg import String

from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.ros.log_files import arguments_for_logging
from rebt_ros.simulated_robot.robot import State
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.tree_file import write_tree

#: An action that no narrow encoding knows.
LABEL = "dreh … ≤"

_NO_UTF8 = ["PYTHONCOERCECLOCALE=0", "PYTHONUTF8=0"]

#: Variables, what happens to the streams, and a letter that paths may have.
ENVIRONMENTS = {
    "nobody's home, ASCII, output closed": (
        ["-u", "HOME", "-u", "ROS_HOME", "-u", "ROS_LOG_DIR", "PYTHONIOENCODING=ascii", "LC_ALL=C"],
        ">&-",
        "ü",
    ),
    "no room in the home, Latin 1, errors closed": (
        ["-u", "ROS_HOME", "-u", "ROS_LOG_DIR", "HOME=/proc", "PYTHONIOENCODING=latin-1"],
        "2>&-",
        "ü",
    ),
    "no UTF-8, both closed": (["LC_ALL=C", *_NO_UTF8], ">&- 2>&-", "u"),
}


def _recorder(peer: Peer, directory: Path) -> None:
    peer.state(1.0)
    peer.action(LABEL)
    answer = peer.call("/recorder/new_demonstration")
    assert answer.success, answer.message
    assert len(list(directory.glob("demonstrations/*.rec"))) == 1


def _learner(peer: Peer, directory: Path) -> None:
    features = (Feature("x", topic="state", index=0),)
    with RecordingWriter(directory / "demonstrations", features, ["action"]) as writer:
        for step in range(60):
            x = float(step % 10)
            writer.write(Row(step, "action", LABEL if x > 4 else "go", None, (x,)))
    answer = peer.call("/learner/relearn")
    assert answer.success, answer.message
    text = directory / "learned" / "tree.txt"
    peer.wait_until(lambda: text.exists() and LABEL in text.read_text(encoding="utf-8"))


def _executor(peer: Peer, directory: Path) -> None:
    heard = peer.listen(String, "command")
    assert peer.call("/executor/enable", True).success

    def commanded() -> bool:
        peer.state(0.0, 1.0)
        peer.spin_once()
        return LABEL in [one.data for one in heard]

    peer.wait_until(commanded)


def _demonstrator(peer: Peer, directory: Path) -> None:
    heard = peer.listen(String, "action")

    def answered() -> bool:
        peer.state(*[0.0] * len(State._fields), labels=State._fields)
        peer.spin_once()
        return bool(heard)

    peer.wait_until(answered)


def _robot(peer: Peer, directory: Path) -> None:
    peer.publish(String(data="go"), "command")
    answer = peer.call("/robot/reset")
    assert answer.success, answer.message


def _synthetic_robot(peer: Peer, directory: Path) -> None:
    heard = peer.listen(String, "action")
    peer.wait_until(lambda: LABEL in [one.data for one in heard])


WORK: dict[str, tuple[dict[str, object], Callable[[Peer, Path], None]]] = {
    "recorder": ({"state_wait": 0.2}, _recorder),
    "learner": ({}, _learner),
    "executor": ({"tree_file": "tree # %.json"}, _executor),
    "demonstrator": ({"plain": True}, _demonstrator),
    "robot": ({"plain": True}, _robot),
    "synthetic_robot": ({"config": "wink #1.json"}, _synthetic_robot),
}


@pytest.mark.parametrize("node", WORK)
@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_a_node_starts_works_and_ends(
    environment: str, node: str, domain: int, peer: Peer, tmp_path: Path
) -> None:
    variables, shell, letter = ENVIRONMENTS[environment]
    directory = tmp_path / f"a workspace # % {letter}"
    directory.mkdir()
    tree = learned(where_x_is_small(Action("go", "action"), Action(LABEL, "action")))
    write_tree(directory / "tree # %.json", tree)
    (directory / "wink #1.json").write_text(
        f'{{"type_": "sequence", "child_list": [{{"type_": "action", "name": "{LABEL}"}}]}}',
        encoding="utf-8",
    )
    start = ["env", *variables, "sh", "-c", f'exec "$@" {shell}', "sh", *command_of(node)]
    parameters, work = WORK[node]
    with NodeProcess(f"{node}_node", domain, directory, parameters, command=start) as process:
        work(peer, directory)
        assert process.stop() == 0
        assert "Traceback" not in process.stderr


@pytest.mark.parametrize("node", WORK)
def test_paths_that_ros_cannot_write_are_refused(node: str, domain: int, tmp_path: Path) -> None:
    directory = tmp_path / "a workspace # % ü"
    directory.mkdir()
    start = ["env", "LC_ALL=C", *_NO_UTF8, *command_of(node)]
    with NodeProcess(f"{node}_node", domain, directory, command=start) as process:
        assert process.wait() == 1
        [line] = process.stderr.splitlines()
        assert "cannot be read as ascii, and ROS needs UTF-8: set PYTHONUTF8=1" in line


@pytest.mark.parametrize(
    ("node", "parameter"),
    [
        ("recorder", "demonstrations"),
        ("learner", "output"),
        ("executor", "tree_file"),
        ("synthetic_robot", "config"),
    ],
)
def test_the_home_of_nobody_is_refused(
    node: str, parameter: str, domain: int, tmp_path: Path
) -> None:
    home = {parameter: "~nobody_is_called_so/x"}
    with NodeProcess(f"{node}_node", domain, tmp_path, home) as process:
        assert process.wait() == 1
        [line] = process.stderr.splitlines()
        assert f"parameter '{parameter}' is '~nobody_is_called_so/x', but there is no such" in line


def test_log_files_have_a_place_or_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        # What is set now is what it is afterwards, whether there was something or not.
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert arguments_for_logging(["node"]) == ["node"]
    assert os.environ["ROS_LOG_DIR"] == str(tmp_path / ".ros" / "log")
    monkeypatch.setenv("ROS_LOG_DIR", "~/logs")
    assert arguments_for_logging(["node"]) == ["node"]
    assert (tmp_path / "logs").is_dir()
    monkeypatch.setenv("ROS_LOG_DIR", "/proc/no/such")
    assert arguments_for_logging(["node"]) == ["node", "--ros-args", "--disable-external-lib-logs"]
    monkeypatch.setenv("ROS_LOG_DIR", "~nobody_is_called_so")
    assert arguments_for_logging(["node"])[1:] == ["--ros-args", "--disable-external-lib-logs"]
