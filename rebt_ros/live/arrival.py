"""Messages of several topics in one order, be it that of their sending or of their reception.

An rclpy executor takes one message of each topic at a time, so that of a burst state, state,
state, action the callbacks see the action second.  Waiting for a moment and sorting by a stamp
restores the order.  What the transport has dropped comes seconds later, once it was sent again:
an item that needs all that was sent before it may wait for that, too.
"""

from __future__ import annotations

import heapq
from collections import deque
from typing import Final, Generic, NamedTuple, TypeVar

T = TypeVar("T")

#: A stamp after all others.
LAST: Final = 2**63 - 1


class _Waiting(NamedTuple, Generic[T]):
    stamp: int
    number: int
    """Running; it also keeps the heap from comparing what follows."""
    item: T
    until: int
    """When it waits no longer for what was sent before it; 0 if it never does."""


class ArrivalOrder(Generic[T]):
    """Holds every item back for a moment and hands items out in the order of their stamps.

    Time is that of any one clock that never goes back; stamps may be of another clock.

    Args:
        window: How long an item waits for others with earlier stamps, nanoseconds.
        patience: How long one that needs all of them waits at most, nanoseconds.

    >>> order = ArrivalOrder[str](window=5, patience=50)
    >>> order.push(20, "second", now=100)
    >>> order.push(10, "first", now=101)
    >>> order.ready(now=104), order.ready(now=105)
    ([], ['first', 'second'])
    >>> order.push(30, "action", now=106, waits=True)
    >>> order.ready(now=120, complete=20), order.ready(now=121, complete=30)
    ([], ['action'])
    """

    def __init__(self, window: int, patience: int = 0) -> None:
        self._window = window
        self._patience = patience
        self._waiting: list[_Waiting[T]] = []
        self._pushed: deque[tuple[int, int]] = deque()
        self._due = -1
        self._count = 0

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def held(self) -> int:
        """How many items wait for what was sent before them, or may have to."""
        return sum(one.until > 0 for one in self._waiting)

    def push(self, stamp: int, item: T, now: int, *, waits: bool = False) -> None:
        """Adds an item; those with equal stamps keep the order in which they were added.

        Args:
            stamp: Its place, nanoseconds.
            item: The item.
            now: The time.
            waits: Whether it, and so all that follow it, waits for what has earlier stamps.
        """
        until = now + self._patience if waits else 0
        heapq.heappush(self._waiting, _Waiting(stamp, self._count, item, until))
        self._pushed.append((now, stamp))
        self._count += 1

    def ready(self, now: int, complete: int = LAST) -> list[T]:
        """Takes the items that have waited long enough, and whatever comes before one of them.

        Args:
            now: The time.
            complete: All that has stamps up to this one has been added.
        """
        while self._pushed and self._pushed[0][0] <= now - self._window:
            self._due = max(self._due, self._pushed.popleft()[1])
        taken = self._taken(self._due, complete, now)
        if not self._waiting:
            # Stamps begin anew where a clock is set back.
            self._due = -1
        return taken

    def flush(self, complete: int = LAST) -> list[T]:
        """Takes all items but those that still need others before them."""
        self._pushed.clear()
        return self._taken(LAST, complete, 0)

    def _taken(self, last: int, complete: int, now: int) -> list[T]:
        taken: list[T] = []
        waiting = self._waiting
        while waiting and waiting[0].stamp <= last:
            if waiting[0].stamp > complete and waiting[0].until > now:
                break
            taken.append(heapq.heappop(waiting).item)
        return taken
