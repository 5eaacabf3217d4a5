"""Labels that are goals of a real action server: reached, cancelled, rejected, aborted, lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import robot_bags as some
from geometry_msgs.msg import Twist
from rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future
from ros_processes import NodeProcess, Peer, values_of
from std_msgs.msg import String
from test_msgs.action import Fibonacci

import rebt_ros
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions

ROBOT = """\
state: {ahead: {path: "/scan.ranges[-30deg:30deg].@min", max_age: 600}}
actions: {action: /action.data}
commands:
  dock: {action: /dock, type: test_msgs/action/Fibonacci, goal: {order: 7}}
  go: {publish: /cmd_vel, type: geometry_msgs/msg/Twist, message: {linear: {x: 0.25}}}
"""

NEAR, FAR = some.scan(0.5), some.scan(4.0)


class Dock:
    """An action server: each goal runs until the test ends it."""

    def __init__(self, peer: Peer) -> None:
        self.orders: list[int] = []
        self.cancelled = 0
        self.accepts = True
        self._ended: Any = Future()
        self.server = ActionServer(
            peer.node,
            Fibonacci,
            "/dock",
            self._execute,
            goal_callback=self._decide,
            cancel_callback=self._cancel,
        )

    def end(self, how: str) -> None:
        """Ends the goal: "succeed" or "abort"."""
        self._ended.set_result(how)

    def _decide(self, goal: Fibonacci.Goal) -> GoalResponse:
        self.orders.append(goal.order)
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    def _cancel(self, handle: object) -> CancelResponse:
        self.cancelled += 1
        self.end("canceled")
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Fibonacci.Result:
        how = await self._ended
        self._ended = Future()
        getattr(handle, how)()
        return Fibonacci.Result()


@contextmanager
def _driving(domain: int, directory: Path, **parameters: object) -> Iterator[NodeProcess]:
    """An executor that ticks on each scan, and docks where something is near."""
    messages: list[tuple[int, str, Any]] = []
    for number in range(24):
        near = number % 2 == 1
        messages.append((2 * number, "/scan", NEAR if near else FAR))
        messages.append((2 * number + 1, "/action", String(data="dock" if near else "go")))
    bag = some.write_bag(directory / "bag", messages)
    reading = InputOptions(robot=parse_robot_file(ROBOT))
    (directory / "tree.json").write_text(dumps(rebt_ros.learn(bag, reading=reading).learned))
    (directory / "robot.yaml").write_text(ROBOT)
    its = {"robot_file": "robot.yaml", "tree_file": "tree.json", "enabled": True, "rate": 0.1}
    with NodeProcess(
        "executor_node", domain, directory, its | {"tick_on": "state"} | parameters
    ) as executor:
        yield executor
        assert executor.stop() == 0
        assert "Traceback" not in executor.stderr


def _said(peer: Peer, executor: NodeProcess, part: str) -> None:
    """Waits until the executor has said something; something is near meanwhile."""

    def says() -> bool:
        peer.publish(NEAR, "/scan")
        return part in executor.stderr

    peer.wait_until(says, what=part)


def _docking(peer: Peer, dock: Dock) -> None:
    """Waits until the executor has sent a goal."""

    def sent() -> bool:
        peer.publish(NEAR, "/scan")
        peer.spin_once()
        return bool(dock.orders)

    peer.wait_until(sent, what="a goal")


def test_a_goal_is_cancelled_in_the_tick_in_which_another_branch_takes_over(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    dock = Dock(peer)
    with _driving(domain, tmp_path):
        velocities = peer.listen(Twist, "/cmd_vel")
        _docking(peer, dock)
        assert dock.orders == [7]
        assert velocities == []
        # The next tick of the timer is ten seconds away.
        peer.publish(FAR, "/scan")
        peer.wait_until(lambda: dock.cancelled and velocities, what="a cancellation")
        assert velocities[0].linear.x == 0.25
        assert (dock.cancelled, dock.orders) == (1, [7])


def test_a_goal_is_cancelled_without_a_tick_when_the_tree_is_halted(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    dock = Dock(peer)
    with _driving(domain, tmp_path):
        _docking(peer, dock)
        assert peer.call("/executor/enable", False).success
        peer.wait_until(lambda: dock.cancelled, what="a cancellation")
        ticks = values_of(peer.wait_until(peer.anew("executor: execution")))["ticks"]
        assert dock.orders == [7]
        # It begins anew when the tree does.
        assert peer.call("/executor/enable", True).success
        peer.wait_until(
            lambda: (peer.publish(NEAR, "/scan"), len(dock.orders) == 2)[1], what="a second goal"
        )
        status = peer.wait_until(peer.anew("executor: execution"))
        assert int(values_of(status)["ticks"]) > int(ticks)


def test_a_goal_that_was_reached_is_sent_anew_and_one_that_was_aborted_is_told(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    dock = Dock(peer)
    with _driving(domain, tmp_path) as executor:
        _docking(peer, dock)
        dock.end("succeed")
        peer.wait_until(
            lambda: (peer.publish(NEAR, "/scan"), len(dock.orders) == 2)[1], what="a second goal"
        )
        dock.end("abort")
        _said(peer, executor, "'dock' has failed: /dock has not reached the goal")
        assert dock.cancelled == 0


def test_a_goal_that_is_rejected_is_a_failure_that_is_told(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    dock = Dock(peer)
    dock.accepts = False
    with _driving(domain, tmp_path) as executor:
        _said(peer, executor, "'dock' has failed: /dock has rejected the goal")
        assert dock.cancelled == 0


def test_a_server_that_dies_is_told_and_one_that_comes_back_is_used(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    first = Dock(peer)
    with _driving(domain, tmp_path) as executor:
        _docking(peer, first)
        first.server.destroy()
        _said(peer, executor, "what 'dock' waits for is not there any more")
        second = Dock(peer)
        _docking(peer, second)
        assert first.orders == [7]
