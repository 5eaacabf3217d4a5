"""Whether simulated time goes on, without ROS."""

from __future__ import annotations

from typing import Final

#: Simulators publish their clock many times a second; without a change for so long it has stopped
#: (seconds).
_STOPPED: Final = 3.0


class ClockWatch:
    """Notices that a simulated clock has not begun, or has stopped.

    >>> watch = ClockWatch()
    >>> [watch.stands(simulated, now) for simulated, now in ((0, 0.0), (7, 1.0), (7, 2.0))]
    [True, False, False]
    >>> watch.stands(7, 5.0), watch.stands(8, 6.0)
    (True, False)
    """

    def __init__(self) -> None:
        self._latest = 0
        self._since = 0.0

    def stands(self, simulated: int, now: float) -> bool:
        """Whether the clock stands still; to be called every now and then.

        Args:
            simulated: What it shows (ns), 0 before its first message.
            now: Seconds of a clock that always goes on.
        """
        if simulated != self._latest:
            self._latest, self._since = simulated, now
        return simulated == 0 or now - self._since > _STOPPED
