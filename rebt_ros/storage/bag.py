"""rosbag2 recordings as demonstrations.

The messages of a bag go through the same `DemonstrationBuilder` as those that the live recorder
receives, so that the same messages give the same rows.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from struct import Struct
from textwrap import shorten
from typing import Final, Protocol, cast

from rosbags.typesys import Stores, get_typestore

from rebt_ros.arrays import FloatArray
from rebt_ros.demonstration.builder import BadMessageError, DemonstrationBuilder, Fault, StateTopic
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.fields import ArrayMessage, names_of, values_of
from rebt_ros.demonstration.large_arrays import GrowingArray
from rebt_ros.errors import InputError, printable
from rebt_ros.storage.account import Account
from rebt_ros.storage.bag_files import GAP, BagFiles, Message, Topic, explained, opened_bag
from rebt_ros.storage.bag_safety import check_expansion, expansion
from rebt_ros.storage.packing import ZSTD_MAGIC, unzstd
from rebt_ros.storage.read import Read

STATE_TYPE = "std_msgs/msg/Float64MultiArray"
ACTION_TYPE = "std_msgs/msg/String"

#: So many messages can have been recorded at the same time.
_FEW: Final = 4

#: A state this old (nanoseconds), and so many times as old as is usual on its topic, is one that a
#: sensor left behind which has fallen silent.
_OLD: Final = 1_000_000_000
_SILENT: Final = 10.0

#: So far from each other (nanoseconds) are times by different clocks.
_ANOTHER_CLOCK: Final = 86_400_000_000_000

#: Topics of texts that describe a robot, which is no action.
_DESCRIPTIONS: Final = frozenset({"robot_description", "robot_description_semantic"})

#: So many different messages of so many bytes are remembered.
_MOST_LABELS: Final = 1000
_LONGEST_LABEL: Final = 1000

#: Longest list of topics in a sentence (characters).
_LONGEST_LIST: Final = 500

#: Later than any clock tells (nanoseconds): stamps are signed 64-bit numbers.
LATEST = 2**63


def read_bag(
    path: Path,
    *,
    state_topics: Sequence[StateTopic] = (),
    action_topics: Sequence[str] = (),
    sample_rate: float | None = None,
    skip_bad: bool = False,
) -> Read:
    """Reads a bag.

    Args:
        path: A bag's directory, or a single .mcap or .db3 file, packed with zstd or not.
        state_topics: Topics of the state, with or without their leading slash; by default the
            only one of type std_msgs/msg/Float64MultiArray.
        action_topics: Topics of the actions; by default the only one of type std_msgs/msg/String.
        sample_rate: Rows per second and channel while an action holds; None: one row per action
            message.
        skip_bad: Leave out messages that cannot be used, and note how many, instead of refusing
            the bag.  Actions before the first state are always left out.

    Returns:
        The rows that the recorder would have made from these messages.

    Raises:
        InputError: The bag cannot be read, lacks the topics or holds unusable messages.
        OptionError: A topic is named twice, or the sample rate is not positive.
    """
    with opened_bag(path) as bag:
        names = [one.name for one in state_topics]
        with with_notes(bag):
            kinds = kinds_of(bag)
            if not kinds:
                raise InputError(no_messages(path, bag, "state and action topics"))
            states = _chosen(path, kinds, names, STATE_TYPE, "state")
            actions = _chosen(path, kinds, action_topics, ACTION_TYPE, "action", taken=states)
        topics = (
            [replace(one, name=name) for one, name in zip(state_topics, states, strict=True)]
            if state_topics
            else [StateTopic(name) for name in states]
        )
        builder = DemonstrationBuilder(topics, actions, sample_rate)
        wanted = {
            *((state, STATE_TYPE) for state in states),
            *((action, ACTION_TYPE) for action in actions),
        }
        feed = Feed(path, builder, skip_bad, {name: bag.found[name, STATE_TYPE] for name in states})
        demonstration = feed.demonstration(
            bag, messages_of(path, bag, wanted), (*states, *actions), sample_rate
        )
        return feed.read(bag, wanted, demonstration)


@dataclass(slots=True)
class Feed:
    """Hands messages to the builder and counts those that it does not take."""

    path: Path
    builder: DemonstrationBuilder
    skip_bad: bool
    there: Mapping[str, int]
    """Messages by state topic, of those that can be read."""
    states: _States = field(default_factory=lambda: _States())
    labels: _Labels = field(default_factory=lambda: _Labels())
    seen: Counter[str] = field(default_factory=Counter)
    """Messages by topic."""
    early: int = 0
    """Actions before the first state."""
    stale: int = 0
    """Actions after missing messages and before the next states."""
    unknown: set[str] = field(default_factory=set)
    """State topics whose last message may be missing."""
    earliest: int = LATEST
    """Stamp of a message."""
    latest: int = -LATEST
    """Stamp of another one."""
    bad: list[str] = field(default_factory=list)
    """What was wrong with the messages that were left out."""
    firsts: dict[str, int] = field(default_factory=dict)
    """Stamp of the first message by state topic."""
    last: dict[str, int] = field(default_factory=dict)
    """Stamp of the last message by state topic."""
    ages: dict[str, array[int]] = field(default_factory=dict)
    """How old states were in rows, by state topic; of those that may be too old (nanoseconds)."""

    def demonstration(
        self,
        bag: BagFiles,
        messages: Iterator[Message],
        topics: Sequence[str],
        sample_rate: float | None,
    ) -> Demonstration:
        """The rows that messages give.

        Args:
            bag: Where they are from.
            messages: Those of the topics.
            topics: In the order in which a person should look for what is missing.
            sample_rate: Rows per second and channel while an action holds; None: one row per
                action.

        Raises:
            InputError: There are no rows, or a message cannot be used.
        """
        rows = (row for message in messages for row in self.rows_of(*message))
        first = next(rows, None)
        if first is None or self.builder.features is None:
            with with_notes(bag):
                raise InputError(f"{self.path} gives no rows: {self.why_no_rows(topics)}.")
        return Demonstration.from_rows(
            self.path.absolute().name,
            self.builder.features,
            chain((first,), rows),
            RowKind.EVENT if sample_rate is None else RowKind.SAMPLE,
            GrowingArray(),
        )

    def read(self, bag: BagFiles, wanted: set[Topic], demonstration: Demonstration) -> Read:
        """A demonstration with the notes on it, and its account."""
        stated = sum(bag.stated.get(topic, bag.found[topic]) for topic in wanted)
        notes = (*bag.notes, *differences(bag, wanted), *self.notes())
        return Read(
            demonstration, tuple(map(printable, notes)), self.account(stated, demonstration)
        )

    def rows_of(self, topic: Topic, stamp: int, data: bytes) -> tuple[Row, ...]:
        """The rows that a message completes; none where it is left out.

        Raises:
            InputError: It cannot be used, and such messages are not left out.
        """
        if topic == GAP:
            self.builder.interrupt()
            # A topic on which nothing more comes still has its value, as far as can be known.
            self.unknown = {name for name, count in self.there.items() if self.seen[name] < count}
            return ()
        name, kind = topic
        self.seen[name] += 1
        # Calls of min and max would take a tenth of the time that a message does.
        if stamp < self.earliest:
            self.earliest = stamp
        if stamp > self.latest:
            self.latest = stamp
        if name in self.there:
            self.unknown.discard(name)
        elif self.unknown:
            self.stale += 1
            return ()
        try:
            rows = self.pushed(topic, stamp, data)
            if rows:
                self.compare(rows)
            if name in self.there:
                self.last[name] = stamp
                if self.seen[name] == 1:
                    self.firsts[name] = stamp
            return rows
        except BadMessageError as err:
            if err.fault is Fault.NO_STATE:
                self.early += 1
                return ()
            text = str(err).rstrip(".") + ("" if self.skip_bad else "; --skip-bad leaves it out")
            problem = InputError(f"{self.path}, message {self.seen[name]} on {name!r}: {text}.")
            problem.__cause__ = err
        except UndecodableError as err:
            problem = InputError(
                f"{self.path}, message {self.seen[name]} on {name!r} cannot be decoded as "
                f"{kind}{err}: leave it out (--skip-bad), or record the topic again."
            )
            problem.__cause__ = err
        except TooLargeError as err:
            problem = InputError(f"{self.path}, message {self.seen[name]} on {name!r}: {err}")
            problem.__cause__ = err
        except LateError:
            problem = InputError(
                f"{self.path}, message {self.seen[name]} on {name!r} has the time {stamp} "
                "(nanoseconds), which no clock tells: leave it out (--skip-bad), or record again."
            )
        if not self.skip_bad:
            raise problem
        self.bad.append(str(problem))
        return ()

    def pushed(self, topic: Topic, stamp: int, data: bytes) -> tuple[Row, ...]:
        """The rows that a message completes.

        Raises:
            BadMessageError: The builder refuses it.
            UndecodableError: It cannot be decoded.
            LateError: Its stamp is too large.
            TooLargeError: It could unpack to too much.
        """
        name, kind = topic
        if stamp >= LATEST:
            raise LateError
        data = unpacked(data)
        if kind == ACTION_TYPE:
            return self.builder.act(stamp, name, self.labels.read(data))
        values, labels = self.states.read(data)
        return self.builder.observe(stamp, name, values, labels)

    def compare(self, rows: Sequence[Row]) -> None:
        """Remembers how old the states of rows are."""
        for row in rows:
            for name, stamp in self.last.items():
                # What has no time at all is told as such.
                if row.stamp - stamp > _OLD and stamp > 0:
                    self.ages.setdefault(name, array("q")).append(row.stamp - stamp)

    def account(self, stated: int, demonstration: Demonstration) -> Account:
        """Where the messages went, of which the bag states so many."""
        left_out = {
            "came before the first state": self.early,
            "came after missing messages, before the next state": self.stale,
            "cannot be used": len(self.bad),
        }
        return Account(
            "messages",
            stated,
            self.seen.total() - self.early - self.stale - len(self.bad),
            len(demonstration),
            {reason: count for reason, count in left_out.items() if count},
        )

    def notes(self) -> tuple[str, ...]:
        """What was left out; no full stops."""
        notes = []
        if self._has_no_times():
            notes.append(f"{self._no_times()}: they are taken in their order in the file")
        if self.early:
            notes.append(
                f"left out: {_counted(self.early, 'action')} before the first message of every "
                "state topic"
            )
        if self.stale:
            notes.append(
                f"left out: {_counted(self.stale, 'action')} after messages that are missing, "
                "whose state is not known"
            )
        notes += self._on_clocks()
        notes += self._on_silence()
        if self.bad:
            notes.append(
                f"left out: {_counted(len(self.bad), 'unusable message')}; "
                f"the first: {self.bad[0].rstrip('.')}"
            )
        return tuple(notes)

    def _on_silence(self) -> Iterator[str]:
        """Notes on states that had grown old, where they come often as a rule."""
        actions = self.seen.total() - sum(self.seen[name] for name in self.there)
        for name in sorted(self.there):
            if self.seen[name] == 1 and actions > _FEW:
                yield f"{name!r} has a single message, whose values are the state of all rows"
        for name, ages in sorted(self.ages.items()):
            if self.seen[name] == 1:
                continue
            usual = (self.latest - self.earliest) / self.seen[name]
            old = [age for age in ages if age > _SILENT * usual]
            if old:
                yield (
                    f"{_counted(len(old), 'row')} have a state that is up to {max(old) / 1e9:.3g} "
                    f"seconds old, as nothing usable came on {name!r} for so long, where messages "
                    f"come every {usual / 1e9:.2g} seconds: see whether its sensor or driver "
                    f"failed{', or another clock stamped it' if max(old) > _ANOTHER_CLOCK else ''}"
                )

    def _on_clocks(self) -> Iterator[str]:
        """Notes on states that were recorded by another clock than the actions, or by none."""
        for name in sorted(self.there):
            begin, end = self.firsts.get(name, 0), self.last.get(name, 0)
            if self._has_no_times() or self.seen[name] <= 1:
                continue
            if begin == end and self.seen[name] > _FEW:
                yield (
                    f"all messages on {name!r} were recorded at the same time ({begin} ns), and "
                    "others were not, so that the last one is the state of all rows: record again"
                )

    def _has_no_times(self) -> bool:
        return self.earliest == self.latest and self.seen.total() > _FEW

    def _no_times(self) -> str:
        return (
            f"all messages were recorded at the same time ({self.earliest} ns), as under "
            "use_sim_time without /clock"
        )

    def why_no_rows(self, topics: Sequence[str]) -> str:
        """Why there are no rows, and what helps."""
        for topic in topics:
            if not self.seen[topic]:
                return f"there is no message on {topic!r}; record it together with the others"
        if self.early:
            ahead = min(self.firsts.values(), default=0) - self.earliest
            if ahead > _ANOTHER_CLOCK:
                return (
                    f"all actions came before the first state, by up to {ahead / 86_400e9:.3g} "
                    "days, as where they were recorded by another clock; record all by one clock"
                )
            return "all actions came before the first state; start the state topics first"
        if self._has_no_times():
            return f"{self._no_times()}; leave out --sample-rate, or record with a clock"
        return "no action has a label, or none is held until a sample is due; record longer ones"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


class UndecodableError(Exception):
    """The bytes of a message are not one of its type; the text says why, if it is known."""


class TooLargeError(Exception):
    """A message could unpack to too much."""


class LateError(Exception):
    """The stamp of a message is later than any clock tells."""


class _String(Protocol):
    data: str


_TYPES = get_typestore(Stores.ROS2_JAZZY)

#: Bytes that align the numbers of a state message.
_PADDING: Final = 4

#: How messages of either byte order begin; other encapsulations align numbers otherwise.
_PLAIN_CDR: Final = (b"\0\0", b"\0\1")


def _decoded(data: bytes, kind: str) -> object:
    """A message.

    Raises:
        UndecodableError: It cannot be decoded.
    """
    check_encapsulation(data)
    try:
        return _TYPES.deserialize_cdr(data, kind)
    except Exception as err:
        # The generated decoders let whatever goes wrong inside them through.
        raise UndecodableError from err


def check_encapsulation(data: bytes) -> None:
    """Refuses what is no message of plain CDR.

    Raises:
        UndecodableError: It says how the data begin.
    """
    if not data:
        raise UndecodableError(" (it is empty)")
    if data[:2] not in _PLAIN_CDR:
        raise UndecodableError(
            f" (it begins with {data[:2].hex()}, and plain CDR with 0000 or 0001)"
        )


def _array(data: bytes) -> ArrayMessage[FloatArray]:
    """A state message.

    Raises:
        UndecodableError: It cannot be decoded.
    """
    try:
        return cast("ArrayMessage[FloatArray]", _decoded(data, STATE_TYPE))
    except UndecodableError:
        # Where there are no numbers, ROS 2 writes what aligns them all the same.
        message = cast("ArrayMessage[FloatArray]", _decoded(data[:-_PADDING], STATE_TYPE))
        if len(message.data):
            raise
        return message


@dataclass(frozen=True, slots=True)
class _Head:
    """What state messages of one length begin with: all of them but their numbers."""

    data: bytes
    numbers: Struct
    labels: tuple[str, ...]


class _States:
    """Reads state messages, which differ in their numbers alone as a rule.

    A message of the same length and with the same bytes up to its first number has the same layout
    and as many numbers, which are its last bytes.  So the layout is decoded once.
    """

    def __init__(self) -> None:
        self._heads: dict[int, _Head] = {}

    def read(self, data: bytes) -> tuple[tuple[float, ...], tuple[str, ...]]:
        """The numbers of a message, and the names that it gives to them.

        Raises:
            UndecodableError: It cannot be decoded.
        """
        head = self._heads.get(len(data))
        if head is not None and data.startswith(head.data):
            return head.numbers.unpack_from(data, len(head.data)), head.labels
        message = _array(data)
        values, labels = values_of(message), names_of(message)
        self._remember(data, values, labels)
        return tuple(values.tolist()), labels

    def _remember(self, data: bytes, values: FloatArray, labels: tuple[str, ...]) -> None:
        numbers = Struct(f"<{len(values)}d")
        head = data[: len(data) - numbers.size]
        little_endian = data[1:2] == b"\x01"
        if len(values) and little_endian and data[len(head) :] == values.tobytes():
            self._heads[len(data)] = _Head(head, numbers, labels)


class _Labels:
    """Reads action messages, of which there are few different ones as a rule."""

    def __init__(self) -> None:
        self._known: dict[bytes, str] = {}

    def read(self, data: bytes) -> str:
        """The text of a message.

        Raises:
            UndecodableError: It cannot be decoded.
        """
        label = self._known.get(data)
        if label is None:
            label = cast(_String, _decoded(data, ACTION_TYPE)).data
            if len(self._known) < _MOST_LABELS and len(data) <= _LONGEST_LABEL:
                self._known[data] = label
        return label


def unpacked(data: bytes) -> bytes:
    """A message without the compression of single messages; no message begins like that.

    Raises:
        TooLargeError: It could unpack to too much.
        UndecodableError: It cannot be unpacked.
    """
    if not data.startswith(ZSTD_MAGIC):
        return data
    try:
        check_expansion("it", expansion(data), len(data))
    except InputError as err:
        raise TooLargeError(str(err)) from err
    try:
        return unzstd(data)
    except Exception as err:
        raise UndecodableError from err


@contextmanager
def with_notes(bag: BagFiles) -> Iterator[None]:
    """Adds to a refusal what is wrong with the files, which may be its reason."""
    try:
        yield
    except InputError as err:
        if not bag.notes:
            raise
        told = shorten("; ".join(bag.notes), _LONGEST_LIST, placeholder=" ...")
        raise InputError(f"{str(err).rstrip('.')} ({told}).") from err


def messages_of(path: Path, bag: BagFiles, wanted: set[Topic]) -> Iterator[Message]:
    """The messages of some topics; whatever damage there is raises `InputError`."""
    with explained(path):
        yield from bag.messages(wanted)


def differences(bag: BagFiles, wanted: set[Topic]) -> Iterator[str]:
    """Notes of what the account, which is about all topics together, does not tell."""
    for name in sorted({name for name, _ in wanted}):
        if count := bag.others_found[name]:
            yield f"left out: {bag.others[name]} messages on {name}: {count}"
        for topic in sorted(bag.found.keys() - wanted):
            if topic[0] == name and (count := bag.found[topic]):
                kind = topic[1] or "unknown"
                yield f"left out: messages on {name} of type {kind}: {count}"
    told = {topic: bag.stated.get(topic, bag.found[topic]) for topic in sorted(wanted)}
    if sum(told.values()) == sum(bag.found[topic] for topic in told):
        for topic, stated in told.items():
            if stated != bag.found[topic]:
                yield (
                    f"the input says that {topic[0]} has {stated} messages, and "
                    f"{bag.found[topic]} were found"
                )


def no_messages(path: Path, bag: BagFiles, topics: str) -> str:
    """What to say of a bag without messages, which may be due to damage."""
    if bag.is_incomplete:
        return f"{path} holds no messages that can be read: record {topics} again."
    return f"{path} holds no messages: record {topics} first."


def kinds_of(bag: BagFiles) -> dict[str, dict[str, int]]:
    """Messages of each topic that has some, by their type, or by their encoding."""
    kinds: dict[str, dict[str, int]] = {}
    for (name, kind), count in sorted(bag.found.items()):
        if count:
            kinds.setdefault(name, {})[kind or "unknown"] = count
    for name, encoding in sorted(bag.others.items()):
        if count := bag.others_found[name]:
            kinds.setdefault(name, {})[f"{encoding} messages"] = count
    return kinds


def listed(kinds: Mapping[str, Mapping[str, int]]) -> str:
    """The topics that `kinds_of` gives, for a message."""
    topics = ", ".join(f"{topic} ({', '.join(its)})" for topic, its in kinds.items())
    return shorten(topics, _LONGEST_LIST, placeholder=" ...")


def named(topics: Collection[str], name: str) -> str | None:
    """The topic of a name, with or without its leading slash; None where there is none."""
    by_name = {topic.lstrip("/"): topic for topic in topics} | {topic: topic for topic in topics}
    return by_name.get(name) or by_name.get(name.lstrip("/"))


def _chosen(
    path: Path,
    kinds: dict[str, dict[str, int]],
    names: Sequence[str],
    kind: str,
    role: str,
    taken: Sequence[str] = (),
) -> tuple[str, ...]:
    """The topics to read, as the bag has them; unless named, none that is taken."""
    candidates = [
        topic
        for topic, its in kinds.items()
        if kind in its and topic not in taken and topic.rpartition("/")[2] not in _DESCRIPTIONS
    ]
    if not names and len(candidates) == 1:
        return (candidates[0],)
    if not names and candidates:
        raise InputError(
            f"{path} has {len(candidates)} topics of type {kind} ({', '.join(candidates)}): "
            f"say which of them is the {role} topic (--{role}-topic)."
        )
    there = listed(kinds)
    if not names:
        raise InputError(
            f"{path} has no {role} topic of type {kind}: record one, or say by a robot file "
            f"(--robot), for which describe makes a beginning, what to take of {there}."
        )
    topics = []
    for name in names:
        topic = named(kinds, name)
        if topic is None:
            raise InputError(f"{path} has no messages on {role} topic {name!r}: there is {there}.")
        if kind not in kinds[topic]:
            raise InputError(
                f"{path}: {role} topic {name!r} must be of type {kind}: there is {there}."
            )
        topics.append(topic)
    return tuple(topics)
