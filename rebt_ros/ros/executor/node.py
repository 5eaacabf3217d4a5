"""The executor: runs the learned tree on the robot's state and sends its commands."""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from rclpy.clock import Clock, JumpThreshold, TimeJump
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import Bool, Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.demonstration.builder import BadMessageError
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.demonstration.fields import values_of
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.errors import DocumentError, RebtError
from rebt_ros.live.background import Background
from rebt_ros.live.last_tick import LastTick
from rebt_ros.live.novelty_guard import NoveltyGuard
from rebt_ros.live.takeover import Takeover, channel_of
from rebt_ros.live.tree_inputs import Message
from rebt_ros.robot_file.binding import BoundTopic
from rebt_ros.ros import lifetime
from rebt_ros.ros.command_channels import DRIVING_QOS, CommandChannels
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.executor.robot_commands import RobotCommands
from rebt_ros.ros.executor.robot_inputs import RobotInputs
from rebt_ros.ros.executor.settings import declare_settings
from rebt_ros.ros.executor.tree_program import Preparation, TreeProgram, UnmeasurableError
from rebt_ros.ros.graph_watch import Finding, GraphWatch
from rebt_ros.ros.robot_files import RobotTopics
from rebt_ros.ros.topic_names import check_topics
from rebt_ros.storage.tree_file import read_tree

_TREE_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: The newest state only; best effort hears reliable publishers as well.
_STATE_QOS: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

#: Least time between two snapshots (seconds).
_SNAPSHOT_PERIOD: Final = 0.2

#: Messages of a person that may wait.
_PERSON_DEPTH: Final = 10

#: Time between two looks at what topics carry (seconds).
_LOOK_PERIOD: Final = 0.5

#: How long another thread may keep a tick waiting (seconds); Python's default is 5 ms.
_HAND_OVER: Final = 0.0005

_STOP_OTHERS: Final = "stop all but one"
_REFUSED: Final = "refused trees"
_NOVEL: Final = "states outside what was shown"


