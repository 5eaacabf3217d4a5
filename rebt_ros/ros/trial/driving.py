"""Episodes of a trial on a real executor, in a real world."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from rebt_ros.ros.log_files import arguments_for_logging
from rebt_ros.ros.trial.executor import ExecutorHandle
from rebt_ros.ros.trial.peer import PATIENCE, TrialPeer
from rebt_ros.ros.trial.world import SilentJudge, TopicJudge, World
from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.errors import TrialError
from rebt_ros.trial.outcome import Ending, Episode, Judge, VoidEpisodeError
from rebt_ros.trial.settings import TrialSettings

#: How often in a row somebody else's tree may come between.
_INTRUSIONS: Final = 3

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

#: Between two looks at whether the executor is still there (seconds).
_LOOK: Final = 1.0


class Driving:
    """Lets the executor drive, one episode after the other.

    Args:
        peer: Talks to all others.
        settings: Of the trial.
        judge: Says how episodes go; None for what the settings name.

    Raises:
        RebtError: Executor or world are not there, or do not suit.
    """

    def __init__(self, peer: TrialPeer, settings: TrialSettings, judge: Judge | None) -> None:
        self._peer = peer
        self._settings = settings
        self._executor = ExecutorHandle(peer, settings.executor)
        topic_judge = None
        if settings.outcome_topic is not None:
            topic_judge = TopicJudge(peer, settings.outcome_topic, settings.outcome_field)
        self._judge: Judge = judge or topic_judge or SilentJudge()
        self._world = World(peer, settings)
        self._published: Candidate | None = None
        if topic_judge is not None:
            topic_judge.connect()
        self._world.connect()
        self._executor.connect()
        self.farewell = ""
        """What state the executor was left in, once that is so; a sentence."""

    def drive(self, candidate: Candidate, number: int) -> Episode:
        """Drives an episode, again and again until it is a valid one.

        The executor is disabled before and afterwards.

        Args:
            candidate: Whose tree drives.
            number: Of the episode, from 0.

        Raises:
            RebtError: It cannot be driven.
        """
        intrusions = 0
        while intrusions < _INTRUSIONS:
            self._executor.give(candidate)
            start = self._world.place(number)
            self._judge.begin()
            while not self._judge.ready():
                self._peer.spin_once()
            try:
                return self._attempt(start)
            except VoidEpisodeError:
                intrusions += self._executor.replaced
                self._executor.enable(False)
        raise TrialError(
            "others keep publishing trees on behavior_tree: a trial must be alone with the "
            "executor."
        )

    def publish(self, winner: Candidate) -> None:
        """Has the executor run a tree, and goes on to be its publisher.

        Raises:
            TrialError: The executor does not take it.
        """
        self._executor.give(winner)
        self._published = winner

    def hold(self) -> None:
        """Stays, so that nodes which start later hear of the tree, until KeyboardInterrupt."""
        while True:
            self._peer.spin_once()

    def close(self) -> None:
        """Stops the executor, and publishes the tree again that was published before."""
        try:
            self._executor.enable(False)
        except TrialError as err:
            self.farewell = f"The executor could not be disabled: {err}"
            return
        if self._published is not None:
            self.farewell = f"The executor is disabled, and has the tree of {self._published.name}."
        elif self._executor.restore():
            self.farewell = (
                "The executor is disabled, and has the tree again that was published before."
            )
        else:
            self.farewell = (
                "The executor is disabled; it keeps the tree that drove last, as no other was "
                "published before."
            )

    def _attempt(self, start: int | None) -> Episode:
        self._executor.enable(True)
        began = self._peer.seconds
        success, ending = self._watch(began)
        seconds = self._peer.seconds - began
        self._executor.enable(False)
        # What came at the last moment may have driven.
        if self._executor.replaced:
            raise VoidEpisodeError
        if ending is Ending.TIME_LIMIT and self._settings.told_by_reset:
            success, ending = bool(self._world.reset().success), Ending.TOLD
        return Episode(success, seconds, ending, start)

    def _watch(self, began: float) -> tuple[bool, Ending]:
        """Waits for the end of an episode."""
        limit = self._settings.time_limit
        enabled = looked = ticked = time.monotonic()
        has_driven = False
        while True:
            success = self._judge.success()
            if success is not None:
                return success, Ending.TOLD
            if self._executor.replaced:
                raise VoidEpisodeError
            if has_driven and self._executor.driving is False:
                return False, Ending.STOPPED
            has_driven |= self._executor.driving is True
            if limit is not None and self._peer.seconds - began >= limit:
                return False, Ending.TIME_LIMIT
            now = time.monotonic()
            if not self._executor.waits:
                ticked = now
            # A tree that gets no state has not failed: nobody has let it try.
            if (not has_driven and now - enabled > PATIENCE) or now - ticked > PATIENCE:
                raise TrialError(f"the executor does not drive: {self._executor.condition}.")
            if now - looked > _LOOK:
                looked = now
                if not self._executor.present:
                    raise TrialError("the executor has gone: look at its log.")
            self._peer.spin_once()


@contextmanager
def driving(
    settings: TrialSettings, judge: Judge | None = None, arguments: Sequence[str] = ()
) -> Iterator[Driving]:
    """Drives as long as the block lasts; afterwards the executor is as it was, but disabled.

    Args:
        settings: Of the trial.
        judge: Says how episodes go; None for what the settings name.
        arguments: ROS arguments, such as remappings.

    Raises:
        RebtError: Executor or world are not there, or do not suit.
    """
    signals: list[int] = []
    with _handled(lambda number, _: signals.append(number)):
        try:
            rclpy.init(
                args=arguments_for_logging(arguments),
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except Exception as err:
            reason = str(err).split(", at /")[0]
            raise TrialError(f"the ROS arguments are not understood: {reason}.") from err
        try:
            with _peer(signals) as peer:
                session = Driving(peer, settings, judge)
                try:
                    yield session
                finally:
                    # The robot is stopped also where an impatient person presses Ctrl-C again.
                    with _handled(signal.SIG_IGN):
                        signals.clear()
                        session.close()
        except (NameValidationException, ParameterException) as err:
            raise TrialError(f"a name is none for ROS: {' '.join(str(err).split())}.") from err
        finally:
            try_shutdown()


@contextmanager
def _peer(signals: list[int]) -> Iterator[TrialPeer]:
    peer = TrialPeer(signals)
    try:
        yield peer
    finally:
        peer.close()


@contextmanager
def _handled(handler: Callable[[int, object], object] | signal.Handlers) -> Iterator[None]:
    """Has the signals that end a command handled in another way."""
    before = {one: signal.signal(one, handler) for one in _SIGNALS}
    try:
        yield
    finally:
        for one, former in before.items():
            signal.signal(one, former)
