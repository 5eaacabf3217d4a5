"""What reading one file gives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.large_arrays import Spool
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.account import Account


@dataclass(frozen=True, slots=True)
class Read:
    """A demonstration as it was read from a file."""

    demonstration: Demonstration
    notes: tuple[str, ...] = ()
    """What a person should know about it, such as how many rows were left out; no full stops."""
    account: Account | None = None
    """Where what it holds went."""
    no_features: frozenset[str] = frozenset()
    """Columns that hold no feature, which those of other files that are called so may well do."""
    robot: RobotFile | None = None
    """Where its features and actions are in messages; None where it does not say."""


def on_spool(read: Read, spool: Spool) -> Read:
    """The same, with columns that leave the memory once there are many.

    Raises:
        InputError: There is no room for them on disk.
    """
    shown = read.demonstration
    states = spool.take(shown.states)
    # What is a view of a file's bytes would keep all of them in memory.
    stamps, chosen, channel = (
        _taken(column, spool) for column in (shown.stamps, shown.chosen, shown.channel)
    )
    columns = replace(shown, states=states, stamps=stamps, chosen=chosen, channel=channel)
    return replace(read, demonstration=columns)


def _taken(column: IntArray, spool: Spool) -> IntArray:
    return spool.take(np.ascontiguousarray(column, dtype=np.int64).view(np.float64)).view(np.int64)
