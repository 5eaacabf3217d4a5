"""Bags that were made to harm: they are refused, soon, and nothing outside of them is read."""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import lz4.frame
import mcap_files
import pytest
from fuzz import corpus
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from rebt_ros.errors import InputError
from rebt_ros.storage import bag_metadata, bag_safety
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.inputs import load

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3

#: Unpacked, this would take seconds and most of a small robot's memory.
BOMB = 1 << 29


@pytest.fixture(scope="module")
def bomb() -> bytes:
    packed: bytes = zstd.compress(bytes(BOMB))
    assert len(packed) < BOMB / 10_000
    return packed


@contextmanager
def refused(match: str) -> Iterator[None]:
    """Soon, with a sentence."""
    # Of the processor, as a busy machine is no bomb.
    began = time.process_time()
    with pytest.raises(InputError, match=match) as raised:
        yield
    assert time.process_time() - began < 5.0
    assert str(raised.value).endswith(".")


def execute(bag: Path, *statements: str | tuple[str, tuple[object, ...]]) -> None:
    """Changes the database of a bag."""
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as connection:
        connection.execute("PRAGMA writable_schema = ON")
        for one in statements:
            connection.execute(*((one,) if isinstance(one, str) else one))
    connection.close()


# --- what unpacks to too much -----------------------------------------------------------------


def test_a_message_that_unpacks_to_too_much_is_refused(tmp_path: Path, bomb: bytes) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, CompressionMode.MESSAGE)
    execute(bag, ("UPDATE messages SET data = ? WHERE id = 3", (bomb,)))
    with refused("could unpack to"):
        read_bag(bag)


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_a_file_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, bomb: bytes, storage: StoragePlugin
) -> None:
    bag = corpus.bag(tmp_path / "bag", storage, CompressionMode.FILE)
    (file,) = bag.glob("*.zstd")
    file.write_bytes(bomb)
    with refused("could unpack to .*, and at most .* are read: .*zstd -d"):
        read_bag(bag)


def test_a_file_that_is_unpacked_as_was_advised_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bag" / "bag_0.mcap"
    messages = mcap_files.demonstration()
    camera = mcap_files.Message(2, 3, bytes(300 << 20))
    channels = (*mcap_files.CHANNELS, mcap_files.Channel("/camera", "sensor_msgs/msg/Image"))
    mcap_files.write(path, [*messages, camera], channels, per_chunk=None)
    packed = path.with_name("bag_0.mcap.zstd")
    packed.write_bytes(zstd.compress(path.read_bytes()))
    path.unlink()
    with pytest.raises(InputError, match="unpack it with `zstd -d`"):
        read_bag(tmp_path / "bag")
    with zstd.open(packed, "rb") as source, path.open("wb") as target:
        shutil.copyfileobj(source, target)
    assert len(read_bag(tmp_path / "bag").demonstration) == 20


def packed_chunks(
    path: Path,
    name: str,
    pack: Callable[[bytes], bytes],
    *,
    times: int = 1,
    metadata: bytes = b"",
) -> Path:
    """An mcap bag whose chunks are packed in a way of their own, and indexed several times."""
    types = corpus.get_typestore(corpus.Stores.ROS2_JAZZY)
    writer = Writer(path, version=9, storage_plugin=MCAP)
    with writer:
        storage = writer.storage
        storage.compression, storage.compressor = name, pack
        for topic, kind, data in (
            ("/state", corpus.STATE, types.types[corpus.STATE]),
            ("/action", corpus.ACTION, types.types[corpus.ACTION]),
        ):
            connection = writer.add_connection(topic, kind, typestore=types)
            layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
            values = corpus.np.ones(1)
            made = data(data="go") if kind == corpus.ACTION else data(layout=layout, data=values)
            writer.write(connection, 1, types.serialize_cdr(made, kind))
        storage.close_chunk()
        storage.chunks *= times
        storage.channels = [one._replace(metadata=metadata) for one in storage.channels]
    return path


@pytest.mark.parametrize(
    ("name", "pack"),
    [
        ("zstd", lambda _: zstd.compress(bytes(BOMB))),
        ("lz4", lambda _: lz4.frame.compress(bytes(BOMB), block_size=7)),
    ],
)
def test_a_chunk_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, name: str, pack: Callable[[bytes], bytes]
) -> None:
    bag = packed_chunks(tmp_path / "bag", name, pack)
    with refused("could unpack to"):
        read_bag(bag)


@pytest.mark.parametrize("times", [0, 1000])
def test_a_chunk_is_read_once_however_often_it_is_indexed(tmp_path: Path, times: int) -> None:
    read = read_bag(packed_chunks(tmp_path / "bag", "zstd", zstd.compress, times=times))
    assert len(read.demonstration) == 1


