"""Ways in which messages of a bag can be lost: none is lost without a note."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import sqlite3
import struct
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock

import lz4.frame
import mcap_files as mcap
import pytest
import test_bag_table as table
from benchmarks.large_inputs import many_topics
from fuzz import corpus
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.errors import InputError
from rebt_ros.storage import packing, sqlite
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.inputs import load
from rebt_ros.storage.mcap import _records
from rebt_ros.storage.read import Read
from rebt_ros.storage.sqlite_pages import SqlitePages
from rebt_ros.storage.time_order import by_time

MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


def _read(bag: Path) -> Read:
    return read_bag(bag, skip_bad=True)


def _execute(bag: Path, *statements: str) -> None:
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as connection:
        for one in statements:
            connection.execute(one)
    connection.close()


def _log_of_sqlite(bag: Path, which: str = "id % 2") -> None:
    """Leaves some of the messages in the write-ahead log, as a killed recorder does."""
    (file,) = bag.glob("*.db3")
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute(f"CREATE TABLE half AS SELECT * FROM messages WHERE {which}")
    connection.execute(f"DELETE FROM messages WHERE {which}")
    connection.commit()
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.execute("INSERT INTO messages SELECT * FROM half")
    connection.commit()
    copies = [(one, one.with_suffix(one.suffix + ".kept")) for one in bag.glob("*.db3*")]
    for one, kept in copies:
        shutil.copyfile(one, kept)
    connection.close()
    for one, kept in copies:
        kept.replace(one)


def _counts(wanted: tuple[int, int]) -> Callable[[Path], None]:
    def change(bag: Path) -> None:
        metadata = bag / "metadata.yaml"
        counts = iter(wanted)
        text = metadata.read_text()
        begin = text.index("topics_with_message_count")
        changed = re.sub(
            r"message_count: \d+", lambda _: f"message_count: {next(counts)}", text[begin:]
        )
        metadata.write_text(text[:begin] + changed)

    return change


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
@pytest.mark.parametrize(
    ("counts", "note"),
    [
        ((20, 20), ""),
        ((0, 0), ""),
        ((-3, -3), ""),
        ((30, 20), "the input says that it holds 50 messages, and 40 were found"),
        ((25, 15), "the input says that /state has 25 messages, and 20 were found"),
    ],
)
def test_counts_of_metadata_that_differ_are_noted_and_those_of_nobody_are_not_believed(
    tmp_path: Path, storage: StoragePlugin, counts: tuple[int, int], note: str
) -> None:
    bag = corpus.bag(tmp_path / "bag", storage, None)
    _counts(counts)(bag)
    told = load([bag]).notes
    assert any(note in one for one in told) if note else not told


def test_the_write_ahead_log_is_read(tmp_path: Path) -> None:
    whole = _read(corpus.bag(tmp_path / "whole", SQLITE, None))
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    _log_of_sqlite(bag)
    assert (bag / "bag.db3-wal").stat().st_size
    before = {one.name: one.read_bytes() for one in bag.iterdir()}
    read = _read(bag)
    assert read.demonstration.states.tolist() == whole.demonstration.states.tolist()
    assert {one.name: one.read_bytes() for one in bag.iterdir()} == before


def test_messages_of_topics_that_are_not_described_are_noted(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    (bag / "metadata.yaml").unlink()
    _execute(bag, "UPDATE messages SET topic_id = 77 WHERE id > 30")
    (note,) = _read(bag).notes
    assert note == "left out: messages of topics that bag.db3 does not describe: 10"


def test_a_number_in_place_of_a_message_is_an_unusable_message(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    _execute(bag, "UPDATE messages SET data = 1500000000 WHERE id = 3")
    read = _read(bag)
    assert any("1 unusable message" in note for note in read.notes)
    assert read.account is not None
    assert read.account.left_out["cannot be used"] == 1
    assert not read.account.missing


def test_a_file_beside_those_that_are_listed_is_read_with_a_note(tmp_path: Path) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    later = [replace(one, stamp=one.stamp + 1000) for one in mcap.demonstration()]
    mcap.write(bag / "bag_1.mcap", later)
    loaded = load([bag])
    assert any("bag_1.mcap is not listed" in note for note in loaded.notes)
    assert any("holds 120 messages, and 160 were found" in note for note in loaded.notes)


@pytest.mark.parametrize("other", ["bag_0 (1).mcap", "copy.db3"])
@pytest.mark.parametrize("listed", [True, False])
def test_messages_that_are_in_two_files_are_read_once(
    tmp_path: Path, other: str, *, listed: bool
) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    if other.endswith("db3"):
        table._database(bag / other, table.DEMONSTRATION.messages).close()
    else:
        shutil.copyfile(bag / "bag_0.mcap", bag / other)
    if not listed:
        (bag / table.METADATA).unlink()
    read = read_bag(bag)
    assert len(read.demonstration) == table.COUNT
    assert any("holds the same messages as" in note for note in read.notes)
    assert read.account is not None
    assert not read.account.missing


@pytest.mark.parametrize("listed", [True, False])
def test_a_log_whose_database_has_another_name_is_noted(tmp_path: Path, *, listed: bool) -> None:
    bag = table.READERS["sqlite with a log"](tmp_path / "bag")
    (bag / "bag_0.db3").rename(bag / "run.db3")
    if not listed:
        (bag / table.METADATA).unlink()
    read = read_bag(bag)
    assert len(read.demonstration) < table.COUNT
    assert any(note.startswith("bag_0.db3-wal may hold messages") for note in read.notes)


def test_what_stands_behind_the_end_of_an_mcap_file_is_noted(tmp_path: Path) -> None:
    first = mcap.write(tmp_path / "1.mcap", mcap.demonstration())
    second = mcap.write(tmp_path / "2.mcap", mcap.demonstration())
    size = first.stat().st_size
    first.write_bytes(first.read_bytes() + second.read_bytes())
    [note] = read_bag(first).notes
    assert f"goes on for {size} bytes behind its end, which were not read" in note
    second.write_bytes(second.read_bytes() + bytes(4096))
    assert read_bag(second).notes == ()


def test_a_file_that_is_listed_and_not_there_is_noted(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    metadata = bag / "metadata.yaml"
    listed = metadata.read_text().replace("  - bag.mcap\n", "  - bag.mcap\n  - bag_1.mcap\n")
    metadata.write_text(listed)
    assert any("bag_1.mcap is listed in metadata.yaml and not there" in n for n in _read(bag).notes)


def test_a_directory_of_bags_and_recordings_is_not_read_in_part(tmp_path: Path) -> None:
    corpus.bag(tmp_path / "all" / "bag", MCAP, None)
    (recording, *_) = corpus.recordings(tmp_path / "seeds")
    (tmp_path / "all" / "one.rec").write_bytes(recording)
    with pytest.raises(InputError, match="holds bags and recordings"):
        load([tmp_path / "all"])


# --- several types on a topic -----------------------------------------------------------------


def _with_kinds(path: Path) -> Path:
    """A file of demonstrations, where others also publish on the topics, or did for a while."""
    channels = (
        *mcap.CHANNELS,
        mcap.Channel("/state", "std_msgs/msg/Float32MultiArray"),
        mcap.Channel("/action", mcap.ACTION, "json"),
    )
    messages = mcap.demonstration()
    messages[4:4] = [mcap.Message(2, 4, b"\0\1\0\0")] * 3
    messages[9:9] = [mcap.Message(3, 8, b'{"data": "go"}')] * 2
    return mcap.write(path, messages, channels)


@pytest.mark.parametrize("named", [True, False])
def test_messages_of_the_type_are_read_and_those_of_other_types_are_noted(
    tmp_path: Path, *, named: bool
) -> None:
    states = [StateTopic("/state")] if named else []
    read = read_bag(_with_kinds(tmp_path / "bag.mcap"), state_topics=states)
    assert len(read.demonstration) == 20
    assert read.notes == (
        "left out: json messages on /action: 2",
        "left out: messages on /state of type std_msgs/msg/Float32MultiArray: 3",
    )
    assert read.account is not None
    assert not read.account.missing


def test_a_topic_on_which_no_type_fits_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"must be of type .*: there is /action \(std_msgs/msg/S"):
        read_bag(_with_kinds(tmp_path / "bag.mcap"), action_topics=["/state"])


def test_types_without_their_msg_are_the_same_types(tmp_path: Path) -> None:
    channels = [replace(one, kind=one.kind.replace("/msg", "")) for one in mcap.CHANNELS]
    read = read_bag(mcap.write(tmp_path / "bag.mcap", mcap.demonstration(), channels))
    assert (len(read.demonstration), read.notes) == (20, ())


# --- damage -----------------------------------------------------------------------------------


def test_after_a_damaged_chunk_the_next_ones_are_read_and_no_state_is_made_up(
    tmp_path: Path,
) -> None:
    path = mcap.write(tmp_path / "bag.mcap", mcap.demonstration(), per_chunk=5)
    with path.open("rb") as file:
        begins = [start - 9 for kind, start, _ in _records(file) if kind == 6]
    data = bytearray(path.read_bytes())
    # Of 5 messages each: the chunk after this one begins with an action.
    data[begins[2] : begins[2] + 9] = b"\xff" * 9
    path.write_bytes(data)
    read = read_bag(path)
    assert any("is damaged from byte" in note for note in read.notes)
    assert "left out: 1 action after messages that are missing, whose state is not known" in (
        read.notes
    )
    labels = read.demonstration.actions
    rows = {
        int(stamp): (state, labels[code])
        for stamp, state, code in zip(
            read.demonstration.stamps,
            read.demonstration.states.tolist(),
            read.demonstration.chosen,
            strict=True,
        )
    }
    assert len(rows) == 17
    for stamp, (state, label) in rows.items():
        number = stamp // 2 - 1
        assert (state, label) == ([number / 3, -number], ("go", "turn", "wait")[number % 3])
    assert read.account is not None
    assert (read.account.stated, read.account.read) == (40, 34)


@pytest.mark.parametrize("finished", [False, True])
def test_records_of_kinds_that_come_later_are_passed_over_with_a_note(
    tmp_path: Path, *, finished: bool
) -> None:
    added = mcap.record(0x10, b"new!") + mcap.record(0x7F, b"")
    messages = mcap.demonstration()
    mcap.write(tmp_path / "bag.mcap", messages, finished=finished, added=added)
    read = read_bag(tmp_path / "bag.mcap")
    assert len(read.demonstration) == 20
    [note] = (one for one in read.notes if "of its format" in one)
    count = 10 if finished else 8
    assert f"{count} records are of kinds that are not known (0x10, 0x7f), and passed over" in note


def test_records_of_a_programs_own_are_passed_over(tmp_path: Path) -> None:
    added = mcap.record(0x80, b"new!") + mcap.record(0xFF, b"")
    read = read_bag(mcap.write(tmp_path / "bag.mcap", mcap.demonstration(), added=added))
    assert (len(read.demonstration), read.notes) == (20, ())


def test_a_chunk_that_is_called_something_else_is_missing(tmp_path: Path) -> None:
    path = mcap.write(tmp_path / "bag.mcap", mcap.demonstration(), per_chunk=5)
    with path.open("rb") as file:
        begins = [start - 9 for kind, start, _ in _records(file) if kind == 6]
    data = bytearray(path.read_bytes())
    data[begins[2]] ^= 0x40
    path.write_bytes(data)
    read = read_bag(path)
    assert len(read.demonstration) == 17
    assert any("later version of its format, or damaged: 1 record is" in n for n in read.notes)
    assert "left out: 1 action after messages that are missing, whose state is not known" in (
        read.notes
    )


def test_no_action_is_sampled_through_missing_messages(tmp_path: Path) -> None:
    messages = [replace(one, stamp=one.stamp * 100_000_000) for one in mcap.demonstration()]
    path = mcap.write(tmp_path / "bag.mcap", messages, per_chunk=4)
    whole = read_bag(path, sample_rate=20.0).demonstration
    with path.open("rb") as file:
        begins = [start - 9 for kind, start, _ in _records(file) if kind == 6]
    data = bytearray(path.read_bytes())
    data[begins[4] : begins[4] + 9] = b"\xff" * 9
    path.write_bytes(data)
    read = read_bag(path, sample_rate=20.0).demonstration
    # Messages 16 to 19 are missing, which have the stamps 17 to 20.
    expected = [
        (stamp, state)
        for stamp, state in zip(whole.stamps.tolist(), whole.states.tolist(), strict=True)
        if not 1_600_000_000 <= stamp < 2_200_000_000
    ]
    assert list(zip(read.stamps.tolist(), read.states.tolist(), strict=True)) == expected


def test_chunks_packed_by_other_means_are_named(tmp_path: Path) -> None:
    path = mcap.write(tmp_path / "bag.mcap", mcap.demonstration(), compression=mcap.Compression.LZ4)
    path.write_bytes(path.read_bytes().replace(b"\3\0\0\0lz4", b"\3\0\0\0br9"))
    with pytest.raises(InputError, match="packed by 'br9', which is not known here: 4 chunks are"):
        read_bag(path)


def test_statistics_that_do_not_count_by_channel_are_compared_in_total(tmp_path: Path) -> None:
    path = mcap.write(tmp_path / "bag.mcap", mcap.demonstration())
    data = path.read_bytes()
    begin = data.rindex(struct.pack("<BQQ", 11, 46 + 20, 40))
    head = struct.pack("<BQQ", 11, 46 + 20, 50) + data[begin + 17 : begin + 9 + 42]
    # An attachment is no message, and takes the place of the counts.
    path.write_bytes(data[:begin] + head + bytes(4 + 20) + data[begin + 9 + 46 + 20 :])
    read = read_bag(path)
    assert len(read.demonstration) == 20
    assert read.notes == ("the file says that it holds 50 messages, and 40 were found",)


@pytest.mark.parametrize("suffix", [".lz4", ".zst", ".zstd"])
def test_files_packed_with_command_line_tools_are_read(tmp_path: Path, suffix: str) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    data = (bag / "bag.mcap").read_bytes()
    pack = lz4.frame.compress if suffix == ".lz4" else packing._zstd().compress
    (bag / "bag.mcap").unlink()
    (bag / f"bag.mcap{suffix}").write_bytes(pack(data))
    read = _read(bag)
    assert (len(read.demonstration), read.notes) == (20, ())


def test_of_a_packed_file_that_is_cut_off_the_beginning_is_read(tmp_path: Path) -> None:
    path = mcap.write(tmp_path / "bag.mcap", mcap.demonstration(3000), per_chunk=100)
    packed = packing._zstd().compress(path.read_bytes())
    path.unlink()
    whole = tmp_path / "bag.mcap.zstd"
    whole.write_bytes(packed[: len(packed) * 9 // 10])
    read = read_bag(whole)
    assert 500 < len(read.demonstration) < 3000
    assert any("bytes could be unpacked" in note for note in read.notes)


def test_files_are_missed_by_their_numbers_where_there_is_no_list(tmp_path: Path) -> None:
    for number in (0, 3):
        mcap.write(tmp_path / "run" / f"run_{number}.mcap", mcap.demonstration())
    notes = _read(tmp_path / "run").notes
    assert "by their numbers, 2 files are not there: run_1, run_2" in notes


def test_a_file_that_cannot_be_read_does_not_keep_the_others_from_being_read(
    tmp_path: Path,
) -> None:
    for number in (0, 1):
        mcap.write(tmp_path / "run" / f"run_{number}.mcap", mcap.demonstration())
    (tmp_path / "run" / "run_1.mcap").write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    read = _read(tmp_path / "run")
    assert len(read.demonstration) == 20
    assert any("run_1.mcap cannot be read, and is left out" in note for note in read.notes)
    assert any("git lfs pull" in note for note in read.notes)


_TABLES = (
    "PRAGMA page_size = 512;"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
    "serialization_format TEXT, offered_qos_profiles TEXT);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
    "timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
)


def _database_of(path: Path, messages: list[tuple[int, int, bytes]]) -> None:
    """A database of messages: topic, stamp and data of each."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.executescript(_TABLES)
        connection.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", messages
        )
        connection.commit()


