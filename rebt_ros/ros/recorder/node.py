"""The recorder: writes what a demonstrator does, and in which state, to durable recordings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Final

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import Bool, Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.fields import names_of, values_of
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import OptionError
from rebt_ros.live.arrival import LAST, ArrivalOrder
from rebt_ros.live.recording_session import NOT_HEARD, WRITE_ERROR, Answer, RecordingSession, Writer
from rebt_ros.live.state_streams import StateStreams
from rebt_ros.live.traffic import Traffic
from rebt_ros.live.values_seen import ValuesSeen
from rebt_ros.robot_file.binding import BoundTopic
from rebt_ros.robot_file.features import FeatureReader, described
from rebt_ros.ros import lifetime
from rebt_ros.ros.command_channels import DRIVING_QOS, topic_of
from rebt_ros.ros.diagnostics import Diagnostics, Faults, Level, Report
from rebt_ros.ros.graph_watch import Finding, GraphWatch
from rebt_ros.ros.node_clock import simulated_time
from rebt_ros.ros.recorder.sending_time import SendingTime, received_at
from rebt_ros.ros.recorder.settings import declare_settings
from rebt_ros.ros.robot_files import RobotTopics
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.recording_head import Origin
from rebt_ros.storage.shared_directory import SharedDirectory, Use
from rebt_ros.storage.writable import WritableDirectory

#: Long enough that no message of a burst is lost while the disk is slow.
_QUEUE: Final = 5000

#: An action that came so long after it was sent may belong to another state (seconds).
_LATE: Final = 1.0

#: Least time between two fetches (seconds).
_LEAST_PERIOD: Final = 0.005

#: Kind of the fault that an action came before there was a time for its row.
_TIMELESS: Final = "action before the first /clock"

#: Simulated time that falls by more begins anew (nanoseconds).
_SET_BACK: Final = 100_000_000

#: Time between two looks at who publishes (seconds).
_LOOK_PERIOD: Final = 0.5


class _Fetched(CallbackGroup):
    """Subscriptions whose messages a timer fetches, and for which no executor wakes up.

    To wake an executor up costs many times what it costs to take a message.
    """

    def can_execute(self, entity: object) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Nothing has begun."""


