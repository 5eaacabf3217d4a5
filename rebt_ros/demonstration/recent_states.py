"""The states of the last while, so that an action finds the one that held when it was sent."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Sequence

#: So many states are kept of a topic, or fewer that have so many values together.
_STATES = 20_000
_VALUES = 500_000

#: A state that was sent so long before the newest one tells of a clock that was set back (ns).
_SET_BACK = 60_000_000_000


class RecentStates:
    """States of one topic by when they were sent.

    They are added in about that order: a state that comes late finds its place among the others.

    >>> states = RecentStates()
    >>> for sent, state in ((10, [1.0]), (30, [3.0]), (20, [2.0])):
    ...     states.add(sent, state)
    >>> states.at(25), states.at(30), states.at(9)
    ((2.0,), (3.0,), None)
    """

    def __init__(self) -> None:
        self._sent: list[int] = []
        self._states: list[array[float]] = []

    def add(self, sent: int, state: Sequence[float]) -> None:
        """Takes a state; one that was sent at the same time is replaced.

        Args:
            sent: When it was sent, nanoseconds.
            state: Its values; where there are more or fewer than before, what was before is gone.
        """
        if self._sent and (
            len(state) != len(self._states[-1]) or sent < self._sent[-1] - _SET_BACK
        ):
            self._sent.clear()
            self._states.clear()
        values = array("d", state)
        place = bisect_right(self._sent, sent)
        if place and self._sent[place - 1] == sent:
            self._states[place - 1] = values
            return
        self._sent.insert(place, sent)
        self._states.insert(place, values)
        self._trim(len(values))

    def at(self, when: int) -> tuple[float, ...] | None:
        """The state that was sent last at a time; None where none is known from before it."""
        place = bisect_right(self._sent, when)
        return tuple(self._states[place - 1]) if place else None

    def _trim(self, width: int) -> None:
        """Forgets the oldest, many at a time."""
        most = max(1, min(_STATES, _VALUES // max(width, 1)))
        if len(self._sent) > most + most // 4:
            del self._sent[:-most], self._states[:-most]
