"""Logs of trees that ran, as BehaviorTree.CPP's FileLogger2 writes them and Groot2 replays them.

``src/loggers/bt_file_logger_v2.cpp`` of BehaviorTree.CPP (4.3 and later) has the format, all of it
little-endian: ``BTCPP4-FileLogger2``, the version (a byte, 1), the length of the tree's XML (32
bits) and the XML, when the log begins (64 bits, microseconds since 1970), and then nine bytes for
each change of a node's status: microseconds since the beginning (48 bits), number of the node (16
bits), status (8 bits).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import StorageError

_MAGIC = b"BTCPP4-FileLogger2"
_VERSION = 1
_LENGTH = struct.Struct("<i")
_BEGAN = struct.Struct("<q")
#: Microseconds, in 32 and 16 bits, number and status.
_TRANSITION = struct.Struct("<IHHB")
#: Largest log that is read (bytes): 22 million changes.
_LARGEST = 200_000_000


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of a node's status."""

    microseconds: int
    """Since the beginning."""
    uid: int
    """Number of the node: ``_uid`` in the XML."""
    status: int
    """0 idle, 1 running, 2 success, 3 failure, 4 skipped."""

    def packed(self) -> bytes:
        """Its nine bytes; microseconds beyond nine years begin at 0 again."""
        high, low = divmod(max(self.microseconds, 0) % 2**48, 2**32)
        return _TRANSITION.pack(low, high, self.uid, self.status)


@dataclass(frozen=True, slots=True)
class BtLog:
    """A log."""

    xml: str
    began: int
    """Microseconds since 1970."""
    transitions: tuple[Transition, ...]
    """In the order of the file."""


class BtLogWriter:
    """Writes a log; what was given to `write` is in the file after `flush`.

    Args:
        path: The file, which is replaced.
        xml: The tree, with a ``_uid`` for each node.
        began: Microseconds since 1970.
        anew: Whether there must be no such file.

    Raises:
        StorageError: The file cannot be written.
    """

    def __init__(self, path: Path, xml: str, began: int, *, anew: bool = False) -> None:
        self.path = path
        text = xml.encode()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb" if anew else "wb")
        except OSError as err:
            raise self._error(err) from err
        self._write(
            _MAGIC + bytes([_VERSION]) + _LENGTH.pack(len(text)) + text + _BEGAN.pack(began)
        )

    def write(self, transitions: Iterable[Transition]) -> None:
        """Adds changes.

        Raises:
            StorageError: They cannot be written.
        """
        self._write(b"".join(one.packed() for one in transitions))

    def flush(self) -> None:
        """Hands all of it to the operating system.

        Raises:
            StorageError: It cannot be written.
        """
        try:
            self._file.flush()
        except OSError as err:
            raise self._error(err) from err

    def close(self) -> None:
        """Ends the file.

        Raises:
            StorageError: What was not flushed cannot be written.
        """
        try:
            self._file.close()
        except OSError as err:
            raise self._error(err) from err

    def __enter__(self) -> BtLogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, content: bytes) -> None:
        try:
            self._file.write(content)
        except OSError as err:
            raise self._error(err) from err

    def _error(self, err: OSError) -> StorageError:
        return StorageError(
            f"{self.path} cannot be written ({err.strerror or err}): "
            "name a place with room where you may write."
        )


def read_btlog(path: Path) -> BtLog:
    """Reads a log, be it of this package or of BehaviorTree.CPP.

    A change at the end that was not written whole, as after a power cut, is left out.

    Args:
        path: The file.

    Raises:
        InputError: It cannot be read, or is no such log.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path} is larger than {_LARGEST // 10**6} MB: log a shorter time.")
        content = path.read_bytes()
    except OSError as err:
        raise InputError(f"{path} cannot be read ({err.strerror or err}).") from err
    place = len(_MAGIC) + 1
    if content[:place] != _MAGIC + bytes([_VERSION]):
        raise InputError(
            f"{path} is no log of BehaviorTree.CPP's FileLogger2 in version {_VERSION}: name a "
            ".btlog that an executor, a replay, or BehaviorTree.CPP 4.3 or later has written."
        )
    try:
        (length,) = _LENGTH.unpack_from(content, place)
        place += _LENGTH.size
        if length < 0:
            raise struct.error
        xml = content[place : place + length].decode()
        (began,) = _BEGAN.unpack_from(content, place + length)
    except (struct.error, UnicodeDecodeError) as err:
        raise InputError(f"{path} ends before its tree does, or the tree is no text.") from err
    place += length + _BEGAN.size
    whole = (len(content) - place) // _TRANSITION.size * _TRANSITION.size
    return BtLog(
        xml,
        began,
        tuple(
            Transition((high << 32) + low, uid, status)
            for low, high, uid, status in _TRANSITION.iter_unpack(content[place : place + whole])
        ),
    )
