"""The files of a bag: which there are, and the messages in them.

A bag is its files of messages.  What its metadata says of them is only compared with what is there,
so that a bag is read whose recorder was killed before it wrote all down.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import shorten
from typing import Final, TypeAlias

from rebt_ros.errors import InputError, RebtError
from rebt_ros.storage import bag_metadata, sqlite
from rebt_ros.storage.bag_safety import check_bag
from rebt_ros.storage.mcap import MAGIC as MCAP_MAGIC
from rebt_ros.storage.mcap import McapFile
from rebt_ros.storage.packing import unzstd_file
from rebt_ros.storage.text import unreadable

#: Suffixes of files that hold a bag's messages, in lower case.
STORAGE_SUFFIXES: Final = (".mcap", ".db3")
PACKED: Final = ".zstd"

_CDR: Final = "cdr"

#: A topic with the type of its messages.
Topic: TypeAlias = tuple[str, str]
#: The topic of a message, when it was recorded (nanoseconds), and its bytes.
Message: TypeAlias = tuple[Topic, int, bytes]


def holds_messages(path: Path) -> bool:
    """Whether the name is that of a file of a bag's messages, packed or not."""
    name = path.name.lower().removesuffix(PACKED)
    return name.endswith(STORAGE_SUFFIXES)


def is_bag(directory: Path) -> bool:
    """Whether a directory is a bag."""
    return (directory / bag_metadata.NAME).exists() or any(map(holds_messages, directory.iterdir()))


@dataclass(slots=True)
class BagFiles:
    """The open files of a bag."""

    found: Counter[Topic] = field(default_factory=Counter)
    """Messages of ROS 2 by topic; with 0 where there is none."""
    others: dict[str, str] = field(default_factory=dict)
    """Encoding of the messages of other topics."""
    others_found: Counter[str] = field(default_factory=Counter)
    """Messages of those, by topic."""
    stated: dict[Topic, int] = field(default_factory=dict)
    """How many the bag says that there are; only where it does."""
    notes: list[str] = field(default_factory=list)
    """What a person must know; no full stops."""
    _readers: list[Callable[[Collection[Topic]], Iterator[Message]]] = field(default_factory=list)

    def messages(self, topics: Collection[Topic]) -> Iterator[Message]:
        """The messages by the time at which they were recorded; of one instant, as they stand."""
        parts = (message for read in self._readers for message in read(topics))
        # Where the recorder went from one file to the next their times may overlap.
        return iter(sorted(parts, key=itemgetter(1))) if len(self._readers) > 1 else parts

    def add(
        self,
        counts: Mapping[Topic, int],
        stated: Mapping[Topic, int],
        read: Callable[[Collection[Topic]], Iterator[Message]],
    ) -> None:
        """Adds a file."""
        self.found.update(dict.fromkeys(counts, 0))
        self.found.update(counts)
        for topic, count in stated.items():
            self.stated[topic] = self.stated.get(topic, 0) + count
        self._readers.append(read)


@contextmanager
def opened_bag(path: Path) -> Iterator[BagFiles]:
    """Opens a bag.

    Args:
        path: Its directory, or one of its files.

    Raises:
        InputError: It cannot be read.
    """
    with ExitStack() as stack:
        bag = BagFiles()
        with explained(path):
            check_bag(path, bag_metadata.NAME)
            metadata = _metadata(path, bag.notes) if path.is_dir() else None
            files = _files(path, metadata, bag.notes) if path.is_dir() else [path]
            for file in files:
                _open(file, bag, stack)
        if metadata is not None:
            # A recorder that was killed has counted nothing.
            bag.stated |= {topic: count for topic, count in metadata.counts.items() if count > 0}
        yield bag


def _metadata(directory: Path, notes: list[str]) -> bag_metadata.BagMetadata | None:
    """What the metadata say, where there are some that can be read; notes why not."""
    try:
        metadata = bag_metadata.read_metadata(directory)
    except InputError as err:
        notes.append(f"{str(err).rstrip('.')}: the bag is read without it")
        return None
    if metadata is None and len(list(filter(holds_messages, directory.iterdir()))) > 1:
        notes.append(f"there is no {bag_metadata.NAME}: all files of messages are read as one bag")
    return metadata


def _files(
    directory: Path, metadata: bag_metadata.BagMetadata | None, notes: list[str]
) -> list[Path]:
    """The files of messages, those that are listed first; notes what differs from the list."""
    there = sorted(one for one in directory.iterdir() if holds_messages(one) and one.is_file())
    plain = {one.name for one in there}
    twice = [one for one in there if one.name.lower().endswith(PACKED) and one.stem in plain]
    files = [one for one in there if one not in twice]
    if metadata is None:
        if not files:
            raise InputError(
                f"{directory} is not a bag: name a directory that `ros2 bag record` wrote."
            )
        return files
    listed = {name: place for place, name in enumerate(metadata.files)}
    known = {_plain(name) for name in listed}
    missing = sorted(known - {_plain(one.name) for one in files})
    if missing and not files:
        raise InputError(
            f"{directory} lacks the files that its {bag_metadata.NAME} lists "
            f"({', '.join(missing)}): put them back."
        )
    for name in missing:
        notes.append(f"{name} is listed in {bag_metadata.NAME} and not there: it was not read")
    for one in files:
        if _plain(one.name) not in known:
            notes.append(f"{one.name} is not listed in {bag_metadata.NAME}: it is read as well")
    return sorted(files, key=lambda one: (listed.get(one.name, len(listed)), one.name))


