"""Up to when all states have come, as far as that can be told from the outside.

A publisher's messages come in the order in which it sends them: once a state has come, so have all
that it sent before.  Where the transport dropped one, none of its topic comes until that is sent
again, which the middleware does seconds later.  So a topic that falls silent may have states under
way, and an action that was sent since then cannot know its state yet.  The same holds for a topic
that was never heard: it may take as long until publisher and recorder know each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from rebt_ros.live.arrival import LAST

#: States that follow each other more slowly (ns), again and again, come now and then.
_CLOSE: Final = 500_000_000


@dataclass(slots=True)
class _Stream:
    sent: int | None = None
    """When its last state was sent; None before the first one."""
    heard: int = 0
    """When that came, by the clock of arrivals."""
    pauses: int = 0
    """How many long ones came one after the other, up to its last state."""
    ended: bool = False
    """Whether nobody publishes it any more."""


class StateStreams:
    """Watches when the states of each topic were sent.

    Args:
        topics: State topics.
        patience: A topic that is silent for longer (ns) has no states under way.

    >>> streams = StateStreams(["state"], patience=50)
    >>> streams.complete(now=0)
    -1
    >>> streams.take("state", sent=3, now=5)
    >>> streams.complete(now=55), streams.complete(now=56) == LAST
    (3, True)
    """

    def __init__(self, topics: Iterable[str], patience: int) -> None:
        self._patience = patience
        self._streams = {topic: _Stream() for topic in topics}

    def take(self, topic: str, sent: int, now: int) -> None:
        """Takes note of a state; times in nanoseconds, of two clocks."""
        stream = self._streams[topic]
        pause = stream.sent is not None and not 0 <= sent - stream.sent <= _CLOSE
        stream.pauses = stream.pauses + 1 if pause else 0
        stream.sent, stream.heard, stream.ended = sent, now, False

    def end(self, topic: str) -> None:
        """Takes note that the topic has no publisher."""
        self._streams[topic].ended = True

    def complete(self, now: int) -> int:
        """All states that were sent up to then have come, or are not waited for."""
        complete = LAST
        for value in self._streams.values():
            if value.sent is None:
                return -1
            if not value.ended and value.pauses < 2 and now - value.heard <= self._patience:
                complete = min(complete, value.sent)
        return complete
