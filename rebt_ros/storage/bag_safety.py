"""Bounds on what a bag from elsewhere can make its reader do.

rosbags trusts the files that it reads: a few bytes of compressed data may stand for gigabytes, an
index may send it to the same chunk over and over, a SQLite file may hold views that compute for
ever, and names are put into URLs.  All of that is looked for here, at the cost of reading lengths
and skipping what they span, before rosbags is let at a file or, where that is not possible,
while it reads.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import stat
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from rebt_ros.errors import InputError

#: Longest metadata.yaml that is read (bytes).
LARGEST_METADATA: Final = 500_000
#: Longest description of a topic's QoS, which is YAML as well (bytes).
LARGEST_QOS: Final = 8_000
#: Deepest nesting of brackets in either; the time that YAML takes grows with its square.
DEEPEST_YAML: Final = 20

#: What compressed data may unpack to: this much in any case, and this many times their own size.
LARGEST_EXPANSION: Final = 64 << 20
LARGEST_RATIO: Final = 200

_ALIAS: Final = re.compile(rb"(?:^|[:\-\[,{?])\s*[*&][^\s*&]", re.MULTILINE)

#: Characters that mean something in the URL of a SQLite file.
_URL_CHARACTERS: Final = frozenset("%?#")

_MCAP: Final = b"\x89MCAP0\r\n"
_MCAP_FOOTER: Final = 37
_SCHEMA: Final = 0x03
_CHANNEL: Final = 0x04
_CHUNK: Final = 0x06
_CHUNK_INDEX: Final = 0x08
_FOOTER: Final = 0x02

_ZSTD: Final = 0xFD2FB528
_ZSTD_SKIPPABLE: Final = range(0x184D2A50, 0x184D2A60)
_ZSTD_BLOCK: Final = 128 << 10
_LZ4: Final = 0x184D2204
#: Most that a byte of lz4 stands for.
_LZ4_RATIO: Final = 255

#: SQLite instructions that are granted per byte of a file, and to any file.
_STEPS_PER_BYTE: Final = 20
_STEPS: Final = 1_000_000
_STEPS_AT_ONCE: Final = 10_000


def check_bag(path: Path, metadata: str) -> None:
    """Refuses a bag that is no plain set of files, or that unpacks to too much.

    Args:
        path: A bag's directory, or a single file.
        metadata: Name of the file in a directory that describes it.

    Raises:
        InputError: The bag is refused.
        ValueError: So it is, and the message tells only why.
        OSError: It cannot be read.
    """
    if not path.is_dir():
        _check_file(path, path.parent)
        return
    for one in sorted(path.iterdir()):
        if one.name == metadata:
            _check_metadata(one, path)
        elif not one.is_dir():
            _check_file(one, path)


def expansion(data: bytes) -> int:
    """The most that a piece of zstd data can unpack to, in bytes."""
    return _zstd_bound(io.BytesIO(data), len(data))


def check_expansion(path: Path, unpacked: int, size: int) -> None:
    """Refuses data that unpack to too much.

    Args:
        path: The bag.
        unpacked: The most that they can unpack to, in bytes.
        size: Their own size, in bytes.

    Raises:
        InputError: It is too much.
    """
    if unpacked > max(LARGEST_EXPANSION, LARGEST_RATIO * size):
        raise InputError(
            f"{path} has {size} bytes that could unpack to {unpacked}, more than {LARGEST_RATIO} "
            "times as much: record it again without compression."
        )


@contextlib.contextmanager
def guarded_databases() -> Iterator[None]:
    """Keeps SQLite files that rosbags opens from computing more than their size warrants."""
    try:
        import apsw  # which rosbags brings
    except ImportError:
        yield
        return

    def guard(connection: apsw.Connection) -> None:
        size = os.stat(connection.filename).st_size
        left = _STEPS + _STEPS_PER_BYTE * size

        def too_long() -> bool:
            nonlocal left
            left -= _STEPS_AT_ONCE
            return left < 0

        connection.set_progress_handler(too_long, _STEPS_AT_ONCE)
        # No value in it can be longer than the file.
        connection.limit(apsw.SQLITE_LIMIT_LENGTH, max(size, 1 << 16))
        _check_schema(connection)

    apsw.connection_hooks.append(guard)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(guard)


def _check_schema(connection: object) -> None:
    """Refuses a database with anything in it that computes.

    Raises:
        ValueError: It is refused.
    """
    execute = connection.execute  # type: ignore[attr-defined]
    objects = execute("SELECT type, name, rootpage FROM sqlite_master").fetchall()
    for kind, name, root in objects:
        # Tables without a page of their own are virtual.
        if kind not in ("table", "index") or not root:
            raise ValueError(f"it holds {kind} {name!r}, which no recorder makes")
        if kind == "table":
            columns = execute("SELECT hidden FROM pragma_table_xinfo(?)", (name,)).fetchall()
            if any(hidden for (hidden,) in columns):
                raise ValueError(f"its table {name!r} has computed columns")
    columns = execute("SELECT name FROM pragma_table_info('topics')").fetchall()
    if ("offered_qos_profiles",) in columns:
        for (profiles,) in execute("SELECT offered_qos_profiles FROM topics"):
            _check_qos(str(profiles).encode())


def _check_qos(text: bytes) -> None:
    if len(text) > LARGEST_QOS or _nests_deeply(text):
        raise ValueError("the QoS of a topic is too long or nested")


def _nests_deeply(text: bytes) -> bool:
    depth = 0
    for bracket in re.findall(rb"[\[\]{}]", text):
        depth += 1 if bracket in b"[{" else -1
        if depth > DEEPEST_YAML:
            return True
    return False


def _check_metadata(file: Path, directory: Path) -> None:
    _check_place(file, directory)
    if file.stat().st_size > LARGEST_METADATA:
        raise InputError(
            f"{file} has more than {LARGEST_METADATA} bytes, the most that are read: "
            f"run `ros2 bag reindex {directory}` to write it anew."
        )
    text = file.read_bytes()
    if _ALIAS.search(text) or _nests_deeply(text):
        raise InputError(
            f"{file} has YAML anchors, aliases or deep nesting, which no recorder writes: "
            f"run `ros2 bag reindex {directory}` to write it anew."
        )


def _check_file(file: Path, directory: Path) -> None:
    _check_place(file, directory)
    with file.open("rb") as opened:
        magic = opened.read(8)
        size = os.fstat(opened.fileno()).st_size
        opened.seek(0)
        if magic == _MCAP:
            unpacked = _mcap_bound(opened, size)
        elif int.from_bytes(magic[:4], "little") == _ZSTD:
            if Path(file.stem).suffix == ".mcap":
                raise InputError(
                    f"{file} is compressed as a whole, and its messages once more: "
                    f"unpack it first with `zstd -d {file}`."
                )
            unpacked = _zstd_bound(opened, size)
        else:
            unpacked = 0
    check_expansion(file, unpacked, size)


def _check_place(file: Path, directory: Path) -> None:
    """Refuses what is no file, or stands elsewhere."""
    if not stat.S_ISREG(file.stat().st_mode):
        raise InputError(f"{file} is not a file: take it out of the bag.")
    if not file.resolve().is_relative_to(directory.resolve()):
        raise InputError(
            f"{file} is a link that leads out of {directory}: put the file itself in its place."
        )
    if file.suffix != ".mcap" and _URL_CHARACTERS & set(str(file)):
        raise InputError(
            f"{file} has one of the characters {' '.join(sorted(_URL_CHARACTERS))} in its path, "
            "which SQLite reads as part of an address: rename it."
        )


def _zstd_bound(file: BinaryIO, end: int) -> int:
    """The most that zstd frames up to a position can unpack to; reads the heads of blocks only."""
    total = 0
    with contextlib.suppress(struct.error, IndexError):
        while file.tell() < end:
            (magic,) = struct.unpack("<I", file.read(4))
            if magic in _ZSTD_SKIPPABLE:
                file.seek(struct.unpack("<I", file.read(4))[0], os.SEEK_CUR)
                continue
            if magic != _ZSTD:
                break
            descriptor = file.read(1)[0]
            single = descriptor >> 5 & 1
            content_size = (single, 2, 4, 8)[descriptor >> 6]
            file.seek(1 - single + (0, 1, 2, 4)[descriptor & 3] + content_size, os.SEEK_CUR)
            last = False
            while not last:
                head = int.from_bytes(struct.unpack("3s", file.read(3))[0], "little")
                last, kind, size = bool(head & 1), head >> 1 & 3, head >> 3
                # Raw, one byte repeated, or compressed.
                total += _ZSTD_BLOCK if kind >= 2 else size
                file.seek(1 if kind == 1 else size, os.SEEK_CUR)
            file.seek(4 * (descriptor >> 2 & 1), os.SEEK_CUR)
    return total


def _lz4_bound(file: BinaryIO) -> int:
    """The most that an lz4 frame can unpack to."""
    total = 0
    with contextlib.suppress(struct.error):
        magic, flags, block = struct.unpack("<IBB", file.read(6))
        if magic != _LZ4:
            return 0
        largest = 1 << (8 + 2 * (block >> 4 & 7))
        file.seek(8 * (flags >> 3 & 1) + 4 * (flags & 1) + 1, os.SEEK_CUR)
        while True:
            (head,) = struct.unpack("<I", file.read(4))
            size = head & 0x7FFFFFFF
            if not size:
                break
            total += size if head >> 31 else min(largest, _LZ4_RATIO * size)
            file.seek(size + 4 * (flags >> 4 & 1), os.SEEK_CUR)
    return total


def _mcap_bound(file: BinaryIO, size: int) -> int:
    """The most that the chunks of an mcap file can unpack to.

    Raises:
        ValueError: Its index names a chunk twice, one that is not there, or not all.
    """
    total = 0
    if size < len(_MCAP) + _MCAP_FOOTER:
        return total
    file.seek(size - _MCAP_FOOTER + 9)
    (summary,) = struct.unpack("<Q", file.read(8))
    end = summary or size - _MCAP_FOOTER
    chunks: dict[int, tuple[bytes, int]] = {}
    with contextlib.suppress(struct.error, OverflowError):
        for kind, start in _records(file, len(_MCAP), end):
            if kind == _CHUNK:
                file.seek(start + 28)
                chunks[start - 9] = compression, length = _packed(file)
                if compression == b"zstd":
                    total += _zstd_bound(file, file.tell() + length)
                else:
                    total += _lz4_bound(file) if compression == b"lz4" else length
            elif kind == _CHANNEL:
                _check_channel(file, start)
    described = False
    with contextlib.suppress(struct.error, OverflowError):
        for kind, start in _records(file, summary or size, size):
            described = described or kind == _SCHEMA
            if kind == _CHUNK_INDEX:
                file.seek(start + 16)
                (place,) = struct.unpack("<Q", file.read(8))
                file.seek(start + 32)
                file.seek(struct.unpack("<I", file.read(4))[0] + 8, os.SEEK_CUR)
                if chunks.pop(place, None) != _packed(file):
                    raise ValueError("its index does not fit its chunks")
            elif kind == _CHANNEL:
                _check_channel(file, start)
    if chunks or (total and not described):
        # rosbags would unpack all chunks to find the channels in them.
        raise ValueError("its index does not name all its chunks")
    return total


def _check_channel(file: BinaryIO, start: int) -> None:
    """Refuses a channel with descriptions that take long to read."""
    file.seek(start + 4)
    for _ in range(2):
        file.seek(struct.unpack("<I", file.read(4))[0], os.SEEK_CUR)
    (length,) = struct.unpack("<I", file.read(4))
    _check_qos(file.read(min(length, LARGEST_QOS + 1)))


def _packed(file: BinaryIO) -> tuple[bytes, int]:
    """Compression of a chunk and its compressed size in bytes."""
    (length,) = struct.unpack("<I", file.read(4))
    compression = file.read(min(length, 16))
    return compression, *struct.unpack("<Q", file.read(8))


def _records(file: BinaryIO, start: int, end: int) -> Iterator[tuple[int, int]]:
    """Kind and place of the content of each record of an mcap file.

    Raises:
        struct.error: The file ends within one.
    """
    while start < end:
        file.seek(start)
        kind, length = struct.unpack("<BQ", file.read(9))
        if kind == _FOOTER:
            return
        yield kind, start + 9
        start += 9 + length
