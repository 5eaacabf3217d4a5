"""What reading one file gives."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    """The same, with states that leave the memory once there are many.

    Raises:
        InputError: There is no room for them on disk.
    """
    shown = read.demonstration
    states = spool.take(shown.states)
    if states is shown.states:
        return read
    return replace(read, demonstration=replace(shown, states=states))
