"""A routine that was found, whatever it was found by."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes


@dataclass(frozen=True, slots=True)
class FoundRoutine:
    """A Sequence or Repeater that the demonstrator seems to have followed."""

    subtree: nodes.Sequence | nodes.Repeater
    support: int
    """How often it was gone through: as often as the rarest of its actions was done in it."""
    rows: int
    """How many rows it explains."""
