"""rosbag2 recordings as demonstrations (the only module that imports rosbags).

The messages of a bag go through the same `DemonstrationBuilder` as those that the live recorder
receives, so that the same messages give the same rows.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from operator import itemgetter
from pathlib import Path
from struct import Struct
from textwrap import shorten
from typing import Protocol, cast

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from rebt_ros.arrays import FloatArray
from rebt_ros.demonstration.builder import BadMessageError, DemonstrationBuilder, Fault, StateTopic
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.fields import fields_of
from rebt_ros.errors import InputError, RebtError
from rebt_ros.storage.bag_safety import check_bag, check_expansion, expansion, guarded_databases
from rebt_ros.storage.read import Read
from rebt_ros.storage.text import unreadable

STATE_TYPE = "std_msgs/msg/Float64MultiArray"
ACTION_TYPE = "std_msgs/msg/String"

#: Names of the files that hold a bag's messages.
STORAGE_SUFFIXES = (".mcap", ".db3")
METADATA = "metadata.yaml"


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
        path: A bag's directory, or a single .mcap or .db3 file.
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
    with _opened(path) as reader:
        kinds = _topics(path, reader)
        if not kinds:
            raise InputError(f"{path} holds no messages: record state and action topics first.")
        names = [one.name for one in state_topics]
        states = _chosen(path, kinds, names, STATE_TYPE, "state")
        actions = _chosen(path, kinds, action_topics, ACTION_TYPE, "action")
        topics = (
            [replace(one, name=name) for one, name in zip(state_topics, states, strict=True)]
            if state_topics
            else [StateTopic(name) for name in states]
        )
        builder = DemonstrationBuilder(topics, actions, sample_rate)
        wanted = [one for one in reader.connections if one.topic in {*states, *actions}]
        feed = _Feed(path, builder, skip_bad)
        rows = (
            row for message in _messages(path, reader, wanted) for row in feed.rows_of(*message)
        )
        first = next(rows, None)
        if first is None or builder.features is None:
            raise InputError(f"{path} gives no rows: {feed.why_no_rows(states, actions)}.")
        demonstration = Demonstration.from_rows(
            path.absolute().name,
            builder.features,
            chain((first,), rows),
            RowKind.EVENT if sample_rate is None else RowKind.SAMPLE,
        )
    return Read(demonstration, feed.notes())


@dataclass(slots=True)
class _Feed:
    """Hands messages to the builder and counts those that it does not take."""

    path: Path
    builder: DemonstrationBuilder
    skip_bad: bool
    states: _States = field(default_factory=lambda: _States())
    seen: Counter[str] = field(default_factory=Counter)
    """Messages by topic."""
    early: int = 0
    """Actions before the first state."""
    bad: list[str] = field(default_factory=list)
    """What was wrong with the messages that were left out."""

    def rows_of(self, connection: Connection, stamp: int, data: bytes) -> tuple[Row, ...]:
        topic = connection.topic
        self.seen[topic] += 1
        try:
            return self._pushed(connection, stamp, data)
        except BadMessageError as err:
            if err.fault is Fault.NO_STATE:
                self.early += 1
                return ()
            problem = InputError(f"{self.path}, message {self.seen[topic]} on {topic!r}: {err}")
            problem.__cause__ = err
        except _UndecodableError as err:
            problem = InputError(
                f"{self.path}, message {self.seen[topic]} on {topic!r} cannot be decoded as "
                f"{connection.msgtype}: record the topic again."
            )
            problem.__cause__ = err
        if not self.skip_bad:
            raise problem
        self.bad.append(str(problem))
        return ()

    def _pushed(self, connection: Connection, stamp: int, data: bytes) -> tuple[Row, ...]:
        """The rows that a message completes.

        Raises:
            BadMessageError: The builder refuses it.
            _UndecodableError: It cannot be decoded.
        """
        if connection.msgtype == ACTION_TYPE:
            message = cast(_String, _decoded(data, ACTION_TYPE))
            return self.builder.act(stamp, connection.topic, message.data)
        values, labels = self.states.read(data)
        return self.builder.observe(stamp, connection.topic, values, labels)

    def notes(self) -> tuple[str, ...]:
        notes = []
        if self.early:
            notes.append(
                f"left out: {_counted(self.early, 'action')} before the first message of every "
                "state topic"
            )
        if self.bad:
            notes.append(
                f"left out: {_counted(len(self.bad), 'unusable message')}; "
                f"the first: {self.bad[0].rstrip('.')}"
            )
        return tuple(notes)

    def why_no_rows(self, states: Sequence[str], actions: Sequence[str]) -> str:
        for topic in (*states, *actions):
            if not self.seen[topic]:
                return f"there is no message on {topic!r}; record it together with the others"
        if self.early:
            return "all actions came before the first state; start the state topics first"
        return "no action has a label, or none is held until a sample is due; record longer ones"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


class _UndecodableError(Exception):
    """The bytes of a message are not one of its type."""


class _Dimension(Protocol):
    label: str


class _Layout(Protocol):
    dim: Sequence[_Dimension]


class _Float64MultiArray(Protocol):
    layout: _Layout
    data: FloatArray


class _String(Protocol):
    data: str


_TYPES = get_typestore(Stores.ROS2_JAZZY)


def _decoded(data: bytes, kind: str) -> object:
    """A message.

    Raises:
        _UndecodableError: It cannot be decoded.
    """
    try:
        return _TYPES.deserialize_cdr(data, kind)
    except Exception as err:
        # The generated decoders let whatever goes wrong inside them through.
        raise _UndecodableError(str(err)) from err


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
            _UndecodableError: It cannot be decoded.
        """
        head = self._heads.get(len(data))
        if head is not None and data.startswith(head.data):
            return head.numbers.unpack_from(data, len(head.data)), head.labels
        message = cast(_Float64MultiArray, _decoded(data, STATE_TYPE))
        labels = fields_of([dimension.label for dimension in message.layout.dim], len(message.data))
        self._remember(data, message.data, labels)
        return tuple(message.data.tolist()), labels

    def _remember(self, data: bytes, values: FloatArray, labels: tuple[str, ...]) -> None:
        numbers = Struct(f"<{len(values)}d")
        head = data[: len(data) - numbers.size]
        little_endian = data[1:2] == b"\x01"
        if len(values) and little_endian and data[len(head) :] == values.tobytes():
            self._heads[len(data)] = _Head(head, numbers, labels)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Reader]:
    with _explained(path), guarded_databases():
        reader = Reader(path)
        check_bag(path, METADATA)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _messages(
    path: Path, reader: Reader, wanted: Sequence[Connection]
) -> Iterator[tuple[Connection, int, bytes]]:
    """The messages by the time at which they were recorded, those of one instant as they stand."""
    with _explained(path):
        messages = _unpacked_in_bounds(path, reader, wanted)
        # Files are read one after the other, each in the order of time, and where the recorder went
        # from one to the next their times may overlap.
        several = path.is_dir() and len(list(filter(_holds_messages, path.iterdir()))) > 1
        yield from sorted(messages, key=itemgetter(1)) if several else messages


