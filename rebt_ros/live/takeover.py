"""A person's hand on the robot: who drives, and what was done, without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


class Takeover:
    """A person drives from a first message until some time after the last one.

    Times are nanoseconds of one clock.

    Args:
        timeout: How long a message lasts.
    """

    def __init__(self, timeout: int) -> None:
        self._timeout = timeout
        self._last: int | None = None
        self.count = 0
        """How often a person has taken over."""

    def note(self, now: int) -> bool:
        """A message of the person has come.

        Returns:
            Whether the person takes over with it.
        """
        begins = not self.lasts(now)
        self.count += begins
        self._last = now
        return begins

    def lasts(self, now: int) -> bool:
        """Whether the person drives now."""
        # A clock that is set back does not end it: see restart().
        return self._last is not None and now - self._last < self._timeout

    def restart(self, now: int) -> None:
        """The clock was set back: where a person drives, as long as if a message had come now."""
        if self._last is not None and now < self._last:
            self._last = now


def channel_of(topic: str, channels: Iterable[str], topics: Sequence[str]) -> str | None:
    """The channel whose actions come on a topic.

    A channel is named after the topic that it was demonstrated on; that of a table, after a
    column, is the only one.

    Args:
        topic: One of `topics`.
        channels: Of the tree.
        topics: All on which a person takes over.

    >>> channel_of("arm/action", ["/arm/action", "base"], ["arm/action", "action"])
    '/arm/action'
    >>> channel_of("action", ["class"], ["action"])
    'class'
    """
    names = list(channels)
    same = [name for name in names if name.strip("/") == topic.strip("/")]
    if not same and len(names) == len(topics) == 1:
        return names[0]
    return same[0] if same else None
