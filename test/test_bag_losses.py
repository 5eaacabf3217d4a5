"""Ways in which messages of a bag can be lost: none is lost without a note."""

from __future__ import annotations

import re
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
from fuzz import corpus
from rosbags.rosbag2 import StoragePlugin

from rebt_ros.errors import InputError
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.inputs import load
from rebt_ros.storage.read import Read

MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


def _read(bag: Path) -> Read:
    return read_bag(bag, skip_bad=True)


def _execute(bag: Path, *statements: str) -> None:
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as connection:
        for one in statements:
            connection.execute(one)
    connection.close()


def _log_of_sqlite(bag: Path) -> None:
    """Leaves half of the messages in the write-ahead log, as a killed recorder does."""
    (file,) = bag.glob("*.db3")
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("CREATE TABLE half AS SELECT * FROM messages WHERE id % 2")
    connection.execute("DELETE FROM messages WHERE id % 2")
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
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    shutil.copyfile(bag / "bag.mcap", bag / "bag_1.mcap")
    loaded = load([bag])
    assert any("bag_1.mcap is not listed" in note for note in loaded.notes)
    assert any("holds 40 messages, and 80 were found" in note for note in loaded.notes)


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