def _holds_messages(path: Path) -> bool:
    """Whether it is a file of a bag's messages, compressed or not."""
    return any(suffix in STORAGE_SUFFIXES for suffix in path.suffixes)


def _unpacked_in_bounds(
    path: Path, reader: Reader, wanted: Sequence[Connection]
) -> Iterator[tuple[Connection, int, bytes]]:
    """The messages as rosbags has them; those of too much compressed data are refused."""
    if reader.compression_mode == "message":
        storages = cast(_Directory, reader.storage).storages
        storages[:] = [_BoundedStorage(path, one) for one in storages]
    yield from reader.messages(wanted)


class _Storage(Protocol):
    connections: list[Connection]

    def messages(
        self, connections: Collection[Connection], start: int | None, stop: int | None
    ) -> Iterator[tuple[Connection, int, bytes]]: ...


class _Directory(Protocol):
    storages: list[_Storage]


class _BoundedStorage:
    """A file of compressed messages whose sizes are looked at before they are unpacked."""

    def __init__(self, path: Path, storage: _Storage) -> None:
        self._path = path
        self._storage = storage
        self.connections = storage.connections

    def messages(
        self, connections: Collection[Connection], start: int | None, stop: int | None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        unpacked = size = 0
        for connection, stamp, data in self._storage.messages(connections, start, stop):
            unpacked += expansion(data)
            size += len(data)
            check_expansion(self._path, unpacked, size)
            yield connection, stamp, data


@contextlib.contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turns whatever a reader of damaged files may raise into one sentence."""
    try:
        yield
    except RebtError:
        raise
    except Exception as err:  # of struct, apsw, zstd, YAML, ...: whatever the bytes provoke
        raise _explanation(path, err) from err


def _explanation(path: Path, err: Exception) -> InputError:
    if not path.exists() or isinstance(err, PermissionError):
        return unreadable(path, err if isinstance(err, OSError) else FileNotFoundError())
    if path.is_dir() and not (path / METADATA).exists():
        if any(one.suffix in STORAGE_SUFFIXES for one in path.iterdir()):
            return InputError(f"{path} has no {METADATA}: run `ros2 bag reindex {path}` first.")
        return InputError(f"{path} is not a bag: name a directory that `ros2 bag record` wrote.")
    reason = shorten(str(err), 200).rstrip(".") or type(err).__name__
    directory = path if path.is_dir() else path.parent
    return InputError(
        f"{path} is truncated, damaged or not a bag ({reason}): "
        f"try `ros2 bag reindex {directory}`, or record it again."
    )


def _topics(path: Path, reader: Reader) -> dict[str, str]:
    """Type of each topic that has messages; empty where its publishers differ."""
    for one in reader.connections:
        if not isinstance(one.topic, str) or not isinstance(one.msgtype, str):
            raise InputError(f"{path} has a topic or type that is no text: record it again.")
    with _explained(path):
        topics = sorted(reader.topics.items())
    return {name: info.msgtype or "" for name, info in topics if info.msgcount}


def _chosen(
    path: Path, kinds: dict[str, str], names: Sequence[str], kind: str, role: str
) -> tuple[str, ...]:
    """The topics to read, by the names that the bag gives them."""
    candidates = [topic for topic, its in kinds.items() if its == kind]
    if not names and len(candidates) == 1:
        return (candidates[0],)
    if not names and candidates:
        raise InputError(
            f"{path} has {len(candidates)} topics of type {kind} ({', '.join(candidates)}): "
            f"say which of them is the {role} topic."
        )
    there = ", ".join(f"{topic} ({its or 'several types'})" for topic, its in kinds.items())
    if not names:
        raise InputError(
            f"{path} has no {role} topic: record one of type {kind}; there is {there}."
        )
    by_name = {topic.lstrip("/"): topic for topic in kinds}
    topics = []
    for name in names:
        topic = by_name.get(name.lstrip("/"))
        if topic is None:
            raise InputError(f"{path} has no messages on {role} topic {name!r}: there is {there}.")
        if kinds[topic] != kind:
            raise InputError(
                f"{path}: {role} topic {name!r} must be of type {kind}: there is {there}."
            )
        topics.append(topic)
    return tuple(topics)