@pytest.mark.parametrize(("name", "pack"), [("zstd", zstd.compress), ("lz4", lz4.frame.compress)])
def test_chunks_of_honest_size_are_read(
    tmp_path: Path, name: str, pack: Callable[[bytes], bytes]
) -> None:
    assert len(read_bag(packed_chunks(tmp_path / "bag", name, pack)).demonstration) == 1


@pytest.mark.parametrize("size", [0, 1, 1000, 200_000, 5_000_000])
@pytest.mark.parametrize("fill", [bytes, os.urandom])
def test_the_bound_is_never_below_what_comes_out_and_close_to_it(
    size: int, fill: Callable[[int], bytes]
) -> None:
    data = fill(size)
    bound = bag_safety.expansion(zstd.compress(data))
    assert size <= bound <= size + (128 << 10)
    assert bag_safety.expansion(zstd.compress(data) * 3) >= 3 * size


# --- SQLite that computes ---------------------------------------------------------------------

ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x FROM n"


@pytest.mark.parametrize(
    "statements",
    [
        ("DROP TABLE schema", f"CREATE VIEW schema(schema_version) AS {ENDLESS} WHERE x < 0"),
        (
            "DROP TABLE message_definitions",
            "CREATE VIEW message_definitions(id, topic_type, encoding, encoded_message_definition,"
            f" type_description_hash) AS SELECT 1, 2, 3, 4, 5 FROM ({ENDLESS})",
        ),
        ("ALTER TABLE messages ADD COLUMN more BLOB AS (zeroblob(1000000000))",),
        ("CREATE VIRTUAL TABLE extra USING fts5(x)",),
        ("CREATE TRIGGER t AFTER INSERT ON topics BEGIN SELECT 1; END",),
    ],
    ids=["endless view", "large view", "computed column", "virtual table", "trigger"],
)
def test_a_database_that_computes_is_refused(tmp_path: Path, statements: tuple[str, ...]) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    execute(bag, *statements)
    with refused("which no recorder makes|computed columns"):
        read_bag(bag)