def _plain(name: str) -> str:
    return name[: -len(PACKED)] if name.lower().endswith(PACKED) else name


def _open(file: Path, bag: BagFiles, stack: ExitStack) -> None:
    if file.name.lower().endswith(PACKED):
        directory = stack.enter_context(TemporaryDirectory())
        unpacked = Path(directory, file.stem)
        unzstd_file(file, unpacked)
        check_bag(unpacked, bag_metadata.NAME)
        _open_plain(unpacked, file.name, bag, stack)
    else:
        _open_plain(file, file.name, bag, stack)


def _open_plain(file: Path, name: str, bag: BagFiles, stack: ExitStack) -> None:
    with file.open("rb") as opened:
        magic = opened.read(len(sqlite.MAGIC))
    if magic.startswith(MCAP_MAGIC):
        _open_mcap(file, name, bag, stack)
    elif file.suffix.lower() == ".mcap":
        raise ValueError(f"{name} does not begin like an mcap file")
    else:
        _open_sqlite(file, name, bag, stack)


def _open_mcap(path: Path, name: str, bag: BagFiles, stack: ExitStack) -> None:
    file = McapFile(stack.enter_context(path.open("rb")))
    survey = file.survey
    number = {}
    for channel, about in survey.channels.items():
        if about.encoding == _CDR:
            number[channel] = (about.topic, about.kind)
        else:
            bag.others[about.topic] = about.encoding or "unknown"
            bag.others_found[about.topic] += survey.found[channel]

    def read(topics: Collection[Topic]) -> Iterator[Message]:
        wanted = {channel: topic for channel, topic in number.items() if topic in topics}
        for message in file.messages(wanted.keys()):
            yield wanted[message.channel], message.stamp, message.data

    counts, stated = Counter[Topic](), Counter[Topic]()
    for channel, topic in number.items():
        counts[topic] += survey.found[channel]
        stated[topic] += survey.stated_of(channel)
    bag.add(counts, stated, read)
    if not survey.is_complete:
        bag.notes.append(
            f"{name} ends before its end, as where a recorder was killed: what is whole was read"
        )
    if survey.damaged:
        chunks = "chunk is" if survey.damaged == 1 else "chunks are"
        bag.notes.append(f"{name} is damaged: {survey.damaged} {chunks} left out")
    if survey.cut:
        chunks = "chunk ends" if survey.cut == 1 else "chunks end"
        bag.notes.append(
            f"{name} is damaged: {survey.cut} {chunks} inside of a message: what is whole was read"
        )
    _note_undeclared(survey.undeclared, name, bag)


def _open_sqlite(path: Path, name: str, bag: BagFiles, stack: ExitStack) -> None:
    connection = stack.enter_context(sqlite.opened(path))
    topics = {
        one.number: (one.name, one.kind)
        for one in sqlite.topics(connection)
        if one.encoding == _CDR or bag.others.setdefault(one.name, one.encoding) == _CDR
    }

    def read(wanted: Collection[Topic]) -> Iterator[Message]:
        numbers = [number for number, topic in topics.items() if topic in wanted]
        for number, stamp, data in sqlite.messages(connection, numbers):
            yield topics[number], stamp, data

    counts = Counter[Topic]()
    for one in sqlite.topics(connection):
        if one.number in topics:
            counts[topics[one.number]] += one.messages
        else:
            bag.others_found[one.name] += one.messages
    bag.add(counts, {}, read)
    _note_undeclared(sqlite.undeclared(connection), name, bag)


def _note_undeclared(count: int, name: str, bag: BagFiles) -> None:
    if count:
        bag.notes.append(f"left out: messages of topics that {name} does not describe: {count}")


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turns whatever a reader of damaged files may raise into one sentence."""
    try:
        yield
    except RebtError:
        raise
    except Exception as err:  # of struct, SQLite, zstd, YAML, ...: whatever the bytes provoke
        raise _explanation(path, err) from err


#: How files begin that are no files of messages, what they are, and what helps.
_STRANGERS: Final[Sequence[tuple[bytes, str]]] = (
    (
        b"version https://git-lfs",
        "is a pointer of Git LFS, not the file itself: run `git lfs pull`",
    ),
    (
        b"#ROSBAG V",
        "is a bag of ROS 1: convert it with `rosbags-convert --src FILE --dst DIRECTORY`",
    ),
)


def refuse_strangers(path: Path) -> None:
    """Refuses a file that is something else than what its user took it for.

    Raises:
        InputError: It says what the file is and what helps.
    """
    if not path.is_file():
        # What is read from a pipe is gone.
        return
    with contextlib.suppress(OSError), path.open("rb") as file:
        begin = file.read(32)
        for magic, what in _STRANGERS:
            if begin.startswith(magic):
                raise InputError(f"{path} {what}.")


def _explanation(path: Path, err: Exception) -> InputError:
    if not path.exists() or isinstance(err, PermissionError):
        return unreadable(path, err if isinstance(err, OSError) else FileNotFoundError())
    if isinstance(err, ImportError):
        return InputError(
            f"{path} cannot be read without the package {err.name}, which rosbags brings: "
            "install rosbags with pip."
        )
    reason = shorten(str(err), 200).rstrip(".") or type(err).__name__
    return InputError(f"{path} is damaged or not a bag ({reason}): record it again.")
