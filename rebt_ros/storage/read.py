"""What reading one file gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Final, NamedTuple

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.large_arrays import Spool
from rebt_ros.errors import printable
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.account import Account

#: Stands between the name of a table and that of one of its demonstrations.
PART: Final = "#"


class Part(NamedTuple):
    """One of several demonstrations of a table."""

    name: str
    """What its column says."""
    rows: int
    """It has so many, behind those of the part before."""


@dataclass(frozen=True, slots=True)
class Read:
    """What was read from a file: a demonstration, or a table of several ones."""

    demonstration: Demonstration
    """With all rows."""
    notes: tuple[str, ...] = ()
    """What a person should know about it, such as how many rows were left out; no full stops."""
    account: Account | None = None
    """Where what it holds went."""
    no_features: frozenset[str] = frozenset()
    """Columns that hold no feature, which those of other files that are called so may well do."""
    robot: RobotFile | None = None
    """Where its features and actions are in messages; None where it does not say."""
    parts: tuple[Part, ...] = ()
    """Of a table that says where its demonstrations begin, all of them, in order; else empty."""

    def demonstrations(self) -> tuple[Demonstration, ...]:
        """Each one, in a table of several called `NAME#PART`."""
        whole = self.demonstration
        if not self.parts:
            return (whole,)
        ends = accumulate(part.rows for part in self.parts)
        return tuple(
            whole.part(printable(f"{whole.name}{PART}{part.name}"), slice(end - part.rows, end))
            for part, end in zip(self.parts, ends, strict=True)
        )


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
