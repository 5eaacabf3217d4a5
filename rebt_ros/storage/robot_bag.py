"""rosbag2 recordings of a robot's own messages, read by its robot file."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeAlias

from rebt_ros.demonstration.builder import BadMessageError, DemonstrationBuilder
from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.errors import InputError, listing
from rebt_ros.robot_file.binding import BoundTopic, bind
from rebt_ros.robot_file.features import FeatureReader, described, state_topics_of
from rebt_ros.robot_file.labelling import Labeller
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.bag import (
    LATEST,
    Feed,
    LateError,
    UndecodableError,
    check_encapsulation,
    kinds_of,
    listed,
    messages_of,
    named,
    no_messages,
    unpacked,
    with_notes,
)
from rebt_ros.storage.bag_files import GAP, BagFiles, Message, Topic, opened_bag
from rebt_ros.storage.message_types import BagTypes
from rebt_ros.storage.read import Read
from rebt_ros.storage.time_order import by_time

#: The stamp of a header, behind the four bytes that messages begin with.
_STAMPS: Final = {b"\0\1": struct.Struct("<iI"), b"\0\0": struct.Struct(">iI")}
_HEAD: Final = 4


def read_robot_bag(
    path: Path,
    robot: RobotFile,
    *,
    sample_rate: float | None = None,
    skip_bad: bool = False,
) -> Read:
    """Reads a bag by a robot file.

    Args:
        path: A bag's directory, or a single .mcap or .db3 file, packed with zstd or not.
        robot: Where features and actions are.
        sample_rate: Rows per second and channel while an action holds; None: one row per action.
        skip_bad: Leave out messages that cannot be used, and note how many, instead of refusing
            the bag.  Actions before the first state are always left out.

    Returns:
        The rows that the recorder would have made of these messages.

    Raises:
        InputError: The bag cannot be read, lacks topics or holds unusable messages.
        RobotFileError: The robot file does not fit the bag.
        OptionError: The sample rate makes no sense.
    """
    if not robot.actions:
        raise InputError(f"{robot.name} has no part 'actions', so that a bag shows no actions.")
    with opened_bag(path) as bag:
        types = BagTypes(bag.definitions, bag.elsehow)
        with with_notes(bag):
            kinds = kinds_of(bag)
            if not kinds:
                raise InputError(no_messages(path, bag, "the robot's topics"))
            wanted = {
                topic: bind(robot, name, topic[1], types)
                for topic, name in _chosen(path, kinds, robot).items()
            }
        if changed := sorted(bag.redefined & {kind for _, kind in wanted}):
            raise InputError(
                f"{path} defines {changed[0]} in several ways, as where its package changed "
                "between two recordings, so that messages would be misread: name the files of "
                "the bag one by one, or record again."
            )
        states = [value for value in wanted.values() if value.features]
        categories: dict[str, Categories] = {}
        readers = {state.name: FeatureReader(state, categories) for state in states}
        builder = DemonstrationBuilder(
            state_topics_of(robot),
            list(robot.actions),
            sample_rate,
        )
        decoders = {topic: types.decoder(topic[1], one.wanted) for topic, one in wanted.items()}
        there = {topic[0]: bag.found[topic] for topic, one in wanted.items() if one.features}
        feed = _RobotFeed(
            path, builder, skip_bad, there, decoders=decoders, topics=wanted, readers=readers
        )
        shown = feed.demonstration(
            bag,
            _in_order(path, bag, wanted, feed.unstamped),
            [name for name, _ in wanted],
            sample_rate,
        )
        shown = replace(shown, features=described(shown.features, states, categories))
        return replace(feed.read(bag, set(wanted), shown), robot=robot)


#: What the robot file calls a topic, and what decodes its messages and takes them.
_Taking: TypeAlias = tuple[
    str,
    Callable[[bytes], object],
    tuple[tuple[str, Labeller], ...],
    FeatureReader | None,
]


@dataclass(slots=True, kw_only=True)
class _RobotFeed(Feed):
    """Reads messages of any type."""

    decoders: dict[Topic, Callable[[bytes], object]]
    topics: dict[Topic, BoundTopic]
    readers: dict[str, FeatureReader] = field(default_factory=dict)
    lacking: dict[str, None] = field(default_factory=dict)
    """What messages should have and do not, as sentences."""
    unstamped: Counter[str] = field(default_factory=Counter)
    """Messages whose headers should tell their times and do not, by topic."""
    _taking: dict[Topic, _Taking] = field(init=False)

    def __post_init__(self) -> None:
        self._taking = {
            topic: (
                one.name,
                self.decoders[topic],
                tuple(one.labellers.items()),
                self.readers.get(one.name),
            )
            for topic, one in self.topics.items()
        }

    def notes(self) -> tuple[str, ...]:
        """What a person should know; see `Feed.notes`."""
        return (
            *(
                f"{count} of {self.seen[topic]} messages on {topic!r} have no time in their "
                "headers (0): leave out 'stamp: header' there, or have their publisher fill it in"
                for topic, count in sorted(self.unstamped.items())
            ),
            *self._on_categories(),
            *self.lacking,
            *super(_RobotFeed, self).notes(),
        )

    def _on_categories(self) -> Iterator[str]:
        for reader in self.readers.values():
            for feature, values in reader.unnamed.items():
                yield (
                    f"feature {feature!r} has no value where its field is {listing([*values])}, "
                    "which is none of its categories"
                )

    def why_no_rows(self, topics: Sequence[str]) -> str:
        """Why there are no rows, and what helps; see `Feed.why_no_rows`."""
        sources = sorted(topic[0] for topic, one in self.topics.items() if one.labellers)
        if all(self.seen[topic] for topic in topics) and not self.early and sources:
            return (
                f"no message on {', '.join(sources)} is an action to the robot file, or none is "
                "held until a sample is due; see whether its labels, buttons, axes or dead band "
                "are those of the robot"
            )
        return super(_RobotFeed, self).why_no_rows(topics)

    def pushed(self, topic: Topic, stamp: int, data: bytes) -> tuple[Row, ...]:
        """The rows that a message completes; see `Feed.pushed`."""
        if stamp >= LATEST:
            raise LateError
        name, decode, labellers, reader = self._taking[topic]
        data = unpacked(data)
        try:
            message = decode(data)
        except Exception as err:  # whatever the generated decoders meet
            check_encapsulation(data)
            raise UndecodableError from err
        rows: list[Row] = []
        refused: BadMessageError | None = None
        # What is done follows from what was there before this message.
        for channel, labeller in labellers:
            for label in labeller.labels(message, stamp):
                try:
                    rows += self.builder.act(stamp, channel, label)
                except BadMessageError as err:
                    refused = err
            if labeller.lacks:
                self.lacking.update(dict.fromkeys(self.topics[topic].lacks()))
        if reader is not None:
            # The state is there whatever becomes of the action.
            rows += self.builder.observe(stamp, name, reader.read(message, stamp))
        if refused is not None and not (rows and self.skip_bad):
            raise refused
        return tuple(rows)


def _chosen(
    path: Path, kinds: Mapping[str, Mapping[str, int]], robot: RobotFile
) -> dict[Topic, str]:
    """The topics that the robot file names, as the bag has them, by what it calls them.

    Raises:
        InputError: The bag has no messages on one of them, or messages of several types.
    """
    chosen: dict[Topic, str] = {}
    for name in dict.fromkeys((*robot.state_topics, *robot.action_topics)):
        topic = named(kinds, name)
        if topic is None:
            raise InputError(
                f"{path} has no messages on {name!r}, which {robot.name} names: there is "
                f"{listed(kinds)}."
            )
        declared = robot.settings_of(name).kind
        if len(kinds[topic]) > 1 and declared not in kinds[topic]:
            raise InputError(
                f"{path} has messages of several types on {name!r} ({', '.join(kinds[topic])}): "
                f"say in {robot.name} which of them is meant, under 'topics'."
            )
        kind = declared if declared in kinds[topic] else next(iter(kinds[topic]))
        chosen[topic, kind] = name
    return chosen


def _in_order(
    path: Path, bag: BagFiles, wanted: dict[Topic, BoundTopic], unstamped: Counter[str]
) -> Iterator[Message]:
    """The messages by when they are from."""
    messages = messages_of(path, bag, set(wanted))
    headed = {topic for topic, one in wanted.items() if one.has_stamp}
    if not headed:
        return messages

    def own(topic: Topic, stamp: int, data: bytes) -> int:
        if topic not in headed:
            return stamp
        said = _stamp_of(data, stamp)
        if not said:
            unstamped[topic[0]] += 1
        return said

    stamped = ((topic, own(topic, stamp, data), data) for topic, stamp, data in messages)
    return iter(by_time(stamped, lambda stamp: (GAP, stamp, b""), bag.note_set_back))


def _stamp_of(data: bytes, otherwise: int) -> int:
    """The stamp in the header of a message (nanoseconds), where it has one."""
    numbers = _STAMPS.get(data[:2])
    if numbers is None or len(data) < _HEAD + numbers.size:
        return otherwise
    seconds, nanoseconds = numbers.unpack_from(data, _HEAD)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)
