"""The last minutes: what was commanded and by whom, and the moments in between to step back to."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

#: How far back it reaches (seconds).
REACH: Final = 600.0

#: Most events and moments: ten of each a second.
MOST: Final = 6000


class EventKind(Enum):
    """What happened."""

    COMMAND = "command"
    """The tree commands something else."""
    PERSON = "person"
    """A person does something else."""
    DRIVING = "driving"
    """The tree takes the robot in hand, or gives it away."""
    TREE = "tree"
    """Another tree is published."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What was so from one time until the next moment."""

    time: float
    """Seconds since the epoch."""
    document: str
    """Fingerprint of the tree that ran."""
    statuses: tuple[str, ...]
    values: Mapping[str, float | str | None]
    commands: Mapping[str, str]


class Timeline:
    """Events by number, and moments by time."""

    def __init__(self) -> None:
        self._number = 0
        self._events: deque[tuple[str, float]] = deque()
        self._moments: deque[Moment] = deque(maxlen=MOST)

    def event(
        self, time: float, kind: EventKind, text: str, channel: str = ""
    ) -> dict[str, dict[str, Any] | None]:
        """Notes an event.

        Returns:
            What changes on the board: the event, and None for those that are too old by now.
        """
        self._number += 1
        key = str(self._number)
        changes: dict[str, dict[str, Any] | None] = {
            key: {"t": round(time, 3), "kind": kind.value, "text": text, "channel": channel}
        }
        self._events.append((key, time))
        while len(self._events) > MOST or self._events[0][1] < time - REACH:
            changes[self._events.popleft()[0]] = None
        return changes

    def note(self, moment: Moment) -> None:
        """Notes a moment; they come in the order of time."""
        self._moments.append(moment)
        while self._moments[0].time < moment.time - REACH:
            self._moments.popleft()

    def at(self, time: float) -> Moment | None:
        """What was so at a time; None where that is too long ago, or nothing was known yet."""
        place = bisect_right(self._moments, time, key=lambda moment: moment.time)
        return self._moments[place - 1] if place else None

    def done_before(self, time: float, channel: str) -> Sequence[str]:
        """What was commanded on a channel before a time, oldest first, each change once."""
        done: list[str] = []
        for moment in self._moments:
            if moment.time >= time:
                break
            command = moment.commands.get(channel)
            if command is not None and (not done or done[-1] != command):
                done.append(command)
        return done
