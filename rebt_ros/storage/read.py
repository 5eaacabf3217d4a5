"""What reading one file gives."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.demonstration.demonstration import Demonstration


@dataclass(frozen=True, slots=True)
class Read:
    """A demonstration as it was read from a file."""

    demonstration: Demonstration
    notes: tuple[str, ...] = ()
    """What a person should know about it, such as how many rows were left out; no full stops."""