class ExecutorNode(Node):
    """Ticks the latest tree while it is enabled and nothing speaks against it.

    It does so at a fixed rate or, where that is asked for, as soon as a state arrives.

    What does: a state that is not fresh, a person who has taken over, and, where that is asked
    for, a state outside what was shown.

    Raises:
        RebtError: A parameter makes no sense, or the tree file cannot be used.
    """

    def __init__(self) -> None:
        super().__init__("executor")
        self._settings = settings = declare_settings(self)
        self._faults = Faults(self.get_logger())
        self._robot_commands = (
            RobotCommands(self, settings.robot, self._note_command) if settings.robot else None
        )
        self._channels = CommandChannels(
            self,
            settings.action_result_topic,
            settings.every_tick,
            self._note_result,
            self._robot_commands,
        )
        # Open before there is a tree, whose first command may then be heard.
        self._channels.follow([DEFAULT_CHANNEL])
        self._histories: dict[str, ActionHistory] = {}
        self._preparation = Preparation(settings, self._channels, self._histories)
        self._takeover = Takeover(settings.takeover.timeout)
        self._guard = NoveltyGuard(settings.novelty.mode)
        self._program: TreeProgram | None = None
        # Runs once it is known that its topics send what it reads.
        self._candidate: TreeProgram | None = None
        # How the sentence on waiting ends where the tree of a file does not run, and the topics
        # that it would have read.
        self._unusable = ""
        self._awaited: frozenset[str] = frozenset()
        self._latest: dict[str, Message] = {}
        self._subscriptions_by_topic: dict[str, Subscription] = {}
        self._robots: dict[TreeProgram, RobotInputs] = {}
        self._enabled = settings.enabled
        self._resting = True
        # Whether the robot may still do what it was told last, by the tree or by a person.
        self._moving = False
        self._ticks = 0
        self._commands = 0
        self._slowest = 0.0
        self._last_tick: LastTick | None = None
        self._watch = GraphWatch(self)
        self._trees = f"{settings.learner}/behavior_tree" if settings.learner else "behavior_tree"
        self._last_snapshot = ""
        self._watchers = 0
        self._snapshot = self.create_publisher(String, "~/snapshot", 10)
        self._driving = self.create_publisher(Bool, "~/driving", DRIVING_QOS)
        self._said_to_drive: bool | None = None
        self._begin()

    def _begin(self) -> None:
        """Opens everything that calls back."""
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        # Simulated time where that is used; else a clock that nobody sets.
        self._simulated = bool(self.get_parameter("use_sim_time").value)
        self._time = self.get_clock() if self._simulated else steady
        if self._simulated:
            back = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1))
            self._jumps = self._time.create_jump_callback(
                back, post_callback=self._on_clock_set_back
            )
        ready = self.create_guard_condition(self._take_prepared)
        self._background = Background(self._preparation.read, ready.trigger)
        self._documents = self.create_subscription(
            String, self._trees, self._on_document, _TREE_QOS
        )
        self._persons = self._listen_to_persons()
        for topic in self._settings.takeover.topics:
            self.create_subscription(String, topic, partial(self._on_person, topic), 10)
        if self._settings.tree_file is not None:
            self._open(self._settings.tree_file)
        self.create_service(SetBool, "~/enable", self._enable)
        self.create_service(Trigger, "~/explain", self._explain)
        self._timer = self.create_timer(1.0 / self._settings.rate, self._tick, clock=self._time)
        self.create_timer(_SNAPSHOT_PERIOD, self._publish_snapshot, clock=steady)
        self.create_timer(_LOOK_PERIOD, self._look_at_publishers, clock=steady)
        self._diagnostics = Diagnostics(self, "execution", self._report)
        self._say_who_drives()
        if self._settings.learner:
            self.get_logger().info(
                f"following the trees of {self._settings.learner}, on {self._documents.topic_name}."
            )
        self.get_logger().info(
            f"enabled: {self._condition()}."
            if self._enabled
            else "disabled until ~/enable is called."
        )

    def close(self) -> None:
        """Interrupts what runs."""
        self._enabled = False
        self._background.close()
        self._interrupt()

    # --- trees ---

    def _open(self, path: Path) -> None:
        """Runs the tree of a file.

        A tree that tests texts is a sound one, though not for topics of numbers: another one may
        come, and until then whoever sends states finds the executor and is told what is wrong.
        """
        learned = read_tree(path)
        try:
            program = self._preparation.program(learned, dumps(learned))
        except UnmeasurableError as err:
            self._unusable = f": {path} is not run: {str(err).rstrip('.')}"
            self._awaited = err.topics
            self._subscribe()
            self.get_logger().warning(f"{self._condition()}.")
            return
        self._check_topics(program)
        self._install(program)

    def _on_document(self, message: String) -> None:
        # Reading may take longer than a tick.
        self._background.put(message.data)

    def _take_prepared(self) -> None:
        for prepared in self._background.take():
            if isinstance(prepared, DocumentError):
                self._refuse(str(prepared))
            elif self._program is not None and prepared.document == self._program.document:
                # It stays, whatever came in between.
                self._discard_candidate()
                self._subscribe()
                self._preparation.retire(prepared)
            else:
                self._propose(prepared)
        self._try_candidate()

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
        self._subscribe()

    def _check_topics(self, program: TreeProgram) -> None:
        """Looks whether a program can have its topics.

        Raises:
            DocumentError: It cannot.
        """
        robot, commands = program.learned.robot, self._channels.topics_of(program.channels)
        check_topics(self, () if robot else program.inputs.topics, commands)
        if robot is None or program in self._robots:
            return
        try:
            self._robots[program] = RobotInputs(
                self,
                robot,
                program.learned.features,
                program.inputs,
                self._now,
                partial(self._on_robot_state, program),
            )
        except RebtError as err:
            raise DocumentError(str(err)) from err

    def _refuse(self, why: str) -> None:
        kept = "the tree before it stays" if self._program else "there is no tree yet"
        self._faults.note(_REFUSED, f"a behavior tree was refused ({kept}): {why}", severe=True)

    def _try_candidate(self) -> None:
        """Takes the candidate into use, unless its topics do not suit or have to show it yet."""
        candidate = self._candidate
        if candidate is None:
            return
        if self._program is not None:
            short = candidate.inputs.too_short(self._latest)
            if short:
                self._discard_candidate()
                self._refuse(f"{short}.")
                self._subscribe()
                return
            if self._unheard(candidate):
                return
        self._candidate = None
        self._install(candidate)
        self._say_who_drives()
        # Who has sent it waits for that.
        self._diagnostics.publish()

    def _discard_candidate(self) -> None:
        if self._candidate is not None:
            self._preparation.retire(self._candidate)
            self._candidate = None

    def _unheard(self, program: TreeProgram) -> list[str]:
        if program in self._robots:
            return self._robots[program].unheard
        return [topic for topic in program.inputs.topics if topic not in self._latest]

    def _install(self, program: TreeProgram) -> None:
        """Takes a tree into use; the action that runs is interrupted, the history goes on."""
        self._interrupt()
        self._guard.release()
        self._channels.follow(program.channels)
        if self._program is not None:
            self._preparation.retire(self._program)
        self._program = program
        self._subscribe()
        for topic in self._latest:
            self._accept(topic, quietly=True)
        self.get_logger().info(
            f"running a tree of {nodes.size(program.learned.tree)} nodes that reads "
            f"{', '.join(program.inputs.topics) or 'no state'}."
        )

    # --- what comes in ---

    def _subscribe(self) -> None:
        programs = [one for one in (self._program, self._candidate) if one is not None]
        for program in self._robots.keys() - set(programs):
            self._robots.pop(program).close()
        plain = [one for one in programs if one not in self._robots]
        topics = {topic for one in plain for topic in one.inputs.topics}
        if not programs:
            topics |= self._awaited
        for topic in self._subscriptions_by_topic.keys() - topics:
            self.destroy_subscription(self._subscriptions_by_topic.pop(topic))
            self._latest.pop(topic, None)
        for topic in sorted(topics - self._subscriptions_by_topic.keys()):
            self._subscriptions_by_topic[topic] = self.create_subscription(
                Float64MultiArray, topic, partial(self._on_state, topic), _STATE_QOS
            )

    def _on_robot_state(self, program: TreeProgram, topic: str) -> None:
        """Goes on once a program has taken a message of a robot's own type."""
        self._try_candidate()
        if self._settings.tick_on_state and program is self._program:
            self._tick_on(topic)

    def _look_at_publishers(self) -> None:
        for robot in self._robots.values():
            robot.look()
        if self._persons is not None:
            self._persons.look()

    def _on_state(self, topic: str, message: Float64MultiArray) -> None:
        # A message may still come on a topic that no tree reads any longer.
        if topic not in self._subscriptions_by_topic:
            return
        self._latest[topic] = Message(values_of(message), self._now())
        self._accept(topic)
        self._try_candidate()
        if self._settings.tick_on_state:
            self._tick_on(topic)

    def _tick_on(self, topic: str) -> None:
        """Ticks on a state that has just arrived; the timer's next tick is a whole period away."""
        program = self._program
        if program is None or topic not in program.inputs.topics:
            return
        # Lagged features look back at ticks that are evenly spaced: those of the timer.
        if program.inputs.lagged:
            return
        self._tick()
        self._timer.reset()

    def _accept(self, topic: str, *, quietly: bool = False) -> None:
        if self._program is None or topic not in self._program.inputs.topics:
            return
        if self._program in self._robots:
            return
        try:
            self._program.inputs.accept(topic, self._latest[topic])
        except BadMessageError as err:
            if not quietly:
                self._faults.note(err.fault.value, str(err))

    def _on_person(self, topic: str, message: String) -> None:
        # Where commands were remapped to that topic, they are not a person's.
        if self.resolve_topic_name(topic) in self._channels.topics:
            return
        self._take_over(topic)
        channels = self._program.channels if self._program else [topic]
        channel = channel_of(topic, channels, self._settings.takeover.topics)
        if message.data and channel is not None:
            self._histories.setdefault(channel, ActionHistory()).take(message.data)

    def _listen_to_persons(self) -> RobotTopics | None:
        """Subscribes to what the robot file says that a person does."""
        robot, commands = self._settings.robot, self._robot_commands
        if robot is None or commands is None or not self._settings.takeover.timeout:
            return None
        # What is commanded there is not a person's, and the others are listened to already.
        others = commands.topics | {
            self.resolve_topic_name(topic) for topic in self._settings.takeover.topics
        }
        topics = (
            topic for topic in robot.action_topics if self.resolve_topic_name(topic) not in others
        )
        return RobotTopics(self, robot, tuple(topics), _PERSON_DEPTH, self._person_callback)

    def _person_callback(self, bound: BoundTopic) -> Callable[..., None]:
        def take(message: Any) -> None:
            for channel, labeller in bound.labellers.items():
                labels = labeller.labels(message, time.time_ns())
                if labeller.acts:
                    self._take_over(bound.name)
                for label in filter(None, labels):
                    self._histories.setdefault(channel, ActionHistory()).take(label)

        return take

    def _take_over(self, topic: str) -> None:
        if self._takeover.note(self._now()) and self._enabled and self._program is not None:
            self.get_logger().info(f"a person has taken over on {topic}.")
            self._interrupt()
            self._channels.rest()
            self._guard.release()
        self._moving = self._enabled and self._program is not None
        self._say_who_drives()

    def _on_clock_set_back(self, _: TimeJump) -> None:
        """What was received then is not from now: all topics are stale until they send again."""
        self._latest.clear()
        if self._program is not None:
            self._program.inputs.forget()
        self._takeover.restart(self._now())
        # Time may stand still now, and the next tick be far away.
        if self._enabled and not self._takeover.lasts(self._now()):
            self._rest()

    def _note_result(self, text: str) -> None:
        self._faults.note(
            "unknown action result",
            f"the action result {text!r} is not understood: "
            "send 'success' or 'failure', or 'label:success' or 'label:failure'.",
        )

    def _note_command(self, text: str) -> None:
        self._faults.note("failed command", f"{text}.")

    # --- what goes out ---

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data:
            if not self._enabled:
                # Nothing was done before it, as in a demonstration's first row.
                self._forget_history()
            self._enabled = True
            self._guard.release()
        else:
            self._disable()
        self._say_who_drives()
        response.success = True
        response.message = f"enabled: {self._condition()}." if self._enabled else "disabled."
        self.get_logger().info(response.message)
        return response

    def _explain(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Says why the last tick did what it did."""
        if self._last_tick is None:
            response.message = f"there was no tick yet: {self._condition()}."
            return response
        try:
            response.message = self._last_tick.explained()
            response.success = True
        except RebtError as err:
            response.message = str(err)
        return response

    def _forget_history(self) -> None:
        for history in self._histories.values():
            history.clear()

    def _disable(self) -> None:
        # A person who drives goes on to do so.
        self._moving = self._moving and not self._takeover.lasts(self._now())
        self._rest()
        self._enabled = False

    def _tick(self) -> None:
        program, now = self._program, self._now()
        if program is None or not self._enabled or self._takeover.lasts(now):
            return
        self._say_who_drives()
        if program.inputs.stale(now) or not self._is_familiar(program):
            self._rest()
            return
        began = time.perf_counter()
        self._resting = False
        self._moving = True
        self._channels.begin_tick()
        state = program.inputs.state()
        commands = program.runtime.tick(state).commands
        self._last_tick = LastTick(program.learned, tuple(state), program.runtime.outcomes())
        self._ticks += 1
        self._commands += self._channels.send(commands)
        self._slowest = max(self._slowest, time.perf_counter() - began)

    def _is_familiar(self, program: TreeProgram) -> bool:
        if self._guard.holding:
            return False
        familiar = self._guard.passes(program.novelty, program.inputs.values)
        if self._guard.departure is not None:
            held = "" if familiar else ": the robot is held until a person takes over"
            self._faults.note(
                _NOVEL, f"the state is outside what was shown{held}: {self._guard.departure}."
            )
        return familiar

    def _rest(self) -> None:
        """Halts the tree, and the robot; what is commanded next is sent, be it what was last."""
        self._interrupt()
        self._channels.rest()
        if self._moving:
            self._channels.stop()
        if self._moving and self._settings.halt_action:
            self._channels.send_to_all(self._settings.halt_action)
            for history in self._histories.values():
                # LAT knows of it.  The previous action stays: the tree goes on with what it did.
                history.begin(self._settings.halt_action)
        self._moving = False

    def _interrupt(self) -> None:
        """Halts the tree."""
        if self._program is not None and not self._resting:
            self._channels.begin_tick()
            self._program.runtime.halt()
            self._program.inputs.reset()
        self._resting = True

    # --- what it says ---

    def _say_who_drives(self) -> None:
        """Tells others, above all the recorder, whether the robot is in the tree's hands."""
        ready = self._enabled and self._program is not None
        driving = ready and not self._takeover.lasts(self._now())
        if driving != self._said_to_drive:
            self._said_to_drive = driving
            self._driving.publish(Bool(data=driving))

    def _now(self) -> int:
        # What a steady clock of ROS says, at a fraction of the cost: this is asked several times
        # between a state and its command.
        return int(self._time.now().nanoseconds) if self._simulated else time.monotonic_ns()

    def _condition(self) -> str:
        """What the executor does, or what it waits for."""
        now = self._now()
        if self._program is None:
            return f"waiting for a tree{self._unusable}"
        if not self._enabled:
            return "disabled"
        if self._simulated and now == 0:
            return "waiting for /clock"
        if self._takeover.lasts(now):
            return "paused: a person has taken over"
        stale = self._program.inputs.stale(now)
        if stale:
            ages = ", ".join(f"{topic} ({age})" for topic, age in stale.items())
            return f"waiting for state: {ages}"
        if self._guard.holding:
            return f"held until a person takes over: {self._guard.departure}"
        return "running"

    def _publish_snapshot(self) -> None:
        watchers = self._snapshot.get_subscription_count()
        newcomers, self._watchers = watchers > self._watchers, watchers
        if self._program is None or not watchers:
            return
        runtime = self._program.runtime
        snapshot = json.dumps(
            {
                "document": self._program.fingerprint,
                "condition": self._condition().split(":")[0],
                "status": runtime.root.status.name,
                "tip": runtime.tip,
                "commands": self._channels.sent,
                "nodes": runtime.snapshot(),
            },
            ensure_ascii=False,
        )
        if newcomers or snapshot != self._last_snapshot:
            self._last_snapshot = snapshot
            self._snapshot.publish(String(data=snapshot))

    def _report(self) -> Report:
        condition = self._condition()
        values: dict[str, Any] = {
            "condition": condition.split(":")[0],
            "enabled": self._enabled,
            "ticks": self._ticks,
            "commands": self._commands,
            "longest tick (ms)": f"{self._slowest * 1e3:.1f}",
            "trees from": self._documents.topic_name,
            "takeovers": self._takeover.count,
            _REFUSED: 0,
            _NOVEL: 0,
        }
        self._slowest = 0.0
        if self._program is not None:
            learned = self._program.learned
            values |= {
                "document": self._program.fingerprint,
                "nodes": nodes.size(learned.tree),
                "actions": len(learned.actions),
                "rows": learned.provenance.rows,
                "own-history agreement": learned.provenance.figures.own_history_agreement,
                "novelty": self._guard.departure or "none",
            }
            stale = self._program.inputs.stale(self._now())
            topics = self._program.inputs.topics
            values |= {f"state of {topic}": stale.get(topic, "fresh") for topic in topics}
        if self._candidate is not None:
            values["the next tree waits for"] = ", ".join(self._unheard(self._candidate))
        values |= self._faults.counts
        if self._faults.recent:
            return Report(Level.WARN, f"{condition}; {self._faults.recent}", values)
        unusable = self._program is None and bool(self._unusable)
        blocked = unusable or (self._enabled and condition != "running")
        problems = self._problems()
        if problems:
            return Report(Level.WARN, "; ".join((condition, *problems)), values)
        return Report(Level.WARN if blocked else Level.OK, condition, values)

    def _problems(self) -> list[str]:
        """What in the graph keeps the tree from driving, or makes it a matter of chance.

        What a disabled executor lacks it may still get before it is enabled.
        """
        watch, commands = self._watch, self._channels.topics
        findings = [
            *watch.several(
                self._trees,
                "trees",
                "chance decides which one drives; name one with the parameter 'learner', or stop "
                "all but one",
            ),
            *watch.misfits([self._documents]),
            *(finding for robot in self._robots.values() for finding in robot.look()),
            *(one for topic in commands for one in watch.several(topic, "commands", _STOP_OTHERS)),
            *self._without_command(),
        ]
        if self._settings.learner:
            findings += watch.unheard([self._documents])
        if self._enabled:
            findings += [
                *watch.timeless(),
                *watch.unheard(self._subscriptions_by_topic.values()),
                *watch.unread(commands),
            ]
        return watch.say(findings)

    def _without_command(self) -> list[Finding]:
        """Labels of the tree for which the robot file has no command."""
        if self._program is None or self._robot_commands is None or self._settings.robot is None:
            return []
        labels = {action.label for action in nodes.actions(self._program.learned.tree)}
        found = ", ".join(map(repr, self._robot_commands.missing(sorted(labels))))
        sentence = f"{self._settings.robot.name} has no command for {found}"
        return [Finding(sentence, waits=False)] if found else []


def main(args: list[str] | None = None) -> None:
    """Runs the executor."""
    # The thread that reads trees hands the interpreter over to a tick that is due.
    sys.setswitchinterval(_HAND_OVER)
    # A search through all that there is takes longer than a tick, and there is next to no garbage
    # to be found, as trees are taken apart: it is made a hundred times less often.
    young, middle, old = gc.get_threshold()
    gc.set_threshold(young, middle, 100 * max(old, 1))
    gc.freeze()
    lifetime.run(ExecutorNode, args)


if __name__ == "__main__":
    main()
