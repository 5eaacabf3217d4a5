"""The files of a bag: which there are, and the messages in them.

A bag is its files of messages.  What its metadata says of them is only compared with what is there,
so that a bag is read whose recorder was killed before it wrote all down.
"""

from __future__ import annotations

import contextlib
import errno
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from textwrap import shorten
from typing import Final, TypeAlias

from rebt_ros.errors import InputError, RebtError
from rebt_ros.storage import bag_metadata, mcap, sqlite
from rebt_ros.storage.bag_safety import check_bag
from rebt_ros.storage.mcap import MAGIC as MCAP_MAGIC
from rebt_ros.storage.mcap import McapFile, Survey
from rebt_ros.storage.message_definitions import differ
from rebt_ros.storage.packing import unpack_file, without_packing
from rebt_ros.storage.strangers import refuse_strangers
from rebt_ros.storage.text import unreadable
from rebt_ros.storage.time_order import SET_BACK, by_time

#: Suffixes of files that hold a bag's messages, in lower case.
STORAGE_SUFFIXES: Final = (".mcap", ".db3")

#: Suffixes of packed files that are to be unpacked before they are read.
_PACKED_OTHERWISE: Final = (".gz", ".bz2", ".xz", ".zip", ".tar", ".7z")

#: How the names of files begin in which macOS keeps what other file systems cannot hold.
_APPLE: Final = "._"

_CDR: Final = "cdr"
#: What SQLite adds to the name of a database for that of its log.
_LOG: Final = "-wal"
_NUMBERED: Final = re.compile(r"(.+)_([0-9]{1,6})\.\w.*")
#: A recording of a day that is split each minute has 1440 files.
_MOST_FILES: Final = 10_000

#: A topic with the type of its messages.
Topic: TypeAlias = tuple[str, str]
#: The topic of a message, when it was recorded (nanoseconds), and its bytes.
Message: TypeAlias = tuple[Topic, int, bytes]


#: Reads the messages of some topics.
_Reader: TypeAlias = Callable[[Collection[Topic]], Iterator[Message]]

#: The topic of what stands for messages that are missing.
GAP: Final[Topic] = ("", "")


def holds_messages(path: Path) -> bool:
    """Whether the name is that of a file of a bag's messages, packed or not."""
    if path.name.startswith(_APPLE):
        return False
    return without_packing(path.name.lower()).endswith(STORAGE_SUFFIXES)


def begins_like_messages(path: Path) -> bool:
    """Whether a file begins as those of messages do, whatever it is called."""
    if not path.is_file():
        return False
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(len(sqlite.MAGIC)).startswith((MCAP_MAGIC, sqlite.MAGIC))
    return False


def is_bag(directory: Path) -> bool:
    """Whether a directory is a bag."""
    return (directory / bag_metadata.NAME).exists() or any(map(holds_messages, directory.iterdir()))


@dataclass(eq=False)
class _File:
    """A file of a bag."""

    name: str
    counts: Mapping[Topic, int]
    """Its messages by topic."""
    read: _Reader

    @cached_property
    def first(self) -> Message | None:
        """Its first message.

        Parts of a recording often have as many messages each; that they begin otherwise is read
        once of each, not of each pair.
        """
        return next(self.read(self.counts), None)

    def equals(self, other: _File) -> bool:
        """Whether both hold the same messages, and any."""
        return (
            self.counts == other.counts
            and any(self.counts.values())
            and self.first == other.first
            and all(
                one == its
                for one, its in zip_longest(self.read(self.counts), other.read(self.counts))
            )
        )


