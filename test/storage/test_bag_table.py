"""Every reader of bags, times every way to lose messages: none is lost without a word.

Whatever is read is a part of what was recorded, in its order; where it is not all, a note says so
with numbers or by the name of what is not there; what is refused is refused in one sentence.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Final

import lz4.frame
import mcap_files as mcap
import pytest
from fuzz import corpus
from mcap_files import Compression
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import Loaded, load
from rebt_ros.storage.recording import RecordingWriter

#: Rows of every whole input.
COUNT: Final = 60
MESSAGES: Final = 2 * COUNT
LABELS: Final = ("go", "turn", "wait")
RECORDED: Final = [((number / 3, float(-number)), LABELS[number % 3]) for number in range(COUNT)]


@dataclass(frozen=True)
class Content:
    """What is in a bag."""

    messages: tuple[mcap.Message, ...] = tuple(mcap.demonstration(COUNT))
    channels: tuple[mcap.Channel, ...] = mcap.CHANNELS


DEMONSTRATION: Final = Content()

# --- readers: each makes a bag in a directory ---------------------------------------------------


def _metadata(bag: Path, storage: str) -> Path:
    """Writes metadata that list the files and count the messages."""
    files = "".join(f"  - {one.name}\n" for one in _files(bag))
    topics = "".join(
        f"  - message_count: {COUNT}\n    topic_metadata:\n      name: {topic}\n"
        f"      type: {kind}\n      serialization_format: cdr\n      offered_qos_profiles: []\n"
        for topic, kind in (("/state", mcap.STATE), ("/action", mcap.ACTION))
    )
    (bag / METADATA).write_text(
        f"rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n"
        f"  message_count: {MESSAGES}\n  relative_file_paths:\n{files}"
        f"  topics_with_message_count:\n{topics}",
        encoding="utf-8",
    )
    return bag


def _mcap(
    bag: Path,
    content: Content = DEMONSTRATION,
    *,
    per_chunk: int | None = 20,
    compression: Compression = Compression.NONE,
    index: bool = True,
    summary: bool = True,
    finished: bool = True,
) -> Path:
    mcap.write(
        bag / "bag_0.mcap",
        content.messages,
        content.channels,
        per_chunk=per_chunk,
        compression=compression,
        index=index,
        summary=summary,
        finished=finished,
    )
    return _metadata(bag, "mcap")


def _split_mcap(bag: Path, content: Content = DEMONSTRATION) -> Path:
    mcap.write(bag / "bag_0.mcap", content.messages[:COUNT], content.channels)
    mcap.write(bag / "bag_1.mcap", content.messages[COUNT:], content.channels)
    return _metadata(bag, "mcap")


def _packed(
    bag: Path,
    content: Content = DEMONSTRATION,
    *,
    make: Callable[[Path, Content], Path],
    suffix: str,
) -> Path:
    make(bag, content)
    (file,) = _files(bag)
    pack = lz4.frame.compress if suffix == ".lz4" else mcap.packing._zstd().compress
    file.with_name(f"{file.name}{suffix}").write_bytes(pack(file.read_bytes()))
    file.unlink()
    return _metadata(bag, "mcap")


def _database(
    file: Path, messages: Sequence[mcap.Message], channels: Sequence[mcap.Channel] = mcap.CHANNELS
) -> sqlite3.Connection:
    """A file as rosbag2 makes it, with pages so small that there are many."""
    file.parent.mkdir(parents=True, exist_ok=True)
    connection = sqlite3.connect(file, isolation_level=None)
    connection.execute("PRAGMA page_size = 1024")
    for statement in (
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)",
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
        "timestamp INTEGER NOT NULL, data BLOB NOT NULL)",
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC)",
    ):
        connection.execute(statement)
    connection.executemany(
        "INSERT INTO topics VALUES (?, ?, ?, ?, '')",
        [(number + 1, one.topic, one.kind, one.encoding) for number, one in enumerate(channels)],
    )
    _insert(connection, messages)
    return connection


def _insert(connection: sqlite3.Connection, messages: Sequence[mcap.Message]) -> None:
    connection.execute("BEGIN")
    connection.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
        [(one.channel + 1, one.stamp, one.data) for one in messages],
    )
    connection.execute("COMMIT")


def _sqlite(bag: Path, content: Content = DEMONSTRATION) -> Path:
    _database(bag / "bag_0.db3", content.messages, content.channels).close()
    return _metadata(bag, "sqlite3")


def _split_sqlite(bag: Path, content: Content = DEMONSTRATION) -> Path:
    _database(bag / "bag_0.db3", content.messages[:COUNT], content.channels).close()
    _database(bag / "bag_1.db3", content.messages[COUNT:], content.channels).close()
    return _metadata(bag, "sqlite3")


def _sqlite_with_log(bag: Path, content: Content = DEMONSTRATION) -> Path:
    """The second half of the messages is in the write-ahead log, as a killed recorder leaves it."""
    messages = content.messages
    live = bag.with_name(f"{bag.name}.live") / "bag_0.db3"
    connection = _database(live, messages[:COUNT], content.channels)
    connection.execute("PRAGMA journal_mode = WAL")
    _insert(connection, messages[COUNT:])
    bag.mkdir()
    for one in ("bag_0.db3", "bag_0.db3-wal"):
        shutil.copyfile(live.with_name(one), bag / one)
    connection.close()
    _metadata(bag, "sqlite3")
    text = (bag / METADATA).read_text(encoding="utf-8")
    (bag / METADATA).write_text(text.replace("  - bag_0.db3-wal\n", ""), encoding="utf-8")
    return bag


def _by_rosbags(
    bag: Path, _: Content = DEMONSTRATION, *, storage: StoragePlugin, mode: CompressionMode | None
) -> Path:
    return corpus.bag(bag, storage, mode, COUNT)


def _recording(directory: Path, _: Content = DEMONSTRATION) -> Path:
    features = (Feature("a", topic="/state", index=0), Feature("b", topic="/state", index=1))
    with RecordingWriter(directory, features, ("/action",)) as writer:
        for number, (values, label) in enumerate(RECORDED):
            writer.write(Row(2 * number + 2, "/action", label, None, values))
    return directory


READERS: Final[Mapping[str, Callable[..., Path]]] = {
    "mcap": _mcap,
    "mcap without chunks": partial(_mcap, per_chunk=None),
    "mcap without indexes": partial(_mcap, index=False),
    "mcap without a summary": partial(_mcap, summary=False),
    "unfinished mcap": partial(_mcap, finished=False),
    "unfinished mcap without chunks": partial(_mcap, finished=False, per_chunk=None),
    "mcap zstd": partial(_mcap, compression=Compression.ZSTD),
    "mcap lz4": partial(_mcap, compression=Compression.LZ4),
    "split mcap": _split_mcap,
    "packed mcap": partial(_packed, make=_mcap, suffix=".zstd"),
    "mcap packed by lz4": partial(_packed, make=_mcap, suffix=".lz4"),
    "mcap of rosbags": partial(_by_rosbags, storage=StoragePlugin.MCAP, mode=None),
    "mcap of packed messages": partial(
        _by_rosbags, storage=StoragePlugin.MCAP, mode=CompressionMode.MESSAGE
    ),
    "sqlite": _sqlite,
    "sqlite with a log": _sqlite_with_log,
    "split sqlite": _split_sqlite,
    "packed sqlite": partial(_packed, make=_sqlite, suffix=".zstd"),
    "sqlite of packed messages": partial(
        _by_rosbags, storage=StoragePlugin.SQLITE3, mode=CompressionMode.MESSAGE
    ),
    "recording": _recording,
}

# --- ways to lose messages: each changes a bag, and says whether it applies ---------------------


def _files(bag: Path) -> list[Path]:
    return sorted(one for one in bag.iterdir() if one.name != METADATA)


def _cut(bag: Path, share: float) -> bool:
    file = _files(bag)[-1]
    data = file.read_bytes()
    file.write_bytes(data[: round(len(data) * share)])
    return True


def _overwritten(bag: Path, share: float, size: int, with_byte: int) -> bool:
    file = _files(bag)[-1]
    data = bytearray(file.read_bytes())
    begin = round(len(data) * share)
    size = min(size, len(data) - begin)
    data[begin : begin + size] = bytes([with_byte]) * size
    file.write_bytes(data)
    return True


def _counts(bag: Path, count: int) -> bool:
    if not (bag / METADATA).exists():
        return False
    text = (bag / METADATA).read_text(encoding="utf-8")
    begin = text.index("topics_with_message_count")
    changed = re.sub(r"message_count: \d+", f"message_count: {count}", text[begin:])
    (bag / METADATA).write_text(text[:begin] + changed, encoding="utf-8")
    return True


def _missing(bag: Path) -> bool:
    files = _files(bag)
    if len(files) < 2 or files[-1].name.endswith("-wal"):
        return False
    files[0].unlink()
    return True


def _unlisted(bag: Path) -> bool:
    if not (bag / METADATA).exists():
        return False
    if len(_files(bag)) == 2:
        text = (bag / METADATA).read_text(encoding="utf-8")
        listed = [line for line in text.splitlines(keepends=True) if "- bag_1" not in line]
        (bag / METADATA).write_text("".join(listed), encoding="utf-8")
        return not _files(bag)[-1].name.endswith("-wal")
    return False


def _emptied(bag: Path) -> bool:
    _files(bag)[-1].write_bytes(b"")
    return True


def _without_metadata(bag: Path) -> bool:
    if not (bag / METADATA).exists():
        return False
    (bag / METADATA).unlink()
    return True


def _nothing(_: Path) -> bool:
    return True


WAYS: Final[Mapping[str, Callable[[Path], bool]]] = {
    "nothing": _nothing,
    **{f"cut at {share}": partial(_cut, share=share) for share in (0.0, 0.02, 0.3, 0.7, 0.95)},
    **{
        f"{size} bytes {byte:#x} at {share}": partial(
            _overwritten, share=share, size=size, with_byte=byte
        )
        for share in (0.1, 0.4, 0.62, 0.8, 0.97)
        for size, byte in ((1, 0x55), (30, 0xFF), (2000, 0))
    },
    "counts too high": partial(_counts, count=99),
    "counts of zero": partial(_counts, count=0),
    "counts too low": partial(_counts, count=7),
    "a listed file missing": _missing,
    "a file that is not listed": _unlisted,
    "an empty file": _emptied,
}


def _rows(loaded: Loaded) -> list[tuple[tuple[float, ...], str]]:
    return [
        (tuple(state[:2]), one.actions[code])
        for one in loaded.demonstrations
        for state, code in zip(one.states.tolist(), one.chosen.tolist(), strict=True)
    ]


def _check_sentence(text: str) -> None:
    assert text.endswith(".")
    assert text.isprintable()
    assert len(text) < 1000


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Makes the bag for a reader, once."""

    @cache
    def made(reader: str) -> Path:
        return READERS[reader](tmp_path_factory.mktemp("whole") / "bag")

    return made


