"""A directory that keeps what was read of inputs, by what they hold and what decides about rows."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.atomic import replace_with
from rebt_ros.storage.column_file import NoColumnFileError, packed, read_columns
from rebt_ros.storage.input_options import InputKind, Source
from rebt_ros.storage.read import Read
from rebt_ros.storage.versions import source_digest, versions

SUFFIX: Final = ".columns"

#: Packages whose versions decide what is read.
_DECIDING: Final = ("numpy", "rosbags")
#: Where SQLite keeps what it has not yet written to a database, behind the name of the latter.
_LOGS: Final = ("-wal", "-journal")
_BLOCK: Final = 1 << 20
#: Where the cache has the keys of inputs by the states of their files, each as a link that leads
#: nowhere: a link of that length takes no room beside its name.
_STATES: Final = "states"
_KEY: Final = re.compile("[0-9a-f]{64}")
#: Age of a change from which on another one has another time (nanoseconds): FAT's take 2 s.
_SETTLED: Final = 3_000_000_000


def default_cache() -> Path | None:
    """Where what was read is kept by default: in the user's cache, as XDG has it; None without one.

    https://specifications.freedesktop.org/basedir-spec
    """
    there = Path(os.environ.get("XDG_CACHE_HOME", ""))
    base = there if there.is_absolute() else Path(os.path.expanduser("~/.cache"))
    return base / "rebt_ros" if base.is_absolute() else None


def is_kept(source: Source) -> bool:
    """Whether what is read of an input is worth keeping: recordings are columns already."""
    return source.kind is not InputKind.RECORDING and (
        source.path.is_dir() or source.path.is_file()
    )


def key_of(source: Source, deciding: tuple[object, ...]) -> str:
    """What tells apart inputs of which something else is read.

    Args:
        source: An input, of which the content and the name count.
        deciding: Options that decide about rows, in plain values.

    Returns:
        A digest of these and of the versions of what reads.

    Raises:
        OSError: The input cannot be read.
    """
    digest = hashlib.sha256()
    digest.update(repr(_said(source, deciding)).encode("utf-8", "surrogatepass"))
    for file in _files(source.path):
        called = os.fsencode(file.name)
        if not file.is_file():
            digest.update(b"\0other\0" + called)
            continue
        with file.open("rb", buffering=0) as opened:
            size = os.fstat(opened.fileno()).st_size
            digest.update(b"\0file\0%b\0%d\0" % (called, size))
            while block := opened.read(_BLOCK):
                digest.update(block)
    return digest.hexdigest()


class FileState(NamedTuple):
    """What changes where somebody writes to a file, or puts another one in its place."""

    name: str
    size: int
    """Bytes."""
    written: int
    """When its content changed, as far as its owner says (nanoseconds)."""
    changed: int
    """When it or what is said of it changed, which nobody can set (nanoseconds)."""
    number: int
    """Of its inode, and of the device that has it."""
    device: int
    is_plain: bool
    """Whether it is a file itself, no link to one."""


def state_of(source: Source) -> tuple[FileState, ...]:
    """The state of each of an input's files.

    Raises:
        OSError: It cannot be looked at.
    """
    try:
        with os.scandir(source.path) as entries:
            # As `_files` has them.
            inside = sorted(entries, key=lambda one: one.name)
            return tuple(_state(one.name, one.stat(follow_symlinks=False)) for one in inside)
    except NotADirectoryError:
        return tuple(_state(file.name, file.lstat()) for file in _files(source.path))


def _state(name: str, status: os.stat_result) -> FileState:
    return FileState(
        name,
        status.st_size,
        status.st_mtime_ns,
        status.st_ctime_ns,
        status.st_ino,
        status.st_dev,
        stat.S_ISREG(status.st_mode),
    )


def size_of(source: Source) -> int:
    """Bytes that an input has; 0 where that is not known."""
    try:
        return sum(one.size for one in state_of(source))
    except OSError:
        return 0


class ReadCache:
    """What was read earlier.

    Args:
        directory: Where it is kept; created when something is.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def get(self, key: str, source: Source, robot: RobotFile | None) -> Read | None:
        """What was read of an input, by this robot file; None where that is not kept."""
        try:
            read, words, has_robot = read_columns(self._path(key))
        except (OSError, NoColumnFileError):
            return None
        if words.get("path") not in (None, str(source.path)):
            return None
        return replace(read, robot=robot) if has_robot else read

    def put(self, key: str, content: Iterable[bytes]) -> None:
        """Keeps the bytes that `kept_bytes` gives; another process sees all of them or nothing.

        Raises:
            OSError: They cannot be written.
        """
        path = self._path(key)
        path.parent.mkdir(parents=True, exist_ok=True)

        # The checksum tells what a loss of power leaves, so that nothing waits for the disk.
        def write(temporary: Path) -> None:
            with temporary.open("wb") as file:
                file.writelines(content)

        replace_with(path, write)

    def key_of(self, source: Source, deciding: tuple[object, ...]) -> str:
        """The key of an input, as `key_of` gives it, without reading one that is as it was.

        Like git's index, the cache remembers the states of files whose content it has read: where
        they are the same, down to the time of the last change, so is the content.  What was changed
        a moment ago may be changed again at what the clock of files takes for the same time, so it
        is not remembered yet.

        Raises:
            OSError: The input cannot be read.
        """
        state = state_of(source)
        if not state or not all(one.is_plain for one in state):
            return key_of(source, deciding)
        said = (str(source.path.absolute()), state, *_said(source, deciding))
        digest = hashlib.sha256(repr(said).encode("utf-8", "surrogatepass")).hexdigest()
        link = self.directory / _STATES / digest[:2] / digest[2:]
        with contextlib.suppress(OSError):
            known = os.readlink(link)
            if _KEY.fullmatch(known):
                return known
        key = key_of(source, deciding)
        latest = max(max(one.written, one.changed) for one in state)
        if time.time_ns() - latest > _SETTLED and state_of(source) == state:
            with contextlib.suppress(OSError):
                link.parent.mkdir(parents=True, exist_ok=True)
                replace_with(link, lambda temporary: temporary.symlink_to(key))
        return key

    def _path(self, key: str) -> Path:
        return self.directory / key[:2] / f"{key[2:]}{SUFFIX}"


def kept_bytes(source: Source, read: Read) -> Iterator[bytes]:
    """What is kept of an input, part by part.

    Where notes name its path, that is kept as well, and must be the same then.
    """
    path = str(source.path)
    return packed(read, {"path": path} if any(path in note for note in read.notes) else None)


def _said(source: Source, deciding: tuple[object, ...]) -> tuple[str, ...]:
    """What decides about what is read, beside the content."""
    name = source.path.absolute().name
    return (source.kind.value, name, *_versions(), json.dumps(deciding, default=repr))


@cache
def _versions() -> tuple[str, ...]:
    return (source_digest(), *(f"{name} {one}" for name, one in versions(_DECIDING).items()))


def _files(path: Path) -> Iterator[Path]:
    """The files that an input is read from, as far as they are there."""
    if path.is_dir():
        yield from sorted(path.iterdir())
        return
    yield path
    for log in _LOGS:
        beside = path.resolve()
        beside = beside.with_name(beside.name + log)
        if beside.is_file():
            yield beside