@dataclass(slots=True)
class BagFiles:
    """The open files of a bag."""

    found: Counter[Topic] = field(default_factory=Counter)
    """Messages of ROS 2 by topic; with 0 where there is none."""
    others: dict[str, str] = field(default_factory=dict)
    """Encoding of the messages of other topics."""
    others_found: Counter[str] = field(default_factory=Counter)
    """Messages of those, by topic."""
    definitions: dict[str, str] = field(default_factory=dict)
    """Definitions of types as `.msg` or `.idl` files have them, by name."""
    redefined: set[str] = field(default_factory=set)
    """Names of types that have several of them, which differ."""
    elsehow: dict[str, str] = field(default_factory=dict)
    """How types are defined otherwise, by name."""
    stated: dict[Topic, int] = field(default_factory=dict)
    """How many the bag says that there are; only where it does."""
    notes: list[str] = field(default_factory=list)
    """What a person must know; no full stops."""
    is_incomplete: bool = False
    """Whether messages are missing inside of a file, or between two of them."""
    _readers: list[_Reader] = field(default_factory=list)
    _files: list[_File] = field(default_factory=list)

    def messages(self, topics: Collection[Topic]) -> Iterator[Message]:
        """The messages by the time at which they were recorded; of one instant, as they stand.

        Among them are messages of the topic `GAP` where others are missing.
        """
        parts = self._parts(topics)
        if len(self._readers) == 1:
            return parts
        # Where the recorder went from one file to the next their times may overlap.
        return iter(by_time(parts, lambda stamp: (GAP, stamp, b""), self.note_set_back))

    def note_set_back(self) -> None:
        """Notes that the clock was set back; once."""
        if SET_BACK not in self.notes:
            self.notes.append(SET_BACK)

    def _parts(self, topics: Collection[Topic]) -> Iterator[Message]:
        for number, read in enumerate(self._readers):
            is_gap = number > 0 and self.is_incomplete
            for message in read(topics):
                if is_gap:
                    yield GAP, message[1], b""
                    is_gap = False
                yield message

    def define(self, kind: str, text: str) -> None:
        """Adds the definition of a type."""
        if differ(kind, self.definitions.setdefault(kind, text), text):
            self.redefined.add(kind)

    def add(
        self, name: str, counts: Mapping[Topic, int], stated: Mapping[Topic, int], read: _Reader
    ) -> None:
        """Adds a file, unless it holds the same messages as another one."""
        file = _File(name, counts, read)
        for other in self._files:
            if file.equals(other):
                self.notes.append(
                    f"{name} holds the same messages as {other.name}: they are read once"
                )
                return
        self._files.append(file)
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
            if path.is_dir():
                files = _files(path, metadata, bag.notes)
                # Whatever is noted about files, some may be missing between others.
                bag.is_incomplete = bool(bag.notes)
                _open_all(files, bag, stack)
            else:
                # SQLite's log is beside the file that a link leads to.
                _open(path.resolve(), bag, stack, "the file")
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
    if metadata is None:
        notes += _gaps_in_numbers(directory)
    return metadata


def _gaps_in_numbers(directory: Path) -> Iterator[str]:
    """Notes which files are not there by the numbers that recorders give to them, from 0."""
    numbers: dict[str, set[int]] = {}
    for path in filter(holds_messages, directory.iterdir()):
        if found := _NUMBERED.fullmatch(path.name):
            numbers.setdefault(found[1], set()).add(int(found[2]))
    for base, there in sorted(numbers.items()):
        missing = [number for number in range(min(max(there), _MOST_FILES)) if number not in there]
        if missing:
            listed = shorten(", ".join(f"{base}_{number}" for number in missing), 200)
            yield f"by their numbers, {len(missing)} files are not there: {listed}"


def _files(
    directory: Path, metadata: bag_metadata.BagMetadata | None, notes: list[str]
) -> list[Path]:
    """The files of messages, those that are listed first; notes what differs from the list."""
    there = sorted(path for path in directory.iterdir() if holds_messages(path) and path.is_file())
    plain = {one.name for one in there}
    twice = [one for one in there if without_packing(one.name) in plain - {one.name}]
    files = [one for one in there if one not in twice]
    notes += _logs_alone(directory, plain)
    if metadata is None:
        if not files:
            raise InputError(
                f"{directory} is not a bag: name a directory that `ros2 bag record` wrote."
            )
        return files
    listed = {name: place for place, name in enumerate(metadata.files)}
    known = {without_packing(name) for name in listed}
    missing = sorted(known - {without_packing(file.name) for file in files})
    if missing and not files:
        raise InputError(
            f"{directory} lacks the files that its {bag_metadata.NAME} lists "
            f"({', '.join(missing)}): put them back{_unfinished(directory, missing)}."
        )
    for name in missing:
        notes.append(f"{name} is listed in {bag_metadata.NAME} and not there: it was not read")
    for file in files:
        if without_packing(file.name) not in known:
            notes.append(f"{file.name} is not listed in {bag_metadata.NAME}: it is read as well")
    return sorted(files, key=lambda file: (listed.get(file.name, len(listed)), file.name))


