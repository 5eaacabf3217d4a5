"""Messages of several topics in the order in which they were received.

An rclpy executor takes one message of each topic at a time, so that of a burst state, state,
state, action the callbacks see the action second.  Waiting for a moment and sorting by the time
of reception restores the order in which they came in.
"""

from __future__ import annotations

import heapq
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class ArrivalOrder(Generic[T]):
    """Holds every item back for a moment and hands items out in the order of their stamps.

    Time is that of any one clock that never goes back; stamps may be of another clock.

    Args:
        window: How long an item waits for others with earlier stamps, nanoseconds.

    >>> order = ArrivalOrder[str](window=5)
    >>> order.push(20, "second", now=100)
    >>> order.push(10, "first", now=101)
    >>> order.ready(now=104), order.ready(now=105)
    ([], ['first', 'second'])
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._waiting: list[tuple[int, int, T]] = []
        self._pushed: deque[tuple[int, int]] = deque()
        self._count = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def push(self, stamp: int, item: T, now: int) -> None:
        """Adds an item; those with equal stamps keep the order in which they were added."""
        # The running number also keeps the heap from comparing items.
        heapq.heappush(self._waiting, (stamp, self._count, item))
        self._pushed.append((now, stamp))
        self._count += 1

    def ready(self, now: int) -> list[T]:
        """Takes the items that have waited long enough, and whatever comes before one of them."""
        due: list[int] = []
        while self._pushed and self._pushed[0][0] <= now - self._window:
            due.append(self._pushed.popleft()[1])
        taken: list[T] = []
        last = max(due, default=None)
        while last is not None and self._waiting and self._waiting[0][0] <= last:
            taken.append(heapq.heappop(self._waiting)[2])
        return taken

    def flush(self) -> list[T]:
        """Takes all items."""
        self._pushed.clear()
        return [heapq.heappop(self._waiting)[2] for _ in range(len(self._waiting))]
