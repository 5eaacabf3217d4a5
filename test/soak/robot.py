"""A robot as a process: publishes states and actions at steady rates, and notes every command.

The state changes once per block of states, and in the middle of each block the demonstrator takes
the action that its state asks for.  So every row of a recording can be judged by itself: all
values follow from the first one, the action follows from the values, and no block is there twice.

It reads lines from standard input: ``pause``, ``resume``; it ends when that is closed.
"""

from __future__ import annotations

import contextlib
import json
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray, String

#: Values of a state.
WIDTH: Final = 24
#: States of one block.
BLOCK: Final = 10
#: What the demonstrator does, and the robot is commanded.
LABELS: Final = ("go", "turn")

_QUEUE: Final = QoSProfile(depth=1000)


def state_of(block: int) -> tuple[float, ...]:
    """The state of a block, values in [0, 1)."""
    return values_from((block * 2654435761 % 2**32) / 2**32)


def values_from(first: float) -> tuple[float, ...]:
    """All values of the state that begins with this one."""
    return tuple(first * (place + 1) % 1.0 for place in range(WIDTH))


def action_in(state: Sequence[float]) -> str:
    """What the demonstrator does in a state."""
    return LABELS[0] if state[0] <= 0.5 else LABELS[1]


class Robot(Node):
    """Publishes on a timer of its own thread, so that neither waits for the other."""

    def __init__(self, log: Path) -> None:
        super().__init__("robot")
        self._states = self.create_publisher(Float64MultiArray, "state", _QUEUE)
        self._actions = self.create_publisher(String, "action", _QUEUE)
        self._log = log.open("w", encoding="utf-8", buffering=1)
        self.create_subscription(String, "command", self._on_command, _QUEUE)
        self.paused = threading.Event()
        self.states = self.actions = 0

    def publish_state(self) -> None:
        """The next state, and the action in the middle of a block."""
        state = state_of(self.states // BLOCK)
        self._states.publish(Float64MultiArray(data=state))
        if self.states % BLOCK == BLOCK // 2:
            self._actions.publish(String(data=action_in(state)))
            self.actions += 1
        self.states += 1

    def _on_command(self, message: String, info: dict[str, Any]) -> None:
        # When it was sent: the middleware may deliver it later.
        self._log.write(f"{info['source_timestamp'] / 1e9:.6f} {message.data}\n")


def _run(robot: Robot, rate: float, ended: threading.Event) -> None:
    following = time.monotonic()
    while not ended.is_set():
        if robot.paused.is_set():
            time.sleep(0.01)
            following = time.monotonic()
            continue
        robot.publish_state()
        following += 1 / rate
        # After a late start it catches up, but no longer than for a second.
        following = max(following, time.monotonic() - 1.0)
        time.sleep(max(0.0, following - time.monotonic()))


def _spin(executor: SingleThreadedExecutor) -> None:
    with contextlib.suppress(ExternalShutdownException):
        executor.spin()


def main() -> None:
    """Arguments: the log of commands, states per second."""
    log, rate = Path(sys.argv[1]), float(sys.argv[2])
    rclpy.init(args=[])
    robot = Robot(log)
    executor = SingleThreadedExecutor()
    executor.add_node(robot)
    ended = threading.Event()
    threads = [
        threading.Thread(target=_run, args=(robot, rate, ended)),
        threading.Thread(target=_spin, args=(executor,)),
    ]
    for thread in threads:
        thread.start()
    for line in sys.stdin:
        match line.strip():
            case "pause":
                robot.paused.set()
            case "resume":
                robot.paused.clear()
    ended.set()
    threads[0].join()
    # What was sent arrives.
    time.sleep(0.5)
    print(json.dumps({"states": robot.states, "actions": robot.actions}), flush=True)
    rclpy.try_shutdown()
    threads[1].join()


if __name__ == "__main__":
    main()
