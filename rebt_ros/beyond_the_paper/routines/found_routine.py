"""A found routine, independent of the search."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes


@dataclass(frozen=True, slots=True)
class FoundRoutine:
    """A Sequence or Repeater that the demonstrator seems to have followed."""

    subtree: nodes.Sequence | nodes.Repeater
    support: int
    """How often it was done: as often as its rarest action was done in it."""
    rows: int
    """Number of rows that it explains."""
