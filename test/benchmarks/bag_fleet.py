"""Many bags of a simple policy, written faster than a recorder would write them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.demonstration.fields import dimension_labels_of
from rebt_ros.storage.bag import ACTION_TYPE, STATE_TYPE

TYPES: Final = get_typestore(Stores.ROS2_JAZZY)
#: Rows of a bag, values of a state, and one bag of so many is broken.
ROWS, WIDTH, BROKEN = 1000, 8, 50
#: All of one length, so that all bags are laid out alike.
_LABELS: Final = ("move", "turn", "wait", "lift")
#: What a broken bag holds.
_NOTHING: Final = b"\0" * 1000


class BagFleet:
    """Writes bags that differ in their states and actions only.

    rosbags writes the first one.  All others are its bytes with other states and actions in their
    places, since writing 10,000 of them takes longer than what is to be measured.

    Args:
        directory: Where the first one is written to.
    """

    def __init__(self, directory: Path) -> None:
        values, chosen = _shown(0)
        self._labels = _write(directory / "template", values, chosen)
        (file,) = (directory / "template").glob("*.mcap")
        self._metadata = (directory / "template" / "metadata.yaml").read_bytes()
        self._bytes = file.read_bytes()
        self._name = file.name
        places = [self._bytes.index(row.tobytes()) for row in values]
        actions = [
            self._bytes.index(self._labels[chosen[row]], place) for row, place in enumerate(places)
        ]
        self._states = np.array(places)[:, None] + np.arange(8 * WIDTH)
        self._actions = np.array(actions)[:, None] + np.arange(len(self._labels[0]))

    def write(self, path: Path, seed: int) -> None:
        """A bag of 1,000 states, each followed by what is done in it; some are no bags.

        Args:
            path: Its directory, which is made.
            seed: Its states and actions, and whether it is broken, follow from this.
        """
        values, chosen = _shown(seed)
        content = np.frombuffer(self._bytes, dtype=np.uint8).copy()
        content[self._states] = values.view(np.uint8)
        content[self._actions] = np.array([list(label) for label in self._labels], np.uint8)[chosen]
        path.mkdir()
        (path / "metadata.yaml").write_bytes(self._metadata)
        is_broken = seed % BROKEN == BROKEN // 2
        (path / self._name).write_bytes(_NOTHING if is_broken else content.tobytes())


def _shown(seed: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """States, shape (ROWS, WIDTH), and what is done in each."""
    values = np.random.default_rng(seed).random((ROWS, WIDTH))
    return values, 2 * (values[:, 0] > 0.5) + (values[:, 1] > 0.3)


def _write(path: Path, values: NDArray[np.float64], chosen: NDArray[np.int64]) -> tuple[bytes, ...]:
    """Writes a bag as rosbags does; returns the messages of the actions."""
    kinds = TYPES.types
    dimensions = [
        kinds["std_msgs/msg/MultiArrayDimension"](label=label, size=WIDTH, stride=WIDTH)
        for label in dimension_labels_of([f"x{number}" for number in range(WIDTH)])
    ]
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=dimensions, data_offset=0)
    empty = kinds[STATE_TYPE](layout=layout, data=np.zeros(WIDTH))
    head = bytes(TYPES.serialize_cdr(empty, STATE_TYPE))[: -8 * WIDTH]
    actions = tuple(
        bytes(TYPES.serialize_cdr(kinds[ACTION_TYPE](data=label), ACTION_TYPE)) for label in _LABELS
    )
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        to_state = writer.add_connection("/state", STATE_TYPE, typestore=TYPES)
        to_action = writer.add_connection("/action", ACTION_TYPE, typestore=TYPES)
        for row in range(len(values)):
            writer.write(to_state, row * 10**7, head + values[row].tobytes())
            writer.write(to_action, row * 10**7 + 1, actions[chosen[row]])
    return actions