def _large_database(path: Path) -> bytes:
    """A database of 400 messages, one of them longer than a page, with 100 deleted."""
    connection = sqlite3.connect(path)
    connection.executescript(
        f"{_TABLES} INSERT INTO topics VALUES (1, '/state', '{mcap.STATE}', 'cdr', ''),"
        f" (2, '/action', '{mcap.ACTION}', 'cdr', '')"
    )
    messages = [
        (one.channel + 1, one.stamp, one.data if one.stamp != 200 else mcap.action("x" * 2000))
        for one in mcap.demonstration(250)
    ]
    connection.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", messages
    )
    connection.execute("DELETE FROM messages WHERE id > 400")
    connection.commit()
    connection.close()
    return path.read_bytes()


def test_pages_hold_the_messages_that_sqlite_finds(tmp_path: Path) -> None:
    path = tmp_path / "bag.db3"
    _large_database(path)
    with path.open("rb") as file, contextlib.closing(sqlite3.connect(path)) as connection:
        by_sqlite = connection.execute("SELECT id, topic_id, timestamp, data FROM messages")
        pages = [
            (one.number, one.topic, one.stamp, one.data) for one in SqlitePages(file).messages()
        ]
        assert sorted(pages) == sorted(by_sqlite.fetchall())


with tempfile.TemporaryDirectory() as _directory:
    _DATABASE = _large_database(Path(_directory, "bag.db3"))


