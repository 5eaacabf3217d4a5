"""What the recorder does with messages, without ROS: demonstrations, one file after another."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from rebt_ros.demonstration.builder import BadMessageError, DemonstrationBuilder, Fault, StateTopic
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.recent_states import RecentStates
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import RebtError
from rebt_ros.live.takeover_watch import TakeoverWatch
from rebt_ros.storage.recording_head import Origin

#: Kind of the fault that a row could not be written.
WRITE_ERROR = "write error"

#: Kind of the fault that simulated time was set back.
SET_BACK = "simulated time set back"

#: What is said where a demonstration without rows ends.
NO_ROWS = "no rows were recorded."

#: Before the topics that a recorder waits for in vain.
NOT_HEARD = "Not heard so far:"

#: Pause between attempts to open a file where writing failed (seconds).
_RETRY_AFTER = 1.0


class Writer(Protocol):
    """A file of one demonstration; all methods raise `RebtError` where the disk does."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def rows(self) -> int:
        """How many rows it holds."""

    def write(self, row: Row) -> None:
        """Adds a row that is durable afterwards."""

    def look(self) -> None:
        """Sees to it that it is where its path says."""

    def sync(self) -> None:
        """Makes its rows survive a loss of power."""

    def close(self) -> None:
        """Ends the file."""

    def set_aside(self) -> None:
        """Ends the file, and keeps it where it is not learned from."""

    def discard(self) -> None:
        """Removes the file, also where it has ended."""


class Answer(NamedTuple):
    """A service's answer."""

    success: bool
    message: str


class _Ended(NamedTuple):
    writer: Writer
    origin: Origin


class _Message(NamedTuple):
    stamp: int
    values: Sequence[float]
    labels: Sequence[str]
    sent: int | None


