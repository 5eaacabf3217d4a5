"""Benchmarks of reading: bags and recordings into tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import recorder
from examples import demonstration
from harness import Figure, Settings, alternate, compared, timed
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.demonstration.fields import dimension_labels_of
from rebt_ros.demonstration.table import tabulate
from rebt_ros.storage.bag import ACTION_TYPE, STATE_TYPE, read_bag

_WIDTH = 24
#: Messages on the state topic for each on the action topic: 1 kHz and 50 Hz.
_STATES_PER_ACTION = 20

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def bag(settings: Settings) -> list[Figure]:
    """A bag of a million messages into a table."""
    messages = settings.size(1_000_000, 2100)
    figures = []
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        path = settings.directory / plugin.name.lower()
        _write_bag(path, messages, plugin)
        spreads = alternate(
            {
                "ours": timed(lambda path=path: tabulate([read_bag(path).demonstration])),
                "limit": timed(lambda path=path: _bare_loop(path)),
            },
            settings.rounds,
        )
        name = f"bag -> table, {plugin.name.lower()}, {messages:,} messages / bare rosbags loop"
        figures.append(compared(name, spreads, 1.3))
    return figures


def _bare_loop(path: Path) -> int:
    """Deserialises every message and drops it."""
    count = 0
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            _TYPES.deserialize_cdr(data, connection.msgtype)
            count += 1
    return count


def _write_bag(path: Path, messages: int, plugin: StoragePlugin) -> None:
    rows = demonstration(messages, _WIDTH)
    kinds = _TYPES.types
    empty = np.zeros(_WIDTH)
    dimensions = [
        kinds["std_msgs/msg/MultiArrayDimension"](label=label, size=_WIDTH, stride=_WIDTH)
        for label in dimension_labels_of([feature.name for feature in rows.features])
    ]
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=dimensions, data_offset=0)
    state = bytes(_TYPES.serialize_cdr(kinds[STATE_TYPE](layout=layout, data=empty), STATE_TYPE))
    head = state[: -empty.nbytes]
    actions = [
        bytes(_TYPES.serialize_cdr(kinds[ACTION_TYPE](data=label), ACTION_TYPE))
        for label in rows.actions
    ]
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        to_state = writer.add_connection("/state", STATE_TYPE, typestore=_TYPES)
        to_action = writer.add_connection("/action", ACTION_TYPE, typestore=_TYPES)
        for number in range(messages):
            if number % (_STATES_PER_ACTION + 1) == _STATES_PER_ACTION:
                writer.write(to_action, number * 10**6, actions[rows.chosen[number]])
            else:
                writer.write(to_state, number * 10**6, head + rows.states[number].tobytes())


def recording(settings: Settings) -> list[Figure]:
    """A recording into its demonstration; rows of recorder.py."""
    rows = settings.size(1_000_000, 20_000)
    return recorder.read(rows, settings.rounds, settings.directory)
