"""The topics that trees read: plain ones of numbers, and those of a robot file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from functools import partial
from typing import Final

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import Float64MultiArray

from rebt_ros.demonstration.builder import BadMessageError
from rebt_ros.demonstration.fields import names_of, values_of
from rebt_ros.errors import DocumentError, RebtError
from rebt_ros.live.tree_inputs import Message
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.executor.robot_inputs import RobotInputs
from rebt_ros.ros.executor.tree_program import TreeProgram
from rebt_ros.ros.graph_watch import Finding
from rebt_ros.ros.quiet_events import create_subscription

#: The newest state only; best effort hears reliable publishers as well.
_STATE_QOS: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class StateTopics:
    """Subscribes to what the running tree and the next one read, and hands it to the running one.

    Args:
        node: The node.
        now: Tells the time, nanoseconds.
        faults: Told of messages that a tree cannot use.
        heard: Told the topic of each message, and the tree that reads it where no other one does.
    """

    def __init__(
        self,
        node: Node,
        now: Callable[[], int],
        faults: Faults,
        heard: Callable[[str, TreeProgram | None], None],
    ) -> None:
        self._node = node
        self._now = now
        self._faults = faults
        self._heard = heard
        self._running: TreeProgram | None = None
        self._latest: dict[str, Message] = {}
        self._plain: dict[str, Subscription] = {}
        self._robots: dict[TreeProgram, RobotInputs] = {}

    def bind(self, program: TreeProgram) -> None:
        """Opens what a tree reads in messages of the robot's own types.

        Raises:
            DocumentError: Its robot file does not fit the installed types.
        """
        robot = program.learned.robot
        if robot is None or program in self._robots:
            return
        try:
            self._robots[program] = RobotInputs(
                self._node,
                robot,
                program.learned.features,
                program.inputs,
                self._now,
                lambda topic: self._heard(topic, program),
            )
        except RebtError as err:
            raise DocumentError(str(err)) from err

    def follow(
        self,
        running: TreeProgram | None,
        candidate: TreeProgram | None,
        awaited: Collection[str] = (),
    ) -> None:
        """Listens to what these trees read, and to nothing else.

        Args:
            running: What takes the messages.
            candidate: The next tree, of whose topics it is to be known what they send.
            awaited: Topics to listen to while there is no tree.
        """
        begins, self._running = running is not self._running, running
        programs = [program for program in (running, candidate) if program is not None]
        for program in self._robots.keys() - set(programs):
            self._robots.pop(program).close()
        plain = [program for program in programs if program not in self._robots]
        topics = {topic for program in plain for topic in program.inputs.topics}
        if not programs:
            topics |= set(awaited)
        for topic in self._plain.keys() - topics:
            self._node.destroy_subscription(self._plain.pop(topic))
            self._latest.pop(topic, None)
        for topic in sorted(topics - self._plain.keys()):
            on_state = partial(self._on_state, topic)
            self._plain[topic] = create_subscription(
                self._node, Float64MultiArray, topic, on_state, _STATE_QOS
            )
        if begins:
            for topic in self._latest:
                self._accept(topic, quietly=True)

    @property
    def subscriptions(self) -> Iterable[Subscription]:
        """Those of plain topics."""
        return self._plain.values()

    def unheard(self, program: TreeProgram) -> list[str]:
        """The topics of a tree on which no message came yet."""
        if program in self._robots:
            return self._robots[program].unheard
        return [topic for topic in program.inputs.topics if topic not in self._latest]

    def misfit(self, program: TreeProgram) -> str:
        """Which of the latest messages lacks values that a tree reads, in words; empty for none."""
        return program.inputs.misfit(self._latest)

    def look(self) -> list[Finding]:
        """Looks at who publishes; see `RobotTopics.look`."""
        return [finding for robot in self._robots.values() for finding in robot.look()]

    def forget(self) -> None:
        """Forgets all messages."""
        self._latest.clear()

    def _on_state(self, topic: str, message: Float64MultiArray) -> None:
        # A message may still come on a topic that no tree reads any longer.
        if topic not in self._plain:
            return
        self._latest[topic] = Message(values_of(message), self._now(), names_of(message))
        self._accept(topic)
        self._heard(topic, None)

    def _accept(self, topic: str, *, quietly: bool = False) -> None:
        running = self._running
        if running is None or running in self._robots or topic not in running.inputs.topics:
            return
        try:
            running.inputs.accept(topic, self._latest[topic])
        except BadMessageError as err:
            if not quietly:
                self._faults.note(err.fault.value, str(err))
