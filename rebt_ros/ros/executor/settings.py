"""The executor's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from rebt_ros.errors import OptionError
from rebt_ros.live.novelty_guard import Novelty
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.ros.parameters import Parameters, at_home, nanoseconds
from rebt_ros.ros.robot_files import robot_file


@dataclass(frozen=True, slots=True)
class TakeoverSettings:
    """How a person takes over."""

    topics: tuple[str, ...]
    timeout: int
    """How long the tree rests after a message of the person, nanoseconds; 0: nobody can."""


@dataclass(frozen=True, slots=True)
class NoveltySettings:
    """What is done about states outside what was shown."""

    mode: Novelty
    margin: float
    """In shares of all that was shown of a feature."""


@dataclass(frozen=True, slots=True)
class WatchingSettings:
    """Who watches the tree while it runs."""

    groot2_port: int
    """Where Groot2's monitor is answered on this machine; 0 for nowhere."""
    btlog_directory: Path | None
    """Where a log of each tree is written; None for nowhere."""
    topics: bool
    """Whether the tree's XML and the statuses of its nodes are published."""

    @property
    def watched(self) -> bool:
        """Whether there is anyone."""
        return bool(self.groot2_port) or self.btlog_directory is not None or self.topics


@dataclass(frozen=True, slots=True)
class ExecutorSettings:
    """What the executor was started with; durations in nanoseconds."""

    tree_file: Path | None
    robot: RobotFile | None
    """What labels do; None where they are only sent."""
    rules_file: Path | None
    """Rules that every tree must keep."""
    learner: str
    """Node whose trees are followed; empty for any."""
    rate: float
    """Ticks per second."""
    tick_on_state: bool
    """Whether a state is ticked on when it arrives; `rate` is then that of ticks without one."""
    state_timeout: int
    state_topic: str
    every_tick: bool
    """Whether a command is sent at every tick, or only when it changes."""
    enabled: bool
    action_result_topic: str
    halt_action: str
    """Empty for none."""
    takeover: TakeoverSettings
    novelty: NoveltySettings
    watching: WatchingSettings


def declare_settings(node: Node) -> ExecutorSettings:
    """Declares and reads the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    tree_file = declare.text(
        "tree_file", "", "Behavior tree document to start with; empty for none."
    )()
    rules_file = declare.text(
        "rules_file",
        "",
        "Rules file (docs/rules.md): a tree is accepted only if it is proven to keep these "
        "rules. Empty for none.",
    )()
    learner = declare.text(
        "learner",
        "",
        "Learner to follow, such as /robot/learner, if there are several; empty to follow every "
        "publisher of behavior_tree.",
    )().rstrip("/")
    rate = declare.number(
        "rate",
        20.0,
        "Ticks per second. If the tree has lagged features, use the recording's sample rate.",
        0.1,
        1000.0,
    )()
    state_timeout = declare.number(
        "state_timeout", 0.5, "How long a state message stays valid (seconds).", 0.001, 3600.0
    )()
    publish = declare.text(
        "publish",
        "every_tick",
        "When to send the command: at every tick, or only when it changes.",
        choices=("every_tick", "on_change"),
    )()
    tick_on = declare.text(
        "tick_on",
        "timer",
        "When to tick: timer, or state to tick when a state message arrives, and at the rate "
        "while none arrives.",
        choices=("timer", "state"),
    )()
    if learner:
        _check_node(learner)
    settings = ExecutorSettings(
        tree_file=at_home("tree_file", tree_file) if tree_file else None,
        robot=robot_file(declare),
        rules_file=at_home("rules_file", rules_file) if rules_file else None,
        learner=learner,
        rate=rate,
        tick_on_state=tick_on == "state",
        state_timeout=nanoseconds(state_timeout),
        state_topic=declare.text(
            "state_topic", "state", "State topic for a tree learned from a table."
        )(),
        every_tick=publish == "every_tick",
        enabled=declare.flag("enabled", False, "Command the robot from the start; see ~/enable.")(),
        action_result_topic=declare.text(
            "action_result_topic",
            "",
            "String topic that reports 'success' or 'failure' (or 'label:success') when an "
            "action ends. If empty, an action counts as done once its command is sent.",
        )(),
        halt_action=declare.text(
            "halt_action",
            "",
            "Command to send once when the tree is halted, such as 'stop'; empty for none.",
        )(),
        takeover=_takeover(declare),
        novelty=_novelty(declare),
        watching=_watching(declare),
    )
    declare.refuse_others()
    return settings


def _check_node(name: str) -> None:
    try:
        validate_topic_name(name)
    except InvalidTopicNameException as err:
        raise OptionError(
            f"parameter 'learner' is {name!r}, which is no name of a node: name it as "
            "'ros2 node list' does, such as /robot/learner."
        ) from err


def _takeover(declare: Parameters) -> TakeoverSettings:
    topics = declare.texts(
        "takeover_topics",
        ["action"],
        "String topics on which a person takes over. The channel of the same name continues with "
        "the history that they give.",
    )()
    timeout = declare.number(
        "takeover_timeout",
        1.0,
        "How long the tree pauses after a person's last message (seconds); 0.0 to disable "
        "takeovers.",
        0.0,
        3600.0,
    )()
    return TakeoverSettings(topics if timeout else (), nanoseconds(timeout))


def _novelty(declare: Parameters) -> NoveltySettings:
    mode = declare.text(
        "novelty",
        Novelty.WARN.value,
        "What to do in a state unlike any that was shown; hold halts the tree until a person "
        "takes over.",
        choices=[one.value for one in Novelty],
    )()
    margin = declare.number(
        "novelty_margin",
        0.1,
        "How far a feature may lie outside the range shown in similar states, as a share of its "
        "whole range.",
        0.0,
        100.0,
    )()
    return NoveltySettings(Novelty(mode), margin)


def _watching(declare: Parameters) -> WatchingSettings:
    port = declare.integer(
        "groot2_port",
        0,
        "TCP port, such as 1667, on which Groot2 on this machine can monitor the tree; 0 for none.",
        0,
        65535,
    )()
    directory = declare.text(
        "btlog_directory",
        "",
        "Directory for .btlog files, one per tree, which Groot2 can replay; empty for none.",
    )()
    topics = declare.flag(
        "status_topics",
        False,
        "Publish the tree as XML on ~/tree_xml and, if nav2_msgs is installed, the statuses of "
        "its nodes on ~/behavior_tree_log, for example for Foxglove.",
    )()
    return WatchingSettings(
        port, at_home("btlog_directory", directory) if directory else None, topics
    )
