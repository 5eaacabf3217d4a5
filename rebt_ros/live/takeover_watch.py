"""Tells the recorder where a correction begins and ends, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rebt_ros.demonstration.last_action import ActionHistory

#: A command that comes so soon after a person's action was under way when the person took over, or
#: comes from another executor that does not heed persons (nanoseconds).
_STRAGGLER = 200_000_000


class TakeoverWatch:
    """Knows who drives, the robot's executor or a person, from what they send.

    Args:
        channels: Action topics.
    """

    def __init__(self, channels: Sequence[str]) -> None:
        self._histories = {channel: ActionHistory() for channel in channels}
        self._driven = False
        self._last_action: int | None = None
        self.takeovers = 0
        """How often a person has taken over."""

    @property
    def driven(self) -> bool:
        """Whether the executor drives, as far as is known."""
        return self._driven

    def command(self, stamp: int, channel: str, label: str) -> bool:
        """The executor has sent a command.

        Returns:
            Whether the person's time ends with it.
        """
        if self._last_action is not None and 0 <= stamp - self._last_action < _STRAGGLER:
            return False
        self._histories[channel].take(label)
        return self.drive(True)

    def drive(self, driving: bool) -> bool:
        """The executor says whether it drives, also where it has nothing to command.

        Returns:
            Whether the person's time ends with it.
        """
        ended = driving and not self._driven
        self._driven = driving
        return ended

    def act(
        self, stamp: int, channel: str, label: str, *, awaited: bool = False
    ) -> Mapping[str, Sequence[str]] | None:
        """A person has sent an action.

        Args:
            stamp: When, nanoseconds.
            channel: Action topic it came on.
            label: The action; empty where none is taken any longer.
            awaited: A person was asked to show something, so that this is no takeover.

        Returns:
            What was done on each channel before, most recent last, where the person takes over
            with it; else None.
        """
        before = None
        if self._driven and not awaited:
            before = {name: history.taken for name, history in self._histories.items()}
            self.takeovers += 1
        self._driven = False
        self._last_action = stamp
        if label:
            self._histories[channel].take(label)
        return before
