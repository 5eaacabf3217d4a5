"""Commands that take time: they run until there is a result, or they are cancelled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from py_trees.common import Status


class Running(NamedTuple):
    """What was begun."""

    cancel: Callable[[], None]
    alive: Callable[[], bool]
    """Whether there may still be a result."""


class LongCommand:
    """A service call or a goal, as the action of a tree sees it.

    Args:
        begin: Begins it; told what to call with its result, at once or later.
        died: Told where what should give the result is not there any more.

    >>> told = []
    >>> command = LongCommand(lambda tell: (told.append(tell), NOTHING)[1], lambda: None)
    >>> command.update()
    <Status.RUNNING: 'RUNNING'>
    >>> told[0](Status.SUCCESS)
    >>> command.update()
    <Status.SUCCESS: 'SUCCESS'>
    """

    def __init__(
        self, begin: Callable[[Callable[[Status], None]], Running], died: Callable[[], None]
    ) -> None:
        self._begin = begin
        self._died = died
        self._running: Running | None = None
        self._result: Status | None = None
        self._run = 0
        self._updated = False

    def begin_tick(self) -> None:
        """Must be called before each tick of the tree."""
        self._updated = False

    def update(self) -> Status:
        """Begins it, or tells how it goes; once it has ended, the next call begins it anew."""
        self._updated = True
        if self._running is None:
            self._run += 1
            run = self._run
            self._result = None
            self._running = self._begin(lambda status: self._end(run, status))
        if self._result is None and not self._running.alive():
            self._died()
            self._result = Status.FAILURE
        if self._result is None:
            return Status.RUNNING
        result = self._result
        self._running = self._result = None
        return result

    def halt(self) -> None:
        """Cancels it, unless another node of the tree goes on with the same action."""
        if self._running is None or self._updated:
            return
        running, self._running = self._running, None
        self._run += 1
        if self._result is None:
            running.cancel()
        self._result = None

    def _end(self, run: int, status: Status) -> None:
        # What was cancelled may still end.
        if run == self._run:
            self._result = status


#: Of what is done once it was begun, or can only be waited for.
NOTHING: Final = Running(lambda: None, lambda: True)
