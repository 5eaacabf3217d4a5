"""What labels do, by a robot file: messages, service calls and goals."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from py_trees.common import Status
from rclpy.action.client import ActionClient
from rclpy.node import Node
from rclpy.publisher import Publisher

from rebt_ros.errors import MessagePathError
from rebt_ros.live.long_command import NOTHING, LongCommand, Running
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.place import Place
from rebt_ros.robot_file.robot_file import (
    STOP,
    CallCommand,
    Command,
    GoalCommand,
    PublishCommand,
    RobotFile,
)
from rebt_ros.ros.message_types import action_class, message_class, service_class
from rebt_ros.ros.message_values import fill
from rebt_ros.ros.quiet_events import create_publisher
from rebt_ros.ros.topic_names import full_name

#: What action_msgs/msg/GoalStatus calls a goal that was reached.
_SUCCEEDED: Final = 4

_DEPTH: Final = 10

#: Begins a call or a goal; told what to call with its result.
_Begin = Callable[[Callable[[Status], None]], Running]


class RobotCommands:
    """Carries labels out; all is checked, and opened, when it is made.

    Args:
        node: The node.
        robot: The robot file.
        note: Told of calls and goals that fail.

    Raises:
        RobotFileError: A type is not installed or has no such field, or a name is none.
    """

    def __init__(self, node: Node, robot: RobotFile, note: Callable[[str], None]) -> None:
        self._node = node
        self._name = robot.name
        self._note = note
        self._publishers: dict[tuple[str, str], Any] = {}
        self._each_tick: dict[str, Callable[[], None]] = {}
        self._once: dict[str, Callable[[], None]] = {}
        self._long: dict[str, LongCommand] = {}
        self._begins: dict[str, _Begin] = {}
        for label, command in robot.commands.items():
            try:
                self._open(label, command)
            except MessagePathError as err:
                raise RobotFileError(f"{robot.name}: commands.{label}: {err}") from err

    def missing(self, labels: Iterable[str]) -> list[str]:
        """The labels for which there is no command."""
        known = {*self._each_tick, *self._once, *self._long}
        return [label for label in labels if label not in known]

    @property
    def publishers(self) -> Iterable[Publisher]:
        """What publishes messages."""
        return self._publishers.values()

    @property
    def topics(self) -> frozenset[str]:
        """The full names of the topics on which messages are published."""
        return frozenset(str(value.topic_name) for value in self._publishers.values())

    def begin_tick(self) -> None:
        """Must be called before each tick of the tree."""
        for value in self._long.values():
            value.begin_tick()

    def send(self, label: str, *, begins: bool) -> None:
        """Publishes what a label says, if it does.

        Args:
            label: What is commanded.
            begins: Whether it was not what was commanded before.
        """
        if label in self._each_tick:
            self._each_tick[label]()
        elif begins and label in self._once:
            self._once[label]()

    def update(self, label: str) -> Status | None:
        """How it goes with a call or a goal; None where the label is neither."""
        long = self._long.get(label)
        return None if long is None else long.update()

    def halt(self, label: str) -> None:
        """Cancels a call or a goal."""
        if label in self._long:
            self._long[label].halt()

    def stop(self) -> None:
        """Does what is to be done when the tree is halted."""
        for sending in (self._each_tick, self._once):
            if STOP in sending:
                sending[STOP]()
        if STOP in self._begins:
            self._begins[STOP](lambda status: None)

    def _open(self, label: str, command: Command) -> None:
        match command:
            case PublishCommand():
                self._check_name(label, "publish", command.topic)
                send = self._publishing(label, command)
                (self._each_tick if command.each_tick else self._once)[label] = send
            case CallCommand():
                self._check_name(label, "call", command.service)
                self._open_long(label, self._calling(label, command))
            case GoalCommand():
                self._check_name(label, "action", command.server)
                self._open_long(label, self._reaching(label, command))

    def _check_name(self, label: str, part: str, name: str) -> None:
        """Refuses what no topic, service or action server can be called, before it is opened."""
        if full_name(self._node, name) is None:
            raise RobotFileError(
                f"{self._name}: commands.{label}.{part} is {name!r}, which is no name in ROS 2: "
                "it has letters, digits and _ between slashes, such as /cmd_vel."
            )

    def _open_long(self, label: str, begin: _Begin) -> None:
        self._begins[label] = begin
        self._long[label] = LongCommand(
            begin, lambda: self._note(f"what {label!r} waits for is not there any more")
        )

    def _publishing(self, label: str, command: PublishCommand) -> Callable[[], None]:
        kind = message_class(command.kind)
        message = fill(kind(), self._place(label, "message", command.content))
        key = (command.topic, command.kind)
        if key not in self._publishers:
            self._publishers[key] = create_publisher(self._node, kind, command.topic, _DEPTH)
        publisher = self._publishers[key]
        stamped = hasattr(message, "header") and "header" not in command.content

        def publish() -> None:
            if stamped:
                message.header.stamp = self._node.get_clock().now().to_msg()
            publisher.publish(message)

        return publish

    def _calling(self, label: str, command: CallCommand) -> _Begin:
        kind = service_class(command.kind)
        request = fill(kind.Request(), self._place(label, "request", command.content))
        client = self._node.create_client(kind, command.service)

        def begin(tell: Callable[[Status], None]) -> Running:
            if not client.service_is_ready():
                self._note(f"{label!r} has failed: there is no service {command.service}")
                tell(Status.FAILURE)
                return NOTHING
            future = client.call_async(request)
            future.add_done_callback(lambda done: tell(self._answered(label, done)))
            return Running(lambda: client.remove_pending_request(future), client.service_is_ready)

        return begin

    def _answered(self, label: str, done: Any) -> Status:
        response = None if done.cancelled() or done.exception() else done.result()
        if response is None:
            return Status.FAILURE
        if getattr(response, "success", True) is False:
            reason = getattr(response, "message", "") or "it says no more"
            self._note(f"{label!r} has failed: {reason}")
            return Status.FAILURE
        return Status.SUCCESS

    def _reaching(self, label: str, command: GoalCommand) -> _Begin:
        kind = action_class(command.kind)
        goal = fill(kind.Goal(), self._place(label, "goal", command.content))
        client = ActionClient(self._node, kind, command.server)
        return lambda tell: Goal(client, label, command.server, self._note).begin(goal, tell)

    def _place(self, label: str, part: str, content: Any) -> Place:
        return Place(content, self._name, {}, ("commands", label, part))


class Goal:
    """One goal of an action server.

    Args:
        client: Its client.
        label: What the tree calls it.
        server: Name of the server.
        note: Told why it fails.
    """

    def __init__(self, client: Any, label: str, server: str, note: Callable[[str], None]) -> None:
        self._client = client
        self._label = label
        self._server = server
        self._note = note
        self._handle: Any = None
        self._cancelled = False

    def begin(self, goal: Any, tell: Callable[[Status], None]) -> Running:
        """Sends the goal.

        Args:
            goal: The goal.
            tell: Told success or failure, once.
        """
        self._tell = tell
        if not self._client.server_is_ready():
            self._fail(f"there is no action server {self._server}")
            return NOTHING
        self._client.send_goal_async(goal).add_done_callback(self._on_answer)
        return Running(self.cancel, self._client.server_is_ready)

    def cancel(self) -> None:
        """Cancels the goal, at once or as soon as it is accepted."""
        self._cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_answer(self, future: Any) -> None:
        handle = None if future.cancelled() or future.exception() else future.result()
        if handle is None or not handle.accepted:
            self._fail(f"{self._server} has rejected the goal")
            return
        self._handle = handle
        if self._cancelled:
            handle.cancel_goal_async()
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future: Any) -> None:
        result = None if future.cancelled() or future.exception() else future.result()
        if result is not None and result.status == _SUCCEEDED:
            self._tell(Status.SUCCESS)
        else:
            self._fail(f"{self._server} has not reached the goal")

    def _fail(self, why: str) -> None:
        if not self._cancelled:
            self._note(f"{self._label!r} has failed: {why}")
        self._tell(Status.FAILURE)
