"""What was done before row t, for trees to test.

previous action
    The action of the row before; none in the first row of a demonstration.
last action taken (LAT)
    The most recent action that differs from row t's (paper, III-B).
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

import numpy as np

from rebt_ros.arrays import IntArray

#: Code of "no action yet" in integer columns of last actions.
NO_ACTION = -1


class History(Enum):
    """Which earlier action a tree may test."""

    NONE = "none"
    PREVIOUS = "previous"
    """The previous action."""
    LAST = "last"
    """LAT, as in the paper."""


class ActionHistory:
    """What has been done on a channel so far.

    >>> history = ActionHistory(["turn", "go", "go"])
    >>> history.previous
    'go'
    >>> history.before("go"), history.before("turn"), history.before("stop")
    ('turn', 'go', 'go')
    """

    def __init__(self, actions: Iterable[str] = ()) -> None:
        self._recent: list[str] = []
        self.previous: str | None = None
        """The previous action; None if none is known."""
        for action in actions:
            self.take(action)

    def take(self, action: str) -> None:
        """Notes that `action` was taken, and that the next decision comes after it."""
        self.previous = action
        self.begin(action)

    def begin(self, action: str) -> None:
        """Notes that `action` has begun: it is in LAT, but not yet the previous action."""
        if self._recent and self._recent[0] == action:
            return
        if action in self._recent:
            self._recent.remove(action)
        self._recent.insert(0, action)

    def before(self, *deciding: str) -> str | None:
        """LAT as seen by a rule for `deciding`: the most recent action that is none of them."""
        return next((action for action in self._recent if action not in deciding), None)

    @property
    def taken(self) -> tuple[str, ...]:
        """The distinct actions, the most recent one last; they make an equal `ActionHistory`."""
        return tuple(reversed(self._recent))

    def clear(self) -> None:
        """Forgets everything, as at the start of a demonstration."""
        self._recent.clear()
        self.previous = None


def previous_actions(actions: IntArray, demonstrations: IntArray) -> IntArray:
    """The previous action of every row of one channel.

    Args:
        actions: Action codes in the order in which they were taken, shape (rows,).
        demonstrations: Number of each row's demonstration, shape (rows,); its rows are contiguous.

    Returns:
        Codes, shape (rows,); `NO_ACTION` in the first row of each demonstration.

    >>> previous_actions(np.array([0, 0, 1, 2]), np.array([0, 0, 0, 1])).tolist()
    [-1, 0, 0, -1]
    """
    previous = np.full(len(actions), NO_ACTION, dtype=np.int64)
    inside = demonstrations[1:] == demonstrations[:-1]
    previous[1:][inside] = actions[:-1][inside]
    return previous


def last_actions(
    actions: IntArray, demonstrations: IntArray, before: IntArray | None = None
) -> IntArray:
    """LAT of every row of one channel.

    Args:
        actions: Action codes in the order in which they were taken, shape (rows,).
        demonstrations: Number of each row's demonstration, shape (rows,); its rows are contiguous.
        before: LAT of the first row of each demonstration, by its number; None for none at all.

    Returns:
        Codes of the last actions taken, shape (rows,); `NO_ACTION` where there is none.

    >>> last_actions(np.array([0, 0, 1, 0, 2]), np.array([0, 0, 0, 0, 1])).tolist()
    [-1, -1, 0, 1, -1]
    >>> last_actions(
    ...     np.array([0, 0, 1, 0, 2]), np.array([0, 0, 0, 0, 1]), np.array([3, -1])
    ... ).tolist()
    [3, 3, 0, 1, -1]
    """
    rows = len(actions)
    if rows == 0:
        return np.empty(0, dtype=np.int64)
    border = np.empty(rows, dtype=bool)
    border[0] = True
    border[1:] = demonstrations[1:] != demonstrations[:-1]
    changed = border.copy()
    changed[1:] |= actions[1:] != actions[:-1]
    # All rows of a run of equal actions look back at the row before the run.
    start = np.maximum.accumulate(np.where(changed, np.arange(rows), 0))
    first = NO_ACTION if before is None else before[demonstrations]
    return np.where(border[start], first, actions[start - 1]).astype(np.int64)
