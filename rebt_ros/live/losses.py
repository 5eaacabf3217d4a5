"""Counts messages that were sent but never came."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(slots=True)
class _Topic:
    last: int | None = None
    missing: int = 0
    alone: bool = False


class Losses:
    """Finds gaps in the numbers that a publisher gives to its messages.

    Messages do not say which publisher they are from, so that gaps count only while a topic has
    one publisher.

    Args:
        topics: Topics that are watched.

    >>> losses = Losses(["state"])
    >>> losses.settle(lambda topic: 1)
    {'state': 0}
    >>> for number in (7, 8, 11):
    ...     losses.take("state", number)
    >>> losses.settle(lambda topic: 1)
    {'state': 2}
    """

    def __init__(self, topics: Iterable[str]) -> None:
        self._topics = {topic: _Topic() for topic in topics}

    def take(self, topic: str, number: int | None) -> None:
        """Notes a message.

        Args:
            topic: Topic it came on.
            number: Its publisher's number for it; None where the middleware gives none.
        """
        one = self._topics[topic]
        # A lower number is that of another publisher, which may have begun anew.
        if number is not None and one.last is not None and number > one.last:
            one.missing += number - one.last - 1
        one.last = number

    def settle(self, publishers: Callable[[str], int]) -> dict[str, int]:
        """How many messages of each topic were lost since the last call.

        Args:
            publishers: How many publishers a topic has now.
        """
        lost: dict[str, int] = {}
        for topic, one in self._topics.items():
            alone = publishers(topic) == 1
            lost[topic] = one.missing if alone and one.alone else 0
            one.alone, one.missing = alone, 0
        return lost