def test_a_database_whose_pages_multiply_is_refused(tmp_path: Path) -> None:
    """Each of its last pages names the next one many times: all rows together are 10 ** 15."""
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    rows = [(1, 100 + one, os.urandom(500)) for one in range(100)]
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as connection:
        connection.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows
        )
        (size,) = connection.execute("PRAGMA page_size").fetchone()
        (root,) = connection.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        ).fetchone()
    connection.close()
    data = bytearray(file.read_bytes())
    top = data[(root - 1) * size : root * size]
    assert top[0] == 5, "not an interior page"
    first = len(data) // size + 1
    leaf = struct.unpack_from(">I", top, struct.unpack_from(">H", top, 12)[0])[0]
    levels = 15
    for level in range(levels):
        child = first + level + 1 if level < levels - 1 else leaf
        page = bytearray(top)
        struct.pack_into(">I", page, 8, child)
        for cell in range(struct.unpack_from(">H", page, 3)[0]):
            struct.pack_into(">I", page, *struct.unpack_from(">H", page, 12 + 2 * cell), child)
        data += page
    data[(root - 1) * size : root * size] = data[(first - 1) * size : first * size]
    struct.pack_into(">I", data, 28, len(data) // size)
    file.write_bytes(data)
    with refused("interrupted"):
        read_bag(bag)


# --- what lies elsewhere ----------------------------------------------------------------------


def outside(tmp_path: Path, storage: StoragePlugin = SQLITE) -> Path:
    """A file that a bag beside it must not lead to."""
    (file,) = (
        one
        for one in corpus.bag(tmp_path / "outside", storage, None).iterdir()
        if one.name != METADATA
    )
    return file


def rename_in_metadata(bag: Path, name: str) -> None:
    metadata = bag / METADATA
    text = re.sub(r"- \w+\.(db3|mcap)$", f"- {name}", metadata.read_text(), flags=re.MULTILINE)
    metadata.write_text(text)


def within_the_bag(bag: Path) -> None:
    """Reads what is in a bag, whatever its metadata say."""
    alone = bag.with_name("alone")
    shutil.copytree(bag, alone, ignore=shutil.ignore_patterns(METADATA))
    wanted = read_bag(alone).demonstration
    read = read_bag(bag)
    assert read.demonstration.states.tolist() == wanted.states.tolist()
    assert any("listed" in note or "cannot be read" in note for note in read.notes)


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
@pytest.mark.parametrize("absolute", [False, True])
def test_metadata_cannot_name_a_file_outside_of_the_bag(
    tmp_path: Path, storage: StoragePlugin, absolute: bool
) -> None:
    file = outside(tmp_path, storage)
    bag = corpus.bag(tmp_path / "bag", storage, None)
    rename_in_metadata(bag, str(file) if absolute else f"../outside/{file.name}")
    within_the_bag(bag)


@pytest.mark.parametrize("name", ["..", ".", "/", "", "'\\0'", "[]", "5"])
def test_metadata_cannot_name_what_is_no_file(tmp_path: Path, name: str) -> None:
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    rename_in_metadata(bag, name)
    within_the_bag(bag)


@pytest.mark.parametrize("suffix", [".db3", ""])
def test_a_name_cannot_lead_out_of_the_bag_as_an_address(tmp_path: Path, suffix: str) -> None:
    """SQLite is given a URL, in which %2e%2e%2f would be the directory above."""
    file = outside(tmp_path)
    target = file.with_suffix(suffix)
    file.rename(target)
    bag = corpus.bag(tmp_path / "bag", SQLITE, None)
    name = f"%2e%2e%2foutside%2f{target.name}"
    (bag / "bag.db3").rename(bag / name)
    rename_in_metadata(bag, name)
    shown = read_bag(corpus.bag(tmp_path / "same", SQLITE, None)).demonstration
    if suffix:
        assert read_bag(bag).demonstration.states.tolist() == shown.states.tolist()
    else:
        with refused("lacks the files|is not a bag"):
            read_bag(bag)


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_a_link_cannot_lead_out_of_the_bag(tmp_path: Path, storage: StoragePlugin) -> None:
    file = outside(tmp_path, storage)
    bag = corpus.bag(tmp_path / "bag", storage, None)
    (link,) = (one for one in bag.iterdir() if one.name != METADATA)
    link.unlink()
    link.symlink_to(file)
    with refused("a link that leads out of"):
        read_bag(bag)


@pytest.mark.parametrize("name", ["bag.mcap", METADATA])
def test_a_pipe_in_a_bag_is_not_waited_for(tmp_path: Path, name: str) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    (bag / name).unlink()
    os.mkfifo(bag / name)
    with refused("is not a file"):
        read_bag(bag)


def test_a_pipe_among_recordings_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with refused("holds no recordings"):
        load([tmp_path])


# --- metadata ---------------------------------------------------------------------------------


def without_metadata(bag: Path, why: str) -> None:
    """Reads a bag, within a second, with a note that says why its metadata are not."""
    began = time.process_time()
    read = read_bag(bag)
    assert time.process_time() - began < 5.0
    assert len(read.demonstration)
    (note,) = read.notes
    assert why in note
    assert note.endswith("the bag is read without it")


def test_metadata_with_aliases_are_not_read(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    levels = "".join(f"  l{one}: &l{one} [{f'*l{one - 1}, ' * 9}]\n" for one in range(1, 12))
    text = (bag / METADATA).read_text()
    text = text.replace("  version: 9", "  l0: &l0 [x]\n" + levels + "  version: *l11")
    (bag / METADATA).write_text(text)
    without_metadata(bag, "has YAML anchors")


def test_long_metadata_are_not_read(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    with (bag / METADATA).open("a") as metadata:
        metadata.write("#" * bag_metadata.LARGEST)
    without_metadata(bag, "are read")


NESTED = "[" * 1500


def test_deeply_nested_metadata_are_not_read(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    with (bag / METADATA).open("a") as metadata:
        metadata.write(f"  more: {NESTED}\n")
    without_metadata(bag, "deep nesting")


@pytest.mark.parametrize(
    "blocks",
    ["- " * 400_000, "? " * 400_000, "".join(f"{' ' * depth}a:\n" for depth in range(900))],
)
def test_deeply_nested_blocks_of_metadata_are_not_read(tmp_path: Path, blocks: str) -> None:
    bag = corpus.bag(tmp_path / "bag", MCAP, None)
    (bag / METADATA).write_text(blocks)
    without_metadata(bag, "deep nesting")


def test_qos_is_not_read_whatever_stands_there(tmp_path: Path) -> None:
    bag = corpus.bag(tmp_path / "database", SQLITE, None)
    execute(bag, ("UPDATE topics SET offered_qos_profiles = ?", (NESTED,)))
    assert len(read_bag(bag).demonstration)
    texts = (b"offered_qos_profiles", NESTED.encode())
    metadata = b"".join(struct.pack("<I", len(text)) + text for text in texts)
    bag = packed_chunks(tmp_path / "bag", "zstd", zstd.compress, metadata=metadata)
    assert len(read_bag(bag).demonstration)
