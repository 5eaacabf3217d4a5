"""Messages by the time at which they were recorded, also where the clock was set back meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from typing import Any, Final, TypeVar

#: Messages of one topic overtake each other by less (nanoseconds).
_FALLEN: Final = 1_000_000_000

#: A topic, a stamp in nanoseconds, and more.
Stamped = TypeVar("Stamped", bound=tuple[Any, ...])

#: What is told where `set_back` finds something.
SET_BACK: Final = (
    "the clock was set back while it was recorded, as where a simulation began anew: messages are "
    "taken in the order in which they stand"
)


def by_time(
    messages: Iterable[Stamped], gap: Callable[[int], Stamped], told: Callable[[], object]
) -> list[Stamped]:
    """Messages by their stamps; those of one instant as they stand.

    Where the clock was set back all of them stay as they stand, since their stamps would mix those
    of before and of afterwards.

    Args:
        messages: In the order in which they stand.
        gap: Makes what stands for missing messages: it comes before what followed the setting back.
        told: Called if the clock was set back.
    """
    there = list(messages)
    found = sorted(there, key=itemgetter(1))
    places = [] if found == there else set_back(there)
    if not places:
        return found
    told()
    for place in reversed(places):
        there.insert(place, gap(there[place][1]))
    return there


def set_back(messages: Sequence[tuple[Any, ...]]) -> list[int]:
    """The places of the messages before which the clock was set back.

    That is where the stamps of a topic fall, and do not rise again with its next message, as those
    of a single late one do.  Topics that stand one behind the other in a file tell nothing.

    Args:
        messages: Topic and stamp (nanoseconds) of each, in the order in which they stand.

    >>> second = 1_000_000_000
    >>> set_back([("a", 50 * second), ("a", 51 * second), ("a", 2 * second), ("a", 3 * second)])
    [2]
    >>> set_back([("a", 50 * second), ("a", 2 * second), ("a", 51 * second)])
    []
    """
    places: list[int] = []
    latest: dict[Any, int] = {}
    suspected: dict[Any, int] = {}
    for place, (topic, stamp, *_) in enumerate(messages):
        if stamp >= latest.get(topic, stamp) - _FALLEN:
            latest[topic] = max(stamp, latest.get(topic, stamp))
            suspected.pop(topic, None)
        elif topic not in suspected:
            suspected[topic] = place
        else:
            places.append(min(suspected.values()))
            latest, suspected = {topic: stamp}, {}
    return places
