"""What a person should know about several demonstrations to learn from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.demonstration.alike import alike
from rebt_ros.demonstration.apart import apart
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.repeated import repeated
from rebt_ros.demonstration.valueless import valueless


def notes_together(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """Notes on what demonstrations repeat, lack, or may call by several names.

    >>> list(notes_together([]))
    []
    """
    yield from repeated(demonstrations)
    yield from apart(demonstrations)
    yield from alike(demonstrations)
    yield from valueless(demonstrations)
