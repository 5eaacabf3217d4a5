"""Writing rosbag2 bags of states and actions."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_typestore

from rebt_ros.demonstration.fields import dimension_labels_of
from rebt_ros.storage.atomic import StorageError
from rebt_ros.storage.bag import ACTION_TYPE, STATE_TYPE

#: Not a String, so that readers still find a single topic of actions.
OUTCOME_TYPE = "std_msgs/msg/Bool"

#: Format of the bag's metadata, as Jazzy writes it.
_VERSION: Final = 9


class BagStorage(Enum):
    """How a bag holds its messages."""

    MCAP = "mcap"
    SQLITE3 = "sqlite3"


_PLUGINS = {BagStorage.MCAP: StoragePlugin.MCAP, BagStorage.SQLITE3: StoragePlugin.SQLITE3}


class BagWriter:
    """Writes messages on the topics /state, /action and /outcome; see `new_bag`."""

    def __init__(self, writer: Writer, fields: Sequence[str]) -> None:
        self._writer = writer
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._connections = {
            kind: writer.add_connection(topic, kind, typestore=self._types)
            for topic, kind in (
                ("/state", STATE_TYPE),
                ("/action", ACTION_TYPE),
                ("/outcome", OUTCOME_TYPE),
            )
        }
        self._layout = self._make(
            "std_msgs/msg/MultiArrayLayout", dim=self._dimensions(fields), data_offset=0
        )

    def state(self, stamp: int, values: Sequence[float]) -> None:
        """Adds a state; the stamp is in nanoseconds, as below, and never goes back."""
        self._write(stamp, STATE_TYPE, layout=self._layout, data=np.array(values, dtype=np.float64))

    def action(self, stamp: int, label: str) -> None:
        """Adds an action."""
        self._write(stamp, ACTION_TYPE, data=label)

    def outcome(self, stamp: int, succeeded: bool) -> None:
        """Adds how an action ended."""
        self._write(stamp, OUTCOME_TYPE, data=succeeded)

    def _dimensions(self, fields: Sequence[str]) -> list[Any]:
        labels = dimension_labels_of(fields)
        # Where one dimension has all labels it has all values.
        size = len(fields) if len(labels) == 1 else 1
        return [
            self._make("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=size)
            for label in labels
        ]

    def _make(self, kind: str, **fields: Any) -> Any:
        return self._types.types[kind](**fields)

    def _write(self, stamp: int, kind: str, **fields: Any) -> None:
        data = self._types.serialize_cdr(self._make(kind, **fields), kind)
        self._writer.write(self._connections[kind], stamp, data)


@contextmanager
def new_bag(path: Path, fields: Sequence[str], storage: BagStorage) -> Iterator[BagWriter]:
    """Creates a bag; it is there, whole, once the context ends without an error.

    Args:
        path: Its directory.
        fields: Names of the state's values; the messages' layout says them.
        storage: How to store the messages.

    Raises:
        StorageError: It exists already or cannot be written.
    """
    if path.exists():
        raise StorageError(f"{path} exists already: remove it, or name another directory.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # The files of a bag are named after its directory, so that one has its final name already.
        with tempfile.TemporaryDirectory(prefix=".bag.", dir=path.parent) as temporary:
            unfinished = Path(temporary) / path.name
            with Writer(unfinished, version=_VERSION, storage_plugin=_PLUGINS[storage]) as writer:
                yield BagWriter(writer, fields)
            unfinished.rename(path)
    except (OSError, sqlite3.Error, WriterError) as err:
        reason = (err.strerror if isinstance(err, OSError) else None) or err
        raise StorageError(
            f"{path} cannot be written ({reason}): name a place with room where you may write."
        ) from err
