"""Channels that no demonstration has together, as where robots have namespaces of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rebt_ros.demonstration.demonstration import Demonstration

#: So many channels are named.
_NAMED = 5


def apart(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """A note where each demonstration has a single channel, and not all have the same.

    Channels decide side by side, each learned from its own rows alone: of one action that was
    recorded by several names, none knows what was shown of the others.

    >>> list(apart([]))
    []
    """
    alone = [one.channels for one in demonstrations]
    names = sorted({channel for channels in alone for channel in channels})
    if not names[1:] or any(len(channels) != 1 for channels in alone):
        return
    listed = ", ".join(map(repr, names[:_NAMED])) + (", …" if len(names) > _NAMED else "")
    yield (
        f"no demonstration has actions on two of {listed}: each is a channel of its own, which "
        "acts beside the others; where they are one by several names, as of robots in namespaces, "
        "learn from the demonstrations of one name only, or record the others by the same"
    )
