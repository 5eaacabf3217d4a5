"""The only place where rows of a demonstration are made.

Callbacks of live nodes and loops over bags push the same messages, in the order in which they were
received, into a `DemonstrationBuilder`, which returns the rows that they complete.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import chain

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.recent_states import RecentStates
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError, OptionError

#: Larger values are refused: decision trees compare in single precision, which ends soon after.
LARGEST_VALUE = 1e38

#: Bounds of the sample rate (rows per second).
_LEAST_RATE, _LARGEST_RATE = 1e-6, 1e6

#: Sampling pauses if no state arrived for this long (nanoseconds).
_STALE = 1_000_000_000


class Fault(Enum):
    """What may be wrong with a message."""

    UNKNOWN_TOPIC = "unknown topic"
    EMPTY = "empty message"
    LENGTH = "unexpected length"
    NAMES = "unexpected names"
    NOT_FINITE = "value that is not finite"
    TOO_LARGE = "value that is too large"
    LABEL = "unusable action label"
    NO_STATE = "action before the first state"


class BadMessageError(InputError):
    """A message that cannot become part of a demonstration; the builder is unchanged."""

    def __init__(self, fault: Fault, text: str) -> None:
        super().__init__(text)
        self.fault = fault


@dataclass(frozen=True, slots=True)
class StateTopic:
    """A topic that carries numbers of the state."""

    name: str
    fields: tuple[str, ...] = ()
    """Names of its values; empty: those of the first message's labels, or else indices."""
    may_miss: bool = False
    """Whether values may be missing (NaN); otherwise a message with such a value is refused."""

    def __post_init__(self) -> None:
        if len(set(self.fields)) != len(self.fields):
            raise OptionError(f"the field names of state topic {self.name!r} must differ.")


