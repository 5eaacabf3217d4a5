"""Bounds on what a bag from elsewhere can make its reader do.

A few bytes of compressed data may stand for gigabytes, and names may lead to other places.  That is
looked for here before anything is unpacked, at the cost of reading lengths and skipping what they
span.  See `sqlite` for what a database may compute, and `bag_metadata` for bounds on YAML.
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
import struct
from pathlib import Path
from typing import BinaryIO, Final

from rebt_ros.errors import InputError
from rebt_ros.storage.mcap import MAGIC, packed_chunks

#: What compressed data may unpack to: this much in any case, and this many times their own size.
LARGEST_EXPANSION: Final = 64 << 20
LARGEST_RATIO: Final = 200

_ZSTD: Final = 0xFD2FB528
_ZSTD_SKIPPABLE: Final = range(0x184D2A50, 0x184D2A60)
_ZSTD_BLOCK: Final = 128 << 10
_LZ4: Final = 0x184D2204
#: Most that a byte of lz4 stands for.
_LZ4_RATIO: Final = 255


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
            _check_place(one, path)
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


def _check_file(file: Path, directory: Path) -> None:
    _check_place(file, directory)
    with file.open("rb") as opened:
        magic = opened.read(8)
        size = os.fstat(opened.fileno()).st_size
        opened.seek(0)
        if magic == MAGIC:
            unpacked = _mcap_bound(opened)
        elif int.from_bytes(magic[:4], "little") == _ZSTD:
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


def _mcap_bound(file: BinaryIO) -> int:
    """The most that the chunks of an mcap file can unpack to."""
    total = 0
    for compression, place, length in packed_chunks(file):
        file.seek(place)
        if compression == "zstd":
            total += _zstd_bound(file, place + length)
        else:
            total += _lz4_bound(file) if compression == "lz4" else length
    return total
