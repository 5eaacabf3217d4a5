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
from rebt_ros.storage.packing import LZ4_MAGIC, ZSTD_MAGIC, without_packing

#: What a message or chunk may unpack to in any case (bytes): the largest real ones are a
#: chunk of 4 MB, as rosbag2 makes them, and a point cloud of 1,000,000 points (32 MB).
LARGEST_EXPANSION: Final = 64 << 20
#: The same of a whole file (bytes): a costmap of 1000 x 1000 cells that hardly changes, at 2 Hz for
#: a minute, is 120 MB that pack to next to nothing.
LARGEST_FILE: Final = 256 << 20
#: How many times their own size data may unpack to where that is more: chunks of 700 topics on
#: which messages hardly change unpack to 78 times their size.
LARGEST_RATIO: Final = 200

_ZSTD: Final = int.from_bytes(ZSTD_MAGIC, "little")
_SKIPPABLE: Final = range(0x184D2A50, 0x184D2A60)
_ZSTD_BLOCK: Final = 128 << 10
_LZ4: Final = int.from_bytes(LZ4_MAGIC, "little")
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
        # A link that is named leads where its user wants.
        _check_file(path.resolve(), path.resolve().parent)
        return
    inside = sorted(path.iterdir())
    names = {one.name for one in inside}
    for one in inside:
        if one.name == metadata:
            _check_place(one, path)
        elif not one.is_dir() and without_packing(one.name) not in names - {one.name}:
            # What is there unpacked as well is not read.
            _check_file(one, path)


def expansion(data: bytes) -> int:
    """The most that a piece of zstd data can unpack to, in bytes."""
    return _zstd_bound(io.BytesIO(data), len(data))


def check_expansion(
    what: str,
    unpacked: int,
    size: int,
    least: int = LARGEST_EXPANSION,
    advice: str = "record it again without compression",
) -> None:
    """Refuses data that unpack to too much.

    Args:
        what: Its name, as a sentence begins.
        unpacked: The most that they can unpack to, in bytes.
        size: Their own size, in bytes.
        least: What they may unpack to in any case, in bytes.
        advice: What helps.

    Raises:
        InputError: It is too much.
    """
    most = max(least, LARGEST_RATIO * size)
    if unpacked > most:
        raise InputError(
            f"{what} has {size} bytes that could unpack to {unpacked}, and at most {most} are "
            f"read: {advice}."
        )


def _check_file(file: Path, directory: Path) -> None:
    _check_place(file, directory)
    advice = "record it again without compression"
    with file.open("rb") as opened:
        magic = opened.read(8)
        size = os.fstat(opened.fileno()).st_size
        opened.seek(0)
        if magic == MAGIC:
            unpacked = _mcap_bound(file, opened)
        elif magic.startswith(ZSTD_MAGIC):
            advice = "if you trust it, unpack it with `zstd -d`"
            unpacked = _zstd_bound(opened, size)
        elif magic.startswith(LZ4_MAGIC):
            advice = "if you trust it, unpack it with `lz4 -d`"
            unpacked = _lz4_bound(opened, size)
        else:
            unpacked = 0
    check_expansion(str(file), unpacked, size, LARGEST_FILE, advice)


def _check_place(file: Path, directory: Path) -> None:
    """Refuses what is no file, or stands elsewhere."""
    if file.is_symlink() and not file.exists():
        raise InputError(f"{file} is a link that leads nowhere: put the file itself in its place.")
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
            if magic in _SKIPPABLE:
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


def _lz4_bound(file: BinaryIO, end: int) -> int:
    """The most that lz4 frames up to a position can unpack to; reads the heads of blocks only."""
    total = 0
    with contextlib.suppress(struct.error):
        while file.tell() < end:
            (magic,) = struct.unpack("<I", file.read(4))
            if magic in _SKIPPABLE:
                file.seek(struct.unpack("<I", file.read(4))[0], os.SEEK_CUR)
                continue
            if magic != _LZ4:
                break
            flags, block = struct.unpack("<BB", file.read(2))
            largest = 1 << (8 + 2 * (block >> 4 & 7))
            file.seek(8 * (flags >> 3 & 1) + 4 * (flags & 1) + 1, os.SEEK_CUR)
            while head := struct.unpack("<I", file.read(4))[0]:
                size = head & 0x7FFFFFFF
                total += size if head >> 31 else min(largest, _LZ4_RATIO * size)
                file.seek(size + 4 * (flags >> 4 & 1), os.SEEK_CUR)
            file.seek(4 * (flags >> 2 & 1), os.SEEK_CUR)
    return total


def _mcap_bound(path: Path, file: BinaryIO) -> int:
    """The most that the chunks of an mcap file can unpack to.

    Raises:
        InputError: One of them alone unpacks to too much.
    """
    total = 0
    for compression, place, length in packed_chunks(file):
        file.seek(place)
        if compression == "zstd":
            unpacked = _zstd_bound(file, place + length)
        else:
            unpacked = _lz4_bound(file, place + length) if compression == "lz4" else length
        check_expansion(str(path), unpacked, length)
        total += unpacked
    return total