@pytest.mark.parametrize("metadata", [True, False], ids=["metadata", "no metadata"])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("reader", READERS)
def test_nothing_is_lost_in_silence(
    tmp_path: Path, whole: Callable[[str], Path], reader: str, way: str, *, metadata: bool
) -> None:
    bag = Path(shutil.copytree(whole(reader), tmp_path / "bag"))
    if not WAYS[way](bag) or not (metadata or _without_metadata(bag)):
        pytest.skip("does not apply")
    options = InputOptions(skip_bad=True) if reader != "recording" else InputOptions()
    try:
        loaded = load([bag], options)
    except InputError as err:
        _check_sentence(str(err))
        assert way not in {"nothing", "a file that is not listed"}
        assert not way.startswith("counts")
        return
    rows = _rows(loaded)
    # Nothing but metadata tells of a log that is gone.
    gone = reader == "sqlite with a log" and way in {"cut at 0.0", "an empty file"}
    if len(rows) < COUNT and (metadata or not gone):
        assert loaded.notes, (reader, way, len(rows))
        assert any(re.search(r"\d", note.removeprefix("bag")) for note in loaded.notes)
    for account in loaded.accounts.values():
        assert account.read + sum(account.left_out.values()) == account.stated or any(
            f"holds {account.stated} {account.unit}, and" in note for note in loaded.notes
        )
    if "bytes" not in way:
        # What is read is what was recorded, with the state of then.
        assert [row for row in RECORDED if row in rows] == rows
    if way == "counts of zero" or (way == "nothing" and "unfinished" not in reader):
        assert rows == RECORDED
        if "unfinished" not in reader and (metadata or "split" not in reader):
            assert loaded.notes == ()
    if way.startswith("counts too") and metadata:
        assert any(f"and {MESSAGES} were found" in note for note in loaded.notes)