def _logs_alone(directory: Path, there: Collection[str]) -> Iterator[str]:
    """Notes write-ahead logs of SQLite whose databases have another name, or are gone."""
    for log in sorted(directory.glob(f"*{_LOG}")):
        name = log.name.removesuffix(_LOG)
        if name not in there and log.stat().st_size:
            yield (
                f"{log.name} may hold messages, and is read only beside {name}, which is "
                "not there: give that file its name back"
            )


def _unfinished(directory: Path, missing: Sequence[str]) -> str:
    """What is there of missing files under longer names, as while they are copied or written."""
    there = sorted(one.name for one in directory.iterdir())
    found = [one for one in there if any(one.startswith(f"{name}.") for name in missing)]
    if not found:
        return ""
    packed = all(one.lower().endswith(_PACKED_OTHERWISE) for one in found)
    return f", or {'unpack' if packed else 'wait for what writes'} {', '.join(found)}"


def _open_all(files: Sequence[Path], bag: BagFiles, stack: ExitStack) -> None:
    """Opens the files that can be opened; notes which cannot.

    Raises:
        Exception: What the last one raised, where none can.
    """
    failures = 0
    for file in files:
        try:
            _open(file, bag, stack, file.name)
        except Exception as err:
            failures += 1
            if failures == len(files):
                raise
            bag.is_incomplete = True
            bag.notes.append(f"{file.name} cannot be read, and is left out: {_reason(err)}")


def _open(file: Path, bag: BagFiles, stack: ExitStack, name: str) -> None:
    """Opens a file, packed or not; notes call it by a name."""
    plain = without_packing(file.name)
    if plain == file.name:
        _open_plain(file, name, bag, stack)
        return
    directory = stack.enter_context(TemporaryDirectory())
    unpacked = Path(directory, plain)
    if why := unpack_file(file, unpacked):
        size = unpacked.stat().st_size
        bag.notes.append(
            f"{name} is damaged: its first {size} bytes could be unpacked ({_shortened(why)})"
        )
    check_bag(unpacked, bag_metadata.NAME)
    _open_plain(unpacked, name, bag, stack)


def _open_plain(file: Path, name: str, bag: BagFiles, stack: ExitStack) -> None:
    if not file.stat().st_size:
        # A recorder that was killed at once leaves one.
        bag.notes.append(f"{name} is empty")
        return
    refuse_strangers(file)
    with file.open("rb") as opened:
        magic = opened.read(len(sqlite.MAGIC))
    if magic.startswith(MCAP_MAGIC):
        _open_mcap(file, name, bag)
    elif file.suffix.lower() == ".mcap" and magic != sqlite.MAGIC:
        raise ValueError(f"{file.name} does not begin like an mcap file")
    elif magic != sqlite.MAGIC and not holds_messages(file):
        raise InputError(
            f"{file} is not a bag: name a directory that `ros2 bag record` wrote, or a file in it."
        )
    else:
        _open_sqlite(file, name, bag, stack)


def _open_mcap(path: Path, name: str, bag: BagFiles) -> None:
    # Not all files of a bag can be open at once where there are thousands.
    with path.open("rb") as file:
        survey = McapFile(file).survey
    for kind, text in survey.definitions.items():
        bag.define(_full(kind), text)
    bag.redefined.update(map(_full, survey.redefined))
    bag.elsehow |= {_full(kind): how for kind, how in survey.elsehow.items()}
    number = {}
    for channel, about in survey.channels.items():
        if about.encoding == _CDR:
            number[channel] = (about.topic, _full(about.kind))
        else:
            bag.others[about.topic] = about.encoding or "unknown"
            bag.others_found[about.topic] += survey.found[channel]

    def read(topics: Collection[Topic]) -> Iterator[Message]:
        wanted = {channel: topic for channel, topic in number.items() if topic in topics}
        wanted[mcap.GAP] = GAP
        with path.open("rb") as file:
            for message in McapFile(file, survey).messages(wanted.keys()):
                yield wanted[message.channel], message.stamp, message.data
        if survey.set_back:
            bag.note_set_back()

    counts, stated = Counter[Topic](), Counter[Topic]()
    for channel, topic in number.items():
        counts[topic] += survey.found[channel]
        stated[topic] += survey.stated_of(channel)
    bag.add(name, counts, stated, read)
    problems = tuple(_problems(survey))
    bag.is_incomplete |= bool(problems)
    bag.notes += (f"{name} {note}" for note in problems)
    if survey.unknown:
        which = _counted(survey.unknown.total(), "record is", "records are")
        kinds = ", ".join(f"0x{kind:02x}" for kind in sorted(survey.unknown))
        bag.notes.append(
            f"{name} is of a later version of its format, or damaged: {which} of kinds that are "
            f"not known ({kinds}), and passed over"
        )
    _note_undeclared(survey.undeclared, name, bag)


