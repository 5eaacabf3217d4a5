"""Shortest plans, for experts of worlds with few states."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable
from typing import TypeVar

Place = TypeVar("Place", bound=Hashable)


def shortest_plan(
    start: Place,
    ways: Callable[[Place], Iterable[tuple[str, Place]]],
    is_goal: Callable[[Place], bool],
) -> tuple[str, ...] | None:
    """The first of the shortest ways to a goal; breadth-first.

    Args:
        start: Where it begins.
        ways: What can be done at a place, and where that leads to.  Of plans of one length that one
            is taken whose actions come first here.
        is_goal: Whether a place is a goal.

    Returns:
        Actions, none at a goal; None where no goal can be reached.

    >>> shortest_plan(3, lambda one: [("halve", one // 2), ("add", one + 1)], lambda one: one == 8)
    ('add', 'add', 'add', 'add', 'add')
    """
    came_from: dict[Place, tuple[Place, str] | None] = {start: None}
    to_visit = deque([start])
    while to_visit:
        place = to_visit.popleft()
        if is_goal(place):
            return _retraced(place, came_from)
        for action, after in ways(place):
            if after not in came_from:
                came_from[after] = place, action
                to_visit.append(after)
    return None


def _retraced(place: Place, came_from: dict[Place, tuple[Place, str] | None]) -> tuple[str, ...]:
    actions: list[str] = []
    while (step := came_from[place]) is not None:
        place, action = step
        actions.append(action)
    return tuple(reversed(actions))