# --- messages that are no part of a demonstration -------------------------------------------------

_WHOLE: Final = DEMONSTRATION.messages


def _with(message: mcap.Message, *channels: mcap.Channel) -> Content:
    """The demonstration with the same message in three places, and with more channels."""
    messages = list(_WHOLE)
    for place in (5, 30, 91):
        messages.insert(place, replace(message, stamp=messages[place].stamp))
    return Content(tuple(messages), (*mcap.CHANNELS, *channels))


#: What is in a bag besides, what notes say of it, and how many of its messages are accounted for.
CONTENTS: Final[Mapping[str, tuple[Content, str, int]]] = {
    "states that cannot be decoded": (
        _with(mcap.Message(0, 0, b"\0\1\0\0\xff")),
        "left out: 3 unusable messages; the first: .*cannot be decoded",
        3,
    ),
    "actions without data": (
        _with(mcap.Message(1, 0, b"")),
        "left out: 3 unusable messages; the first: .*cannot be decoded",
        3,
    ),
    "another type on the topic": (
        _with(mcap.Message(2, 0, b"\0\1\0\0"), mcap.Channel("/state", "geometry_msgs/msg/Twist")),
        "left out: messages on /state of type geometry_msgs/msg/Twist: 3",
        0,
    ),
    "another encoding on the topic": (
        _with(mcap.Message(2, 0, b"{}"), mcap.Channel("/action", mcap.ACTION, "json")),
        "left out: json messages on /action: 3",
        0,
    ),
    "another topic": (
        _with(mcap.Message(2, 0, b"\0\1\0\0"), mcap.Channel("/odom", "a/msg/B")),
        "",
        0,
    ),
    "topics that are not described": (
        _with(mcap.Message(76, 0, b"\0\1\0\0")),
        "left out: messages of topics that .* does not describe: [1-3]",
        0,
    ),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("reader", [one for one in READERS if " of " not in one])
def test_what_is_left_out_is_named_and_counted(tmp_path: Path, reader: str, content: str) -> None:
    if reader == "recording":
        pytest.skip("has no messages")
    inside, note, count = CONTENTS[content]
    bag = READERS[reader](tmp_path / "bag", inside)
    for metadata in (True, False):
        if not metadata:
            (bag / METADATA).unlink()
        loaded = load([bag], InputOptions(skip_bad=True))
        assert _rows(loaded) == RECORDED
        assert not note or any(re.search(note, one) for one in loaded.notes)
        [account] = loaded.accounts.values()
        assert account.read == MESSAGES
        assert sum(account.left_out.values()) == count
        # Metadata say that there are as many as belong there.
        expected = MESSAGES if metadata else MESSAGES + count
        assert account.stated == expected
        told = any(f"says that it holds {MESSAGES}" in one for one in loaded.notes)
        assert told == bool(metadata and count)
