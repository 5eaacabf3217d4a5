"""The recorder's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.errors import OptionError
from rebt_ros.robot_file.features import state_topics_of
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.ros.parameters import Parameters, nanoseconds
from rebt_ros.ros.recorder.sending_time import PairBy
from rebt_ros.ros.robot_files import robot_file


@dataclass(frozen=True, slots=True)
class ExecutorTopics:
    """Where the recorder hears what the executor does; empty for nowhere."""

    commands: str
    driving: str


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """What the recorder was started with; durations in nanoseconds."""

    state_topics: tuple[StateTopic, ...]
    action_topics: tuple[str, ...]
    """The channels."""
    robot: RobotFile | None
    """Where features and actions are in messages; None where they are arrays and strings."""
    executor: ExecutorTopics
    demonstrations: Path
    """Directory of the recordings."""
    sample_rate: float | None
    """Rows per second while an action holds; None for a row per action message."""
    recording: bool
    """Record from the start."""
    best_effort: bool
    """Whether states are subscribed to as sensor data are."""
    reorder_window: int
    """How long messages wait for others that belong before them."""
    pair_by: PairBy
    state_wait: int
    """How long an action waits at most for states that were sent before it."""
    sync_period: float
    """Seconds; 0.0 for only when a demonstration ends."""

    @property
    def sources(self) -> tuple[str, ...]:
        """State topics, then action topics."""
        if self.robot is not None:
            return tuple(dict.fromkeys((*self.robot.state_topics, *self.robot.action_topics)))
        return (*(topic.name for topic in self.state_topics), *self.action_topics)


def declare_settings(node: Node) -> RecorderSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    names = declare.texts(
        "state_topics", ["state"], "Float64MultiArray topics, in the order of their features."
    )()
    fields = declare.texts(
        "state_fields",
        [],
        "Names for the values of state topics, such as 'state:front,left,right'. By default, the "
        "layout labels of the messages name them, or else their index.",
    )()
    sample_rate = declare.number(
        "sample_rate",
        0.0,
        "Rows per second while an action holds; 0.0 for one row per action message.",
        0.0,
        1000.0,
    )()
    reliability = declare.text(
        "state_qos",
        "reliable",
        "How to subscribe to states: sensor_data also receives from best-effort publishers.",
        choices=("reliable", "sensor_data"),
    )()
    window = declare.number(
        "reorder_window",
        0.05,
        "How long to wait for messages that arrive out of order (seconds).",
        0.0,
        1.0,
    )()
    state_wait = declare.number(
        "state_wait",
        5.0,
        "Longest time that an action waits for states sent before it, if states have just "
        "stopped arriving (seconds).",
        0.0,
        60.0,
    )()
    pair_by = declare.text(
        "pair_by",
        PairBy.AUTO.value,
        "How to pair an action with a state: by the time they were sent or received. auto: by "
        "the time sent, if all publishers are on this machine.",
        choices=[one.value for one in PairBy],
    )()
    actions = declare.texts(
        "action_topics", ["action"], "String topics of actions; each is a separate channel."
    )()
    robot = robot_file(declare)
    if robot is not None:
        _check_beside(robot, names, fields, actions)
    settings = RecorderSettings(
        state_topics=_state_topics(names, fields) if robot is None else state_topics_of(robot),
        action_topics=actions if robot is None else tuple(robot.actions),
        robot=robot,
        executor=_executor_topics(declare),
        demonstrations=declare.directory(
            "demonstrations",
            "demonstrations",
            "Directory for the recordings; ~ is your home directory.",
        )(),
        sample_rate=sample_rate or None,
        recording=declare.flag("recording", True, "Whether to record from the start.")(),
        best_effort=reliability == "sensor_data",
        reorder_window=nanoseconds(window),
        # A grid of samples, and taking messages as they come, know of the present only.
        pair_by=PairBy.RECEIVED if sample_rate or not window else PairBy(pair_by),
        state_wait=nanoseconds(state_wait),
        sync_period=declare.number(
            "sync_period",
            0.0,
            "Interval for flushing rows to disk, so that they survive a power cut (seconds); 0.0 "
            "to flush only when a demonstration ends.",
            0.0,
            3600.0,
        )(),
    )
    declare.refuse_others()
    return settings


def _check_beside(
    robot: RobotFile, states: Sequence[str], fields: Sequence[str], actions: Sequence[str]
) -> None:
    """Refuses topics beside a robot file, which says itself what they are.

    Raises:
        OptionError: There are some, or the robot file shows no actions.
    """
    if fields or tuple(states) != ("state",) or tuple(actions) != ("action",):
        raise OptionError(
            "parameter 'robot_file' is set, which says what the topics are: leave state_topics, "
            "state_fields and action_topics out."
        )
    if not robot.actions:
        raise OptionError(f"{robot.name} has no part 'actions', so that nothing can be recorded.")


def _executor_topics(declare: Parameters) -> ExecutorTopics:
    return ExecutorTopics(
        commands=declare.text(
            "command_topic",
            "command",
            "String topic of the executor's commands, which give a correction its history. With "
            "several action_topics, there is one topic below it for each. Empty for none.",
        )(),
        driving=declare.text(
            "driving_topic",
            "executor/driving",
            "Bool topic on which the executor says whether it is driving. What a person does "
            "while it drives becomes a separate demonstration. Empty for none.",
        )(),
    )


def _state_topics(names: Sequence[str], fields: Sequence[str]) -> tuple[StateTopic, ...]:
    """The state topics, with their fields where an entry "topic:field,field" gives them."""
    named: dict[str, tuple[str, ...]] = {}
    for entry in fields:
        topic, colon, listed = entry.partition(":")
        parts = tuple(part.strip() for part in listed.split(","))
        if not colon or not all(parts):
            raise OptionError(
                f"parameter 'state_fields' has {entry!r}: write it as 'topic:field,field'."
            )
        if topic not in names or topic in named:
            raise OptionError(
                f"parameter 'state_fields' names {topic!r}, which state_topics "
                f"{'does not name' if topic not in names else 'has fields for already'}."
            )
        named[topic] = parts
    return tuple(StateTopic(name, named.get(name, ())) for name in names)
