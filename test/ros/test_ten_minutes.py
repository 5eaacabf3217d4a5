"""docs/ten_minutes.md, word by word: from a robot's own messages to a tree that drives it."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import pytest

pytest.importorskip("rclpy")

import robot_bags as some
import warm_processes
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_processes import CHECKOUT, PATIENCE, NodeProcess, Peer
from sensor_msgs.msg import Joy
from std_msgs.msg import String

from rebt_ros.robot_file.reading import parse_robot_file, read_robot_file
from rebt_ros.ros.robots.standard_messages import STATE_TOPICS

PAGE: Final = (CHECKOUT / "docs" / "ten_minutes.md").read_text(encoding="utf-8")
BLOCKS: Final = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
COMMANDS: Final = [
    shlex.split(line) for kind, text in BLOCKS if not kind for line in text.splitlines()
]
#: What describe proposes; what a person makes of it; and what is added to that.
PROPOSED, CHOSEN, ADDED = (text for kind, text in BLOCKS if kind == "yaml")

#: How long episodes may take on a busy machine (seconds).
EPISODE: Final = 5 * PATIENCE

#: How the joystick is used, which is what describe proposes.
USES: Final[Sequence[Callable[[Joy], bool]]] = (
    lambda joy: joy.buttons[0] == 0,
    lambda joy: joy.buttons[0] == 1,
    lambda joy: joy.axes[1] >= 0.5,
    lambda joy: joy.axes[3] >= 0.5,
    lambda joy: joy.axes[3] <= -0.5,
)

EPISODES: Final = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _arguments(name: str, *, again: bool = False) -> list[str]:
    """The arguments of a command, or of a node, of this package, the first or second time."""
    found = [its[4:] for its in COMMANDS if its[:4] == ["ros2", "run", "rebt_ros", name]]
    assert len(found) == 1 + (name == "learn")
    return found[again]


def _node(name: str, domain: int, directory: Path) -> NodeProcess:
    arguments = [one for one in _arguments(name) if one != "--ros-args"]
    return NodeProcess(f"{name}_node", domain, directory, {}, arguments)


def _run(name: str, directory: Path, *, again: bool = False) -> str:
    arguments = _arguments(name, again=again)
    done = warm_processes.run(f"rebt_ros.commands.{name}", *arguments, directory=directory)
    assert done.returncode == 0, done.stderr
    return done.stdout


def _ended(heard: list[String]) -> list[dict[str, Any]]:
    return [json.loads(one.data) for one in heard]


class Recording:
    """What `ros2 bag record` does: it writes down all messages in the order of their sending."""

    def __init__(self, peer: Peer, topics: dict[str, Any]) -> None:
        self._messages: list[tuple[int, str, Any]] = []
        for topic, kind in topics.items():
            self._listen(peer, topic, kind)

    def has(self, used: Callable[[Joy], bool]) -> bool:
        """Whether the joystick has been used so."""
        return any(isinstance(message, Joy) and used(message) for _, _, message in self._messages)

    def write(self, path: Path) -> None:
        some.write_bag(path, sorted(self._messages, key=lambda message: message[0]))

    def _listen(self, peer: Peer, topic: str, kind: Any) -> None:
        def take(message: Any, info: dict[str, Any]) -> None:
            self._messages.append((info["source_timestamp"], topic, message))

        peer.node.create_subscription(kind, topic, take, 1000)


def test_someone_who_follows_the_page_has_a_tree_that_drives(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    kinds = {f"/{topic}": kind for topic, kind in STATE_TOPICS.items()} | {"/joy": Joy}
    [record] = [its for its in COMMANDS if its[:3] == ["ros2", "bag", "record"]]
    assert set(kinds) == set(record[-len(kinds) :])
    recording = Recording(peer, kinds)
    with _node("robot", domain, tmp_path):
        episodes = peer.listen(String, "robot/episode", EPISODES)
        with _node("demonstrator", domain, tmp_path):
            # The driver may have begun before it is heard.
            peer.wait_until(
                lambda: len(episodes) >= 2 and all(map(recording.has, USES)),
                EPISODE,
                "demonstrations in which all is done",
            )
        recording.write(tmp_path / "my_bag")

        said = _run("describe", tmp_path)
        assert "Written to robot.yaml" in said
        proposal = (tmp_path / "robot.yaml").read_text()
        read_robot_file(tmp_path / "robot.yaml")
        without_comments = [line.partition("  #")[0] for line in proposal.splitlines()]
        assert [line for line in PROPOSED.splitlines() if line not in without_comments] == []

        (tmp_path / "robot.yaml").write_text(CHOSEN)
        assert "Written to learned" in _run("learn", tmp_path)
        assert "rows" in _run("replay", tmp_path)

        (tmp_path / "robot.yaml").write_text(CHOSEN + ADDED)
        shown = len(episodes)
        with _node("executor", domain, tmp_path) as executor:
            assert peer.call("executor/enable", True).success
            peer.wait_until(
                lambda: (
                    len(episodes) >= shown + 3
                    or any(one["reached"] for one in _ended(episodes)[shown:])
                ),
                EPISODE,
                "an episode",
            )
            assert peer.call("executor/enable", False).success
            assert executor.stop() == 0
        assert any(one["reached"] for one in _ended(episodes)[shown:])

        corrected = len(episodes)
        with _node("recorder", domain, tmp_path), _node("demonstrator", domain, tmp_path):
            peer.wait_until(lambda: len(episodes) > corrected, EPISODE, "a demonstration")
    assert list((tmp_path / "demonstrations").glob("*.rec"))
    # The bag is one demonstration.
    said = _run("learn", tmp_path, again=True)
    assert " demonstrations; " in said


def test_the_robot_file_of_the_page_is_that_of_the_demo() -> None:
    shipped = read_robot_file(CHECKOUT / "config" / "demo_robot.yaml")
    written = parse_robot_file(CHOSEN + ADDED)
    assert (written.state, written.actions) == (shipped.state, shipped.actions)
    assert written.commands == shipped.commands
