"""Corrections: a robot fails, a person takes over, and after a relearn it succeeds by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from executor_examples import status
from ros_processes import AGES, NodeProcess, Peer, values_of
from std_msgs.msg import String

from rebt_ros.storage.inputs import load
from rebt_ros.storage.recording_files import recordings
from rebt_ros.storage.recording_head import Origin, read_head

FIELDS = ("place", "door")
GOAL = 2.0
DOOR = 1.0

PARAMETERS = {"history": "none", "psa": "never", "ccp_alpha": 0.0}


class Corridor:
    """A robot that drives to a goal and grips what is there; its way may lead through a door."""

    def __init__(self, closed: bool) -> None:
        self.place = 0.0
        self.left_to_open = 8 if closed else 0
        self.gripped = False

    @property
    def state(self) -> tuple[float, float]:
        """Where it is, and whether it stands before a closed door."""
        return self.place, float(self.place == DOOR and self.left_to_open > 0)

    def obey(self, label: str) -> None:
        before_door = self.state[1] == 1.0
        if label == "forward" and not before_door:
            self.place = min(round(self.place + 0.1, 1), GOAL)
        elif label == "open" and before_door:
            self.left_to_open -= 1
        elif label == "grip" and self.place == GOAL:
            self.gripped = True


def show(state: tuple[float, float]) -> str:
    """What a person does."""
    place, door = state
    return "open" if door else "grip" if place == GOAL else "forward"


class Course:
    """Lets the executor's commands, or a person, move the robot."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self.robot = Corridor(closed=False)
        self.commands: list[str] = []
        peer.node.create_subscription(String, "command", self._on_command, 1000)

    def begin(self, *, closed: bool) -> None:
        self.robot = Corridor(closed)
        self.commands.clear()

    def until(self, condition: Callable[[], Any], what: str = "") -> Any:
        def moved() -> Any:
            self._peer.state(*self.robot.state, labels=FIELDS)
            return condition()

        return self._peer.wait_until(moved, what=what)

    def demonstrate(self, condition: Callable[[], bool]) -> int:
        """A person drives until the condition holds; returns how many actions that took."""
        done = 0
        while not condition():
            state = self.robot.state
            self._peer.state(*state, labels=FIELDS)
            self._peer.action(show(state))
            self.robot.obey(show(state))
            self._peer.spin_once()
            done += 1
        return done

    def _on_command(self, message: String) -> None:
        self.commands.append(message.data)
        self.robot.obey(message.data)


def recorded(peer: Peer, rows: int, **values: str) -> None:
    """Waits until the recorder reports that so many rows are in files, and the values."""
    wanted = {"rows": str(rows)} | {key.replace("_", " "): one for key, one in values.items()}
    peer.wait_until(
        lambda: (
            (one := peer.diagnostics.get("recorder: recording"))
            and wanted.items() <= values_of(one).items()
        ),
        what=str(wanted),
    )


def origins(directory: Path) -> list[Origin]:
    """Of the recordings, oldest first."""
    found = []
    for path in recordings(directory):
        with path.open("rb") as file:
            found.append(read_head(path, file).origin)
    return found


