"""What a recorder hears: how much, how lately, and what was lost on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from rebt_ros.live.losses import Losses

#: A topic without a state for longer than this is silent (seconds).
_SILENT: Final = 2.0


class Traffic:
    """Counts the messages of all topics, and times those that carry state.

    Args:
        states: Topics that carry state.
        sources: All topics.
        now: The time, seconds of the clock that all other times here are of.
    """

    def __init__(self, states: Iterable[str], sources: Iterable[str], now: float) -> None:
        self.messages = 0
        """How many came."""
        self.lost = 0
        """How many were sent and never came."""
        self._losses = Losses(sources)
        self._counts = dict.fromkeys(states, 0)
        self._heard: dict[str, float] = {}
        self._since = now

    def message(self, topic: str, number: int | None) -> None:
        """Notes a message of any topic.

        Args:
            topic: That it came on.
            number: Its publisher's number for it; None where the middleware gives none.
        """
        self.messages += 1
        self._losses.take(topic, number)

    def state(self, topic: str, now: float) -> None:
        """Notes that a message carried state."""
        self._counts[topic] += 1
        self._heard[topic] = now

    def heard(self, topic: str) -> bool:
        """Whether a topic has ever carried state."""
        return topic in self._heard

    def silent(self, now: float) -> list[str]:
        """The topics that carry state and have not done so lately."""
        return [
            topic
            for topic in self._counts
            if topic not in self._heard or now - self._heard[topic] > _SILENT
        ]

    def rates(self, now: float) -> dict[str, float | None]:
        """States per second of each topic since the last call; None where no time has passed."""
        elapsed, self._since = now - self._since, now
        rates = {
            topic: count / elapsed if elapsed else None for topic, count in self._counts.items()
        }
        self._counts = dict.fromkeys(self._counts, 0)
        return rates

    def newly_lost(self, publishers: Callable[[str], int]) -> dict[str, int]:
        """How many messages of each topic were lost since the last call.

        Args:
            publishers: How many publishers a topic has now.
        """
        lost = self._losses.settle(publishers)
        self.lost += sum(lost.values())
        return lost
