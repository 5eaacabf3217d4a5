"""What the studio hears of the robot and of the other nodes."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import Bool, Float64MultiArray, String

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.schema import FeatureKind, sources
from rebt_ros.errors import RebtError
from rebt_ros.robot_file.binding import BoundTopic
from rebt_ros.robot_file.features import FeatureReader
from rebt_ros.ros.diagnostics import Faults
from rebt_ros.ros.robot_files import RobotTopics
from rebt_ros.ros.studio.settings import StudioSettings
from rebt_ros.ros.topic_names import check_topics
from rebt_ros.studio.board import Board, Section
from rebt_ros.studio.timeline import EventKind, Moment, Timeline

#: Who subscribes later gets the latest one, too.
_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Hears reliable publishers and others.
_STATE_QOS: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

#: How often values are shown (seconds).
_PERIOD: Final = 0.1
#: Between two looks at who publishes (seconds).
_LOOK_PERIOD: Final = 0.5
#: A node that says nothing for so long is gone (seconds).
_SILENCE: Final = 4.0
#: A person's action that was said again and again has ended after so much silence (seconds).
_HELD: Final = 1.0

_LEVELS: Final = {
    DiagnosticStatus.OK: "OK",
    DiagnosticStatus.WARN: "WARN",
    DiagnosticStatus.ERROR: "ERROR",
}


class RobotWatch:
    """Subscribes to what happens, and shows it on the board.

    Args:
        node: The studio's.
        settings: Its parameters.
        board: Where it shows.
        timeline: What is kept of it.
        published: Told each document that is published; returns its tree.
    """

    def __init__(
        self,
        node: Node,
        settings: StudioSettings,
        board: Board,
        timeline: Timeline,
        published: Callable[[str], LearnedTree],
    ) -> None:
        self._node = node
        self._settings = settings
        self._board = board
        self._timeline = timeline
        self._published = published
        self._faults = Faults(node.get_logger())
        self._values: dict[str, float | str | None] = {}
        self._commands: dict[str, str] = {}
        self._persons: dict[str, str] = {}
        self._said: dict[str, float] = {}
        self._said_again: set[str] = set()
        self._statuses: tuple[str, ...] = ()
        self._document = ""
        self._heard: dict[str, float] = {}
        self._states: list[Subscription] = []
        self._robot: RobotTopics | None = None
        self._names = {
            self._full(getattr(settings, role)): role
            for role in ("executor", "recorder", "learner")
        }
        executor = settings.executor
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_report, 100)
        node.create_subscription(String, "behavior_tree", self._on_tree, _LATCHED)
        node.create_subscription(String, f"{executor}/snapshot", self._on_snapshot, 10)
        node.create_subscription(Bool, f"{executor}/driving", self._on_driving, _LATCHED)
        for topic in settings.action_topics:
            node.create_subscription(String, topic, partial(self._on_person, topic), 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_PERIOD, self._show, clock=steady)
        node.create_timer(_LOOK_PERIOD, self._look, clock=steady)
        for role in self._names.values():
            board.update(Section.NODES, {role: _absent(role)})
        board.replace(Section.ACTIONS, {})

    def know_actions(self, labels: dict[str, str]) -> None:
        """Adds labels that can be commanded by hand, with their channels."""
        topics = {topic.strip("/"): topic for topic in self._settings.action_topics}
        fallback = self._settings.action_topics[0] if self._settings.action_topics else "action"
        self._board.update(
            Section.ACTIONS,
            {
                label: {"channel": channel, "topic": topics.get(channel.strip("/"), fallback)}
                for label, channel in labels.items()
            },
        )

    # --- what comes in ---

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            role = self._names.get("/" + status.hardware_id.lstrip("/"))
            if role is None:
                continue
            self._heard[role] = time.monotonic()
            level = _LEVELS.get(status.level, "ERROR")
            report = {
                "there": True,
                "level": level,
                "message": status.message,
                "values": {value.key: value.value for value in status.values},
            }
            self._board.update(Section.NODES, {role: report})

    def _on_tree(self, message: String) -> None:
        try:
            learned = self._published(message.data)
        except RebtError as err:
            self._faults.note("documents", f"a published tree cannot be shown: {err}")
            return
        self._follow(learned)
        self.know_actions({action.label: action.channel for action in learned.actions})
        size = nodes.size(learned.tree)
        self._event(EventKind.TREE, f"a tree of {size} nodes was published")

    def _on_snapshot(self, message: String) -> None:
        try:
            snapshot = json.loads(message.data)
            run = {name: snapshot[name] for name in ("condition", "status", "tip", "document")}
            commands = {
                str(key): str(value)
                for key, value in snapshot["commands"].items()
                if value is not None
            }
            statuses = tuple(map(str, snapshot["nodes"]))
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self._faults.note("snapshots", "a snapshot of the executor cannot be read.")
            return
        self._document, self._statuses = str(run["document"]), statuses
        for channel, label in commands.items():
            if self._commands.get(channel) != label:
                self._event(EventKind.COMMAND, label, channel)
        self._commands = commands
        run |= {"commands": commands, "statuses": list(statuses)}
        self._board.update(Section.RUN, run)
        self._note()

    def _on_driving(self, message: Bool) -> None:
        # One that was started again says so once, maybe before its first report: it must not be
        # forgotten with the silence of the one before.
        if "executor" in self._heard:
            self._heard["executor"] = time.monotonic()
        if self._board.section(Section.RUN).get("driving") == message.data:
            return
        self._board.update(Section.RUN, {"driving": message.data})
        text = "the tree drives" if message.data else "the tree rests"
        self._event(EventKind.DRIVING, text)

    def _on_person(self, channel: str, message: String) -> None:
        self.know_actions({message.data: channel} if message.data else {})
        now = time.monotonic()
        if self._persons.get(channel) == message.data and now - self._said[channel] <= _HELD:
            self._said_again.add(channel)
        else:
            self._said_again.discard(channel)
        self._said[channel] = now
        if self._persons.get(channel) != message.data:
            self._persons[channel] = message.data
            self._event(EventKind.PERSON, message.data or "nothing", channel)

    def _on_state(self, names: dict[int, str], message: Float64MultiArray) -> None:
        for index, value in enumerate(message.data):
            if index in names:
                self._values[names[index]] = value if math.isfinite(value) else None

    # --- the state ---

    def _follow(self, learned: LearnedTree) -> None:
        """Subscribes to the features of a tree."""
        for subscription in self._states:
            self._node.destroy_subscription(subscription)
        self._states.clear()
        if self._robot is not None:
            self._robot.close()
            self._robot = None
        self._values = {}
        if learned.robot is not None:
            try:
                self._robot = RobotTopics(
                    self._node, learned.robot, learned.robot.state_topics, 1, self._reading
                )
            except RebtError as err:
                self._faults.note("robot files", f"the state cannot be shown: {err}")
            return
        topics: dict[str, dict[int, str]] = {}
        carried = sources(learned.features, self._settings.state_topic)
        for feature, source in zip(learned.features, carried, strict=True):
            if not feature.lag:
                topics.setdefault(source.topic, {})[source.index] = feature.name
        try:
            check_topics(self._node, topics, ())
        except RebtError as err:
            self._faults.note("documents", f"the state cannot be shown: {err}")
            return
        self._states = [
            self._node.create_subscription(
                Float64MultiArray, topic, partial(self._on_state, names), _STATE_QOS
            )
            for topic, names in topics.items()
        ]

    def _reading(self, bound: BoundTopic) -> Callable[..., None]:
        """Takes the messages of a topic that a robot file is about."""
        categories: dict[str, Categories] = {}
        reader = FeatureReader(bound, categories)
        kinds = {feature.name: feature.kind for feature in bound.features}

        def take(message: Any) -> None:
            values = reader.read(message, time.monotonic_ns())
            for name, value in zip(reader.names, values, strict=True):
                if not math.isfinite(value):
                    self._values[name] = None
                elif kinds[name] is FeatureKind.CATEGORICAL:
                    self._values[name] = categories[name].names[int(value)]
                else:
                    self._values[name] = value

        return take

    # --- what is shown ---

    def _look(self) -> None:
        """Looks for publishers of what a robot file names."""
        if self._robot is not None:
            self._robot.look()

    def _show(self) -> None:
        """Shows the newest values, and who has fallen silent."""
        if self._values:
            shown = {name: value for name, value in self._values.items() if value is not None}
            if shown != self._board.section(Section.VALUES):
                self._board.replace(Section.VALUES, shown)
                self._note()
        now = time.monotonic()
        self._end_persons_actions(now)
        for role in self._names.values():
            if role in self._heard and now - self._heard[role] > _SILENCE:
                del self._heard[role]
                self._board.update(Section.NODES, {role: _absent(role)})
                if role == "executor":
                    self._forget_run()

    def _end_persons_actions(self, now: float) -> None:
        """Notes who has let go.

        Who says an action only when it is another one may still be at it, as is a person for whom
        the executor waits.
        """
        if str(self._board.section(Section.RUN).get("condition", "")).startswith("paused"):
            return
        for channel, label in self._persons.items():
            if label and channel in self._said_again and now - self._said[channel] > _HELD:
                self._persons[channel] = ""
                self._event(EventKind.PERSON, "nothing", channel)

    def _forget_run(self) -> None:
        """The executor has ended: nothing is commanded, and the one that follows begins anew."""
        self._document, self._statuses, self._commands = "", (), {}
        self._board.replace(Section.RUN, {})
        self._event(EventKind.DRIVING, "the tree rests: the executor has ended")

    def _note(self) -> None:
        self._timeline.note(
            Moment(
                time.time(),
                self._document,
                self._statuses,
                dict(self._values),
                dict(self._commands),
            )
        )

    def _event(self, kind: EventKind, text: str, channel: str = "") -> None:
        changes = self._timeline.event(time.time(), kind, text, channel)
        self._board.update(Section.TIMELINE, changes)

    def _full(self, name: str) -> str:
        return str(self._node.resolve_topic_name(name))


def _absent(role: str) -> dict[str, Any]:
    message = f"no {role} is running: start it with 'ros2 run rebt_ros {role}'"
    return {"there": False, "level": "WARN", "message": message, "values": {}}