@pytest.mark.parametrize("novelty", ["ignore", "hold"])
def test_a_robot_that_fails_before_a_door_opens_it_once_it_was_corrected(
    domain: int, peer: Peer, tmp_path: Path, novelty: str
) -> None:
    executing = {
        "rate": 50.0,
        # Longer than this process may stand still while it sends what a person does.
        "takeover_timeout": 4.0,
        "state_timeout": AGES,
        "novelty": novelty,
        "halt_action": "wait" if novelty == "hold" else "",
    }
    with (
        NodeProcess("recorder_node", domain, tmp_path, {"state_wait": 0.2}),
        NodeProcess("learner_node", domain, tmp_path, PARAMETERS),
        NodeProcess("executor_node", domain, tmp_path, executing),
    ):
        course = Course(peer)
        # The recorder and the executor.
        peer.connect(String, "action", subscribers=2)

        shown = course.demonstrate(lambda: course.robot.gripped)
        recorded(peer, shown)
        answer = peer.call("/learner/relearn")
        assert f"{shown} rows of 1 demonstration" in answer.message
        assert peer.call("/executor/enable", True).success

        # It goes where it was shown, and stands before the door.
        course.until(lambda: course.robot.gripped, "the goal")
        course.begin(closed=True)
        course.until(lambda: course.robot.state == (DOOR, 1.0), "the door")
        if novelty == "hold":
            course.until(lambda: course.commands[-1] == "wait", "being held")
            said = status(peer, "held until a person takes over", robot=course)
            assert values_of(said)["novelty"].startswith("door is 1, 1 above the 0 to 0")
            assert course.commands[-1] == "wait"
        else:
            course.commands.clear()
            course.until(lambda: len(course.commands) > 50, "fifty commands")
            assert set(course.commands) == {"forward"}
        assert course.robot.left_to_open == 8

        # A person opens it, and the robot goes on by itself.
        corrected = course.demonstrate(lambda: course.robot.left_to_open == 0)
        recorded(peer, shown + corrected, takeovers="1", failed_episodes="0")
        course.until(lambda: course.robot.gripped, "the goal")
        assert peer.call("/recorder/record", False).success

        # What the person did is a demonstration of its own, with what the robot had done before.
        assert origins(tmp_path / "demonstrations") == [Origin.DEMONSTRATION, Origin.TAKEOVER]
        first, second = load([tmp_path / "demonstrations"]).demonstrations
        assert (len(first), len(second)) == (shown, corrected)
        assert first.before == {}
        assert second.actions == ("open",)
        assert second.before == {"action": "wait" if novelty == "hold" else "forward"}

        answer = peer.call("/learner/relearn")
        assert f"{shown + corrected} rows of 2 demonstrations" in answer.message
        status(peer, "running", robot=course, rows=str(shown + corrected))
        course.begin(closed=True)
        course.until(lambda: course.robot.gripped, "the goal")
        assert "open" in course.commands
        assert "wait" not in course.commands


def test_a_robot_that_failed_before_a_door_opens_it_once_it_was_shown(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    executing = {"rate": 50.0, "takeover_timeout": 4.0, "state_timeout": AGES}
    with (
        NodeProcess("recorder_node", domain, tmp_path, {"state_wait": 0.2}),
        NodeProcess("learner_node", domain, tmp_path, PARAMETERS),
        NodeProcess("executor_node", domain, tmp_path, executing),
    ):
        course = Course(peer)
        peer.connect(String, "action", subscribers=2)
        shown = course.demonstrate(lambda: course.robot.gripped)
        recorded(peer, shown)
        assert peer.call("/recorder/record", False).success
        assert peer.call("/learner/relearn").success
        assert peer.call("/executor/enable", True).success
        course.begin(closed=True)
        course.until(lambda: course.robot.state == (DOOR, 1.0), "the door")
        course.commands.clear()
        course.until(lambda: len(course.commands) > 50, "fifty commands")
        assert course.robot.left_to_open == 8

        # It drives on while a person says that it failed.
        answer = peer.call("/recorder/failed")
        assert answer.success
        assert answer.message.startswith("recording. Now disable the executor, put the robot back")
        course.commands.clear()
        course.until(lambda: len(course.commands) > 20, "twenty commands")
        recorded(peer, shown, failed_episodes="1", origin_of_the_demonstration="failed")
        waiting = peer.diagnostics["recorder: recording"].message
        assert waiting == "waiting for a person to show what failed"
        assert peer.call("/executor/enable", False).success

        # Put back, and shown from its start to its end.
        course.begin(closed=True)
        corrected = course.demonstrate(lambda: course.robot.gripped)
        answer = peer.call("/recorder/new_demonstration")
        assert f"recorded {corrected} rows in " in answer.message
        recorded(
            peer,
            shown + corrected,
            failed_episodes="1",
            takeovers="0",
            origin_of_the_demonstration="demonstration",
        )
        assert origins(tmp_path / "demonstrations") == [Origin.DEMONSTRATION, Origin.FAILED]
        first, second = load([tmp_path / "demonstrations"]).demonstrations
        assert (len(first), len(second)) == (shown, corrected)
        assert second.before == {}
        assert second.states[0].tolist() == [0.0, 0.0]
        assert [second.actions[int(one)] for one in second.chosen].count("open") == 8

        answer = peer.call("/learner/relearn")
        assert f"{shown + corrected} rows of 2 demonstrations" in answer.message
        status(peer, "disabled", robot=course, rows=str(shown + corrected))
        course.begin(closed=True)
        assert peer.call("/executor/enable", True).success
        course.until(lambda: course.robot.gripped, "the goal")
        assert "open" in course.commands
