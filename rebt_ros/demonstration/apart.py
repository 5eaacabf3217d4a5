"""Channels that never occur in one demonstration, as with robots in separate namespaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.errors import listing

#: Number of channels that a note names.
_NAMED = 5


def apart(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """A note if each demonstration has a single channel, and not all have the same one.

    Channels act side by side, each learned only from its own rows.  If one action was recorded
    under several names, each of these channels knows only a part of what was shown.

    >>> list(apart([]))
    []
    """
    alone = [one.channels for one in demonstrations]
    names = sorted({channel for channels in alone for channel in channels})
    if not names[1:] or any(len(channels) != 1 for channels in alone):
        return
    listed = listing([*map(repr, names)], _NAMED)
    yield (
        f"no demonstration has actions on two of {listed}: each is a channel of its own, which "
        "acts beside the others; where they are one by several names, as of robots in namespaces, "
        "learn from the demonstrations of one name only, or record the others by the same"
    )