@given(st.integers(100, 30_000), st.integers(0, 2000), st.integers(0, 255))
@settings(deadline=None)
def test_pages_can_be_anything(begin: int, size: int, byte: int) -> None:
    data = bytearray(_DATABASE)
    begin = min(begin, len(data))
    data[begin : begin + size] = bytes([byte]) * len(data[begin : begin + size])
    whole = {one.number for one in SqlitePages(io.BytesIO(_DATABASE)).messages()}
    numbers = [one.number for one in SqlitePages(io.BytesIO(bytes(data))).messages()]
    assert len(numbers) == len(set(numbers))
    # A page of 512 bytes has at most 36 rows of 14 bytes.
    pages = size // 512 + 2
    assert len(whole - set(numbers)) <= 36 * pages


def test_what_a_cut_off_database_still_has_is_read(tmp_path: Path) -> None:
    data = _large_database(tmp_path / "whole.db3")
    path = tmp_path / "cut.db3"
    path.write_bytes(data[: len(data) // 2 + 100])
    read = read_bag(path)
    assert 50 < len(read.demonstration) < 200
    [note] = [one for one in read.notes if "could be read" in one]
    assert "is damaged (it ends before its end)" in note
    assert re.search(r"\d+ of at least \d+ messages", note)


def test_damage_behind_a_row_that_goes_on_on_other_pages_costs_that_row_alone(
    tmp_path: Path,
) -> None:
    path = tmp_path / "bag.db3"
    data = bytearray(_large_database(path))
    with contextlib.closing(sqlite3.connect(path)) as connection:
        [(count,)] = connection.execute("SELECT count(*) FROM messages")
    [first, *_] = (at for at in range(0, len(data), 512) if data[at + 4 : at + 512] == b"x" * 508)
    data[first : first + 4] = b"\xff" * 4
    path.write_bytes(data)
    whole = tmp_path / "whole.db3"
    _large_database(whole)
    read, of_whole = read_bag(path), read_bag(whole)
    assert len(of_whole.demonstration) - len(read.demonstration) == 1
    [note] = [one for one in read.notes if "could be read" in one]
    assert f"{count - 1} messages could be read" in note or f"{count - 1} of at least" in note


@given(
    st.lists(
        st.tuples(st.integers(1, 3), st.one_of(st.integers(0, 20), st.integers(0, 10**10))),
        max_size=30,
    ),
    st.booleans(),
    st.sets(st.integers(1, 3), min_size=1),
    st.integers(1, 9),
)
def test_messages_of_sqlite_are_given_by_their_stamps(
    messages: list[tuple[int, int]], are_sorted: bool, wanted: set[int], at_once: int
) -> None:
    if are_sorted:
        messages.sort(key=lambda one: one[1])
    named = [(number, stamp, bytes([place])) for place, (number, stamp) in enumerate(messages)]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, "bag.db3")
        _database_of(path, named)
        with mock.patch.object(sqlite, "_ROWS_AT_ONCE", at_once), sqlite.opened(path) as file:
            found = list(file.messages(sorted(wanted)))
    assert file.found == Counter(number for number, _ in messages)
    expected = [one for one in named if one[0] in wanted]
    assert found == by_time(expected, lambda stamp: (sqlite.GAP, stamp, b""), lambda: None)


def test_a_log_that_is_damaged_is_noted(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    _log_of_sqlite(bag, "id > 20")
    log = bag / "bag.db3-wal"
    data = bytearray(log.read_bytes())
    data[:4] = b"\0\0\0\0"
    log.write_bytes(data)
    (bag / "metadata.yaml").unlink()
    notes = _read(bag).notes
    assert (
        f"bag.db3 has a write-ahead log of {len(data)} bytes that is damaged: it was not read"
        in notes
    )


def test_the_pages_of_a_log_that_are_not_complete_are_noted(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    _log_of_sqlite(bag, "id > 20")
    log = bag / "bag.db3-wal"
    log.write_bytes(log.read_bytes()[:-10])
    (bag / "metadata.yaml").unlink()
    assert any(
        "pages are not complete or damaged: they were not read" in note for note in _read(bag).notes
    )


# --- large ones -------------------------------------------------------------------------------


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_a_bag_of_700_topics_with_40_publishers_on_one_is_read(
    tmp_path: Path, storage: StoragePlugin
) -> None:
    loaded = load([many_topics(tmp_path / "bag", storage, seconds=1)])
    assert loaded.notes == ()
    assert [len(one) for one in loaded.demonstrations] == [20]
    assert not [one for one in loaded.accounts.values() if one.missing]
