"""Every reader of bags, times every way to lose messages: none is lost without a word.

Whatever is read is a part of what was recorded, in its order; where it is not all, a note says so
with numbers or by the name of what is not there; what is refused is refused in one sentence.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Final

import mcap_files as mcap
import pytest
from fuzz import corpus
from mcap_files import Compression
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.inputs import InputOptions, Loaded, load
from rebt_ros.storage.recording import RecordingWriter

#: Rows of every whole input.
COUNT: Final = 60
MESSAGES: Final = 2 * COUNT
LABELS: Final = ("go", "turn", "wait")
RECORDED: Final = [((number / 3, float(-number)), LABELS[number % 3]) for number in range(COUNT)]

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
    *,
    per_chunk: int | None = 20,
    compression: Compression = Compression.NONE,
    index: bool = True,
    summary: bool = True,
    finished: bool = True,
) -> Path:
    mcap.write(
        bag / "bag_0.mcap",
        mcap.demonstration(COUNT),
        per_chunk=per_chunk,
        compression=compression,
        index=index,
        summary=summary,
        finished=finished,
    )
    return _metadata(bag, "mcap")


def _split_mcap(bag: Path) -> Path:
    messages = mcap.demonstration(COUNT)
    mcap.write(bag / "bag_0.mcap", messages[:COUNT])
    mcap.write(bag / "bag_1.mcap", messages[COUNT:])
    return _metadata(bag, "mcap")


def _packed_mcap(bag: Path) -> Path:
    _mcap(bag)
    (bag / "bag_0.mcap.zstd").write_bytes(
        mcap.packing._zstd().compress((bag / "bag_0.mcap").read_bytes())
    )
    (bag / "bag_0.mcap").unlink()
    return _metadata(bag, "mcap")


def _database(file: Path, messages: list[mcap.Message]) -> sqlite3.Connection:
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
        "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')",
        [(number + 1, one.topic, one.kind) for number, one in enumerate(mcap.CHANNELS)],
    )
    _insert(connection, messages)
    return connection


def _insert(connection: sqlite3.Connection, messages: list[mcap.Message]) -> None:
    connection.execute("BEGIN")
    connection.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
        [(one.channel + 1, one.stamp, one.data) for one in messages],
    )
    connection.execute("COMMIT")


def _sqlite(bag: Path) -> Path:
    _database(bag / "bag_0.db3", mcap.demonstration(COUNT)).close()
    return _metadata(bag, "sqlite3")


def _split_sqlite(bag: Path) -> Path:
    messages = mcap.demonstration(COUNT)
    _database(bag / "bag_0.db3", messages[:COUNT]).close()
    _database(bag / "bag_1.db3", messages[COUNT:]).close()
    return _metadata(bag, "sqlite3")


def _sqlite_with_log(bag: Path) -> Path:
    """The second half of the messages is in the write-ahead log, as a killed recorder leaves it."""
    messages = mcap.demonstration(COUNT)
    live = bag.with_name(f"{bag.name}.live") / "bag_0.db3"
    connection = _database(live, messages[:COUNT])
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


def _packed_sqlite(bag: Path) -> Path:
    _sqlite(bag)
    (bag / "bag_0.db3.zstd").write_bytes(
        mcap.packing._zstd().compress((bag / "bag_0.db3").read_bytes())
    )
    (bag / "bag_0.db3").unlink()
    return _metadata(bag, "sqlite3")


def _by_rosbags(bag: Path, *, storage: StoragePlugin, mode: CompressionMode | None) -> Path:
    return corpus.bag(bag, storage, mode, COUNT)


def _recording(directory: Path) -> Path:
    features = (Feature("a", topic="/state", index=0), Feature("b", topic="/state", index=1))
    with RecordingWriter(directory, features, ("/action",)) as writer:
        for number, (values, label) in enumerate(RECORDED):
            writer.write(Row(2 * number + 2, "/action", label, None, values))
    return directory


READERS: Final[Mapping[str, Callable[[Path], Path]]] = {
    "mcap": _mcap,
    "mcap without chunks": partial(_mcap, per_chunk=None),
    "mcap without indexes": partial(_mcap, index=False),
    "mcap without a summary": partial(_mcap, summary=False),
    "unfinished mcap": partial(_mcap, finished=False),
    "unfinished mcap without chunks": partial(_mcap, finished=False, per_chunk=None),
    "mcap zstd": partial(_mcap, compression=Compression.ZSTD),
    "mcap lz4": partial(_mcap, compression=Compression.LZ4),
    "split mcap": _split_mcap,
    "packed mcap": _packed_mcap,
    "mcap of rosbags": partial(_by_rosbags, storage=StoragePlugin.MCAP, mode=None),
    "mcap of packed messages": partial(
        _by_rosbags, storage=StoragePlugin.MCAP, mode=CompressionMode.MESSAGE
    ),
    "sqlite": _sqlite,
    "sqlite with a log": _sqlite_with_log,
    "split sqlite": _split_sqlite,
    "packed sqlite": _packed_sqlite,
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
