"""Up to when all states have come, as far as that can be told from the outside.

A publisher's messages come in the order in which it sends them: once a state has come, so have all
that it sent before.  Where the transport dropped one, none of its topic comes until that is sent
again, which the middleware does seconds later.  So a topic that falls silent may have states under
way, and an action that was sent since then cannot know its state yet.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from rebt_ros.ros.arrival import LAST

#: States that follow each other so closely (ns), for so long (ns), are a stream: more will come.
_CLOSE: Final = 500_000_000
_STEADY: Final = 1_000_000_000


@dataclass(slots=True)
class _Stream:
    sent: int | None = None
    """When its last state was sent."""
    since: int = 0
    """When the first one was sent of those that follow each other closely."""
    heard: int = 0
    """When it was heard last, or else when its publisher was; by the clock of arrivals."""
    announced: bool = False


class StateStreams:
    """Watches when the states of each topic were sent.

    Args:
        topics: State topics.
        patience: A topic that is silent for longer (ns) has no states under way.

    >>> streams = StateStreams(["state"], patience=50)
    >>> streams.announce("state", now=0)
    >>> streams.complete(now=50) < 0, streams.complete(now=51) == LAST
    (True, True)
    """

    def __init__(self, topics: Iterable[str], patience: int) -> None:
        self._patience = patience
        self._streams = {topic: _Stream() for topic in topics}

    def announce(self, topic: str, now: int) -> None:
        """Takes note that the topic has a publisher."""
        stream = self._streams[topic]
        if not stream.announced:
            stream.announced, stream.heard = True, now

    def take(self, topic: str, sent: int, now: int) -> None:
        """Takes note of a state; times in nanoseconds, of two clocks."""
        stream = self._streams[topic]
        if stream.sent is None or not 0 <= sent - stream.sent <= _CLOSE:
            stream.since = sent
        stream.sent, stream.heard, stream.announced = sent, now, True

    def awaited(self, now: int) -> list[str]:
        """Topics whose next state is expected."""
        return [
            topic
            for topic, one in self._streams.items()
            if one.announced
            and now - one.heard <= self._patience
            and (one.sent is None or one.sent - one.since >= _STEADY)
        ]

    def complete(self, now: int) -> int:
        """All states that were sent up to then have come, or are not waited for."""
        sent = (self._streams[topic].sent for topic in self.awaited(now))
        return min((-1 if one is None else one for one in sent), default=LAST)
