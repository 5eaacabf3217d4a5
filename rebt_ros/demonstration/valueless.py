"""Features of messages that have no value in an entire demonstration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.errors import listing

#: Number of demonstrations that a note names.
_NAMED = 3


def valueless(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """Notes on features that are read from messages and missing in all rows of a demonstration.

    A valid path may lead to nothing: a misspelled joint, an index or angle beyond the ends of an
    array, values that are not among the feature's categories.

    >>> list(valueless([]))
    []
    """
    lacking: dict[tuple[str, str], list[str]] = {}
    for one in demonstrations:
        if not len(one.stamps):
            continue
        for place, feature in enumerate(one.features):
            if feature.topic and one.lacks(place):
                lacking.setdefault((feature.name, feature.topic), []).append(one.name)
    for (name, topic), those in sorted(lacking.items()):
        if len(those) == len(demonstrations):
            where = "in any row"
        else:
            named = listing(those, _NAMED)
            where = f"in {len(those)} of {len(demonstrations)} demonstrations ({named})"
        yield (
            f"feature {name!r} has no value {where}: see whether its path, kind and categories fit "
            f"what comes on {topic!r}"
        )
