"""What labels do by a robot file: messages, services and goals, and what is said of wrong ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

import robot_bags as some
from geometry_msgs.msg import Twist
from py_trees.common import Status
from ros_processes import NodeProcess, Peer
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

import rebt_ros
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.live.long_command import LongCommand, Running
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.place import Place
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.ros.executor.robot_commands import Goal
from rebt_ros.ros.message_values import fill
from rebt_ros.storage.input_options import InputOptions

STATE = """\
state:
  ahead: {path: "/scan.ranges[-30deg:30deg].@min", max_age: 600}
actions:
  action: /action.data
"""

COMMANDS = """\
commands:
  go: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: 0.25}}}
  beep: {publish: /horn, type: std_msgs/msg/Bool, message: {data: true}, when: once}
  grasp: {call: /grasp, type: std_srvs/srv/Trigger}
  stop: {publish: /cmd_vel, type: geometry_msgs/msg/Twist}
"""


def _document(directory: Path, near: str, far: str) -> str:
    """A tree that does one thing where something is near, and else another."""
    messages: list[tuple[int, str, Any]] = []
    for number in range(24):
        label = near if number % 2 else far
        messages.append((2 * number, "/scan", some.scan(0.5 if number % 2 else 4.0)))
        messages.append((2 * number + 1, "/action", String(data=label)))
    bag = some.write_bag(directory / "bag", messages)
    robot = parse_robot_file(STATE)
    return dumps(rebt_ros.learn(bag, reading=InputOptions(robot=robot)).learned)


def _executor(
    domain: int, directory: Path, commands: str = COMMANDS, **parameters: object
) -> NodeProcess:
    (directory / "robot.yaml").write_text(STATE + commands)
    return NodeProcess(
        "executor_node",
        domain,
        directory,
        {"robot_file": "robot.yaml", "tree_file": "tree.json", "enabled": True, **parameters},
    )


def test_a_label_publishes_at_every_tick_or_once_and_stop_when_the_tree_is_halted(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "tree.json").write_text(_document(tmp_path, "beep", "go"))
    with _executor(domain, tmp_path) as executor:
        velocities, horns = peer.listen(Twist, "/cmd_vel"), peer.listen(Bool, "/horn")
        commands = peer.listen(String, "command")

        def sees(ahead: float, done: Callable[[], bool]) -> Callable[[], bool]:
            def look() -> bool:
                peer.publish(some.scan(ahead), "/scan")
                return done()

            return look

        peer.wait_until(sees(4.0, lambda: len(velocities) > 3), what="velocities")
        assert {one.linear.x for one in velocities} == {0.25}
        assert commands[-1].data == "go"
        commands.clear()
        peer.wait_until(
            sees(0.5, lambda: sum(one.data == "beep" for one in commands) > 3), what="beeps"
        )
        assert [one.data for one in horns] == [True]
        velocities.clear()
        assert peer.call("/executor/enable", False).success
        peer.wait_until(lambda: velocities, what="the command to stop")
        assert [one.linear.x for one in velocities] == [0.0]
        assert executor.stop() == 0


def test_a_service_is_called_and_its_failure_is_told(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "tree.json").write_text(_document(tmp_path, "grasp", "go"))
    calls: list[object] = []

    def grasp(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        calls.append(request)
        response.success, response.message = len(calls) > 1, "nothing is there"
        return response

    def says(part: str) -> bool:
        peer.publish(some.scan(0.5), "/scan")
        status = peer.diagnostics.get("executor: execution")
        return status is not None and part in status.message

    with _executor(domain, tmp_path) as executor:
        peer.wait_until(
            lambda: says("'grasp' has failed: there is no service /grasp"), what="no service"
        )
        peer.node.create_service(Trigger, "/grasp", grasp)
        peer.wait_until(
            lambda: calls and says("'grasp' has failed: nothing is there"), what="a failure"
        )
        assert executor.stop() == 0


def test_a_person_with_a_joystick_takes_over_while_it_is_used(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "tree.json").write_text(_document(tmp_path, "beep", "go"))
    joystick = "actions: {action: {joy: /joy, axes: {1: {0.5: go, -0.5: back}}}}"
    text = f"state: {{x: /odom.pose.pose.position.x}}\n{joystick}\n{COMMANDS}"
    (tmp_path / "joy.yaml").write_text(text)
    with _executor(domain, tmp_path, robot_file="joy.yaml", takeover_timeout=0.5) as executor:

        def condition(axis: float, wanted: str) -> Callable[[], bool]:
            def look() -> bool:
                peer.publish(some.scan(4.0), "/scan")
                peer.publish(some.joy(axis=axis), "/joy")
                status = peer.diagnostics.get("executor: execution")
                return status is not None and wanted in status.message

            return look

        # A joystick that lies on the table is nobody who drives.
        peer.wait_until(condition(0.0, "running"), what="the tree to drive")
        peer.wait_until(condition(-1.0, "paused: a person has taken over"), what="a takeover")
        peer.wait_until(condition(0.0, "running"), what="the tree to drive again")
        assert executor.stop() == 0


def test_a_label_without_a_command_is_told(domain: int, peer: Peer, tmp_path: Path) -> None:
    (tmp_path / "tree.json").write_text(_document(tmp_path, "dance", "go"))

    def says() -> bool:
        peer.publish(some.scan(4.0), "/scan")
        status = peer.diagnostics.get("executor: execution")
        return status is not None and "robot.yaml has no command for 'dance'" in status.message

    with _executor(domain, tmp_path) as executor:
        peer.wait_until(says, what="a warning")
        assert executor.stop() == 0


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            "{publish: /a, type: geometry_msgs/msg/Twist, message: {lineal: {x: 1}}}",
            "commands.go.message.lineal is no field of geometry_msgs/Twist; it has linear, angular",
        ),
        (
            "{publish: /a, type: geometry_msgs/msg/Twist, message: {linear: {x: fast}}}",
            "commands.go.message.linear.x must be a number from -3e+38 to 3e+38, not 'fast'",
        ),
        ("{publish: /a, type: my_msgs/msg/Own}", "install ros-jazzy-my-msgs, or source the"),
        ("{call: /a, type: std_srvs/srv/Nothing}", "the package std_srvs has no service 'Nothing'"),
        ("{call: /a, type: std_msgs/msg/Bool}", "is no name of a service type"),
        ("{action: /a, type: nav2_msgs/action/Spin}", "install ros-jazzy-nav2-msgs"),
        ("{publish: cmd vel, type: std_msgs/msg/Bool}", "commands.go.publish is 'cmd vel', which"),
        ("{call: /a//b, type: std_srvs/srv/Empty}", "commands.go.call is '/a//b', which is no"),
        ("{action: /7up, type: test_msgs/action/Fibonacci}", "commands.go.action is '/7up', which"),
    ],
)
def test_a_command_that_cannot_be_ends_the_executor_with_a_sentence(
    domain: int, tmp_path: Path, command: str, said: str
) -> None:
    with _executor(domain, tmp_path, f"commands: {{go: {command}}}", tree_file="") as executor:
        assert executor.wait() == 1
        assert said in " ".join(executor.stderr.split())
        assert "Traceback" not in executor.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{send: /a}", "line 5: commands.go needs one of publish, call, action"),
        ("{publish: /a}", "commands.go needs a 'type', such as geometry_msgs/msg/Twist"),
        ("{publish: /a, type: b, when: always}", "commands.go.when must be one of tick, once"),
        (
            "{publish: /a, type: b, message: 3}",
            "commands.go.message must be a map, of names and what they stand for, not 3",
        ),
        ("{call: /a, type: b, message: {}}", "commands.go.message is unknown here"),
    ],
)
def test_a_malformed_command_is_one_sentence(text: str, said: str) -> None:
    with pytest.raises(RobotFileError) as caught:
        parse_robot_file(f"{STATE}commands: {{go: {text}}}")
    assert said in str(caught.value)


def _filled(message: Any, content: object) -> Any:
    return fill(message, Place(content, "robot.yaml", {}))


def test_messages_take_values_of_all_kinds() -> None:
    joy = _filled(Joy(), {"axes": [0.5, 1], "buttons": [1, 0], "header": {"frame_id": "pad"}})
    assert (list(joy.axes), list(joy.buttons), joy.header.frame_id) == ([0.5, 1.0], [1, 0], "pad")
    assert _filled(SetBool.Request(), {"data": True}).data is True
    assert _filled(String(), {"data": ""}).data == ""


@pytest.mark.parametrize(
    ("message", "content", "said"),
    [
        (Joy(), {"buttons": [1.5]}, "buttons.0 must be a whole number from -2147483648 to"),
        (Joy(), {"buttons": 1}, "buttons must be a list"),
        (Bool(), {"data": 1}, "data must be true or false"),
        (String(), {"data": [1]}, "data must be a text"),
        (Twist(), {"linear": 1}, "linear must be a map"),
    ],
)
def test_a_value_of_another_kind_is_named(message: Any, content: object, said: str) -> None:
    with pytest.raises(RobotFileError) as caught:
        _filled(message, content)
    assert said in str(caught.value)


# --- what takes time ---


class _Work:
    """Something that was begun, and can be ended by the test."""

    def __init__(self) -> None:
        self.tells: list[Callable[[Status], None]] = []
        self.cancelled = 0
        self.alive = True
        self.died = 0
        self.command = LongCommand(self._begin, self._die)

    def tick(self) -> Status:
        self.command.begin_tick()
        return self.command.update()

    def halt(self) -> None:
        self.command.begin_tick()
        self.command.halt()

    def _begin(self, tell: Callable[[Status], None]) -> Running:
        self.tells.append(tell)
        return Running(self._cancel, lambda: self.alive)

    def _cancel(self) -> None:
        self.cancelled += 1

    def _die(self) -> None:
        self.died += 1


def test_it_runs_until_there_is_a_result_and_begins_anew_after_it() -> None:
    work = _Work()
    assert [work.tick(), work.tick()] == [Status.RUNNING] * 2
    work.tells[0](Status.SUCCESS)
    assert work.tick() is Status.SUCCESS
    assert work.tick() is Status.RUNNING
    work.tells[1](Status.FAILURE)
    assert work.tick() is Status.FAILURE
    assert len(work.tells) == 2


def test_a_halt_cancels_it_at_once_and_what_comes_late_has_no_effect() -> None:
    work = _Work()
    work.tick()
    work.halt()
    assert work.cancelled == 1
    work.tells[0](Status.SUCCESS)
    assert work.tick() is Status.RUNNING
    work.halt()
    work.halt()
    assert work.cancelled == 2


def test_a_halt_in_a_tick_that_goes_on_with_it_does_not_cancel() -> None:
    work = _Work()
    work.tick()
    work.command.halt()
    assert work.cancelled == 0
    assert work.tick() is Status.RUNNING


def test_a_server_that_dies_is_a_failure() -> None:
    work = _Work()
    work.tick()
    work.alive = False
    assert work.tick() is Status.FAILURE
    assert work.died == 1


class _Future:
    def __init__(self) -> None:
        self._callbacks: list[Callable[[Any], None]] = []
        self._result: Any = None

    def add_done_callback(self, callback: Callable[[Any], None]) -> None:
        self._callbacks.append(callback)

    def done(self, result: Any) -> None:
        self._result = result
        for one in self._callbacks:
            one(self)

    def cancelled(self) -> bool:
        return False

    def exception(self) -> None:
        return None

    def result(self) -> Any:
        return self._result


class _Server:
    """An action server, and a client of it."""

    def __init__(self, ready: bool = True) -> None:
        self.answer, self.result = _Future(), _Future()
        self.cancelled = 0
        self.ready = ready
        self.told: list[Status] = []
        self.notes: list[str] = []

    def server_is_ready(self) -> bool:
        return self.ready

    def send_goal_async(self, goal: object) -> _Future:
        return self.answer

    def begin(self) -> Running:
        goal = Goal(self, "dock", "/dock", self.notes.append)
        return goal.begin(object(), self.told.append)

    def decide(self, accepted: bool) -> None:
        self.answer.done(
            SimpleNamespace(
                accepted=accepted,
                get_result_async=lambda: self.result,
                cancel_goal_async=self._cancel,
            )
        )

    def _cancel(self) -> None:
        self.cancelled += 1


@pytest.mark.parametrize(("status", "told"), [(4, Status.SUCCESS), (6, Status.FAILURE)])
def test_a_goal_ends_as_its_server_says(status: int, told: Status) -> None:
    server = _Server()
    server.begin()
    server.decide(accepted=True)
    assert server.told == []
    server.result.done(SimpleNamespace(status=status))
    assert server.told == [told]
    assert server.notes == (
        [] if told is Status.SUCCESS else ["'dock' has failed: /dock has not reached the goal"]
    )


def test_a_goal_that_is_rejected_or_has_no_server_has_failed() -> None:
    server = _Server()
    server.begin()
    server.decide(accepted=False)
    assert server.told == [Status.FAILURE]
    assert server.notes == ["'dock' has failed: /dock has rejected the goal"]
    absent = _Server(ready=False)
    absent.begin()
    assert absent.told == [Status.FAILURE]
    assert absent.notes == ["'dock' has failed: there is no action server /dock"]


def test_a_goal_is_cancelled_at_once_or_as_soon_as_it_is_accepted() -> None:
    server = _Server()
    running = server.begin()
    server.decide(accepted=True)
    running.cancel()
    assert server.cancelled == 1
    early = _Server()
    early.begin().cancel()
    early.decide(accepted=True)
    assert early.cancelled == 1
    early.result.done(SimpleNamespace(status=5))
    assert early.notes == []