class RecorderNode(Node):
    """Subscribes to states and actions, and writes one recording per demonstration.

    Messages and service calls take effect in the order in which they were sent, or received where
    the clocks of publishers cannot be compared, whatever the order of their callbacks; so an action
    is recorded with the state that held then (see `PairBy`).

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("recorder")
        settings = declare_settings(self)
        self._settings = settings
        self._faults = Faults(self.get_logger())
        self._session = RecordingSession(
            settings.state_topics,
            settings.action_topics,
            settings.sample_rate,
            self._open_writer,
            lambda kind, text: self._faults.note(kind, text, severe=kind == WRITE_ERROR),
        )
        self._check_names(settings.sources)
        self._order = ArrivalOrder[Callable[[], object]](
            settings.reorder_window, settings.state_wait
        )
        self._streams = StateStreams(
            (topic.name for topic in settings.state_topics), settings.state_wait
        )
        states = [topic.name for topic in settings.state_topics]
        self._traffic = Traffic(states, settings.sources, time.monotonic())
        self._reliable = settings.action_topics if settings.best_effort else settings.sources
        self._immediate = settings.reorder_window == 0
        self._robot: RobotTopics | None = None
        self._readers: dict[str, FeatureReader] = {}
        self._categories: dict[str, Categories] = {}
        self._seen = ValuesSeen({topic.name: topic.fields for topic in settings.state_topics})
        self._writable = WritableDirectory()
        self._shown = self._listen_to_demonstrator()
        self._driven = self._listen_to_executor()
        self._sources = [*self._shown, *self._driven]
        topics = [source.topic_name for source in self._sources]
        if settings.robot is not None:
            topics += map(self.resolve_topic_name, settings.sources)
        self._sending = SendingTime(self, topics, settings.pair_by)
        self._watch = GraphWatch(self)
        self._sharing = SharedDirectory(Use.RECORDINGS)
        self._ready = self.create_publisher(Bool, "~/ready", DRIVING_QOS)
        self._said_ready: bool | None = None
        self._simulated = 0
        self._begin()

    def _begin(self) -> None:
        """Opens everything else that calls back."""
        # Of their own, because their answers wait for the messages received before.
        group = MutuallyExclusiveCallbackGroup()
        for name, kind, command in (
            ("~/record", SetBool, self._record),
            ("~/new_demonstration", Trigger, self._renew),
            ("~/discard_demonstration", Trigger, lambda _, stamp: self._session.discard(stamp)),
            ("~/failed", Trigger, lambda _, stamp: self._session.fail(stamp)),
        ):
            self.create_service(kind, name, partial(self._serve, command), callback_group=group)
        settings = self._settings
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        if not self._immediate:
            period = max(settings.reorder_window / 2e9, _LEAST_PERIOD)
            self.create_timer(period, self._take_ready, clock=steady)
        self.create_timer(_LOOK_PERIOD, self._look_at_publishers, clock=steady)
        if settings.sync_period:
            self.create_timer(
                settings.sync_period,
                lambda: self._session.sync(self._stamp(time.time_ns())),
                clock=steady,
            )
        self._diagnostics = Diagnostics(self, "recording", self._report)
        self._watch.say(self._unwritable())
        if settings.recording:
            self._session.start(self._stamp(time.time_ns()))
        self.get_logger().info(
            f"{'recording' if settings.recording else 'ready to record'} "
            f"{', '.join(settings.action_topics)} with "
            f"{', '.join(topic.name for topic in settings.state_topics)} "
            f"to {settings.demonstrations.resolve()}."
        )

    def close(self) -> None:
        """Writes what has been received, and ends the recording."""
        self._sharing.close()
        self._take_waiting_messages()
        for take in self._order.flush(self._complete(time.monotonic_ns())):
            take()
        # The node's own logger publishes what it says, and a signal shuts the context down.
        logger = get_logger(f"{self.get_logger().name}.stop")
        if self._order.held:
            logger.warning(
                f"{self._order.held} actions are left out: the states that they belong to had not "
                "come when the recorder was stopped."
            )
        if self._session.recording:
            answer = self._session.stop(self._stamp(time.time_ns()))
            # On two lines: rclpy refuses another severity from the same one.
            if answer.success:
                logger.info(answer.message)
            else:
                logger.warning(answer.message)

    def _open_writer(self, features: tuple[Feature, ...], origin: Origin) -> Writer:
        settings = self._settings
        if self._robot is not None:
            known = {name: its for name, its in self._categories.items() if not its.is_open}
            features = described(features, self._robot.bound.values(), known)
        writer = RecordingWriter(
            settings.demonstrations,
            features,
            settings.action_topics,
            sample_rate=settings.sample_rate,
            origin=origin,
            robot=settings.robot,
            categories=self._categories,
            told=lambda text: self._faults.note("recording removed", text),
        )
        self.get_logger().info(f"recording to {writer.path}.")
        return writer

    def _listen_to_demonstrator(self) -> list[Subscription]:
        waking = None if self._immediate else _Fetched()
        if self._settings.robot is not None:
            self._robot = RobotTopics(
                self,
                self._settings.robot,
                self._settings.sources,
                _QUEUE,
                self._robot_callback,
                waking,
            )
            return []
        states, actions = QoSProfile(depth=_QUEUE), QoSProfile(depth=_QUEUE)
        if self._settings.best_effort:
            states.reliability = ReliabilityPolicy.BEST_EFFORT
        return [
            *(
                self.create_subscription(
                    Float64MultiArray,
                    topic.name,
                    partial(self._on_state, topic.name),
                    states,
                    callback_group=waking,
                )
                for topic in self._settings.state_topics
            ),
            *(
                self.create_subscription(
                    String,
                    channel,
                    partial(self._on_action, channel),
                    actions,
                    callback_group=waking,
                )
                for channel in self._settings.action_topics
            ),
        ]

    def _robot_callback(self, bound: BoundTopic) -> Callable[..., None]:
        if bound.features and bound.name not in self._readers:
            self._readers[bound.name] = FeatureReader(bound, self._categories)

        def take(message: Any, info: dict[str, Any]) -> None:
            self._on_message(bound, message, info)

        return take

    @property
    def _demonstrators(self) -> list[Subscription]:
        """The subscriptions to states and actions."""
        if self._robot is not None:
            return list(self._robot.subscriptions.values())
        return self._shown

    def _listen_to_executor(self) -> list[Subscription]:
        """Subscribes to what tells demonstrations and corrections apart."""
        sources = []
        commands, driving = self._settings.executor.commands, self._settings.executor.driving
        channels = self._settings.action_topics
        shown = {self.resolve_topic_name(channel) for channel in channels}
        for channel in channels if commands else ():
            topic = topic_of(commands, channel, channels)
            # A robot that was told to learn from itself is not corrected by itself.
            if self.resolve_topic_name(topic) not in shown:
                take = partial(self._on_command, channel)
                sources.append(
                    self.create_subscription(String, topic, take, QoSProfile(depth=_QUEUE))
                )
        if driving:
            sources.append(
                self.create_subscription(Bool, driving, partial(self._on_driving), DRIVING_QOS)
            )
        return sources

    def _on_command(self, channel: str, message: String, info: dict[str, Any]) -> None:
        place = self._place(info)
        stamp = self._stamp(place)
        self._queue(place, partial(self._session.command, stamp, channel, message.data))

    def _on_driving(self, message: Bool, info: dict[str, Any]) -> None:
        place = self._place(info)
        self._queue(place, partial(self._session.drive, self._stamp(place), message.data))

    def _check_names(self, topics: Sequence[str]) -> None:
        for topic in topics:
            validate_topic_name(topic)
        resolved = [self.resolve_topic_name(topic) for topic in topics]
        for topic, name in zip(topics, resolved, strict=True):
            if resolved.count(name) > 1:
                raise OptionError(
                    f"topic {topic!r} is {name}, which state_topics and action_topics name twice."
                )

    def _on_message(self, bound: BoundTopic, message: Any, info: dict[str, Any]) -> None:
        """Takes a message of a topic of the robot file."""
        topic, reader = bound.name, self._readers.get(bound.name)
        self._note(topic, info)
        sent = self._sending.of(info)
        if bound.has_stamp:
            stamp_of_header = message.header.stamp
            sent = stamp_of_header.sec * 1_000_000_000 + stamp_of_header.nanosec
        place = received_at(info) if sent is None else sent
        # What is done follows from what was there before this message.
        for channel, labeller in bound.labellers.items():
            for label in labeller.labels(message, place):
                self._queue_action(channel, label, sent, info)
        if reader is None:
            return
        self._traffic.state(topic, time.monotonic())
        if sent is not None:
            self._streams.take(topic, sent, time.monotonic_ns())
        values, stamp = reader.read(message, place), self._stamp(place)
        self._seen.take(topic, values)
        self._queue(place, partial(self._session.observe, stamp, topic, values, (), sent))

    def _on_state(self, topic: str, message: Float64MultiArray, info: dict[str, Any]) -> None:
        self._traffic.state(topic, time.monotonic())
        self._note(topic, info)
        sent = self._sending.of(info)
        if sent is not None:
            self._streams.take(topic, sent, time.monotonic_ns())
        place = received_at(info) if sent is None else sent
        values, labels = values_of(message), names_of(message)
        stamp = self._stamp(place)
        self._queue(place, partial(self._session.observe, stamp, topic, values, labels, sent))

    def _on_action(self, topic: str, message: String, info: dict[str, Any]) -> None:
        self._note(topic, info)
        self._queue_action(topic, message.data, self._sending.of(info), info)

    def _queue_action(
        self, channel: str, label: str, sent: int | None, info: dict[str, Any]
    ) -> None:
        received = received_at(info)
        late = (received - (info.get("source_timestamp") or received)) / 1e9
        if sent is None and late > _LATE:
            self._faults.note(
                "late action",
                f"an action on {channel!r} came {late:.1f} s after it was sent and has the state "
                "of its arrival: wait until recorder and publisher know each other, and check that "
                "their clocks agree.",
            )
        place = received if sent is None else sent
        stamp = self._stamp(place)
        if stamp == 0:
            self._faults.note(
                _TIMELESS,
                f"action {label!r} on {channel!r} is not recorded, because it came before the "
                "first message on /clock: start the simulator, or unset use_sim_time.",
            )
            return
        take = partial(self._session.act, stamp, channel, label, sent)
        self._queue(place, take, waits=sent is not None)

    def _note(self, topic: str, info: dict[str, Any]) -> None:
        """Counts a message."""
        self._traffic.message(topic, info.get("publication_sequence_number"))

    def _place(self, info: dict[str, Any]) -> int:
        """Where a message belongs among the others, nanoseconds."""
        sent = self._sending.of(info)
        return received_at(info) if sent is None else sent

    def _look_at_publishers(self) -> None:
        if self._robot is not None:
            self._robot.look()
        ready = not self._unheard()
        if ready is not self._said_ready:
            self._said_ready = ready
            self._ready.publish(Bool(data=ready))
        silent = self._sending.look()
        for topic in self._settings.state_topics:
            if self.resolve_topic_name(topic.name) in silent:
                self._streams.end(topic.name)

    def _unheard(self) -> list[str]:
        """Topics that would be missing in a demonstration that began now."""
        states = {topic.name for topic in self._settings.state_topics}
        sources = (
            self._robot.subscriptions
            if self._robot is not None
            else dict(zip(self._settings.sources, self._shown, strict=True))
        )
        # A publisher that is there may have another type, or QoS that does not fit.
        connected = {name for name, one in sources.items() if one.get_publisher_count()}
        unheard = [
            name
            for name in self._settings.sources
            if not (self._session.knows(name) if name in states else name in connected)
        ]
        return [*unheard, "/clock"] if simulated_time(self) == 0 else unheard

    def _problems(self) -> list[str]:
        """What in the graph keeps this node from recording."""
        watch = self._watch
        unfit = self._robot.look() if self._robot is not None else []
        bound = self._robot.bound.values() if self._robot is not None else ()
        valueless = self._seen.lacking() if self._robot is not None else ()
        states = {self.resolve_topic_name(topic.name) for topic in self._settings.state_topics}
        # With a robot file several nodes may well publish, each a part of the state.
        plain = [one for one in self._shown if one.topic_name in states]
        known = {
            self.resolve_topic_name(topic.name)
            for topic in self._settings.state_topics
            if self._session.knows(topic.name)
        }
        return watch.say(
            [
                *watch.timeless(),
                *unfit,
                *watch.unheard(
                    self._demonstrators,
                    {one.topic_name: "set state_qos to sensor_data" for one in plain},
                ),
                *watch.mixed(plain),
                *watch.latched(one for one in plain if one.topic_name not in known),
                *watch.misfits(self._driven),
                *(Finding(one, waits=False) for topic in bound for one in topic.lacks()),
                *(Finding(one, waits=True) for one in valueless),
                *self._shared(),
                *self._unwritable(),
            ]
        )

    def _shared(self) -> Iterator[Finding]:
        """That another recorder writes to the same directory."""
        directory = self._settings.demonstrations
        if self._sharing.is_shared(directory):
            yield Finding(
                f"another recorder writes to {directory.absolute()}: what both hear would be "
                "learned from twice; stop it, or give each a directory of its own",
                waits=False,
            )

    def _unwritable(self) -> Iterator[Finding]:
        """That no recording can be written."""
        if why := self._writable.why_not(self._settings.demonstrations):
            yield Finding(why, waits=False)

    async def _serve(
        self, command: Callable[[Any, int], Answer], request: Any, response: Any
    ) -> Any:
        done = Future()
        now = time.time_ns()
        stamp = self._stamp(now)
        self._queue(now, lambda: done.set_result(command(request, stamp)))
        answer = await done
        # On two lines: rclpy refuses another severity from the same one.
        if answer.success:
            self.get_logger().info(answer.message)
        else:
            self.get_logger().warning(answer.message)
        response.success, response.message = answer
        return response

    def _record(self, request: SetBool.Request, stamp: int) -> Answer:
        if not request.data:
            return self._session.stop(stamp)
        failed = bool(self._session.failure)
        if why := self._writable.why_not(self._settings.demonstrations, again=failed):
            return Answer(False, f"not recording: {why}.")
        return self._with_what_is_missing(self._session.start(stamp))

    def _renew(self, _: Trigger.Request, stamp: int) -> Answer:
        return self._with_what_is_missing(self._session.renew(stamp))

    def _with_what_is_missing(self, answer: Answer) -> Answer:
        unheard = self._unheard()
        if not self._session.recording or not unheard:
            return answer
        return answer._replace(
            message=f"{answer.message} {NOT_HEARD} {', '.join(unheard)}; wait for ~/ready."
        )

    def _queue(self, place: int, take: Callable[[], object], *, waits: bool = False) -> None:
        self._order.push(place, take, time.monotonic_ns(), waits=waits)
        if self._immediate:
            self._take_ready()

    def _take_ready(self) -> None:
        now = time.monotonic_ns()
        if not self._immediate:
            self._take_waiting_messages()
        for take in self._order.ready(now, self._complete(now)):
            take()

    def _complete(self, now: int) -> int:
        """All states that were sent up to then have come, as far as that matters."""
        return self._streams.complete(now) if self._sending.comparable else LAST

    def _take_waiting_messages(self) -> None:
        """Fetches what was received and still waits for its callback.

        On a busy machine the executor may come back late, with this timer first and with many
        messages waiting; however long they wait, their order must not depend on it.
        """
        further = self._demonstrators if self._robot is not None else []
        for source in (*self._sources, *further):
            with source.handle:
                for _ in range(_QUEUE):
                    taken = source.handle.take_message(source.msg_type, source.raw)
                    if taken is None:
                        break
                    source.callback(*taken)

    def _stamp(self, place: int) -> int:
        """What a row says: its action's place, or simulated time where that is in use."""
        simulated = simulated_time(self)
        if simulated is None:
            return place
        if simulated < self._simulated - _SET_BACK:
            self._queue(place, partial(self._session.set_back, simulated))
        self._simulated = simulated
        return simulated

    def _count_losses(self) -> None:
        for topic, count in self._traffic.newly_lost(self.count_publishers).items():
            if count and topic in self._reliable:
                self._faults.note(
                    "message lost",
                    f"{count} messages on {topic!r} were lost within a second: publish less often, "
                    "or with a deeper history.",
                )

    def _report(self) -> Report:
        now = time.monotonic()
        session = self._session
        session.look(self._stamp(time.time_ns()))
        self._count_losses()
        values: dict[str, object] = {
            "rows": session.rows,
            "rows lost": session.lost,
            "takeovers": session.takeovers,
            "failed episodes": session.failed,
            "messages": self._traffic.messages,
            "messages lost": self._traffic.lost,
            "actions that wait for their state": self._order.held,
            "paired by": "sent" if self._sending.comparable else "received",
            "demonstration": session.writer.path if session.writer else "none yet",
            "rows of the demonstration": session.writer.rows if session.writer else 0,
            "origin of the demonstration": session.origin.value,
        }
        for topic, rate in self._traffic.rates(now).items():
            values[f"rate of {topic} (Hz)"] = "unknown" if rate is None else f"{rate:.1f}"
        values |= self._faults.counts
        silent = self._traffic.silent(now)
        if session.failure:
            return Report(Level.ERROR, session.failure, values)
        problems = self._problems()
        if not session.recording:
            level = Level.WARN if problems else Level.OK
            return Report(level, "; ".join(("not recording", *problems)), values)
        if self._faults.recent or problems:
            recent = [self._faults.recent.rstrip(".")] if self._faults.recent else []
            return Report(Level.WARN, "; ".join((*recent, *problems)), values)
        if silent:
            return Report(Level.WARN, f"no messages on {', '.join(silent)}", values)
        if session.awaited:
            return Report(Level.OK, "waiting for a person to show what failed", values)
        return Report(Level.OK, "recording", values)


def main(args: list[str] | None = None) -> None:
    """Runs the recorder."""
    lifetime.run(RecorderNode, args)


if __name__ == "__main__":
    main()