class DemonstrationBuilder:
    """Turns a stream of state and action messages into rows.

    In event mode, a row is one action message.  In sampled mode, it is one instant of a fixed grid,
    on each channel that has an action, from its first message on; an empty label ends the action.

    A row has the newest states that the builder received.  In event mode, messages may carry the
    time at which they were sent.  Then a row has the newest states that were sent before its
    action, whatever the order of arrival.

    Args:
        topics: State topics, in the order of their features.
        channels: Action topics; each is a channel with a LAT of its own.
        sample_rate: Rows per second and channel while an action holds; None for event mode.
        before: What was done on each channel before the demonstration, most recent last.
        recent: States by topic that were sent before the demonstration, for late actions; the
            builder adds to them.

    Raises:
        OptionError: There is no topic or channel, one is named twice, or the rate is out of bounds.
    """

    def __init__(
        self,
        topics: Sequence[StateTopic],
        channels: Sequence[str],
        sample_rate: float | None = None,
        before: Mapping[str, Sequence[str]] | None = None,
        recent: dict[str, RecentStates] | None = None,
    ) -> None:
        names = [topic.name for topic in topics]
        if not names or not channels:
            raise OptionError("a demonstration needs at least one state topic and action topic.")
        if len({*names, *channels}) != len(names) + len(channels):
            raise OptionError(f"the topics {[*names, *channels]} must differ from each other.")
        if sample_rate is not None and not (_LEAST_RATE <= sample_rate <= _LARGEST_RATE):
            raise OptionError(
                f"the sample rate must lie between {_LEAST_RATE:g} and {_LARGEST_RATE:g} rows per "
                f"second, not {sample_rate}."
            )
        self._fields: dict[str, tuple[str, ...]] = {one.name: one.fields for one in topics}
        # Topics whose messages name their values.
        self._self_named: set[str] = set()
        self._may_miss = frozenset(one.name for one in topics if one.may_miss)
        self._latest: dict[str, tuple[float, ...]] = {}
        self._recent = {} if recent is None else recent
        self._features: tuple[Feature, ...] | None = None
        self._history = {
            channel: ActionHistory((before or {}).get(channel, ())) for channel in channels
        }
        self._held: dict[str, str] = {}
        self._period = None if sample_rate is None else round(1e9 / sample_rate)
        self._next_sample: int | None = None
        self._last_observed = 0

    @property
    def features(self) -> tuple[Feature, ...] | None:
        """The features, once every state topic has sent a message."""
        return self._features

    def observe(
        self,
        stamp: int,
        topic: str,
        values: Sequence[float],
        labels: Sequence[str] = (),
        sent: int | None = None,
    ) -> tuple[Row, ...]:
        """Takes a state message.

        Args:
            stamp: Stamp of the rows that it completes, nanoseconds; usually when it was received.
            topic: The state topic.
            values: Its numbers.
            labels: Names that the message gives to its numbers.  Those of the topic's first message
                name its features, if nothing else does.  The numbers of a later message with
                another order of labels are put in this order.
            sent: When it was sent, nanoseconds, by the clock of all messages; None if unknown.

        Returns:
            The sampled rows that were due before it; none in event mode.

        Raises:
            BadMessageError: The message was refused.
        """
        state = tuple(map(float, values))
        self._check_state(topic, state)
        if topic in self._self_named:
            state = self._by_name(topic, state, labels)
        due = self._sample_until(stamp)
        if topic not in self._latest and not self._fields[topic]:
            if _names(labels, state):
                self._fields[topic] = tuple(labels)
                self._self_named.add(topic)
            else:
                base = _base(topic)
                self._fields[topic] = tuple(f"{base}[{index}]" for index in range(len(state)))
        self._latest[topic] = state
        if sent is None:
            self._recent.pop(topic, None)
        else:
            self._recent.setdefault(topic, RecentStates()).add(sent, state)
        self._last_observed = stamp
        if self._features is None and len(self._latest) == len(self._fields):
            self._features = _features(self._fields)
        return due

    def act(self, stamp: int, channel: str, label: str, sent: int | None = None) -> tuple[Row, ...]:
        """Takes an action message.

        Args:
            stamp: Stamp of its row, nanoseconds; usually when it was received.
            channel: The action topic.
            label: The action; empty if the action ends.
            sent: When it was sent, nanoseconds, by the clock of all messages; None if unknown.

        Returns:
            The rows that it completes: its own in event mode, those due before it in sampled mode.

        Raises:
            BadMessageError: The message was refused.
        """
        if channel not in self._history:
            raise BadMessageError(
                Fault.UNKNOWN_TOPIC, f"{channel!r} is not one of the action topics."
            )
        if not label.isprintable():
            raise BadMessageError(
                Fault.LABEL,
                f"action topic {channel!r} sent the label {label!r}: "
                "labels must consist of printable characters.",
            )
        states = self._states_at(None if self._period is not None else sent, label)
        due = self._sample_until(stamp)
        if not label:
            self._held.pop(channel, None)
            return due
        self._held[channel] = label
        if self._period is not None:
            if self._next_sample is None:
                self._next_sample = stamp
            return due
        return (self._row(stamp, channel, label, states),)

    def interrupt(self) -> None:
        """Ends all held actions, because messages are missing from here on."""
        self._held.clear()
        self._next_sample = None

    def _states_at(self, sent: int | None, label: str) -> tuple[tuple[float, ...], ...]:
        """The state of each topic that an action belongs to.

        Raises:
            BadMessageError: One of them is unknown.
        """
        states = []
        for topic in self._fields:
            recent = self._recent.get(topic)
            known = self._latest.get(topic)
            came = "came before the first usable message"
            if known is not None and sent is not None and recent is not None:
                known = recent.at(sent)
                came = "was sent before the first usable message that is known"
            if known is None:
                raise BadMessageError(
                    Fault.NO_STATE,
                    f"action {label!r} {came} on state topic {topic!r}: "
                    "it is left out, because the state it belongs to is not known.",
                )
            states.append(known)
        return tuple(states)

    def _check_state(self, topic: str, state: tuple[float, ...]) -> None:
        if topic not in self._fields:
            raise BadMessageError(Fault.UNKNOWN_TOPIC, f"{topic!r} is not one of the state topics.")
        expected = len(self._latest.get(topic) or self._fields[topic])
        if not state:
            raise BadMessageError(
                Fault.EMPTY, f"state topic {topic!r} sent a message without values."
            )
        if expected and len(state) != expected:
            raise BadMessageError(
                Fault.LENGTH,
                f"state topic {topic!r} sent {len(state)} values where {expected} were expected: "
                "every message of a topic must have the same length.",
            )
        # The sum shows at once whether any value is not finite.
        if (
            math.isfinite(sum(state))
            and -LARGEST_VALUE <= min(state) <= max(state) <= LARGEST_VALUE
        ):
            return
        for index, value in enumerate(state):
            if math.isnan(value) and topic in self._may_miss:
                continue
            if not math.isfinite(value):
                raise BadMessageError(
                    Fault.NOT_FINITE,
                    f"state topic {topic!r} sent {value} at index {index}: "
                    "replace it with a finite number before publishing.",
                )
            if abs(value) > LARGEST_VALUE:
                raise BadMessageError(
                    Fault.TOO_LARGE,
                    f"state topic {topic!r} sent {value} at index {index}: "
                    f"values must lie within ±{LARGEST_VALUE:g}.",
                )

    def _by_name(
        self, topic: str, state: tuple[float, ...], labels: Sequence[str]
    ) -> tuple[float, ...]:
        """The values of a message in the order of the features.

        Raises:
            BadMessageError: Its names differ from those of the topic.
        """
        fields = self._fields[topic]
        if tuple(labels) == fields or not _names(labels, state):
            return state
        places = {label: place for place, label in enumerate(labels)}
        if len(fields) == 1:
            # The label of a single value may be anything, such as its unit or a count.
            return state
        if places.keys() != set(fields):
            raise BadMessageError(
                Fault.NAMES,
                f"state topic {topic!r} calls its values {', '.join(labels)}, and before "
                f"{', '.join(fields)}: what they are called must not change.",
            )
        return tuple(state[places[name]] for name in fields)

    def _row(
        self, stamp: int, channel: str, label: str, states: Iterable[tuple[float, ...]]
    ) -> Row:
        history = self._history[channel]
        last_action = history.before(label)
        history.take(label)
        return Row(stamp, channel, label, last_action, tuple(chain.from_iterable(states)))

    def _sample_until(self, stamp: int) -> tuple[Row, ...]:
        if self._period is None or self._next_sample is None:
            return ()
        rows: list[Row] = []
        end = min(stamp, self._last_observed + _STALE)
        states = [self._latest[topic] for topic in self._fields]
        while self._next_sample < end:
            rows += [self._row(self._next_sample, *held, states) for held in self._held.items()]
            self._next_sample += self._period
        if self._next_sample < stamp or self._next_sample > stamp + self._period:
            # After silence, or when the clock was set back, the grid starts again here.
            self._next_sample = stamp
        # No message is newer than the current one, whatever the clock said.
        self._last_observed = min(self._last_observed, stamp)
        return tuple(rows)


def _features(fields: dict[str, tuple[str, ...]]) -> tuple[Feature, ...]:
    """A feature has the name of its field, after that of its topic if two topics share the name."""
    names = [name for topic in fields for name in fields[topic]]
    ambiguous = len(set(names)) != len(names)
    return tuple(
        Feature(f"{topic}/{name}" if ambiguous else name, topic=topic, index=index)
        for topic in fields
        for index, name in enumerate(fields[topic])
    )


def is_label(text: str) -> bool:
    r"""Whether an action can have this label.

    >>> is_label("turn left"), is_label(""), is_label("two\nlines")
    (True, False, False)
    """
    return bool(text) and text.isprintable()


def _names(labels: Sequence[str], state: Sequence[float]) -> bool:
    """Whether labels name every value."""
    return len(labels) == len(state) == len(set(labels)) and all(labels)


def _base(topic: str) -> str:
    return topic.rsplit("/", 1)[-1]
