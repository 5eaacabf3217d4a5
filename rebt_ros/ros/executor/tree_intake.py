"""Which tree runs: documents are read beside the ticks, and taken once their topics suit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.errors import DocumentError
from rebt_ros.live.background import Background
from rebt_ros.ros.command_channels import CommandChannels
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.executor.driving import Driving
from rebt_ros.ros.executor.preparation import Preparation, UnmeasurableError
from rebt_ros.ros.executor.state_topics import StateTopics
from rebt_ros.ros.executor.tree_program import TreeProgram
from rebt_ros.ros.quiet_events import create_subscription
from rebt_ros.ros.topic_names import check_topics
from rebt_ros.storage.tree_file import read_tree

#: What refused documents are counted as.
REFUSED: Final = "refused trees"

_TREE_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TreeIntake:
    """Takes the trees of a learner, each as soon as its topics send what it reads.

    Args:
        node: The node.
        learner: Whose trees are followed; empty for any.
        preparation: Reads documents.
        topics: What trees read.
        channels: What trees command.
        driving: Runs the tree.
        faults: Told of trees that are refused.
        taken: Called when another tree runs.
    """

    def __init__(
        self,
        node: Node,
        learner: str,
        preparation: Preparation,
        topics: StateTopics,
        channels: CommandChannels,
        driving: Driving,
        faults: Faults,
        taken: Callable[[], None],
    ) -> None:
        self._node = node
        self._preparation = preparation
        self._topics = topics
        self._channels = channels
        self._driving = driving
        self._faults = faults
        self._taken = taken
        self._candidate: TreeProgram | None = None
        self._awaited: frozenset[str] = frozenset()
        self.unusable = ""
        """Why the tree of a file does not run, to end the sentence on waiting for one."""
        self.name = f"{learner}/behavior_tree" if learner else "behavior_tree"
        """Where trees come from, as it was given."""
        ready = node.create_guard_condition(self._take_prepared)
        self._background = Background(preparation.read, ready.trigger)
        self.documents: Subscription = create_subscription(
            node, String, self.name, self._on_document, _TREE_QOS
        )
        """What hears them."""

    def open(self, path: Path) -> None:
        """Runs the tree of a file.

        A tree that tests texts is a sound one, though not for topics of numbers: another one may
        come, and until then whoever sends states finds the executor and is told what is wrong.

        Raises:
            DocumentError: It cannot be run here.
        """
        learned = read_tree(path)
        try:
            program = self._preparation.program(learned, dumps(learned))
        except UnmeasurableError as err:
            self.unusable = f": {path} is not run: {str(err).rstrip('.')}"
            self._awaited = err.topics
            self._follow()
            self._node.get_logger().warning(f"waiting for a tree{self.unusable}.")
            return
        self._check_topics(program)
        self._install(program)

    def try_candidate(self) -> None:
        """Takes the next tree into use, unless its topics do not suit or have to show it yet."""
        candidate = self._candidate
        if candidate is None:
            return
        if self._driving.program is not None:
            misfit = self._topics.misfit(candidate)
            if misfit:
                self._discard_candidate()
                self._refuse(f"{misfit}.")
                self._follow()
                return
            if self._topics.unheard(candidate):
                return
        self._candidate = None
        self._install(candidate)
        self._taken()

    @property
    def awaited(self) -> list[str] | None:
        """The topics that the next tree still waits for; None if there is no next tree."""
        return None if self._candidate is None else self._topics.unheard(self._candidate)

    def close(self) -> None:
        """Reads no more."""
        self._background.close()

    def _on_document(self, message: String) -> None:
        # Reading may take longer than a tick.
        self._background.put(message.data)

    def _take_prepared(self) -> None:
        running = self._driving.program
        for prepared in self._background.take():
            if isinstance(prepared, DocumentError):
                self._refuse(str(prepared))
            elif running is not None and prepared.document == running.document:
                # It stays, whatever came in between.
                self._discard_candidate()
                self._follow()
                self._preparation.retire(prepared)
            else:
                self._propose(prepared)
        self.try_candidate()

    def _propose(self, program: TreeProgram) -> None:
        """Makes a program the candidate, if there can be topics of the names in it."""
        try:
            self._check_topics(program)
        except DocumentError as err:
            self._preparation.retire(program)
            self._refuse(str(err))
            return
        self._discard_candidate()
        self._candidate = program
        self._follow()

    def _check_topics(self, program: TreeProgram) -> None:
        """Looks whether a program can have its topics.

        Raises:
            DocumentError: It cannot.
        """
        commands = self._channels.topics_of(program.channels)
        check_topics(self._node, () if program.learned.robot else program.inputs.topics, commands)
        self._topics.bind(program)

    def _refuse(self, why: str) -> None:
        running = self._driving.program is not None
        kept = "the tree before it stays" if running else "there is no tree yet"
        self._faults.note(REFUSED, f"a behavior tree was refused ({kept}): {why}", severe=True)

    def _discard_candidate(self) -> None:
        if self._candidate is not None:
            self._preparation.retire(self._candidate)
            self._candidate = None

    def _install(self, program: TreeProgram) -> None:
        before = self._driving.take(program)
        if before is not None:
            self._preparation.retire(before)
        self._follow()
        self._node.get_logger().info(
            f"running a tree of {nodes.size(program.learned.tree)} nodes that reads "
            f"{', '.join(program.inputs.topics) or 'no state'}."
        )

    def _follow(self) -> None:
        self._topics.follow(self._driving.program, self._candidate, self._awaited)
