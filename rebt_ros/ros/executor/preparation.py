"""Makes trees ready to be run, beside the ticks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import loads
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree, unmeasurable
from rebt_ros.behavior_tree.novelty import NoveltyDetector
from rebt_ros.behavior_tree.runtime import Commander, TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.errors import DocumentError
from rebt_ros.export.watched import WatchedTree, watched
from rebt_ros.live.tree_inputs import TreeInputs
from rebt_ros.ros.command_channels import topic_of
from rebt_ros.ros.executor.settings import ExecutorSettings
from rebt_ros.ros.executor.tree_program import TreeProgram, channels_of


class UnmeasurableError(DocumentError):
    """A tree tests texts, which no message of numbers has.

    Args:
        sentence: Which ones.
        topics: The state topics that it reads.
    """

    def __init__(self, sentence: str, topics: Iterable[str]) -> None:
        super().__init__(sentence)
        self.topics = frozenset(topics)


class Preparation:
    """Makes programs; may be used in any thread, one at a time, and `retire` at any time.

    Args:
        settings: The executor's parameters.
        commander: Carries out the actions.
        histories: What was taken on each channel, by whatever tree or person; channels are added.
        check: Raises DocumentError for trees that are not to run.
    """

    def __init__(
        self,
        settings: ExecutorSettings,
        commander: Commander,
        histories: dict[str, ActionHistory],
        check: Callable[[LearnedTree], None],
    ) -> None:
        self._settings = settings
        self._commander = commander
        self._histories = histories
        self._retired: deque[TreeProgram] = deque()
        self._check = check

    def retire(self, program: TreeProgram) -> None:
        """Has the next call of `read` take a program apart that is not needed any more."""
        self._retired.append(program)

    def read(self, document: str) -> TreeProgram | DocumentError:
        """The program of a document, or why there is none; never raises."""
        while self._retired:
            self._retired.popleft().runtime.dismantle()
        return _refusal_or(lambda: self.program(loads(document), document))

    def program(self, learned: LearnedTree, document: str) -> TreeProgram:
        """The program of a tree.

        Raises:
            DocumentError: It cannot be run here.
            UnmeasurableError: It could be, did it not test texts.
        """
        _check_channels(learned)
        self._check(learned)
        topic = self._settings.state_topic
        inputs = TreeInputs(learned, topic, self._settings.state_timeout)
        for one in inputs.topics:
            try:
                validate_topic_name(one)
            except InvalidTopicNameException as err:
                raise DocumentError(
                    f"the tree reads the state topic {one!r}, which is no name of a topic."
                ) from err
        _check_measurable(learned, inputs.topics)
        histories = {
            channel: self._histories.setdefault(channel, ActionHistory())
            for channel in channels_of(learned)
        }
        return TreeProgram(
            document,
            fingerprint(document),
            TreeRuntime(learned, self._commander, executable(learned.tree), histories),
            inputs,
            NoveltyDetector(learned, inputs.topics, topic, self._settings.novelty.margin),
            _watched(learned) if self._settings.watching.watched else None,
        )


def _watched(learned: LearnedTree) -> WatchedTree | None:
    try:
        return watched(learned)
    except DocumentError:
        return None


def _check_channels(learned: LearnedTree) -> None:
    commanded = {action.channel for action in nodes.actions(learned.tree)}
    if commanded != set(nodes.policies(learned.tree)):
        raise DocumentError(
            f"the tree mixes the channels {', '.join(sorted(commanded))} in one policy: "
            "put the policies of several channels side by side under a Parallel."
        )
    channels = channels_of(learned)
    for channel in channels:
        topic_of("command", channel, channels)


def _check_measurable(learned: LearnedTree, topics: Iterable[str]) -> None:
    for feature in unmeasurable(learned):
        raise UnmeasurableError(
            f"the tree tests {feature.name!r} for texts ({feature.examples}), which "
            "no state topic can carry; learn from numbers, such as 0, 1 and 2.",
            topics,
        )


def _refusal_or(make: Callable[[], TreeProgram]) -> TreeProgram | DocumentError:
    try:
        return make()
    except DocumentError as err:
        # Without the traceback, which keeps the whole document in memory.
        return DocumentError(str(err))
    except Exception as err:
        # Whatever a document does to the one that reads it, the robot's tree goes on.
        return DocumentError(
            f"it cannot be read, which is a mistake in rebt_ros ({type(err).__name__}): "
            "please report it, with the document."
        )