class RecordingSession:
    """Turns messages into files, one per demonstration, opened at its first row.

    Neither a bad message nor a full disk ends a session: the first is noted and left out; after
    the second a new demonstration begins, in a new file, once there is room again.

    A correction is a demonstration of its own, and so begins without a previous action:

    takeover
        What a person does from the moment of taking over from the executor on, until that drives
        again or a person ends it.
    failed
        What a person does after saying that the executor failed.  It begins with an action that
        comes after that, whoever drives until then.

    Args:
        topics: State topics, in the order of their features.
        channels: Action topics.
        sample_rate: Rows per second while an action holds; None for a row per action message.
        open_writer: Opens the file of a demonstration with these features and of this origin.
        note: Told the kind and description of each fault.

    Raises:
        OptionError: See `DemonstrationBuilder`.
    """

    def __init__(
        self,
        topics: Sequence[StateTopic],
        channels: Sequence[str],
        sample_rate: float | None,
        open_writer: Callable[[tuple[Feature, ...], Origin], Writer],
        note: Callable[[str, str], None],
    ) -> None:
        self._topics = tuple(topics)
        self._channels = tuple(channels)
        self._sample_rate = sample_rate
        self._open_writer = open_writer
        self._note = note
        # Refuses topics and rates that no demonstration can have, before one begins.
        DemonstrationBuilder(self._topics, self._channels, sample_rate)
        self._watch = TakeoverWatch(self._channels)
        self._latest: dict[str, _Message] = {}
        self._recent: dict[str, RecentStates] = {}
        # Topics whose last message was refused.
        self._unclear: set[str] = set()
        self._may_miss = {topic.name for topic in self._topics if topic.may_miss}
        self._usable: set[str] = set()
        # Actions of the demonstration under way that came before its first state.
        self._early = 0
        self._held: dict[str, str] = {}
        self._builder: DemonstrationBuilder | None = None
        self._writer: Writer | None = None
        # The demonstration that ended last, as long as it may be meant to be thrown away.
        self._ended: _Ended | None = None
        # What was recorded of a takeover that ended because the executor drove on, until a person
        # ends it, too.
        self._handed_back = ""
        self._retry_at = -math.inf
        self.origin = Origin.DEMONSTRATION
        """Why the demonstration under way, or the one that ended last, is or was shown."""
        self.awaited = False
        """Whether a person was asked to show what failed, and no row of that has come yet."""
        self.rows = 0
        """Rows written in this session."""
        self.lost = 0
        """Rows that could not be written."""
        self.failed = 0
        """How often the executor was said to have failed."""
        self.failure = ""
        """Why rows cannot be written at the moment; empty while they can."""

    @property
    def takeovers(self) -> int:
        """How often a person has taken over from the executor."""
        return self._watch.takeovers

    @property
    def recording(self) -> bool:
        """Whether actions become rows."""
        return self._builder is not None

    def knows(self, topic: str) -> bool:
        """Whether a state topic has ever had a message that a row can be made of."""
        return topic in self._usable

    @property
    def writer(self) -> Writer | None:
        """The file of the demonstration under way, once that has a row."""
        return self._writer

    def observe(
        self,
        stamp: int,
        topic: str,
        values: Sequence[float],
        labels: Sequence[str],
        sent: int | None = None,
    ) -> None:
        """Takes a state message (see `DemonstrationBuilder.observe`)."""
        before = self._latest.get(topic)
        if not labels and before is not None and len(before.labels) == len(values):
            # Some publishers name their fields in the first message only.
            labels = before.labels
        message = _Message(stamp, values, labels, sent)
        if self._builder is None:
            self._latest[topic] = message
            self._unclear.discard(topic)
            if topic in self._may_miss or (values and all(map(math.isfinite, values))):
                self._usable.add(topic)
            return
        with self._noting_faults():
            # What is refused may be an intruder or the first of a new length: a demonstration to
            # come begins with neither of both kinds, but with the message after it.
            self._unclear.add(topic)
            rows = self._builder.observe(stamp, topic, values, labels, sent)
            self._unclear.discard(topic)
            self._usable.add(topic)
            self._latest[topic] = message
            self._write(rows)

    def act(self, stamp: int, channel: str, label: str, sent: int | None = None) -> None:
        """Takes an action message (see `DemonstrationBuilder.act`)."""
        before = self._watch.act(stamp, channel, label, awaited=self.awaited)
        if before is not None and self.recording:
            self._end(stamp)
            self._begin(stamp, Origin.TAKEOVER, before)
        self._held[channel] = label
        if self._builder is not None:
            with self._noting_faults():
                self._write(self._builder.act(stamp, channel, label, sent))

    def command(self, stamp: int, channel: str, label: str) -> None:
        """Takes a command of the executor: what is held by a person ends with it."""
        if self._watch.command(stamp, channel, label):
            self._hand_over(stamp)

    def drive(self, stamp: int, driving: bool) -> None:
        """Takes note of whether the executor drives."""
        if self._watch.drive(driving):
            self._hand_over(stamp)

    def start(self, stamp: int) -> Answer:
        """Begins to record, with a new demonstration."""
        if self.recording:
            return Answer(True, "already recording.")
        # States were not taken since they were added last.
        self._recent.clear()
        self._ended = None
        self._handed_back = ""
        self._begin(stamp)
        return Answer(True, "recording: the demonstration begins with the first action.")

    def stop(self, stamp: int) -> Answer:
        """Ends the demonstration and records no more."""
        if not self.recording:
            return Answer(True, "recording had stopped already.")
        ended = self._end(stamp)
        self._builder = None
        self.awaited = False
        self._handed_back = ""
        if not ended.success and not self.failure and self.rows:
            rows = _count(self.rows)
            return Answer(True, f"stopped; no rows since the last demonstration, {rows} in all.")
        return Answer(ended.success, f"stopped; {ended.message}")

    def renew(self, stamp: int) -> Answer:
        """Ends the demonstration and begins the next one.

        A takeover that has ended already, since the executor drives on, is meant where no row came
        after it.
        """
        if not self.recording:
            return Answer(False, "not recording: call ~/record with true first.")
        ended = self._end(stamp)
        if ended.message == NO_ROWS and self._handed_back:
            ended = Answer(True, f"the takeover is kept: {self._handed_back}")
        self._handed_back = ""
        self.awaited = False
        self._begin(stamp)
        return Answer(ended.success, f"{ended.message} A new demonstration has begun.")

    def fail(self, stamp: int) -> Answer:
        """The executor has failed, and a person shows next how it is done, from wherever it is.

        The demonstration under way ends.  A takeover did not save the episode: it is kept, but set
        aside, so that it is not learned from.
        """
        self.failed += 1
        self._handed_back = ""
        taken_over = self.recording and self.origin is Origin.TAKEOVER
        if self.recording:
            ended = self._end(stamp, aside=taken_over)
            # What failed may have failed before anybody did anything.
            ended = ended._replace(success=not self.failure)
        else:
            # States were not taken since they were added last.
            self._recent.clear()
            ended = Answer(True, "recording.")
        # It was right until it failed.
        self._ended = None
        self._await(stamp)
        # Soon after a takeover it drives again.
        disable = "disable the executor, " if self._watch.driven or taken_over else ""
        return Answer(
            ended.success,
            f"{ended.message} Now {disable}put the robot back to where the episode began, or leave "
            "it where it is, and show how it is done, to the end; then call ~/new_demonstration.",
        )

    def discard(self, stamp: int) -> Answer:
        """Throws the demonstration under way away and begins the next one.

        Where it has no row yet, the one that ended just before is meant.  What ended before that
        stays: who calls this twice loses one demonstration, not two.
        """
        if not self.recording:
            which = (
                f"the one that ended last is {self._ended.writer.path}, a file"
                if self._ended is not None
                else "a demonstration that has ended is a file"
            )
            return Answer(False, f"not recording: {which} that you can delete.")
        self._handed_back = ""
        ended, self._ended = self._ended, None
        writer, self._writer = self._writer, None
        origin = self.origin
        if writer is None and ended is not None:
            writer, origin = ended
        if origin is Origin.FAILED:
            self._await(stamp)
        else:
            self._begin(stamp)
        if writer is None:
            return Answer(False, "there is no row to discard; a new demonstration has begun.")
        try:
            rows = writer.rows
            writer.discard()
        except RebtError as err:
            return Answer(False, str(err))
        self.rows -= rows
        return Answer(
            True, f"discarded {_count(rows)} in {writer.path}; a new demonstration has begun."
        )

    def set_back(self, stamp: int) -> None:
        """Simulated time begins anew: so does the demonstration, and what was before is not known.

        Args:
            stamp: What time it is now.
        """
        # They are kept for what their values are called.
        self._unclear.update(self._latest)
        self._recent.clear()
        self._held.clear()
        if not self.recording:
            return
        if self._writer is not None:
            self._note(
                SET_BACK,
                "simulated time was set back: the demonstration ends with "
                f"{_count(self._writer.rows)}, and another one begins.",
            )
        self._end(stamp)
        self._begin(stamp, Origin.FAILED if self.awaited else Origin.DEMONSTRATION)

    def look(self, stamp: int) -> None:
        """Sees to it that the rows written so far are where they are said to be."""
        try:
            if self._writer is not None:
                self._writer.look()
        except RebtError as err:
            assert self._builder is not None
            self._abandon(str(err))
            # The disk refused nothing: there is no need to wait before the next file.
            self._retry_at = -math.inf
            self._begin(stamp, self.origin)

    def sync(self, stamp: int) -> None:
        """Makes the rows written so far survive a loss of power."""
        try:
            if self._writer is not None:
                self._writer.sync()
        except RebtError as err:
            # Whether the rows before are on the disk is not known: another file begins.
            assert self._builder is not None
            self._abandon(str(err))
            self._begin(stamp, self.origin)

    def _hand_over(self, stamp: int) -> None:
        """The executor drives from now on: no action is held by a person any more."""
        if self.recording:
            shown = self._writer is not None and self.origin is not Origin.DEMONSTRATION
            ended = self._end(stamp)
            if shown and ended.success:
                self._handed_back = ended.message
        self._held.clear()
        if self.recording:
            self._begin(stamp, Origin.FAILED if self.awaited else Origin.DEMONSTRATION)

    def _await(self, stamp: int) -> None:
        """Starts a demonstration of what failed, with what a person does from now on."""
        self._held.clear()
        self.awaited = True
        self._begin(stamp, Origin.FAILED)

    def _begin(
        self,
        stamp: int,
        origin: Origin = Origin.DEMONSTRATION,
        before: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        """Starts a demonstration that knows the present state, and of the past only `before`."""
        self.origin = origin
        builder = DemonstrationBuilder(
            self._topics, self._channels, self._sample_rate, before, self._recent
        )
        for topic, (when, values, labels, sent) in self._latest.items():
            if topic in self._unclear:
                continue
            with contextlib.suppress(BadMessageError):
                builder.observe(when, topic, values, labels, sent)
        if self._sample_rate is not None:
            for channel, label in self._held.items():
                with contextlib.suppress(BadMessageError):
                    builder.act(stamp, channel, label)
        self._builder = builder
        self._early = 0

    def _end(self, stamp: int, *, aside: bool = False) -> Answer:
        """Closes the file under way, or sets it aside."""
        if self._sample_rate is not None:
            self._take_due(stamp)
        writer, self._writer = self._writer, None
        early = self._left_out()
        if writer is None and self.failure:
            return Answer(False, f"rows were lost: {self.failure}{early}")
        if writer is None:
            # Nobody has to show what failed, nor what a tree does.
            is_right = (self.awaited or self.origin is Origin.TAKEOVER) and not early
            return Answer(is_right, f"{NO_ROWS}{early}")
        try:
            writer.set_aside() if aside else writer.close()
        except RebtError as err:
            self.failure = str(err)
            return Answer(False, str(err))
        if not aside:
            self._ended = _Ended(writer, self.origin)
        rows = f"{_count(writer.rows)} in {writer.path}"
        if aside:
            return Answer(True, f"the takeover did not help and is set aside: {rows}.{early}")
        return Answer(True, f"recorded {rows}.{early}")

    def _left_out(self) -> str:
        """A sentence on actions of the demonstration under way that came too early."""
        if not self._early:
            return ""
        came = "1 action is" if self._early == 1 else f"{self._early} actions are"
        return f" {came} left out, which came before the first state."

    def _take_due(self, stamp: int) -> None:
        """Takes the samples that are due since the last message."""
        assert self._builder is not None
        for channel in self._held:
            with contextlib.suppress(BadMessageError):
                self._write(self._builder.act(stamp, channel, ""))

    @contextlib.contextmanager
    def _noting_faults(self) -> Iterator[None]:
        try:
            yield
        except BadMessageError as err:
            self._early += err.fault is Fault.NO_STATE
            self._note(err.fault.value, str(err))

    def _write(self, rows: Sequence[Row]) -> None:
        self.awaited = self.awaited and not rows
        for position, row in enumerate(rows):
            if not self._written(row):
                self.lost += len(rows) - position
                # What comes after a gap is another demonstration: its LAT starts anew.
                self._begin(row.stamp, self.origin)
                return

    def _written(self, row: Row) -> bool:
        try:
            if self._writer is None:
                if time.monotonic() < self._retry_at:
                    return False
                assert self._builder is not None
                assert self._builder.features is not None
                self._writer = self._open_writer(self._builder.features, self.origin)
            self._writer.write(row)
        except RebtError as err:
            self._abandon(str(err))
            return False
        self.rows += 1
        self.failure = ""
        return True

    def _abandon(self, why: str) -> None:
        writer, self._writer = self._writer, None
        self._retry_at = time.monotonic() + _RETRY_AFTER
        self.failure = why
        self._note(WRITE_ERROR, why)
        if writer is not None:
            with contextlib.suppress(RebtError):
                writer.close() if writer.rows else writer.discard()


def _count(rows: int) -> str:
    return f"{rows} row{'' if rows == 1 else 's'}"