def _full(kind: str) -> str:
    """The name of a type with the `msg` in its middle, which some recorders leave out."""
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}" if name and "/" not in name else kind


def _problems(survey: Survey) -> Iterator[str]:
    """What is wrong with an mcap file, in words that follow its name."""
    if survey.gaps:
        lost = sum(following - begin for begin, following in survey.gaps)
        yield (
            f"is damaged from byte {survey.gaps[0][0]} on: {lost} bytes are no records, and were "
            "not read"
        )
    if survey.behind:
        yield (
            f"goes on for {survey.behind} bytes behind its end, which were not read, as where "
            "files were put one behind the other: name each of them"
        )
    elif not survey.gaps and not survey.is_complete:
        yield "ends before its end, as where a recorder was killed: what is whole was read"
    if survey.damaged:
        yield f"is damaged: {_counted(survey.damaged, 'chunk is', 'chunks are')} left out"
    if survey.cut:
        which = _counted(len(survey.cut), "chunk ends", "chunks end")
        yield f"is damaged: {which} inside of a message: what is whole was read"
    for compression, count in sorted(survey.packed_by.items()):
        which = _counted(count, "chunk is", "chunks are")
        yield f"is packed by {compression!r}, which is not known here: {which} left out"
    found = survey.found.total()
    if survey.total is not None and survey.total != found:
        yield f"says that it holds {survey.total} messages, and {found} were found"


def _counted(count: int, singular: str, plural: str) -> str:
    return f"{count} {singular if count == 1 else plural}"


def _open_sqlite(path: Path, name: str, bag: BagFiles, stack: ExitStack) -> None:
    file = stack.enter_context(sqlite.opened(path))
    for kind, text in file.definitions():
        bag.define(_full(kind), text)
    topics: dict[int, Topic] = {}
    for one in file.topics:
        if one.encoding == _CDR:
            topics[one.number] = (one.name, one.kind)
        else:
            bag.others[one.name] = one.encoding or "unknown"
            bag.others_found[one.name] += file.found[one.number]

    def read(wanted: Collection[Topic]) -> Iterator[Message]:
        known = len(file.notes)
        for number, stamp, data in file.messages(
            [number for number, topic in topics.items() if topic in wanted]
        ):
            yield GAP if number == sqlite.GAP else topics[number], stamp, data
        bag.is_incomplete |= file.is_damaged
        if file.set_back:
            bag.note_set_back()
        bag.notes.extend(f"{name} {note}" for note in file.notes[known:])

    counts = Counter[Topic]()
    for number, topic in topics.items():
        counts[topic] += file.found[number]
    bag.add(name, counts, {}, read)
    bag.is_incomplete |= bool(file.notes)
    bag.notes += (f"{name} {note}" for note in file.notes)
    _note_undeclared(file.undeclared, name, bag)


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


def _explanation(path: Path, err: Exception) -> InputError:
    if not path.exists() or isinstance(err, PermissionError):
        return unreadable(path, err if isinstance(err, OSError) else FileNotFoundError())
    if isinstance(err, ImportError):
        return InputError(
            f"{path} cannot be read without the package {err.name}, which rosbags brings: "
            "install rosbags with pip."
        )
    if sqlite.is_interrupted(err):
        return InputError(
            f"{path} would have SQLite compute more than ten times as long as a recorded bag of "
            "its size, and was interrupted: record it again."
        )
    if isinstance(err, OSError) and err.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(
            f"{path} must be unpacked or copied to be read, and there is no room: make room in "
            f"{gettempdir()}, or name another place in TMPDIR."
        )
    if isinstance(err, OSError) and err.errno is not None:
        return unreadable(path, err)
    return InputError(
        f"{path} is damaged or not a bag ({_reason(err)}): copy it again from where it was "
        "recorded, or record it again."
    )


def _reason(err: Exception) -> str:
    return _shortened(str(err)) or type(err).__name__


def _shortened(text: str) -> str:
    return shorten(text, 200).rstrip(".")
