"""Recent states, in which an action finds the one that held when it was sent."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Sequence

#: Maximum number of states kept per topic, and of their values in total.
_STATES = 20_000
_VALUES = 500_000

#: A state sent this much before the newest one means that the clock was set back (ns).
_SET_BACK = 60_000_000_000


class RecentStates:
    """States of one topic by when they were sent.

    They are added in about this order; a late state finds its place among the others.

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
        """Adds a state, which replaces one that was sent at the same time.

        Args:
            sent: When it was sent, nanoseconds.
            state: Its values; if their number changes, all earlier states are dropped.
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
        """The last state sent up to this time; None if none is known."""
        place = bisect_right(self._sent, when)
        return tuple(self._states[place - 1]) if place else None

    def _trim(self, width: int) -> None:
        """Forgets the oldest, many at a time."""
        most = max(1, min(_STATES, _VALUES // max(width, 1)))
        if len(self._sent) > most + most // 4:
            del self._sent[:-most], self._states[:-most]
