"""What a person should know about demonstrations that are learned from together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.demonstration.apart import apart
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.repeated import repeated
from rebt_ros.demonstration.valueless import valueless


def notes_together(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """Notes that no demonstration gives alone: what they repeat, and what none or only some have.

    >>> list(notes_together([]))
    []
    """
    yield from repeated(demonstrations)
    yield from apart(demonstrations)
    yield from valueless(demonstrations)
