"""What the executor does about states outside what was shown, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum

from rebt_ros.behavior_tree.novelty import Departure, NoveltyDetector


class Novelty(Enum):
    """What to do in a state outside what was shown."""

    IGNORE = "ignore"
    WARN = "warn"
    HOLD = "hold"


class NoveltyGuard:
    """Decides whether the tree may decide about a state.

    Once it holds the robot it goes on to do so, also where the state is a known one again, until
    it is released: by a person who takes over, by enabling, or by another tree.

    Args:
        mode: What to do in a state outside what was shown.
    """

    def __init__(self, mode: Novelty) -> None:
        self._mode = mode
        self.departure: Departure | None = None
        """How the latest state, or the one it is held for, differs from what was shown."""
        self.holding = False
        """Whether the robot is held."""

    def passes(self, detector: NoveltyDetector, latest: Mapping[str, Sequence[float]]) -> bool:
        """Whether the tree may decide; to be asked once per tick."""
        if self._mode is Novelty.IGNORE:
            return True
        if not self.holding:
            self.departure = detector.departure(latest)
            self.holding = self.departure is not None and self._mode is Novelty.HOLD
        return not self.holding

    def release(self) -> None:
        """Lets the tree decide again, unless the next state is outside as well."""
        self.departure = None
        self.holding = False
